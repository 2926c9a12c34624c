"""Photographs on the way, against what an ArduPilot's rule takes along flights that it really flew."""

import math
from functools import cache
from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import ArrayLike

from fieldkit.flightlogs.mavlink import mavlink
from fieldkit.missions.autopilots.execution import Execution, Photograph
from fieldkit.missions.autopilots.interpret import interpret
from fieldkit.missions.autopilots.writing import action
from fieldkit.missions.files.read_mission import ReadMission
from fieldkit.missions.items import Command, MissionItem
from fieldkit.routing.motion import turn_deg
from fieldkit.sites.placement import SiteFrame
from tests.missions.vehicles import HOME, SITL, recorded_items, recording, vehicle

FRAME = SiteFrame(HOME)


@cache
def flown_track(name: str) -> tuple[np.ndarray, np.ndarray]:
    """Times in seconds and places east and north of home of a recorded flight, 20 a second."""
    parser = mavlink.MAVLink(None)
    parser.robust_parsing = True
    messages = parser.parse_buffer((SITL / f"{name}.tlog").read_bytes()) or []
    positions = [message for message in messages if message.get_type() == "GLOBAL_POSITION_INT"]
    table = np.array(sorted({(1e-3 * m.time_boot_ms, 1e-7 * m.lat, 1e-7 * m.lon) for m in positions}))
    return table[:, 0], FRAME.to_local(table[:, 1], table[:, 2], 0.0 * table[:, 0])[:, :2]


def by_the_rule(
    times: np.ndarray, places: np.ndarray, begun_s: float, end_s: float, every_m: float, *, at_once: bool
) -> np.ndarray:
    """(n, 3) time and place of photographs: AP_Camera_Backend::update as it stands, 50 times a second."""
    looks = np.arange(begun_s + 0.01, end_s, 0.02)
    rows = np.column_stack([looks, *(np.interp(looks, times, axis) for axis in places.T)]).tolist()
    last, taken = rows[0], rows[:1] if at_once else []
    for row in rows[1:]:
        if math.dist(row[1:], last[1:]) >= every_m:
            taken.append(row)
            last = row
    return np.array(taken).reshape(-1, 3)


def with_trigger(items: list[MissionItem], number: int, every_m: float, *, at_once: bool) -> list[MissionItem]:
    """A mission with a camera triggered by distance on its way to the waypoint of a number."""
    begin = action(Command.DO_SET_CAM_TRIGG_DIST, every_m, 0.0, float(at_once))
    before = next(k for k in range(number - 1, -1, -1) if items[k].command in (16, 22, 93))
    return [*items[: before + 1], begin, *items[before + 1 : number + 1], action(206, 0.0), *items[number + 1 :]]


def predicted(items: list[MissionItem], dialect: str = "ardupilot") -> Execution:
    return interpret(ReadMission("plan", tuple(items), home=HOME), vehicle(dialect), dialect)


def on_the_way(execution: Execution) -> list[Photograph]:
    return [shot for shot in execution.photographs if shot.repeat is not None]


@pytest.mark.parametrize("name", ["mount_then_yaw", "hold0", "naive"])
@pytest.mark.parametrize(("every_m", "at_once"), [(1.0, True), (0.73, False)])
def test_photographs_come_where_the_rule_takes_them_along_recorded_flights(
    name: str, every_m: float, at_once: bool
) -> None:
    """From home to the first station, 14 m, and between stations, where the copter stands still, or passes (hold0)."""
    items, texts = recorded_items(name)[1:], recording(name)["statustext"]
    times, places = flown_track(name)
    began = {int(text.split()[1]): t for t, text in texts if text.startswith("Mission: ") and text.endswith("WP")}
    reached = {int(text.split("#")[1]): t for t, text in texts if text.startswith("Reached")}
    waypoints = [k for k, item in enumerate(items, 1) if item.command == 16][:4]
    for number in waypoints:
        started = on_the_way(predicted(with_trigger(items, number - 1, every_m, at_once=True)))[0].time_s - 0.01
        own = on_the_way(predicted(with_trigger(items, number - 1, every_m, at_once=at_once)))
        rule = by_the_rule(times, places, began[number], reached[number], every_m, at_once=at_once)
        assert len(own) == len(rule) > 0
        late = np.array([shot.time_s for shot in own]) - started - (rule[:, 0] - began[number])
        off = np.linalg.norm(FRAME.points(shot.place for shot in own)[:, :2] - rule[:, 1:], axis=1)
        passes = number == waypoints[0]
        assert np.abs(late).max() < (0.13 if passes else 0.35)
        assert np.median(off) < 0.06 if passes else off.max() < 0.15
        assert off.max() < 0.15


