"""Scene file → photographs → reference → scores, by the command line only, as with a real plot."""

from pathlib import Path

import pytest

from tests.endtoend.commands import DRAFT, CommandLine

SCENE = """\
format = 1
[plot]
extent_m = 0.8
[plot.soil]
kind = "printed"
seed = 5
core_m = 0.6
spacing_m = {spacing}
texture_px = {texture}
stones = 300
residues = 150
[[plot.plants]]
seed = 41
leaves = 6
scale = 0.7
[camera]
model = "PINHOLE"
width = 800
height = 600
params = [680, 680, 400, 300]
"""


def run(line: CommandLine, command: str, *more: str) -> dict[str, object]:
    return line.run(*command.split(), *more, "--json").json


def write_scene(folder: Path, *, spacing: float, texture: int) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "plot.toml").write_text(SCENE.format(spacing=spacing, texture=texture))


def test_a_small_capture_is_scored(line: CommandLine) -> None:
    """Ten photographs of 480 × 360 over printed soil: enough to see that every file fits its reader."""
    write_scene(line.folder, spacing=0.02, texture=512)
    run(line, "simulate plot.toml --ring 10,0.8,0.6 --size 480x360 --pose-noise 0.005,0.5 -o flight")
    report = run(line, "evaluate flight -o scores", *DRAFT)
    (plot,) = report["plots"]
    assert plot["images"] == 10
    assert plot["metric_source"] == "poses.csv"
    assert plot["right"] >= 8
    assert plot["points"] > 1000


@pytest.mark.slow
def test_dense_capture_to_reference_to_scores_to_a_proxy(line: CommandLine) -> None:
    write_scene(line.folder, spacing=0.006, texture=2048)
    run(line, "simulate plot.toml --dense 30 --pose-noise 0.005,0.5 --truth-cloud truth.ply -o dense")
    reference = run(line, "reference dense -o ref", *DRAFT)
    assert reference["right"] == 30
    for name, scene in (("few", "plot.toml"), ("proxy", "ref-scene")):
        if name == "proxy":
            made = run(line, "scene from-reference ref -o ref-scene")
            assert made["plant_surfels"] > 2_000
        flown = f"--ring 12 --size 800x600 --pose-noise 0.01,1 --seed 2 --blur 0.002 -o {name}"
        run(line, f"simulate {scene} {flown}")
        report = run(line, f"evaluate {name} --reference ref -o {name}-scores", *DRAFT)
        (plot,) = report["plots"]
        assert plot["right"] >= 10, name
        assert plot["chamfer_m"] < 0.05, name
