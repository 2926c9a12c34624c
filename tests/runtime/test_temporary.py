import os
import signal
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from fieldkit.files import HAS_LOCKS
from fieldkit.runtime.temporary import temporary_folder

KILLED = """
import os, signal, tempfile
from fieldkit.runtime.temporary import temporary_folder
with temporary_folder():
    tempfile.mkdtemp(prefix="fieldkit-plots-")
    os.kill(os.getpid(), signal.SIGKILL)
"""


@pytest.fixture(autouse=True)
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    return tmp_path


def test_what_workers_leave_goes_with_the_run(place: Path) -> None:
    before = os.environ.get("TMPDIR")
    with pytest.raises(KeyboardInterrupt), temporary_folder():
        child = "import tempfile; print(tempfile.mkdtemp(prefix='fieldkit-plots-'))"
        made = subprocess.run([sys.executable, "-c", child], check=True, capture_output=True, text=True)
        left = Path(made.stdout.strip())
        assert left.is_dir()
        assert left.parent.parent == place
        raise KeyboardInterrupt
    assert list(place.iterdir()) == []
    assert (os.environ.get("TMPDIR"), tempfile.gettempdir()) == (before, str(place))


@pytest.mark.skipif(not HAS_LOCKS, reason="nothing tells here whether a run lives")
def test_the_next_run_removes_what_a_killed_one_left_and_nothing_of_a_living_one(place: Path) -> None:
    done = subprocess.run([sys.executable, "-c", KILLED], env={**os.environ, "TMPDIR": str(place)}, check=False)
    assert done.returncode == -signal.SIGKILL
    assert [entry.name[:13] for entry in place.rglob("fieldkit-plots-*")] == ["fieldkit-plot"]
    with temporary_folder():
        assert list(place.rglob("fieldkit-plots-*")) == []
        living = Path(tempfile.mkdtemp())
        tempfile.tempdir = str(place)
        with temporary_folder():
            assert living.is_dir()


def test_without_a_place_for_temporary_folders_nothing_changes(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(place / "missing"))
    with temporary_folder():
        assert tempfile.tempdir == str(place / "missing")
