"""Photographs on the way, against what an ArduPilot's rule takes along flights that it really flew."""

import math
from itertools import pairwise

import numpy as np
import pytest

from fieldkit.missions.autopilots.execution import Execution, Photograph
from fieldkit.missions.autopilots.interpret import interpret
from fieldkit.missions.autopilots.writing import action
from fieldkit.missions.files.read_mission import ReadMission
from fieldkit.missions.items import Command, MissionItem
from fieldkit.sites.placement import SiteFrame
from tests.missions.vehicles import HOME, SITL, recorded_items, recording, vehicle

FRAME = SiteFrame(HOME)


def flown_track(name: str) -> tuple[np.ndarray, np.ndarray]:
    """Times in seconds and places east and north of home of a recorded flight, 20 a second."""
    from fieldkit.flightlogs.mavlink import mavlink

    parser, rows = mavlink.MAVLink(None), []
    parser.robust_parsing = True
    data = (SITL / f"{name}.tlog").read_bytes()
    for message in parser.parse_buffer(data) or []:
        if message.get_type() == "GLOBAL_POSITION_INT":
            rows.append((1e-3 * message.time_boot_ms, 1e-7 * message.lat, 1e-7 * message.lon))
    table = np.array(sorted(set(rows)))
    return table[:, 0], FRAME.to_local(table[:, 1], table[:, 2], 0.0 * table[:, 0])[:, :2]


def by_the_rule(
    times: np.ndarray, places: np.ndarray, begun_s: float, end_s: float, every_m: float, *, at_once: bool, phase_s: float
) -> np.ndarray:
    """(n, 3) time and place of photographs: AP_Camera_Backend::update as it stands, 50 times a second."""
    taken, last = [], None
    for time in np.arange(begun_s + phase_s, end_s, 0.02):
        here = np.array([np.interp(time, times, axis) for axis in places.T])
        first = at_once and not taken
        if first or (last is not None and float(np.hypot(*(here - last))) >= every_m):
            taken.append((time, *here))
            last = here
        last = here if last is None else last
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
    """The legs that are long enough: from home to the first station, and between stations."""
    items, texts = recorded_items(name)[1:], recording(name)["statustext"]
    times, places = flown_track(name)
    began = {int(text.split()[1]): t for t, text in texts if text.startswith("Mission: ") and text.endswith("WP")}
    reached = {int(text.split("#")[1]): t for t, text in texts if text.startswith("Reached")}
    compared = 0
    for number in [k for k, item in enumerate(items, 1) if item.command == 16][:6]:
        execution = predicted(with_trigger(items, number - 1, every_m, at_once=at_once))
        leg = next(leg for leg in execution.legs if leg.item == number + 1)
        own = on_the_way(execution)
        start = min(shot.time_s for shot in own) if at_once else None
        rule = by_the_rule(
            times, places, began[number], reached[number], every_m, at_once=at_once, phase_s=0.01
        )
        print(name, number, len(own), len(rule))
        for shot, (t, e, n) in zip(own, rule):
            p = FRAME.points([shot.place])[0]
            print("   ", round(t - began[number], 2), round(shot.time_s, 2), np.round(p[:2] - (e, n), 3))
