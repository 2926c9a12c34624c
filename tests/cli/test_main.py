"""The command line as a whole: help is light, results go to stdout, errors are for people."""

import json
import signal
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

from fieldkit.cli.main import COMMANDS, main, module_name
from tests.special_files import limited

ROOT = Path(__file__).parents[2]
HEAVY = (
    "numpy", "scipy", "numba", "cv2", "PIL", "pycolmap", "torch", "trimesh", "pyrender", "OpenGL",
    "matplotlib", "psutil", "platformdirs", "laspy", "small_gicp",
)  # fmt: skip


class TestHelp:
    def test_imports_nothing_heavy_and_no_other_command(self) -> None:
        calls = [*([*name.split(), "--help"] for name in COMMANDS), ["--help"], ["--version"], [], ["scene", "--help"]]
        script = textwrap.dedent(f"""
            import json, sys
            from fieldkit.cli.main import COMMANDS, main, module_name
            def loaded():
                return {{*map(module_name, COMMANDS)}} & sys.modules.keys()
            told = []
            for arguments in {calls!r}:
                before = loaded()
                told.append([main(arguments), sorted(loaded() - before)])
            heavy = [name for name in {HEAVY!r} if name in sys.modules]
            print(json.dumps([told, heavy]), file=sys.stderr)
        """)
        done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
        told, heavy = json.loads(done.stderr)
        for name, (code, modules) in zip([*COMMANDS, *[None] * 4], told, strict=True):
            assert code == 0
            assert modules in ([], name and [module_name(name)])
        assert heavy == []


class TestUsageErrors:
    @pytest.mark.parametrize(
        ("arguments", "message"),
        [
            ("doctr", "Error: no such command 'doctr'. Did you mean 'doctor'?\n  'fieldkit --help' explains"),
            ("scene nwe", "Error: no such command 'nwe'. Did you mean 'new'?\n  'fieldkit scene --help' explains"),
            ("plan -o x --seed 3000000000", "Error: invalid value for '--seed': Input should be less"),
            ("xyzzy", "Error: no such command 'xyzzy'\n  'fieldkit --help' explains the command.\n"),
            ("doctor --x", "Error: no such option: --x\n  'fieldkit doctor --help' explains the command.\n"),
            ("evaluate -o x", "Error: missing argument 'captures'"),
            ("cache burn", "Error: invalid value for 'action': 'burn' is not one of 'show', 'prune', 'clear'\n"),
            ("cache show surplus", "Error: got unexpected extra argument(s) (surplus)\n"),
            ("cache prune", "Error: prune what?\n  Give --max-size or --older-than, or"),
            ("cache show --max-size 1G", "Error: show takes neither --max-size nor --older-than\n"),
            ("cache prune --max-size big", "Error: --max-size: not a size: big\n  Write it like 500M"),
            ("cache prune --older-than -1", "Error: invalid value for '--older-than': "),
        ],
    )
    def test_message_and_code(self, arguments, message, capsys, tmp_path) -> None:
        assert main(arguments.split()) == 2
        output = capsys.readouterr()
        assert output.err.startswith(message)
        assert output.out == ""
        assert main([*arguments.split(), "--json"]) == 2
        error = json.loads(capsys.readouterr().out)["error"]
        assert error.keys() == {"type", "message", "path", "remedy"}
        assert error["type"] == "UsageError"
        assert error["remedy"]


MISSING = [
    "reference no -o x", "scene from-reference no -o x", "plan --scene no -o x", "plan --reference no -o x",
    "plan --captures no -o x", "plan -n 4 -o x", "plan --scene case-1 --vehicle no -o x",
    "export-mission no --vehicle px4-gimbal --site x -o x", "check-mission no.plan --vehicle px4-gimbal",
    "upload no --connect udp", "geotag no --log x", "check no --plan x", "evaluate no -o x", "campaign show no",
    "campaign init x --plan no --site x", "campaign export no -o x",
    "report no", "scene show no", "simulate no --ring 10 -o x", "campaign show", "evaluate . -o x --distances 0",
]  # fmt: skip


