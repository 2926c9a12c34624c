"""Findings about photographs: taken late, moving, not settled, never; and how far they are from the plan."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import groupby

import numpy as np

from fieldkit.geometry.geodesy import LocalFrame
from fieldkit.geometry.stations import PoseArray, associate
from fieldkit.missions.autopilots.execution import Execution, Photograph, distance
from fieldkit.missions.coverage import Coverage
from fieldkit.missions.findings import Deviation, error, warning
from fieldkit.results.finding import Finding
from fieldkit.routing.mission import GeoPoint, Home, Shot
from fieldkit.routing.motion import turn_deg
from fieldkit.sites.reach import Unreachable
from fieldkit.vehicles.vehicle import Vehicle
from fieldkit.wording import count, listed

LEAST_SETTLE_S = 0.5
"""Below it a photograph counts as not settled at all; less than the profile's time is a warning."""
_SLACK_S = 0.05
"""Time by which a limit may be missed, seconds: files round it."""

OFF_M = 0.25
"""Distance from the plan from which a photograph is an error, metres."""
OFF_DEG = 5.0
"""Angle from the plan from which a photograph is an error, degrees."""
_NEAR_M = 0.05
"""Distance from the plan from which a photograph is a warning, metres."""
_NEAR_DEG = 1.0
"""Angle from the plan from which a photograph is a warning, degrees."""
_MOST_BLUR_PX = 1.0
"""Blur by motion beyond which edges of leaves are lost, pixels."""
_FEW_HURRIED = 0.05
"""Share of photographs in flight that may come too soon for the camera: where lines begin."""


def photograph_findings(
    flown: Execution, vehicle: Vehicle, places: Mapping[int, GeoPoint], grounds: Mapping[int, float]
) -> Iterator[Finding]:
    """Of each photograph.

    Args:
        places: where each item leads to, by its number.
        grounds: heights above home of the ground below photographs, by their place in the file; home's own where one
            is missing.
    """
    if not flown.photographs and not flown.refused:
        yield error("no-photographs", "the mission takes no photograph")
    told: set[tuple[int, str]] = set()
    for shot in flown.photographs:
        if shot.never:
            yield error("photo-never", f"never taken: {shot.never}", shot.item, shot.station)
            continue
        poses = _pose(shot, vehicle, grounds.get(shot.station))
        if shot.repeat is None:
            yield from _when(shot, vehicle, places)
            yield from poses
            continue
        for finding in poses:  # one command's photographs share what is amiss
            if (shot.repeat, finding.code) not in told:
                told.add((shot.repeat, finding.code))
                yield finding
    for number in flown.endless:
        message = "nothing ends its photographs on the way: they go on until the vehicle has landed"
        yield warning("photo-interval", message, number)
    for number, why in flown.skipped:
        if not any(shot.item == number for shot in flown.photographs) and "refuses" not in why:
            yield error("item-skipped", f"is never carried out: {why}", number)


def _when(shot: Photograph, vehicle: Vehicle, places: Mapping[int, GeoPoint]) -> Iterator[Finding]:
    settle, exposure = vehicle.trigger.settle_s, vehicle.trigger.exposure_s
    where = (shot.item, shot.station)
    if shot.late_s > 0.0:
        away = ""
        meant = None if shot.waypoint is None else places.get(shot.waypoint)
        if meant is not None and shot.place is not None:
            horizontal, up = distance(meant, shot.place)
            away = f", about {math.hypot(horizontal, up):.1f} m away from it"
        state = "moving" if shot.moving else "at the next place"
        yield error(
            "photo-late", f"taken {shot.late_s:.1f} s after item {shot.waypoint} is left{away}, {state}", *where
        )
        return
    if shot.turning_s > 0.0:
        yield error(
            "photo-late",
            f"the turn to its heading is late: it is over {shot.turning_s:.1f} s after the photograph",
            *where,
        )
        return
    if shot.moving:
        yield error(
            "photo-moving",
            "taken in passing: without a hold of 1 s or more the vehicle does not stop, and heading and gimbal may be "
            "tens of degrees off",
            *where,
        )
        return
    if shot.settled_s is None:
        message = "the action that takes it waits until the camera is turned: how long, is not documented"
        yield warning("not-modelled", message, *where)
    elif shot.settled_s < min(LEAST_SETTLE_S, settle) - 1e-9:
        message = f"the vehicle has stood still with the camera turned for {shot.settled_s:.1f} s only"
        yield error("no-settle", message, *where)
    elif shot.settled_s < settle - _SLACK_S:
        message = f"settles for {shot.settled_s:.1f} s; the vehicle's profile asks for {settle:g} s"
        yield warning("short-settle", message, *where)
    if shot.after_s <= 0.0:
        message = "taken at the instant the vehicle leaves: no delay follows the shutter"
        yield error("no-delay", message, *where)
    elif shot.after_s < exposure - _SLACK_S:
        message = f"stands still for {shot.after_s:.1f} s after it; the vehicle's profile asks for {exposure:g} s"
        yield warning("short-delay", message, *where)


