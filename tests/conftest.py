"""Fixtures that several test folders share."""

import os
import signal
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from hypothesis import settings

from fieldkit.files import lock
from fieldkit.runtime.threads import set_thread_environment

# The same examples in every run, and no deadline, for a busy machine is no failure. `make test-all` takes more of them
# (thorough); HYPOTHESIS_PROFILE=explore looks further.
settings.register_profile("fast", deadline=None, derandomize=True, max_examples=20)
settings.register_profile("thorough", deadline=None, derandomize=True, max_examples=100)
settings.register_profile("explore", deadline=None, max_examples=1000)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "fast"))

set_thread_environment()  # before anything imports NumPy

# A shell's background jobs ignore Ctrl-C, and so would the commands that tests start and interrupt.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_collection_modifyitems(items: list[pytest.Function]) -> None:
    """Tests with a browser or a built wheel are slow, but for one."""
    for item in items:
        if {"browser", "installed"} & {*item.fixturenames} and "something_is_seen" not in item.name:
            item.add_marker("slow")


@pytest.fixture(scope="session")
def data_folder() -> Path:
    """The recorded image sets; they are not part of the repository."""
    folder = os.environ.get("FIELDKIT_DATA")
    if not folder:
        pytest.skip("FIELDKIT_DATA is unset: it names the folder with the recorded image sets")
    return Path(folder)


@pytest.fixture(autouse=True)
def _one_worker(monkeypatch: pytest.MonkeyPatch) -> None:
    """Commands without --workers take one process: the tests themselves run on every core."""
    monkeypatch.setattr("fieldkit.runtime.machine.usual_workers", lambda: 1)


@pytest.fixture(scope="session")
def made_once(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str, Callable[[Path], object]], Path]:
    """made_once(name, make): a folder of the session, made by the first of the workers that asks for it."""
    base = tmp_path_factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:
        base = base.parent

    def folder(name: str, make: Callable[[Path], object]) -> Path:
        with (base / f"{name}.lock").open("w") as file:
            lock(file.fileno(), wait=True)
            if not (base / name).exists():
                making = tmp_path_factory.mktemp(name)
                make(making)
                making.rename(base / name)
        return base / name

    return folder


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """A disk of 1 MiB."""
    yield from _mounted(tmp_path / "disk", "size=1m")


@pytest.fixture
def unwritable(tmp_path: Path) -> Iterator[Path]:
    """A folder nothing can be written to: a read-only mount for root, whom permissions do not stop."""
    folder = tmp_path / "unwritable"
    if os.geteuid() == 0:
        yield from _mounted(folder, "ro,size=1m")
        return
    folder.mkdir(mode=0o555)
    yield folder
    folder.chmod(0o755)


def _mounted(folder: Path, options: str) -> Iterator[Path]:
    folder.mkdir()
    mount = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", options, "tmpfs", str(folder)], capture_output=True, text=True, check=False
    )
    if mount.returncode != 0:
        pytest.skip(f"a small disk cannot be mounted here: {mount.stderr.strip()}")
    try:
        yield folder
    finally:
        subprocess.run(["umount", "-l", str(folder)], check=True)
