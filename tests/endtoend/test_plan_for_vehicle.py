"""A plan for a vehicle is exported for it as it is, and its check finds nothing wrong."""

from pathlib import Path

import pytest

from fieldkit.results.plan_file import load_plan
from tests.endtoend.commands import CommandLine
from tests.endtoend.test_simulated_plot import run, write_scene

SITE = Path(__file__).parents[2] / "missions" / "sites" / "example.toml"
SHORT = ("-n", "6", "--method", "circle", "--evaluations", "2", "--repeats", "1", "--workers", "1")


@pytest.mark.slow
def test_planned_exported_checked(line: CommandLine) -> None:
    write_scene(line.folder, spacing=0.02, texture=512)
    run(line, "plan", "--scene", "plot.toml", "--vehicle", "ardupilot-pitch", *SHORT, "-o", "plan")
    plan = load_plan(line.folder / "plan")
    assert plan.envelope.lower_m[2] == 1.0
    assert plan.envelope.pitch_deg == (-90.0, 30.0)
    assert (plan.camera.width, plan.camera.height) == (800, 600)
    assert plan.camera.params[0] / 800 == pytest.approx(3871.0 / 4056, rel=1e-3)

    mission = ("--vehicle", "ardupilot-pitch", "--site", str(SITE))
    height = ("--plant-height", str(round(max(z for _, _, z in plan.plants.points_m), 2)))
    exported = run(line, "export-mission", "plan", *mission, *height, "--no-picture", "-o", "mission.plan")
    assert exported["moved"] == []
    assert exported["photographs"] == 6
    checked = run(line, "check-mission", "mission.plan", *mission, "--plan", "plan")
    assert checked["ok"] is True

    refused = line.run(
        "plan", "--scene", "plot.toml", "--vehicle", "ardupilot-pitch", "--height", "0.5,2", "-o", "low", code=2
    )
    assert "no lower than 1 m" in refused.err
    other = line.run("plan", "--resume", "--vehicle", "px4-gimbal", "-o", "plan", code=2)
    assert "did not begin with vehicle" in other.err