def _pose(shot: Photograph, vehicle: Vehicle, ground_m: float | None) -> Iterator[Finding]:
    where = (shot.item, shot.station)
    if shot.heading_why:
        yield warning("heading-unknown", f"its heading cannot be told for sure: {shot.heading_why}", *where)
    elif shot.heading_deg is None and not shot.turning_s:
        yield error("no-heading", "nothing turns the camera to a heading: it is the autopilot's own", *where)
    if shot.pitch_why:
        yield warning("pitch-unknown", f"its pitch cannot be told for sure: {shot.pitch_why}", *where)
    if shot.pitch_deg is None:
        if not shot.pitch_why:
            yield error("no-pitch", "nothing turns the gimbal to a pitch before it", *where)
    # ArduPilot's gimbal manager cuts to whole degrees, towards the horizon: within the mount all the same.
    elif not vehicle.mount.reaches(shot.pitch_deg):
        message = f"pitch {shot.pitch_deg:.1f}° is beyond the mount ({vehicle.mount.range_text})"
        yield error("pitch-limit", message, *where)
    if shot.place is None:
        yield error("no-place", "where it is taken cannot be said", *where)
    elif shot.place.height_m - (ground_m or 0.0) < vehicle.min_height_m - 1e-3:
        above = "home" if ground_m is None else "its plot's ground"
        height = shot.place.height_m - (ground_m or 0.0)
        message = f"{height:.2f} m above {above} is below the vehicle's {vehicle.min_height_m:g} m"
        yield error("too-low", message, *where)


def coverage_findings(cover: Coverage, vehicle: Vehicle) -> Iterator[Finding]:
    """What speaks against photographs in flight, and plots that are not shown."""
    if cover.hurried:
        some = count(cover.hurried, "photograph comes", "photographs come") + f" {cover.interval_s:.2f} s or more"
        needs = f"the camera takes {vehicle.trigger.interval_s:g} s: fly slower"
        severe = cover.hurried > _FEW_HURRIED * len(cover.lines)
        yield (error if severe else warning)("camera-interval", f"{some} behind another, and {needs}")
    if cover.blur_px is not None and cover.blur_px > _MOST_BLUR_PX:
        shutter = f"1/{1.0 / vehicle.trigger.shutter_s:.0f} s"
        message = f"photographs are blurred by {cover.blur_px:.1f} pixels at {shutter}: fly slower"
        yield warning("motion-blur", message)
    if cover.unseen and cover.blur_px is not None:
        plots = count(len(cover.unseen), "plot is", "plots are", of=len(cover.photographs))
        yield warning(
            "plots-unseen", f"{plots} shown by no photograph: {listed(list(cover.unseen))}; by another flight?"
        )


def bursts(photographs: Sequence[Photograph]) -> list[list[Photograph]]:
    """Photographs that are taken, by station: those that follow each other with one pose, without a leg between."""
    taken = (shot for shot in photographs if not shot.never)
    return [list(of_one) for _, of_one in groupby(taken, lambda p: (p.legs, p.place, p.heading_deg, p.pitch_deg))]


def usual_burst(photographs: Sequence[Photograph]) -> int:
    """How many photographs most stations have; 1 without any."""
    return max(Counter(map(len, bursts(photographs))).items(), key=lambda each: (each[1], each[0]), default=(1, 0))[0]


def burst_findings(photographs: Sequence[Photograph], matched: Sequence[Deviation], burst: int) -> Iterator[Finding]:
    """Stations with fewer photographs than ``burst``."""
    if burst == 1:
        return
    stations = {found.photograph: found.planned for found in matched}
    for of_one in bursts(photographs):
        first, planned = of_one[0], stations.get(of_one[0].station)
        if len(of_one) < burst:
            what = f"the station of item {first.item}" if planned is None else planned.name
            message = f"{what} has {len(of_one)} of {burst} photographs"
            yield warning("short-burst", message, first.item, first.station, planned)


