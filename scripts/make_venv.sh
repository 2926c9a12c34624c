#!/usr/bin/env bash
# Makes a virtual environment and installs fieldkit with the pinned versions into it; run again, it brings it up to date.
# Usage: scripts/make_venv.sh FOLDER     (PYTHON chooses the interpreter)
set -euo pipefail
cd "$(dirname "$0")/.."
venv=${1:?usage: scripts/make_venv.sh FOLDER}

suits() {
    command -v "$1" >/dev/null && "$1" -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null
}

find_python() {
    if [[ -n ${PYTHON:-} ]]; then
        suits "$PYTHON" && echo "$PYTHON" && return
        echo "make setup: PYTHON=$PYTHON is not Python 3.11 or newer" >&2
        return 1
    fi
    local name
    for name in python3.11 python3.12 python3.13 python3; do
        suits "$name" && echo "$name" && return
    done
    cat >&2 <<-'END'
	make setup: fieldkit needs Python 3.11 or newer, and none was found.
	  Debian, Ubuntu:  sudo apt-get install python3.11 python3.11-venv
	  Fedora:          sudo dnf install python3.11
	  Arch:            sudo pacman -S python
	  elsewhere:       PYTHON=/path/to/python3 make setup
	END
    return 1
}

if ! suits "$venv/bin/python" || ! "$venv/bin/python" -m pip --version >/dev/null 2>&1; then
    python=$(find_python)
    echo "make setup: $venv with $("$python" --version)"
    if ! "$python" -m venv --clear "$venv"; then
        echo "make setup: this Python cannot make virtual environments; Debian, Ubuntu: sudo apt-get install python3-venv" >&2
        exit 1
    fi
fi
"$venv/bin/python" -m pip install --quiet --disable-pip-version-check -e '.[dev]' -c constraints.txt
echo "make setup: $("$venv/bin/fieldkit" --version) is installed; $venv/bin/fieldkit doctor looks at this machine"
