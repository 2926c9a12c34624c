"""The Tab key: what fieldkit offers, and the three shells' scripts run by the shells themselves."""

from __future__ import annotations

import json
import os
import pty
import select
import shlex
import shutil
import subprocess
import sys
import time
from pathlib import Path

import pytest

from fieldkit.cli.candidates import Candidates, candidates
from fieldkit.cli.completion import Shell, script_of
from fieldkit.cli.main import COMMANDS, main, typer_command
from fieldkit.scenes.library import scene_names
from fieldkit.vehicles.vehicle_file import vehicle_names


def offered(line: str) -> Candidates:
    """What fits behind "fieldkit " and this line; the word under the cursor is what stands behind the last space."""
    before, _, partial = line.rpartition(" ")
    return candidates([*before.split(), partial], COMMANDS, typer_command)


def words(line: str) -> list[str]:
    return [word for word, _ in offered(line).words]


class TestCandidates:
    def test_commands(self) -> None:
        assert {name.split()[0] for name in COMMANDS} <= set(words(""))
        assert words("ex") == ["export-mission"]
        assert words("scene ") == ["from-reference", "new", "show", "--help"]
        assert words("scene n") == ["new"]
        assert words("help scene f") == ["from-reference"]
        assert set(words("help ")) == {name.split()[0] for name in COMMANDS}
        assert offered("ev").words == (("evaluate", COMMANDS["evaluate"]),)
        assert words("xyzzy ") == ["--help"]
        assert candidates([], COMMANDS, typer_command) == offered("")

    def test_options(self) -> None:
        assert words("plan --fid") == ["--fidelity"]
        assert "--output" in words("plan -")
        assert "--output" not in words("plan -o out -")
        assert words("plan ")[0] == "--output"  # takes no argument, and needs this
        assert "--scene" in words("plan --scene case-1 --")  # may be given again
        assert words("plan -n12 --cam") == ["--camera-file"]
        assert words("plan -- --") == []

    @pytest.mark.parametrize("name", COMMANDS)
    def test_every_option_and_choice_of_every_command(self, name: str) -> None:
        found = words(f"{name} --")
        for param in typer_command(name).params:
            if param.param_type_name == "option":
                assert set(param.opts) & set(found)
        assert "--help" in found

    def test_values(self) -> None:
        assert words("plan --fidelity ") == ["draft", "standard", "fine"]
        assert not offered("plan --fidelity ").files
        assert words("plan --fidelity=s") == ["--fidelity=standard"]
        assert words("plan --method ci") == ["circle"]
        assert words("cache ") == ["show", "prune", "clear"]
        assert words("completion ") == ["bash", "zsh", "fish"]
        assert offered("plan -n ") == Candidates()
        assert offered("plan --nonsense=") == Candidates()

    def test_names_of_vehicles_and_scenes_and_files(self) -> None:
        assert words("export-mission plan --vehicle ") == vehicle_names()
        assert words("simulate ") == scene_names()
        assert words("plan --scene=case-1") == ["--scene=case-1"]
        assert offered("plan --scene ").files
        assert offered("evaluate ") == Candidates((), files=True)
        assert offered("evaluate captures --reference=") == Candidates((), files=True)

    def test_as_text(self, capsys: pytest.CaptureFixture[str]) -> None:
        assert main(["__complete", "simulate", "case-1"]) == 0
        assert capsys.readouterr().out == "case-1\n:files\n"
        assert main(["__complete", "ev"]) == 0
        assert capsys.readouterr().out == f"evaluate\t{COMMANDS['evaluate']}\n"

    def test_imports_nothing_heavy(self) -> None:
        script = (
            "import sys; from fieldkit.cli.main import main; main(['__complete', 'plan', '--fidelity', '']);"
            "sys.exit([name for name in ('numpy', 'pydantic', 'rich', 'scipy') if name in sys.modules] and 1 or 0)"
        )
        assert subprocess.run([sys.executable, "-c", script], stdout=subprocess.DEVNULL, check=False).returncode == 0


@pytest.fixture
def place(tmp_path: Path) -> Path:
    """A folder to complete in, with a `fieldkit` of this Python's on the search path (its folder `bin`)."""
    program = tmp_path / "bin" / "fieldkit"
    program.parent.mkdir()
    program.write_text(f"#!{sys.executable}\nimport sys\nfrom fieldkit.cli.main import main\nsys.exit(main())\n")
    program.chmod(0o755)
    here = tmp_path / "here"
    (here / "a folder").mkdir(parents=True)
    (here / "captures").mkdir()
    (here / "case.toml").touch()
    return here


def environment(place: Path) -> dict[str, str]:
    return {
        "PATH": f"{place.parent / 'bin'}:{os.environ['PATH']}", "HOME": str(place.parent), "TERM": "dumb",
        "PYTHONPATH": str(Path(__file__).parents[2]),
    }  # fmt: skip


def needs(shell: str) -> str:
    found = shutil.which(shell)
    if found is None:
        pytest.skip(f"{shell} is not installed")
    return found


# What a person has typed, and what has to be among what is offered then.
CASES = [
    ("fieldkit expo", {"export-mission"}),
    ("fieldkit scene ", {"new", "show", "from-reference", "--help"}),
    ("fieldkit plan --met", {"--method"}),
    ("fieldkit plan --method ci", {"circle"}),
    ("fieldkit export-mission plan.json --vehicle ardu", {"ardupilot-pan", "ardupilot-pitch"}),
    ("fieldkit simulate case", {"case-1", "case-2", "case-3", "case.toml"}),
    ("fieldkit upload m.plan --connect udpin://0.0.0.0:14550 --sig", {"--signed", "--signing-key"}),
]