def test_what_is_missing_is_told_before_anything_heavy_is_imported(tmp_path: Path) -> None:
    script = textwrap.dedent(f"""
        import json, sys
        from fieldkit.cli.main import main
        codes = [main(line.split()) for line in {MISSING!r}]
        heavy = [name for name in {HEAVY!r} if name != "numpy" and name in sys.modules]
        print(json.dumps([codes, heavy]))
    """)
    done = subprocess.run([sys.executable, "-c", script], cwd=tmp_path, capture_output=True, text=True, check=False)
    codes, heavy = json.loads(done.stdout)
    assert codes == [2 if line in ("plan -n 4 -o x", "campaign show", MISSING[-1]) else 3 for line in MISSING]
    assert heavy == []
    assert done.stderr.count("Error: ") == len(MISSING)


@pytest.fixture
def a_command(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """The file of a command `probe` whose body a test writes."""
    import fieldkit.cli

    monkeypatch.setitem(COMMANDS, "probe", "Simulate")
    monkeypatch.setattr(fieldkit.cli, "__path__", [*fieldkit.cli.__path__, str(tmp_path)])
    monkeypatch.delitem(sys.modules, "fieldkit.cli.probe", raising=False)
    return tmp_path / "probe.py"


def write(file: Path, body: str, *, resume: bool = False) -> None:
    parameters = "as_json: JsonOption = False" + (", resume: ResumeOption = False" if resume else "")
    file.write_text(
        "from __future__ import annotations\n"
        "import os, signal, sys, time, warnings\n"
        "from pathlib import Path\n"
        "import typer\n"
        "from fieldkit.cli.common import *\n"
        "from fieldkit.errors import *\n"
        f"def command({parameters}):\n    {body}\n"
    )
    sys.modules.pop("fieldkit.cli.probe", None)


class TestBoundary:
    @pytest.mark.parametrize(
        ("kind", "code"),
        [
            ("UsageError", 2),
            ("InputError", 3),
            ("CaptureError", 3),
            ("MetadataError", 3),
            ("StorageError", 3),
            ("EmptyCloudError", 3),
            ("ReconstructionError", 4),
        ],
    )
    def test_known_errors(self, a_command: Path, capsys: pytest.CaptureFixture[str], kind: str, code: int) -> None:
        write(a_command, f"raise {kind}('is empty', path='plot 7/photos', remedy='Copy the photographs there.')")
        assert main(["probe"]) == code
        output = capsys.readouterr()
        assert output.err == "Error: plot 7/photos: is empty\n  Copy the photographs there.\n"
        assert output.out == ""
        assert main(["probe", "--json"]) == code
        output = capsys.readouterr()
        assert json.loads(output.out) == {
            "error": {
                "type": kind,
                "message": "is empty",
                "path": "plot 7/photos",
                "remedy": "Copy the photographs there.",
            }
        }
        assert output.err.startswith("Error: plot 7/photos")

    def test_a_bug(self, a_command: Path, capsys: pytest.CaptureFixture[str]) -> None:
        write(a_command, "1 / 0")
        assert main(["probe"]) == 1
        error = capsys.readouterr().err
        assert error.startswith("Error: this is a bug in fieldkit: ZeroDivisionError: division by zero\n")
        assert "--debug" in error
        assert "Traceback" not in error
        assert main(["probe", "--debug"]) == 1
        assert "Traceback" in capsys.readouterr().err
        assert main(["probe", "--json"]) == 1
        assert json.loads(capsys.readouterr().out)["error"]["type"] == "ZeroDivisionError"

    def test_interrupted(self, a_command: Path, capsys: pytest.CaptureFixture[str]) -> None:
        write(a_command, "raise KeyboardInterrupt", resume=True)
        assert main(["probe"]) == 130
        assert "--resume" in capsys.readouterr().err
        write(a_command, "raise KeyboardInterrupt")
        assert main(["probe"]) == 130
        assert "--resume" not in capsys.readouterr().err

    def test_interrupted_while_compiled_modules_are_imported(self, a_command, capsys) -> None:
        before = signal.getsignal(signal.SIGINT)
        lines = (
            "try:",
            "    os.kill(os.getpid(), signal.SIGINT)",
            "except KeyboardInterrupt:",
            "    raise ImportError('initialization failed')",
        )
        write(a_command, "\n    ".join(lines))
        assert main(["probe"]) == 130
        assert capsys.readouterr().err == "Error: interrupted\n"
        assert signal.getsignal(signal.SIGINT) == before
        write(a_command, "raise ImportError('initialization failed')")
        assert main(["probe"]) == 1

    def test_interrupted_in_compiled_code(self, a_command: Path, capsys: pytest.CaptureFixture[str]) -> None:
        # what CPython makes of a signal's exception that a compiled function did not pass on
        write(a_command, "raise SystemError('returned a result with an exception set') from KeyboardInterrupt()")
        assert main(["probe"]) == 130
        assert "bug" not in capsys.readouterr().err
        write(a_command, "raise SystemError('returned a result with an exception set') from SystemExit(143)")
        assert main(["probe"]) == 143
        write(a_command, "raise SystemError('of another kind')")
        assert main(["probe"]) == 1

    def test_terminated(self, a_command: Path, capsys: pytest.CaptureFixture[str]) -> None:
        before = signal.getsignal(signal.SIGTERM)
        write(a_command, "os.kill(os.getpid(), signal.SIGTERM)", resume=True)
        assert main(["probe"]) == 143
        said = capsys.readouterr().err
        assert "ended by SIGTERM" in said
        assert "--resume" in said
        assert signal.getsignal(signal.SIGTERM) == before

    def test_terminated_where_exceptions_are_dropped_or_changed(self, a_command, capsys) -> None:
        end = "lambda *_: os.kill(os.getpid(), signal.SIGTERM)"
        dropped = f"each = type('A', (), {{'__del__': {end}}})(); del each; [time.sleep(0.1) for _ in range(100)]"
        write(a_command, dropped)
        with limited():
            assert main(["probe"]) == 143
        assert capsys.readouterr().err == "Error: ended by SIGTERM\n"
        write(
            a_command,
            "\n    ".join(
                [
                    "try:",
                    "    os.kill(os.getpid(), signal.SIGTERM)",
                    "except SystemExit as error:",
                    "    raise ImportError('no module') from error",
                ]
            ),
        )
        assert main(["probe"]) == 143
        assert capsys.readouterr().err == "Error: ended by SIGTERM\n"

    def test_warnings(self, a_command: Path, capsys: pytest.CaptureFixture[str]) -> None:
        write(
            a_command,
            "from fieldkit.cache import CacheWarning; warnings.warn('the cache is full', CacheWarning); "
            "warnings.warn('of another library', RuntimeWarning)",
        )
        assert main(["probe"]) == 0
        assert capsys.readouterr().err == "Warning: the cache is full\n"
        assert main(["probe", "--debug"]) == 0
        assert "of another library" in capsys.readouterr().err

    def test_threads_are_limited_before_numpy_is_imported(self, a_command: Path) -> None:
        write(a_command, "emit_json([os.environ['OMP_NUM_THREADS'], 'numpy' in sys.modules])")
        script = (
            "import sys, fieldkit.cli; from fieldkit.cli.main import COMMANDS, main; COMMANDS['probe'] = ''; "
            f"fieldkit.cli.__path__.append({str(a_command.parent)!r}); sys.exit(main(['probe']))"
        )
        done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
        assert json.loads(done.stdout) == ["1", False]


class TestJson:
    def test_plain_values(self, a_command: Path, capsys: pytest.CaptureFixture[str]) -> None:
        write(
            a_command,
            "import numpy as np; emit_json({'a': np.float32(1.5), 'b': np.arange(2), 'c': float('nan'), "
            "'d': Path('x'), 5: (True, None), 'ü': np.array([np.inf])})",
        )
        assert main(["probe"]) == 0
        assert json.loads(capsys.readouterr().out) == {
            "a": 1.5,
            "b": [0, 1],
            "c": None,
            "d": "x",
            "5": [True, None],
            "ü": [None],
        }

    def test_nobody_reads(self) -> None:
        """`fieldkit … | head -0`: no traceback, and the result counts."""
        script = "import sys; from fieldkit.cli.main import main; sys.exit(main(['cache', 'show', '--json']))"
        with subprocess.Popen(
            [sys.executable, "-c", script], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        ) as process:
            process.stdout.close()
            assert process.stderr.read() == ""
        assert process.returncode == 0