def deviations(
    photographs: Sequence[Photograph], planned: Sequence[Shot], home: Home, burst: int = 1
) -> tuple[Deviation, ...]:
    """Photographs matched to the plan's stations, each at most one or a burst, within 3 m, whatever way they look.

    A mission's poses are commanded, so nothing that they have in common is taken out.
    """
    found = bursts(photographs) if burst > 1 else [[shot] for shot in photographs if not shot.never]
    found = [of_one for of_one in found if (at := of_one[0].place) is not None and math.isfinite(at.height_m)]
    usable = [of_one[0] for of_one in found]
    if not usable or not planned:
        return ()
    frame = LocalFrame(home.latitude_deg, home.longitude_deg)
    there = _local(frame, [shot.place for shot in usable if shot.place is not None])
    taken = PoseArray.of([(at, shot.heading_deg, shot.pitch_deg) for at, shot in zip(there, usable, strict=True)])
    wanted = PoseArray.of(
        [(at, s.yaw_deg, s.pitch_deg) for at, s in zip(_local(frame, [s.place for s in planned]), planned, strict=True)]
    )
    pairs = dict(associate(taken, wanted, offset_m=np.zeros(3)).station_of)
    # One that looks elsewhere belongs to the station at its place all the same: that it does is what is to be said.
    left_a = [a for a in range(len(usable)) if a not in pairs]
    left_b = sorted(set(range(len(planned))) - set(pairs.values()))
    blind = replace(taken[left_a], yaws=np.full(len(left_a), np.nan), pitches=np.full(len(left_a), np.nan))
    turned_away = associate(blind, wanted[left_b], offset_m=np.zeros(3)).station_of
    pairs |= {left_a[a]: left_b[b] for a, b in turned_away.items()}
    apart = {a: float(np.linalg.norm(taken.positions[a] - wanted.positions[b])) for a, b in pairs.items()}
    matched = [_deviation(shot, planned[b], apart[a]) for a, b in pairs.items() for shot in found[a]]
    return tuple(sorted(matched, key=lambda found: found.photograph))


def _local(frame: LocalFrame, places: Sequence[GeoPoint]) -> np.ndarray:
    return frame.to_local(
        [p.latitude_deg for p in places], [p.longitude_deg for p in places], [p.height_m for p in places]
    )


def _deviation(shot: Photograph, planned: Shot, metres: float) -> Deviation:
    heading = None if shot.heading_deg is None else turn_deg(planned.yaw_deg, shot.heading_deg)
    pitch = None if shot.pitch_deg is None else shot.pitch_deg - planned.pitch_deg
    return Deviation(shot.item, shot.station, planned, metres, heading, pitch)


def adjusted_findings(matched: Sequence[Deviation], moved: Sequence[Unreachable]) -> Iterator[Finding]:
    """What is flown otherwise than planned, since the vehicle cannot take the plan's pose: as --adjust exports it."""
    of = {problem.shot.name: problem for problem in moved}
    for found in matched:
        if found.planned.name in of:
            yield warning(
                "adjusted", f"not as planned, {of[found.planned.name]}", found.item, found.photograph, found.planned
            )


def plan_findings(
    matched: Sequence[Deviation], photographs: Sequence[Photograph], planned: Sequence[Shot]
) -> Iterator[Finding]:
    """What is off, missing or extra against a plan.

    A plot without any photograph is one warning: a file may hold one flight of several.
    """
    for found in matched:
        turn = max(abs(found.heading_deg or 0.0), abs(found.pitch_deg or 0.0))
        message = (
            f"{found.planned.name} is off by {found.metres:.2f} m"
            + ("" if found.heading_deg is None else f", heading by {found.heading_deg:+.1f}°")
            + ("" if found.pitch_deg is None else f", pitch by {found.pitch_deg:+.1f}°")
        )
        if found.metres > OFF_M or turn > OFF_DEG:
            yield error("off-plan", message, found.item, found.photograph, found.planned)
        elif found.metres > _NEAR_M or turn > _NEAR_DEG:
            yield warning("off-plan", message, found.item, found.photograph, found.planned)
    there = {found.photograph for found in matched}
    for shot in photographs:
        if not shot.never and shot.station not in there:
            yield warning("extra-photo", "no station of the plan is near", shot.item, shot.station)
    met = {found.planned.name for found in matched}
    plots = {shot.plot for shot in planned if shot.name in met}
    for station in planned:
        if station.plot in plots and station.name not in met:
            yield error("missing-photo", f"{station.name} is not photographed", planned=station)
    for plot in sorted({shot.plot for shot in planned} - plots):
        yield warning("missing-plot", f"nothing of {plot} is photographed: in another flight's file?")
