"""Plans within a vehicle's limits: whatever the envelope lets through, the vehicle's mission takes as it is."""

from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fieldkit.clouds import Cloud, Volume
from fieldkit.errors import MissionError, UsageError
from fieldkit.missions.export import route_plan
from fieldkit.planning.plan_settings import EnvelopeSettings, PlanSettings
from fieldkit.planning.run.flyable import vehicle_envelope
from fieldkit.planning.run.request import resumed_settings, search_settings
from fieldkit.planning.space.cameras import Cameras
from fieldkit.planning.space.envelope import Envelope, project
from fieldkit.results.plan import Plan
from fieldkit.results.plan_file import plan_from_poses
from fieldkit.sites.placement import place
from fieldkit.sites.plot_plants import with_plant_height
from fieldkit.sites.reach import unreachable
from fieldkit.sites.site_file import load_site
from fieldkit.vehicles.vehicle_file import load_vehicle, vehicle_names, vehicles_folder
from tests.planning.bowl import bowl_settings

SITE = with_plant_height(load_site(Path(__file__).parents[3] / "missions" / "sites" / "example.toml"), None, 2.0)
TARGET = Volume((-1.0, -1.0, 0.03), (1.0, 1.0, 2.2))
PROFILES = st.sampled_from(vehicle_names())
NO_CAMERA = """model = "PINHOLE"
width = 640
height = 480
params = [500, 500, 320, 240]
"""


def palms() -> Cloud:
    """Two stems with crowns of 0.8 m in 2.2 m, and a hedge about a court of 1.4 m."""
    rng = np.random.default_rng(2)
    turn, out = rng.uniform(0, 2 * np.pi, 300), 0.8 * np.sqrt(rng.uniform(0, 1, 300))
    crown = np.stack([out * np.cos(turn), out * np.sin(turn), rng.uniform(2.1, 2.2, 300)], axis=1)
    stem = np.stack([np.zeros(60), np.zeros(60), np.linspace(0.0, 2.2, 60)], axis=1)
    side = np.linspace(-0.7, 0.7, 30)
    court = [(x, y, z) for s in side for z in (0.2, 0.8, 1.3) for x, y in ((s, -0.7), (s, 0.7), (-0.7, s), (0.7, s))]
    trees = [np.vstack([stem, crown]) + np.array((x, 1.6, 0.0)) for x in (-1.4, 1.4)]
    return Cloud(np.vstack([*trees, np.array(court) + np.array((0.0, -1.3, 0.0))]))


@lru_cache
def envelope_of(name: str) -> Envelope:
    limits = vehicle_envelope(load_vehicle(name), EnvelopeSettings())
    return Envelope.around(palms(), TARGET, **limits.model_dump())


def plan_of(cameras: Cameras, envelope: Envelope) -> Plan:
    plan = plan_from_poses(cameras.poses(), plants=envelope.plan_plants(envelope.plants))
    return Plan.model_validate_json(plan.model_dump_json())


@given(PROFILES, st.integers(0, 2**32))
def test_samples_are_within_the_vehicles_reach(name: str, seed: int) -> None:
    envelope = envelope_of(name)
    plan = plan_of(envelope.sample(8, seed), envelope)
    assert unreachable(place(plan, SITE), SITE, load_vehicle(name)) == ()


@pytest.mark.slow
@given(PROFILES, st.integers(0, 2**32))
@settings(max_examples=12)
def test_samples_are_routed_as_they_are(name: str, seed: int) -> None:
    envelope = envelope_of(name)
    drawn = envelope.sample(5, seed)
    moved = project(Cameras(0.7 * drawn.positions, drawn.yaw_deg, drawn.pitch_deg), envelope)
    for cameras in (drawn, moved):
        assert envelope.contains(cameras)
        routed = route_plan(plan_of(cameras, envelope), load_vehicle(name), SITE)
        assert routed.moved == ()
        assert routed.photographs == 5


