"""How far photographs were taken from their stations, on the recorded flights."""

from collections.abc import Sequence

import numpy as np
import pytest

from fieldkit.flightlogs import Trigger, read_flight_log
from fieldkit.flightlogs.adherence import PlannedPose, adherence
from tests.flightlogs.recordings import description, recording


def names(triggers: Sequence[Trigger]) -> list[str]:
    return [str(k) for k in range(len(triggers))]


def planned(name: str) -> list[PlannedPose]:
    return [
        PlannedPose(f"station {s['i']}", s["lat"] * 1e-7, s["lon"] * 1e-7, s["h"], s["yaw"], s["pitch"])
        for s in description(name)["stations"]
    ]


@pytest.mark.parametrize("name", ["mount_then_yaw", "naive", "hold0"])
def test_errors_are_those_of_the_recording(name: str) -> None:
    """The JSON's err_est are its triggers' estimates less their stations; north is 2 % off there (a round factor)."""
    triggers = read_flight_log(recording(f"{name}.tlog")).triggers
    found = adherence(planned(name), triggers, names(triggers))
    told = {t["img"]: t for t in description(name)["triggers"]}
    assert not found.missing
    assert not found.extra
    for error in found.stations:
        t = told[triggers[int(error.image)].image]
        assert error.station == f"station {t['station']}"
        assert error.east_m == pytest.approx(t["err_est"]["e"], abs=0.012)
        assert error.north_m == pytest.approx(t["err_est"]["n"], abs=0.012)
        assert error.up_m == pytest.approx(t["err_est"]["u"], abs=0.011)
        assert error.yaw_deg == pytest.approx(t["err_est"]["yaw"], abs=0.02)
        station = description(name)["stations"][t["station"]]
        assert error.pitch_deg == pytest.approx(t["gimbal"]["pitch"] - station["pitch"], abs=0.01)


def test_missing_and_extra_whatever_the_order() -> None:
    triggers = read_flight_log(recording("mount_then_yaw.tlog")).triggers
    plan = planned("mount_then_yaw")
    rng = np.random.default_rng(1)
    order = rng.permutation(13)
    shuffled = [triggers[k] for k in order]
    kept = [t for t in shuffled if t.image != 10]
    found = adherence([p for p in plan if p.name != "station 5"], kept, names(kept))
    assert found.missing == ("station 9",)
    assert [kept[int(k)].image for k in found.extra] == [6]
    assert [e.station for e in found.stations] == [f"station {k}" for k in range(13) if k not in (5, 9)]
    for error in found.stations:
        assert kept[int(error.image)].image == int(error.station.split()[1]) + 1
        assert np.hypot(error.east_m, error.north_m) < 0.1
        assert error.speed_mps < 0.05


def test_nothing_is_assigned_far_away() -> None:
    triggers = read_flight_log(recording("mount_then_yaw.tlog")).triggers
    far = [PlannedPose("far", 50.9, 6.5, 2.0, 0.0, -30.0)]
    found = adherence(far, triggers, names(triggers))
    assert found.stations == ()
    assert found.missing == ("far",)
    assert len(found.extra) == 13
    assert adherence([], triggers, names(triggers)).missing == ()
    assert adherence(far, [], []).missing == ("far",)
