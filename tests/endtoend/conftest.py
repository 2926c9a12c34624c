"""A small capture, and the reference made from it once."""

import json
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from tests.endtoend.commands import DRAFT, CommandLine

SMALL_PLOT = Path(__file__).parents[1] / "data" / "small_plot"


@dataclass(frozen=True)
class Built:
    """An unbroken run of `fieldkit reference`.

    Attributes:
        reference: the result's folder.
        cache: the stage cache it left.
        report: what --json printed.
    """

    reference: Path
    cache: Path
    report: dict[str, Any]


@pytest.fixture(scope="session")
def small_plot() -> Path:
    """Eight rendered photographs with poses.csv and camera.toml; not to be written to."""
    return SMALL_PLOT


@pytest.fixture(scope="session")
def built(small_plot: Path, made_once: Callable[[str, Callable[[Path], object]], Path]) -> Built:
    """The small plot's reference, made with an empty cache."""

    def build(folder: Path) -> None:
        done = CommandLine(folder, folder / "cache").run(
            "reference", str(small_plot), "-o", "reference", *DRAFT, "--json"
        )
        (folder / "report.json").write_text(done.out, "utf-8")

    folder = made_once("built", build)
    return Built(folder / "reference", folder / "cache", json.loads((folder / "report.json").read_text("utf-8")))


@pytest.fixture
def line(tmp_path: Path) -> CommandLine:
    """A command line in an empty folder, with an empty cache."""
    return CommandLine(tmp_path, tmp_path / "cache")


@pytest.fixture
def warm(tmp_path: Path, built: Built) -> CommandLine:
    """A command line in an empty folder, with the cache that the reference's run left."""
    return CommandLine(tmp_path, built.cache)


@pytest.fixture
def photographs(small_plot: Path, tmp_path: Path) -> Callable[..., Path]:
    """Copy photographs of the small plot: photographs("plot", 8) or photographs("plot", 2, poses=False)."""

    def copy(name: str = "photos", count: int = 8, *, poses: bool = True) -> Path:
        folder = tmp_path / name
        folder.mkdir(parents=True)
        for path in sorted(small_plot.glob("*.jpg"))[:count]:
            shutil.copyfile(path, folder / path.name)
        shutil.copyfile(small_plot / "camera.toml", folder / "camera.toml")
        if poses:
            lines = (small_plot / "poses.csv").read_text("utf-8").splitlines()
            (folder / "poses.csv").write_text("\n".join(lines[: count + 1]) + "\n", "utf-8")
        return folder

    return copy
