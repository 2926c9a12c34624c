"""Running fieldkit's command line as a person does, and comparing what it leaves."""

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass
from io import StringIO
from pathlib import Path
from typing import Any

import pytest
from PIL import Image

from fieldkit.cli.main import main
from tests.captures.photographs import exif_block, gps_tags

LIMIT_S = 600
DRAFT = ("--fidelity", "draft", "--bounds", "-0.25,-0.25,-0.03,0.25,0.25,0.5")
"""What keeps a run on the small plot short."""
_MEASURE = """
import pathlib, resource, subprocess, sys
code = subprocess.call(sys.argv[2:])
pathlib.Path(sys.argv[1]).write_text(str(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss))
raise SystemExit(code)
"""
_TIMES = ("times", "seconds", "cpu_seconds")


@dataclass(frozen=True)
class Finished:
    """A command that ended."""

    code: int
    out: str
    err: str

    @property
    def json(self) -> dict[str, Any]:
        return json.loads(self.out)

    @property
    def error(self) -> dict[str, Any]:
        return self.json["error"]


@dataclass(frozen=True)
class CommandLine:
    """`fieldkit` in a folder, with a stage cache of its own."""

    folder: Path
    cache: Path

    def start(self, *arguments: str, by: Sequence[str] = ()) -> subprocess.Popen[str]:
        """The command in a process of its own."""
        environment = {**os.environ, "FIELDKIT_CACHE": str(self.cache), "COLUMNS": "200"}
        return subprocess.Popen(
            [*by, sys.executable, "-m", "fieldkit", *arguments],
            cwd=self.folder,
            env=environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            encoding="utf-8",
        )

    def run(self, *arguments: str, code: int = 0) -> Finished:
        """The command in this process, which has imported everything already; it must end with the code."""
        out, err = StringIO(), StringIO()
        with pytest.MonkeyPatch.context() as patch, redirect_stdout(out), redirect_stderr(err):
            patch.chdir(self.folder)
            patch.setenv("FIELDKIT_CACHE", str(self.cache))
            patch.setenv("COLUMNS", "200")
            done = _finished(main(arguments), out.getvalue(), err.getvalue())
        assert done.code == code, done.err
        return done

    def run_measured(self, *arguments: str) -> tuple[Finished, int]:
        """What a command gave, and the most memory one of its processes held, in bytes (Linux).

        A process counts from what its parent held when it was started, so a small one starts the command.
        """
        peak = self.cache.with_name("peak.txt")
        done = finish(self.start(*arguments, by=(sys.executable, "-c", _MEASURE, str(peak))))
        return done, 1024 * int(peak.read_text())

    def entries(self, stage: str = "*") -> int:
        """How many results the cache holds, of one stage or of all."""
        return len(list(self.cache.glob(f"{stage}/*/*.npz")))


def finish(process: subprocess.Popen[str]) -> Finished:
    """Wait for a command; one that hangs is ended and fails the test."""
    try:
        out, err = process.communicate(timeout=LIMIT_S)
    except subprocess.TimeoutExpired:
        process.kill()
        process.communicate()
        raise
    return _finished(process.returncode, out, err)


def _finished(code: int, out: str, err: str) -> Finished:
    assert "Traceback" not in err, err
    return Finished(code, out, err)


def wait_until(process: subprocess.Popen[str], reached: Callable[[], bool]) -> bool:
    """Whether a running command came to a state before it ended."""
    give_up = time.monotonic() + LIMIT_S
    while process.poll() is None and time.monotonic() < give_up:
        if reached():
            return True
        time.sleep(0.01)
    return False


def contents(folder: Path) -> dict[str, bytes]:
    """Every file of a result by name; JSON without how long the run took and what it found in the cache."""
    files = {}
    for path in sorted(folder.rglob("*")):
        if path.is_file():
            data = path.read_bytes()
            if path.suffix == ".json":
                data = json.dumps(_without_times(json.loads(data)), sort_keys=True).encode()
            files[path.relative_to(folder).as_posix()] = data
    return files


def differing(a: Path, b: Path) -> list[str]:
    """Names of the files that are not the same in two results."""
    first, second = contents(a), contents(b)
    return sorted(name for name in first.keys() | second.keys() if first.get(name) != second.get(name))


def partial_folders(folder: Path) -> list[Path]:
    """What a run that did not end left beside its result."""
    return sorted(folder.glob(".*.partial"))


def set_gps(photo: Path, latitude: float, longitude: float, altitude: float, taken: str) -> None:
    """Write a time and a GPS position, good to 2 cm, into a JPEG's EXIF; the pixels stay as they are."""
    with Image.open(photo) as image:
        exif = exif_block(detail={36867: taken}, gps={**gps_tags(latitude, longitude, altitude), 31: 0.02})
        image.save(photo, "JPEG", quality="keep", exif=exif)


def _without_times(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _without_times(item) for key, item in value.items() if key not in _TIMES}
    return [_without_times(item) for item in value] if isinstance(value, list) else value
