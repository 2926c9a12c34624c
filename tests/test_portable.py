"""Nothing needs Linux that has a plain substitute: as far as that can be tried on Linux."""

import ast
import errno
import json
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from fieldkit.files import atomic_folder, write_atomic
from tests.cli.test_scene_commands import TINY

ROOT = Path(__file__).parents[1]
IMPORT = """
import builtins, importlib, pkgutil, signal
missing = {"fcntl", "grp", "pty", "pwd", "resource", "syslog", "termios", "tty"}
real = builtins.__import__
def imported(name, globals=None, locals=None, fromlist=(), level=0):
    if name in missing and (globals or {}).get("__name__", "").startswith("fieldkit"):
        raise ModuleNotFoundError(name)
    return real(name, globals, locals, fromlist, level)
builtins.__import__ = imported
del signal.pthread_sigmask
import fieldkit
heavy = ("fieldkit.planning.surrogate", "fieldkit.planning.methods.bosfm")  # of others' packages they import PyTorch
for module in pkgutil.walk_packages(fieldkit.__path__, "fieldkit."):
    if not module.name.endswith("__main__") and not module.name.startswith(heavy):
        importlib.import_module(module.name)
"""


def test_every_module_imports_without_what_only_posix_has() -> None:
    done = subprocess.run([sys.executable, "-c", IMPORT], capture_output=True, text=True, check=False, cwd=ROOT)
    assert done.returncode == 0, done.stderr


# Of modules and paths, what Windows lacks, or lacks in Python 3.11; each with the files that do without where it is.
POSIX_ONLY = {
    **dict.fromkeys(
        (
            "SIGALRM", "SIGCHLD", "SIGHUP", "SIGKILL", "SIGPIPE", "SIGQUIT", "SIGTSTP", "SIGUSR1", "SIGUSR2",
            "SIGWINCH",
            "alarm", "chown", "chroot", "fork", "forkpty", "getegid", "geteuid", "getgid", "getloadavg", "getpgid",
            "getpgrp", "getpriority", "getuid", "is_mount", "killpg", "lchown", "mkfifo", "mknod", "nice", "openpty",
            "pathconf", "posix_spawn", "pread", "preadv", "pthread_kill", "pwrite", "sched_setaffinity", "sendfile",
            "setitimer", "setpgid", "setpriority", "setsid", "siginterrupt", "sigwait", "statvfs", "sync", "sysconf",
            "tzset", "uname", "wait3", "wait4", "AF_UNIX", "MSG_DONTWAIT", "SO_REUSEPORT", "O_CLOEXEC", "O_DIRECTORY",
            "O_NOFOLLOW", "O_SYNC", "getppid",
        ),
        (),
    ),
    "pthread_sigmask": ("runtime/colmap.py", "runtime/worker.py", "runtime/executor.py"),
    "sched_getaffinity": ("runtime/machine.py",),
}  # fmt: skip


def _calls_without_encoding(tree: ast.AST) -> Iterator[int]:
    """Lines where text is read or written in whatever encoding the machine has."""
    for call in ast.walk(tree):
        if not isinstance(call, ast.Call) or "encoding" in (words := {k.arg: k.value for k in call.keywords}):
            continue
        method = isinstance(call.func, ast.Attribute)
        name = call.func.attr if isinstance(call.func, ast.Attribute) else getattr(call.func, "id", "")
        owner = ast.unparse(call.func.value) if isinstance(call.func, ast.Attribute) else ""
        process = name in ("run", "Popen", "check_output") and ("text" in words or "universal_newlines" in words)
        reading = name == "read_text" and method and not call.args
        writing = name == "write_text" and len(call.args) == 1 and owner != "formatter"  # Click's, of help pages
        if process or reading or writing:
            yield call.lineno
        elif name == "open":
            mode = words.get("mode") or next(iter(call.args[0 if method else 1 :]), ast.Constant("r"))
            if isinstance(mode, ast.Constant) and isinstance(mode.value, str) and "b" not in mode.value:
                yield call.lineno


def _of(package: str) -> Iterator[tuple[str, ast.AST]]:
    for file in sorted((ROOT / package).rglob("*.py")):
        yield file.relative_to(ROOT / package).as_posix(), ast.parse(file.read_text("utf-8"))