def test_below_leaves_is_no_place_for_a_vehicle() -> None:
    envelope = envelope_of("ardupilot-pitch")
    below, above = np.array([[1.4, 0.9, 1.2]]), np.array([[1.4, 0.9, 2.8]])
    court = np.array([[0.0, -1.3, 1.0]])
    for at in (below, court):
        distance = np.linalg.norm(envelope.plants - at, axis=1).min()
        assert distance > envelope.clearance_m
        assert envelope.position_violation(at)[0] > 0
        look = Cameras(at, np.zeros(1), np.full(1, -30.0))
        with pytest.raises(MissionError, match="the plants of plot"):
            route_plan(plan_of(look, envelope), load_vehicle("ardupilot-pitch"), SITE)
    high = replace(envelope, height_m=(0.5, 4.0))
    assert high.position_violation(below)[0] == pytest.approx(2.2 + 0.5 - 1.2, abs=0.15)
    assert high.position_violation(above)[0] < 0.0
    anyone = Envelope.around(palms(), TARGET, clearance_m=envelope.clearance_m)
    assert anyone.position_violation(below)[0] < 0


@pytest.mark.parametrize("limits", [{"height_m": (0.5, 2.0)}, {"clearance_m": 0.3}, {"pitch_deg": (-90.0, 45.0)}])
def test_what_leaves_the_vehicles_limits_is_refused(limits: dict[str, Any]) -> None:
    with pytest.raises(UsageError, match=r"no lower than 1 m, keeps 0.5 m .* from -90° to 30°") as caught:
        search_settings(PlanSettings(scene="demo", vehicle="ardupilot-pitch", envelope=limits))
    assert "--vehicle" in caught.value.remedy


def test_what_is_given_wins_within_the_limits() -> None:
    own = {"height_m": (1.4, 3.0), "clearance_m": 0.8, "pitch_deg": (-60.0, -10.0), "margin_m": 0.7}
    found = search_settings(PlanSettings(scene="demo", vehicle="ardupilot-pitch", envelope=own))
    assert {key: getattr(found.envelope, key) for key in own} == own
    assert found.envelope.vehicle_clearance_m == 0.5
    assert found.camera == load_vehicle("ardupilot-pitch").camera
    high = load_vehicle("ardupilot-pitch").model_copy(update={"min_height_m": 4.0})
    assert vehicle_envelope(high, EnvelopeSettings()).height_m == (4.0, 5.0)


def test_a_camera_that_is_given_is_taken_instead(tmp_path: Path) -> None:
    file = tmp_path / "camera.toml"
    file.write_text(NO_CAMERA)
    found = search_settings(PlanSettings(scene="demo", vehicle="px4-gimbal", camera=file))
    assert found.camera.width == 640
    assert found.vehicle is not None
    with pytest.raises(UsageError, match="did not begin with camera"):
        resumed_settings(found, PlanSettings(camera=_other(tmp_path)))
    assert resumed_settings(found, PlanSettings(camera=file)) == found


def _other(folder: Path) -> Path:
    file = folder / "other.toml"
    file.write_text(NO_CAMERA.replace("500, 500", "400, 400"))
    return file


def test_a_run_goes_on_for_the_vehicle_it_began_with(tmp_path: Path) -> None:
    began = search_settings(PlanSettings(scene="demo", vehicle="ardupilot-pitch"))
    assert (began.vehicle.name, began.vehicle.title) == ("ardupilot-pitch", "ArduCopter quad with a pitch gimbal")
    assert resumed_settings(began, PlanSettings()) == began
    assert resumed_settings(began, PlanSettings(envelope={"height_m": (1.0, 2.5)}, vehicle="ardupilot-pitch")) == began
    with pytest.raises(UsageError, match="did not begin with vehicle = px4-gimbal"):
        resumed_settings(began, PlanSettings(vehicle="px4-gimbal"))
    with pytest.raises(UsageError, match="did not begin with vehicle"):
        resumed_settings(bowl_settings(), PlanSettings(vehicle="ardupilot-pitch"))
    copy = tmp_path / "mine.toml"
    copy.write_bytes((vehicles_folder() / "ardupilot-pitch.toml").read_bytes())
    assert resumed_settings(began, PlanSettings(vehicle=copy)) == began
    copy.write_text(copy.read_text().replace("min_height_m = 1.0", "min_height_m = 1.1"))
    with pytest.raises(UsageError, match=r"did not begin with vehicle = .*mine"):
        resumed_settings(began, PlanSettings(vehicle=copy))
