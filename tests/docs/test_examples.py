"""The examples of the documentation run as they stand, and are what their page says."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from fieldkit.scenes.description import build
from fieldkit.scenes.plot_description import PlotDescription
from fieldkit.scenes.renderer import Renderer, RenderingError
from fieldkit.scenes.scene_file import read_scene
from tests.cli.test_scene_commands import TINY

ROOT = Path(__file__).parents[2]
EXAMPLES = ROOT / "docs" / "examples"
SCRIPTS = sorted(path.stem for path in EXAMPLES.glob("*.py") if path.stem != "small_plot")

# What each has to print: of every figure that it shows, that it is there and that it is a sound one.
QUICK = {
    "change_plan": r"(\d: .*m, heading .*, pitch  -34°\n){8}4 stations, all at 1\.25 m\n",
    "check_mission": r"may be flown\n(heading \d+°, pitch -34°, [\d.]+ s .*\n){3}its camera .*\nwarning: .*\n",
    "export_mission": r"(mission(-\d)?\.(plan|json|geojson): [\d,]+ bytes\n)+\d flights over 12 plots\n",
    "geotag_photographs": r"13 triggers\n12 of 12 photographs .* 40\.\d s fast\nimage,x_m,y_m,z_m.*\n",
}
SLOW = {
    "build_reference": r"8 of 8 photographs .*\n.* are [1-5]\.\d mm .*\n\d,\d{3} points, up to 0\.[45]\d m high, .*\n",
    "choose_views": r"( +\d+\.\d mm  IMG_\d+\.jpg.*\n)+chosen: 6 views, \d+\.\d mm\n",
    "evaluate_captures": r"monday: 8 of 8 .*mm, F-score at 10 mm [01]\.\d\d\ntuesday: .*\n",
    "plan_on_scene": r"3 evaluations; the best is \d+\.\d mm .*\n4 evaluations; 4 stations, .* [12]\.\d+ m\n",
    "run_campaign": r"first: 1 evaluated\nthen: 1 evaluated, 1 .*\nA .*\nB .*\nplot,date,.*\nseason\.html: \d+ kB\n",
    "tour": r"((Photo|Capture|Priors|CheckReport|PlotEvaluation|Finding|Cameras|Plan|Site|Mission|Visit) +\S.*\n){11}",
    "use_objective": r"from 0\.35 m: .*\nfrom 0\.9 m: [56] of 6 photographs, \d+\.\d mm ?\n",
}


def run(name: str, folder: Path) -> str:
    """What an example prints; its temporary folder lies in ``folder``."""
    environment = {**os.environ, "TMPDIR": str(folder), "PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        [sys.executable, "-W", "error::SyntaxWarning", str(EXAMPLES / f"{name}.py")],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        timeout=900,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.fixture
def renderer(tmp_path: Path) -> None:
    file = tmp_path / "tiny.toml"
    file.write_text(TINY, encoding="utf-8")
    scene = read_scene(file)
    assert isinstance(scene.plot, PlotDescription)
    try:
        Renderer(build(scene)).close()
    except RenderingError as error:
        pytest.skip(f"no picture can be rendered here: {error}")


def test_every_example_is_run() -> None:
    assert sorted([*QUICK, *SLOW]) == SCRIPTS


@pytest.mark.parametrize("name", QUICK)
def test_quick(name: str, tmp_path: Path) -> None:
    printed = run(name, tmp_path)
    assert re.fullmatch(QUICK[name], printed), printed


@pytest.mark.slow
@pytest.mark.parametrize("name", SLOW)
def test_slow(name: str, tmp_path: Path, renderer: None) -> None:
    printed = run(name, tmp_path)
    assert re.fullmatch(SLOW[name], printed), printed


@pytest.mark.parametrize("path", sorted(EXAMPLES.glob("*.py")), ids=lambda path: path.stem)
def test_opens_as_a_notebook_and_is_listed(path: Path) -> None:
    text = path.read_text("utf-8")
    assert re.match(r'"""[A-Z][^\n]*\.\n', text)  # the page's title
    cells = re.findall(r"(?m)^# %%(.*)$", text)
    assert cells
    assert set(cells) <= {"", " [markdown]"}
    for cell in re.split(r"(?m)^# %%", text):
        if cell.startswith(" [markdown]"):
            assert all(line.startswith("#") for line in cell.strip().splitlines()[1:])
    assert f"({path.name})" in (EXAMPLES / "README.md").read_text("utf-8")
