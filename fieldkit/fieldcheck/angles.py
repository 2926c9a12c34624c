"""Angles of a check's photographs, read as their matches say, or as the plan does where no matches tell."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fieldkit.captures import Capture
from fieldkit.evaluation.recorded_angles import LEAST_PHOTOGRAPHS, Reading, read_angles, without_angles
from fieldkit.fieldcheck.model import CheckFinding
from fieldkit.fieldcheck.placement import place_tags
from fieldkit.fieldcheck.ties import TieGraph
from fieldkit.geometry.stations import turn_between
from fieldkit.reconstruction.orientation import orient_cameras
from fieldkit.reconstruction.verification import TwoView
from fieldkit.results.plan import Plan
from fieldkit.sites.site import Site, SitePlot

_BOUND_DEG = 30.0
"""Conventions are 90° apart and more; an orientation by positions and pairs of consumer GPS is good to some 10°."""
_MOST_SIGMA_M = 0.3
"""Of a position against its neighbours': receivers' errors are metres, but of all photographs alike."""
_NOTHING = "Nothing to do: mapping tells it by the matches, too."


def angles_as_meant(
    capture: Capture, plan: Plan, site: Site | None, plot: SitePlot | None, graph: TieGraph, *, seed: int
) -> tuple[Capture, list[CheckFinding]]:
    """A capture with its recorded angles read as they are meant, and what a person should know of that.

    Where most angles are the plan's, as fieldkit reads them, the matches alone do not say otherwise of these: few and
    wide views give wrong matches, too.

    Args:
        capture: as read.
        plan, site, plot: as `place_tags` takes them.
        graph: of its photographs.
    """
    if all(prior.yaw_deg is None for prior in capture.priors.values()):
        return capture, []
    reading, by = _by_matches(capture, graph, seed), "the matches"
    if reading.compared < LEAST_PHOTOGRAPHS or reading.convention or reading.unused:
        planned = _by_plan(capture, plan, site, plot)
        if reading.compared < LEAST_PHOTOGRAPHS:
            reading, by = planned, "the plan"
        elif planned.as_recorded:
            unused = tuple(name for name in reading.unused if name not in planned.agreeing)
            reading = _by_matches(capture, graph, seed, sound=True)
            if len(unused) >= LEAST_PHOTOGRAPHS:
                reading = replace(reading, capture=without_angles(reading.capture, unused), unused=unused)
    count = f"{reading.compared} photographs"
    if reading.convention:
        message = f"the recorded angles are not as fieldkit reads them: {reading.convention}, say {by} of {count}"
        return reading.capture, [CheckFinding("angles-read-otherwise", None, "", message, _NOTHING)]
    if reading.unused:
        shown = ", ".join(reading.unused[:5]) + (f" and {len(reading.unused) - 5} more" if reading.unused[5:] else "")
        message = f"the recorded angles of {shown} contradict {by} and are not used; no convention fits them all"
        return reading.capture, [CheckFinding("angles-not-used", None, "", message, _NOTHING)]
    return reading.capture, []


def _by_matches(capture: Capture, graph: TieGraph, seed: int, *, sound: bool = False) -> Reading:
    priors = [capture.priors.get(name) for name in capture.names]
    positions = [None if p is None else p.position for p in priors]
    sigmas = [_MOST_SIGMA_M if p is None else min(p.position_sigma_m, _MOST_SIGMA_M) for p in priors]
    none = np.zeros((3, 3))
    pairs = {
        pair: TwoView(np.zeros((tie.matches, 2), np.uint32), 0, none, none, none, tie.rotation, tie.translation)
        for pair, tie in graph.ties.items()
    }
    found = orient_cameras(positions, sigmas, pairs, seed=seed)
    return read_angles(capture, {capture.names[k]: r for k, r in found.items()}, np.eye(3), _BOUND_DEG, sound=sound)


def _by_plan(capture: Capture, plan: Plan, site: Site | None, plot: SitePlot | None) -> Reading:
    """By the stations that positions alone assign; they tell another convention of all, or that there is none."""
    placed = place_tags(without_angles(capture), plan, site, plot)
    if placed.ambiguous or len(placed.station_of) < LEAST_PHOTOGRAPHS:
        return Reading(capture)
    names = [capture.names[k] for k in placed.station_of]
    before = np.array([capture.priors[name].position for name in names], dtype=np.float64)
    c, s = (f(np.radians(turn_between(before, placed.tags.poses.positions[list(placed.station_of)])))
            for f in (np.cos, np.sin))  # fmt: skip
    turn = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    found = {capture.names[k]: plan.stations[s].pose.rotation for k, s in placed.station_of.items()}
    reading = read_angles(capture, found, turn, _BOUND_DEG)
    return replace(reading, capture=reading.capture if reading.convention else capture, unused=())
