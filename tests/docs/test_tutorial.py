"""The tutorial's commands run as they stand, one after the other, and say what the page shows."""

import csv
import os
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from fieldkit.scenes.description import build
from fieldkit.scenes.renderer import Renderer, RenderingError
from fieldkit.scenes.scene_file import read_scene

pytestmark = pytest.mark.slow
ROOT = Path(__file__).parents[2]
FIELD = ROOT / "docs" / "tutorial"
TRIAL = [f"r{row}c{column}" for row in (1, 2) for column in (1, 2, 3, 4)]
FIGURE = re.compile(r"[-−]?\d[\d.,]*")


def commands(page: str) -> Iterator[tuple[list[str], list[str]]]:
    """A page's commands of fieldkit, each with the lines that it is shown to print."""
    found: list[tuple[list[str], list[str]]] = []
    for line in (ROOT / "docs" / page).read_text("utf-8").splitlines():
        if line.startswith("    $ "):
            found.append((shlex.split(line[6:]), []))
        elif line.startswith("    ") and found:
            found[-1][1].append(line.strip())
    return ((words, lines) for words, lines in found if words[0] == "fieldkit")


def words_of(text: str) -> str:
    """Text without its figures, which differ from machine to machine, and without how it is broken into lines."""
    return " ".join(FIGURE.sub("#", text).split())


@pytest.fixture
def trial(tmp_path: Path) -> Path:
    folder = tmp_path / "my-trial"
    shutil.copytree(FIELD, folder)
    try:
        Renderer(build(read_scene(folder / "apart" / "field" / "A1.toml"))).close()
    except RenderingError as error:
        pytest.skip(f"no picture can be rendered here: {error}")
    return folder


@pytest.mark.parametrize(
    ("page", "count", "result", "plots"),
    [
        ("getting-started.md", 9, "scores", TRIAL),
        ("trials.md", 4, "scores", TRIAL),
        ("plots-apart.md", 15, "apart/season", ["A1", "A2", "B1", "B2"]),
    ],
)
def test_every_command_runs_and_says_what_the_page_shows(
    trial: Path, page: str, count: int, result: str, plots: list[str]
) -> None:
    script = "import sys; from fieldkit.cli.main import main; sys.exit(main())"
    environment = {**os.environ, "FIELDKIT_CACHE": str(trial / "cache"), "PYTHONPATH": str(ROOT), "COLUMNS": "200"}
    ran = 0
    for words, shown in commands(page):
        done = subprocess.run(
            [sys.executable, "-c", script, *words[1:]],
            cwd=(trial / result).parent,
            env=environment,
            capture_output=True,
            text=True,
            timeout=1800,
            check=False,
        )
        assert done.returncode == 0, (words, done.stderr)
        said = words_of(done.stdout + done.stderr)
        for line in shown:
            for part in filter(None, (words_of(part) for part in line.split("…"))):
                assert part in said, (words, line, done.stdout + done.stderr)
        ran += 1
    assert ran == count
    with (trial / result / "traits.csv").open(encoding="utf-8", newline="") as table:
        rows = {row["plot"]: row for row in csv.DictReader(table)}
    assert sorted(rows) == plots
    assert all(row[trait] for row in rows.values() for trait in ("height_m", "cover_percent", "canopy_volume_m3"))