@pytest.mark.parametrize("package", ["fieldkit", "benchmarks"])
def test_text_has_its_encoding(package: str) -> None:
    assert [f"{file}:{line}" for file, tree in _of(package) for line in _calls_without_encoding(tree)] == []


def test_what_only_posix_has_is_guarded() -> None:
    used = [
        f"{file}:{node.lineno} {node.attr}"
        for file, tree in _of("fieldkit")
        for node in ast.walk(tree)
        if isinstance(node, ast.Attribute) and file not in POSIX_ONLY.get(node.attr, (file,))
    ]
    assert used == []


def test_a_stream_of_few_signs_is_no_error(tmp_path: Path) -> None:
    """As where output goes into a file on Windows."""
    environment = {**os.environ, "PYTHONIOENCODING": "cp1252:strict", "PYTHONUTF8": "0", "PYTHONPATH": str(ROOT)}

    def run(*arguments: str) -> subprocess.CompletedProcess[bytes]:
        command = [sys.executable, "-m", "fieldkit", *arguments]
        done = subprocess.run(command, capture_output=True, check=False, cwd=tmp_path, env=environment)
        assert b"Traceback" not in done.stderr + done.stdout
        assert b"bug" not in done.stderr
        return done

    (tmp_path / "plan").touch()
    done = run("check", "Süd → −5 ± 1", "--plan", "plan", "--json")
    assert done.returncode == 3
    assert "Süd → −5 ± 1" in json.loads(done.stdout)["error"]["path"]
    assert rb"S\xfcd" in done.stderr or "Süd".encode("cp1252") in done.stderr
    assert run("check", "--help").returncode == 0


def test_a_name_of_another_encoding_is_told(tmp_path: Path) -> None:
    scene = tmp_path / os.fsdecode(b"s\xfcd.toml")
    try:
        scene.write_text(TINY, encoding="utf-8")
    except (OSError, ValueError):
        pytest.skip("file names are UTF-8 here")
    command = [sys.executable, "-m", "fieldkit", "plan", "--scene", scene.name, "--method", "score", "-o", "plan"]
    done = subprocess.run(
        command, capture_output=True, check=False, cwd=tmp_path, env=os.environ | {"PYTHONPATH": str(ROOT)}
    )
    assert done.returncode == 2, done.stderr
    assert b"is not text in this terminal" in done.stderr


@pytest.fixture
def without_locks(monkeypatch: pytest.MonkeyPatch) -> None:
    """As on Windows: no locks, and folders cannot be opened."""
    monkeypatch.setattr("fieldkit.files.HAS_LOCKS", False)
    monkeypatch.setattr("fieldkit.files.open_folder", lambda path: None)
    monkeypatch.setattr("fieldkit.files._exchange", lambda a, b: False)
    rename = Path.rename

    def renamed(path: Path, target: Path) -> Path:
        """Onto what is there already, even an empty folder, Windows renames nothing."""
        if target.exists():
            raise FileExistsError(errno.EEXIST, os.strerror(errno.EEXIST), str(target))
        return rename(path, target)

    monkeypatch.setattr(Path, "rename", renamed)


@pytest.mark.usefixtures("without_locks")
class TestWithoutLocks:
    def test_results_are_whole_or_absent(self, tmp_path: Path) -> None:
        write_atomic(tmp_path / "file.txt", "text")
        for content in ("first", "second"):
            with atomic_folder(tmp_path / "result", overwrite=True, marker="a.txt") as folder:
                (folder / "a.txt").write_text(content)
        assert (tmp_path / "result" / "a.txt").read_text() == "second"
        with pytest.raises(ZeroDivisionError), atomic_folder(tmp_path / "other"):
            _ = 1 / 0
        assert sorted(path.name for path in tmp_path.iterdir()) == ["file.txt", "result"]
        (tmp_path / "empty").mkdir()
        with atomic_folder(tmp_path / "empty") as folder:
            (folder / "a.txt").write_text("in a folder that was empty")
        assert (tmp_path / "empty" / "a.txt").is_file()