def waypoints(at_m: ArrayLike, hold_s: float = 0.0, command: int = 16) -> list[MissionItem]:
    """Items that lead to places (n, 2) east and north of home, 8 m high."""
    places = FRAME.places(np.column_stack([at_m, np.full(len(at_m), 8.0)]))
    return [
        MissionItem(command, 3, (hold_s, 0.0, 0.0, math.nan, p.latitude_deg, p.longitude_deg, p.height_m))
        for p in places
    ]


@pytest.mark.parametrize(("dialect", "lag_s"), [("ardupilot", 0.01), ("px4", 0.025)])
def test_two_thousand_passes_to_and_fro_are_foretold_in_seconds(dialect: str, lag_s: float) -> None:
    rng = np.random.default_rng(66)
    starts, headings = rng.uniform(-300.0, 300.0, (2000, 2)), rng.uniform(0.0, 2.0 * np.pi, 2000)
    lengths, every = rng.uniform(8.0, 40.0, 2000), rng.uniform(0.8, 4.0, 2000)
    ends = starts + lengths[:, None] * np.column_stack([np.sin(headings), np.cos(headings)])
    items = waypoints([(0.0, 0.0)], command=Command.NAV_TAKEOFF)
    ways = zip(waypoints(starts, 2.0), every.tolist(), waypoints(ends, 2.0), strict=True)
    for begin, metres, end in ways:
        trigger = action(Command.DO_SET_CAM_TRIGG_DIST, metres, 0.0, 1.0)
        items += [begin, trigger, end, action(Command.DO_SET_CAM_TRIGG_DIST)]
    items += waypoints([(0.0, 0.0)])
    execution = predicted(items, dialect)
    shots = on_the_way(execution)
    runs = np.array([shot.repeat for shot in shots])
    places = FRAME.points(shot.place for shot in shots)
    apart = np.linalg.norm(places[:, :2] - starts[runs], axis=1)
    across = np.column_stack([np.cos(headings), -np.sin(headings)])[runs]
    assert np.abs(((places[:, :2] - starts[runs]) * across).sum(axis=1)).max() < 1e-3
    assert np.abs(places[:, 2] - 8.0).max() < 1e-3
    first = np.flatnonzero(np.diff(runs, prepend=-1))
    assert apart[first].max() < 0.01
    same = np.diff(runs) == 0
    # Each comes when it is due and up to a look later: at 2 m/s so much farther.
    more = np.diff(apart)[same] - every[runs[1:][same]]
    assert (more > -0.002).all()
    assert (more < 2.0 * lag_s + 0.002).all()
    counts = np.bincount(runs, minlength=2000)
    assert (np.abs(counts - 1.0 - lengths / (every + 2.0 * lag_s)) < 1.1).all()
    assert execution.endless == ()


def test_an_interval_counts_from_the_photograph_before_and_ends_where_it_is_told() -> None:
    begin = action(Command.IMAGE_START_CAPTURE, 0.0, 2.0, 4.0)
    items = [*waypoints([(0, 0)], command=22), *waypoints([(0, 5)], 2.0), begin, *waypoints([(0, 60)], 2.0)]
    own = on_the_way(predicted(items))
    assert [b.time_s - a.time_s for a, b in pairwise(own)] == pytest.approx([2.01] * 3)
    assert all(turn_deg(shot.heading_deg, 0.0) == pytest.approx(0.0, abs=0.1) for shot in own)
    endless = action(Command.IMAGE_START_CAPTURE, 0.0, 2.0, 0.0)
    stopped = predicted([*items[:2], endless, items[3], action(Command.IMAGE_STOP_CAPTURE), items[1]])
    assert len(on_the_way(stopped)) > 10
    assert stopped.endless == ()
    assert predicted([*items[:2], endless, items[3]]).endless == (3,)
    px4 = [action(214, 1500.0), items[0], action(2003, 1.0), items[1], items[3], action(2003, 0.0)]
    waited = on_the_way(predicted(px4, "px4"))
    assert [b.time_s - a.time_s for a, b in pairwise(waited)] == pytest.approx([1.5] * (len(waited) - 1))
    assert on_the_way(predicted([px4[0], *px4[3:]], "px4")) == []
