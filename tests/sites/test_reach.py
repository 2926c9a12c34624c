"""What a vehicle can reach."""

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fieldkit.results.plan import Plan, Station
from fieldkit.routing.mission import Home, Shot
from fieldkit.sites.placement import place
from fieldkit.sites.reach import nearest, unreachable
from fieldkit.sites.site import Site, SitePlot
from fieldkit.vehicles.vehicle_file import load_vehicle, vehicle_names

SITE = Site(
    home=Home(latitude_deg=50.0, longitude_deg=6.0, amsl_m=100.0),
    plots=(
        SitePlot(name="low", latitude_deg=50.0001, longitude_deg=6.0, height_m=97.0, datum="amsl"),
        SitePlot(name="high", latitude_deg=50.0002, longitude_deg=6.0, height_m=102.0, datum="amsl"),
    ),
)


def shots_of(*poses: tuple[float, float]) -> tuple[Shot, ...]:
    """Stations of (height above the ground, pitch) on both plots."""
    stations = tuple(Station(position_m=(k, 0.0, z), yaw_deg=10.0, pitch_deg=p) for k, (z, p) in enumerate(poses))
    return place(Plan(fieldkit="0", stations=stations), SITE)


def test_a_pitch_beyond_the_mount() -> None:
    shots = shots_of((2.0, -30.0), (2.0, 41.0))
    found = unreachable(shots, SITE, load_vehicle("ardupilot-pitch"))
    assert [each.shot.name for each in found] == [
        "station 2 of low",
        "station 2 of high",
    ]
    assert found[0].nearest == replace(shots[1], pitch_deg=30.0)
    assert str(found[0]) == (
        "station 2 of low: pitch 41°, but the mount of ArduCopter quad with a pitch gimbal reaches -90° to 30°; "
        "the nearest pose is 2.00 m above the ground with pitch 30°"
    )


def test_too_low_is_above_the_plots_ground_and_not_above_home() -> None:
    shots = shots_of((0.6, -30.0), (1.0, -30.0))
    found = unreachable(shots, SITE, load_vehicle("ardupilot-pitch"))
    assert [(each.shot.plot, each.shot.station) for each in found] == [
        ("low", 0),
        ("high", 0),
    ]
    assert [each.nearest.place.height_m for each in found] == pytest.approx([-2.0, 3.0])
    assert "0.60 m above the ground, but" in found[0].what


@given(
    st.sampled_from(vehicle_names()), st.lists(st.tuples(st.floats(-2, 6), st.floats(-90, 90)), min_size=1, max_size=4)
)
def test_the_nearest_pose_is_reachable_and_the_nearest(name: str, poses: list[tuple[float, float]]) -> None:
    vehicle = load_vehicle(name)
    shots = shots_of(*poses)
    changed, problems = nearest(shots, SITE, vehicle)
    assert unreachable(changed, SITE, vehicle) == ()
    assert [each.nearest for each in problems] == [b for a, b in zip(shots, changed, strict=True) if a != b]
    low, high = vehicle.mount.pitch_deg
    for shot, near in zip(shots, changed, strict=True):
        # Neither another pitch nor another height that is reachable is nearer.
        assert abs(near.pitch_deg - shot.pitch_deg) <= max(low - shot.pitch_deg, shot.pitch_deg - high, 0.0) + 1e-6
        rise = near.place.height_m - shot.place.height_m
        above = shot.place.height_m - SITE.ground_m(next(plot for plot in SITE.plots if plot.name == shot.plot))
        assert rise == pytest.approx(max(vehicle.min_height_m - above, 0.0), abs=2e-4)
        assert near == replace(shot, pitch_deg=near.pitch_deg, height_m=near.height_m)
