#!/usr/bin/env bash
# Bundles the reports' 3D view with three.js into fieldkit/report/html/vendor, with three.js' licence. Needs npm.
# Usage: scripts/build_viewer.sh [--if-possible]     (then a machine without npm is told so and is no error)
set -euo pipefail
cd "$(dirname "$0")/.."
source=fieldkit/report/html/web
target=fieldkit/report/html/vendor
work=build/viewer

if ! command -v npm >/dev/null || ! node -e 'process.exit(process.versions.node.split(".")[0] < 18 ? 1 : 0)' 2>/dev/null; then
    cat >&2 <<-'END'
	3D view: npm with Node.js 18 or newer is missing, so reports cannot be written. Install it and run make setup again:
	  Debian, Ubuntu:  sudo apt-get install nodejs npm
	  Fedora:          sudo dnf install nodejs npm
	  Arch:            sudo pacman -S nodejs npm
	END
    [[ ${1:-} == --if-possible ]] && exit 0
    exit 1
fi

mkdir -p "$work" "$target"
cp "$source"/*.js "$source"/package.json "$source"/package-lock.json "$source"/.npmrc "$work"/
(
    cd "$work"
    npm ci --ignore-scripts --prefer-offline --no-audit --no-fund --loglevel=error
    # A report carries the script to others, so the licence goes with it.
    { echo "/*! three.js"; cat node_modules/three/LICENSE; echo "*/"; } >head.txt
    npm exec --offline -- esbuild viewer.js --bundle --minify --format=iife --target=es2022 --charset=utf8 \
        --legal-comments=none --log-level=warning --outfile=body.js
    cat head.txt body.js >viewer.min.js
)
cp "$work/node_modules/three/LICENSE" "$target/LICENSE.three.txt"
mv "$work/viewer.min.js" "$target/viewer.min.js" # last, and in one step: make looks at it
echo "3D view: $(wc -c <"$target/viewer.min.js") bytes in $target/viewer.min.js"
