"""`fieldkit plan`: wrong calls are told in words, and a run is planned, resumed and extended on real photographs."""

import json
import shlex
from pathlib import Path

import numpy as np
import pytest

from fieldkit.captures import read_capture
from fieldkit.cli.main import main
from fieldkit.planning.plan_settings import NoiseSettings
from fieldkit.planning.run.folder import create_run, open_run, read_log
from fieldkit.planning.run.run_setup import set_up_run
from fieldkit.reconstruction.known_poses import known_poses
from fieldkit.results.plan_file import load_plan
from fieldkit.results.report_files import save_report
from fieldkit.runtime.context import Context
from tests.evaluation.test_adherence import flown
from tests.planning.bowl import bowl_settings

SMALL_PLOT = Path(__file__).parents[1] / "data" / "small_plot"


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        ("", 2, "plan on what?"),
        ("--scene case-1 --reference .", 2, "plan on what?"),
        ("--scene case-9", 3, "Did you mean case-"),
        ("--reference nowhere", 3, "nowhere"),
        ("--captures nowhere", 3, "nowhere"),
        ("--scene case-1 -n 2", 2, "cameras"),
        ("--scene case-1 --images .", 2, "--reference"),
        ("--scene case-1 --height 2", 2, "two numbers"),
        ("--scene case-1 --height 3,2", 2, "height_m: 3 is above 2"),
        ("--scene case-1 --height 75,150", 2, "less than or equal to 50"),
        ("--scene case-1 -n 1300", 2, "cameras"),
        ("--scene case-1 --pose-noise 20,1", 2, "in centimetres?"),
        (f"--captures '{SMALL_PLOT}' --clearance 0.5", 2, "recorded photographs have their places"),
        ("--scene case-1 --for this-plot --vary 4", 2, "--vary 4 plans for more than this plot"),
        ("--scene case-1 --method matchable", 2, "matchable"),
        ("--scene case-1 --preset indoors", 2, "indoors"),
        ("--scene case-1 --pose-noise from:", 2, "from what?"),
        ("--scene case-1 --pose-noise from:nowhere", 3, "nowhere"),
        ("--scene case-1 --vehicle ardupilot-pich", 3, "Did you mean ardupilot-pitch"),
        ("--scene case-1 --vehicle px4-gimbal --height 1,2", 2, "flies no lower than 1.2 m"),
        ("--resume --overwrite", 2, "--overwrite"),
        ("--resume", 3, "search.json"),
    ],
)
def test_wrong_calls_are_told_in_words(tmp_path, capsys, arguments, code, words) -> None:
    assert main(["plan", *shlex.split(arguments), "-o", str(tmp_path / "run")]) == code
    told = capsys.readouterr().err
    assert words in told
    assert "Traceback" not in told
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize(
    "arguments",
    ["-n 5", "--seed 4", "--for kind", "--vary 8", "--clearance 2", "--pose-noise 0.1,1"],
)
def test_a_run_goes_on_as_it_began(tmp_path: Path, capsys: pytest.CaptureFixture[str], arguments: str) -> None:
    with create_run(tmp_path / "run", bowl_settings()):
        pass
    assert main(["plan", "--resume", *arguments.split(), "-o", str(tmp_path / "run")]) == 2
    assert "did not begin with" in capsys.readouterr().err


def test_noise_is_taken_from_an_evaluation(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rows = [(x, 0.0, 0.0, 1.5, -1.5) for x in (-0.03, 0.0, 0.03)]
    save_report(tmp_path / "evaluation.json", flown(rows))
    source = bowl_settings().source.model_copy(update={"sha256": "0" * 64})
    noise = NoiseSettings(pose_m=round((2 * 0.03**2 / 6) ** 0.5, 5), pose_deg=1.5)
    for name, settings, words in (
        ("same", bowl_settings(noise=noise, source=source), "gone"),  # so far, the noise is the run's
        ("other", bowl_settings(source=source), "did not begin with pose_m = 0.01732"),
    ):
        with create_run(tmp_path / name, settings):
            pass
        for given in (tmp_path, tmp_path / "evaluation.json"):
            assert main(["plan", "--resume", "--pose-noise", f"from:{given}", "-o", str(tmp_path / name)]) == 2
            assert words in capsys.readouterr().err


@pytest.mark.slow
def test_photographs_are_chosen_resumed_and_extended(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run = str(tmp_path / "run")
    begin = ["plan", "--captures", str(SMALL_PLOT), "-n", "4", "--method", "bosfm", "--repeats", "1", "-o", run]
    assert main([*begin, "--evaluations", "2", "--workers", "1", "--json"]) == 0
    told = capsys.readouterr()
    first = json.loads(told.out)
    assert [json.loads(line)["number"] for line in told.err.splitlines() if line.startswith("{")][:2] == [0, 1]
    assert {"method", "cameras", "chamfer_m", "evaluations", "failed_evaluations", "seconds"} <= first.keys()
    with open_run(tmp_path / "run") as begun:
        problem = set_up_run(begun.settings, begun.path, Context()).problem
    assert problem.exact
    assert main([*begin, "--workers", "1"]) == 2
    assert "exists" in capsys.readouterr().err
    assert main(["plan", "--resume", "--evaluations", "4", "--workers", "2", "--json", "-o", run]) == 0
    second = json.loads(capsys.readouterr().out)
    assert second["evaluations"] == 4
    assert second["chamfer_m"] <= first["chamfer_m"]
    assert [e.number for e in read_log(tmp_path / "run") if e.stage == "search"] == [0, 1, 2, 3]
    plan = load_plan(tmp_path / "run")
    assert len(plan.stations) == 4
    assert plan.source.kind == "captures"
    places = known_poses(read_capture(SMALL_PLOT)).by_name
    for station, name in zip(plan.stations, second["photographs"], strict=True):
        place = places[name].position
        assert np.linalg.norm(np.array(station.position_m) - place) < 0.02  # the frame is moved onto the ground
    for name in ("plan.png", "outcome.json"):
        assert (tmp_path / "run" / name).stat().st_size > 100