IN_A_TERMINAL = {
    "fieldkit expo": "fieldkit export-mission",
    "fieldkit plan --fidelity=st": "fieldkit plan --fidelity=standard",
    "fieldkit evaluate a": "fieldkit evaluate a folder/",
    "fieldkit evaluate x --reference=capt": "fieldkit evaluate x --reference=captures/",
}


def bash_offers(line: str, place: Path) -> set[str]:
    """Calls the script's function as bash does, with the line parted at bash's own COMP_WORDBREAKS."""
    driver = """
        source /dev/stdin <<<"$SCRIPT"
        COMP_LINE=$LINE COMP_POINT=${#LINE}
        rest=$LINE COMP_WORDS=()
        while [[ $rest ]]; do  # as readline does, without quotes
            if [[ $rest =~ ^[[:space:]]+ ]]; then :
            elif [[ $rest =~ ^[=:]+ || $rest =~ ^[^[:space:]=:]+ ]]; then COMP_WORDS+=("${BASH_REMATCH[0]}")
            fi
            rest=${rest:${#BASH_REMATCH[0]}}
        done
        [[ $LINE == *[[:space:]] ]] && COMP_WORDS+=("")
        COMP_CWORD=$((${#COMP_WORDS[@]} - 1))
        _fieldkit fieldkit "${COMP_WORDS[COMP_CWORD]}" "${COMP_WORDS[COMP_CWORD - 1]}"
        printf '%s\\n' "${COMPREPLY[@]}"
        complete -p fieldkit >&2
    """
    done = subprocess.run(
        [needs("bash"), "--norc", "-c", driver], cwd=place, capture_output=True, text=True, check=True,
        env={**environment(place), "SCRIPT": script_of(Shell.BASH), "LINE": line},
    )  # fmt: skip
    assert "-F _fieldkit fieldkit" in done.stderr
    return set(done.stdout.splitlines()) - {""}


class TestBash:
    @pytest.mark.parametrize(("line", "expected"), CASES)
    def test_offers(self, line: str, expected: set[str], place: Path) -> None:
        assert bash_offers(line, place) == expected

    def test_words_that_bash_parts(self, place: Path) -> None:
        assert bash_offers("fieldkit plan --fidelity=", place) == {"draft", "standard", "fine"}
        assert bash_offers("fieldkit plan --fidelity=st", place) == {"standard"}
        assert bash_offers("fieldkit plan --scene=cas", place) == {"case-1", "case-2", "case-3", "case.toml"}

    def test_files(self, place: Path) -> None:
        assert bash_offers("fieldkit evaluate ", place) == {"a folder", "captures", "case.toml"}
        assert bash_offers("fieldkit plan -n ", place) == set()

    def test_in_a_terminal(self, place: Path) -> None:
        shell = [needs("bash"), "--norc", "--noprofile", "-i"]
        setup = 'eval "$(fieldkit completion bash)"; bind "set enable-bracketed-paste off"'
        for line, whole in IN_A_TERMINAL.items():
            assert typed(shell, setup, line, place) == whole


class TestFish:
    @pytest.mark.parametrize(("line", "expected"), CASES)
    def test_offers(self, line: str, expected: set[str], place: Path) -> None:
        script = f"fieldkit completion fish | source; complete -C {shlex.quote(line)}"
        done = subprocess.run(
            [needs("fish"), "--no-config", "-c", script], cwd=place, env=environment(place),
            capture_output=True, text=True, check=True,
        )  # fmt: skip
        assert {row.partition("\t")[0] for row in done.stdout.splitlines()} == expected


class TestZsh:
    def test_in_a_terminal(self, place: Path) -> None:
        shell = [needs("zsh"), "-f", "-i"]
        setup = 'autoload -U compinit; compinit -u -D; eval "$(fieldkit completion zsh)"'
        for line, whole in IN_A_TERMINAL.items():
            assert typed(shell, setup, line, place) == whole.rstrip("/")  # zsh takes it back before a space


def typed(shell: list[str], setup: str, line: str, place: Path) -> str:
    """What a line is after the Tab key, in a shell in a terminal: the line is then given to `echo`."""
    terminal, inside = pty.openpty()
    process = subprocess.Popen(
        shell, cwd=place, env=environment(place), stdin=inside, stdout=inside, stderr=inside, start_new_session=True
    )
    os.close(inside)
    try:
        send(terminal, f"{setup}; echo set-up-'is done'\n", until="set-up-is done")
        # Ctrl-A and Ctrl-E go to the line's begin and end.
        seen = send(terminal, f"{line}\t\x01echo 'line': \x05:'end'\n", until=":end")
        return seen.rpartition("line: ")[2].partition(":end")[0].strip()
    finally:
        process.kill()
        process.wait()
        os.close(terminal)


def send(terminal: int, text: str, until: str) -> str:
    """Type into a terminal and read until a text appears, for at most a minute."""
    os.write(terminal, text.encode())
    seen, end = "", time.monotonic() + 60.0
    while until not in seen:
        assert time.monotonic() < end, seen
        if select.select([terminal], [], [], 1.0)[0]:
            seen += os.read(terminal, 65536).decode(errors="replace")
    return seen


def test_json(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["completion", "zsh", "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == {"shell": "zsh", "script": script_of(Shell.ZSH)}
    assert main(["completion", "zsh"]) == 0
    assert capsys.readouterr().out == script_of(Shell.ZSH)
    assert main(["completion", "tcsh"]) == 2
