"""Nothing needs Linux that has a plain substitute: as far as that can be tried on Linux."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from fieldkit.campaign.lock import campaign_lock
from fieldkit.files import atomic_folder, write_atomic
from fieldkit.planning.run.folder import create_run, open_run
from tests.planning.bowl import bowl_settings

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
from fieldkit.errors import UsageError
from fieldkit.missions.link.wires import open_wire
try:
    open_wire("serial:///dev/ttyUSB0:57600")
except UsageError as error:
    print(error)
try:
    open_wire("udpout://127.0.0.1:none")
except UsageError as error:
    print(error)
"""


def test_every_module_imports_without_what_only_posix_has() -> None:
    done = subprocess.run([sys.executable, "-c", IMPORT], capture_output=True, text=True, check=False, cwd=ROOT)
    assert done.returncode == 0, done.stderr
    assert "serial lines need Linux or macOS" in done.stdout
    assert "not a vehicle's address" in done.stdout


@pytest.fixture
def without_locks(monkeypatch: pytest.MonkeyPatch) -> None:
    """As on Windows: no locks, and folders cannot be opened."""
    monkeypatch.setattr("fieldkit.locks.HAS_LOCKS", False)
    monkeypatch.setattr("fieldkit.files.open_folder", lambda path: None)
    monkeypatch.setattr("fieldkit.files._exchange", lambda a, b: False)


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

    def test_a_campaign_says_so(self, tmp_path: Path) -> None:
        said: list[str] = []
        with campaign_lock(tmp_path, wait=False, note=said.append):
            pass
        assert len(said) == 1
        assert "do not start a second run" in said[0]

    def test_a_run_is_made_and_resumed(self, tmp_path: Path) -> None:
        settings = bowl_settings()
        with create_run(tmp_path / "run", settings):
            pass
        with open_run(tmp_path / "run") as run:
            assert run.settings == settings
