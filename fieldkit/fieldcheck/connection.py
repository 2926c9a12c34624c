"""Whether the photographs hang together by matches, counting on what is flown again."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fieldkit.fieldcheck.model import finding_of
from fieldkit.fieldcheck.ties import TieGraph, tie_errors_deg
from fieldkit.geometry import Pose
from fieldkit.reconstruction.guided import region_of_interest
from fieldkit.reconstruction.mapping.view_graph import connected_parts
from fieldkit.results.finding import Finding
from fieldkit.results.plan import Plan, station_number

_TURN_DEG, _DIRECTION_DEG = 15.0, 35.0
_BRIDGE_DEG = 36.0
_NEAR_DEG = 36.0
"""So near about the plants, guided matching finds 100 matches and more on the recorded rigs."""
_GAP_SHARE = 0.8
_THIN = 30


@dataclass(frozen=True)
class Connection:
    """How stations hang together."""

    matches: Mapping[int, int]
    """Of each station's ties."""
    neighbours: Mapping[int, frozenset[int]]
    """Stations that tie it."""
    components: tuple[int, ...]
    """Sizes of the groups, largest first."""
    lonely: frozenset[int]
    """Stations without a tie whose neighbours are so near that there must be some."""
    thin: frozenset[int]
    """Stations with few matches, and nothing flown again that would add any."""
    beside_gaps: frozenset[int]
    """Stations without a tie beside one that is flown again, which may tie them."""
    findings: tuple[Finding, ...]
    """Of the whole capture."""


def connect(
    plan: Plan, graph: TieGraph, station_of: Mapping[int, int], again: set[int], poses: Mapping[int, Pose]
) -> Connection:
    """Groups of stations that verified matches join.

    Args:
        plan: its stations say how near photographs are to each other.
        graph: of photographs.
        station_of: photographs to stations.
        again: stations that will be flown again; they are counted on to join their neighbours.
        poses: of photographs, where known: a tie that contradicts them joins nothing.
    """
    angles = _view_angles(plan)
    ties: dict[tuple[int, int], int] = {}
    held: set[int] = set()
    for (i, j), tie in graph.ties.items():
        if i not in station_of or j not in station_of:
            continue
        if i in poses and j in poses:
            turn, direction = tie_errors_deg(poses[i], poses[j], tie.rotation, tie.translation)
            if turn > _TURN_DEG or direction > _DIRECTION_DEG:
                continue
        a, b = sorted((station_of[i], station_of[j]))
        held |= {a, b}  # even a blurred neighbour shows that a photograph is what it should be
        if not {a, b} & again:
            ties[a, b] = tie.matches
    good = sorted(set(station_of.values()) - again)
    matches = {s: sum(n for pair, n in ties.items() if s in pair) for s in good}
    neighbours = {s: frozenset(other for pair in ties if s in pair for other in pair if other != s) for s in good}
    bridges = {(a, b) for a in again for b in range(len(plan.stations)) if a != b and angles[a, b] <= _BRIDGE_DEG}
    groups = connected_parts(sorted({*good, *again}), {*ties, *bridges})
    parts = sorted((sorted(set(group) - again) for group in groups), key=lambda part: (-len(part), part))
    parts = [part for part in parts if part]
    lonely = {s for s in good if s not in held and _should_be_held(angles[s], s, good, again)}
    bridged = {s for pair in bridges for s in pair}
    thin = {s for s in good if s not in lonely and matches[s] < _THIN and s not in bridged}
    gaps = {s for s in good if s not in held and s not in lonely and s in bridged}
    return Connection(
        matches, neighbours, tuple(len(part) for part in parts), frozenset(lonely), frozenset(thin), frozenset(gaps),
        _apart([part for part in parts if not set(part) <= lonely]),
    )  # fmt: skip


def _should_be_held(angles: NDArray[np.float64], station: int, good: Sequence[int], again: Collection[int]) -> bool:
    """Whether a sound neighbour is so near that it must show the same, and nearer than any that is still to be flown:
    beside a gap a photograph may be good and have no matches yet.
    """
    nearest = min((angles[o] for o in good if o != station), default=np.inf)
    return bool(nearest <= min([_NEAR_DEG, *(_GAP_SHARE * angles[o] for o in again if o != station)]))


def _apart(parts: list[list[int]]) -> tuple[Finding, ...]:
    if len(parts) < 2:
        return ()
    told = "; ".join(", ".join(str(station_number(s)) for s in part) for part in parts)
    return (
        finding_of(
            "disconnected", None, "",
            f"blind matching leaves {len(parts)} groups of stations that do not hang together: {told}",
            "Mapping by the tags may still join them. For later flights plan stations nearer to each other.",
        ),
    )  # fmt: skip


def _view_angles(plan: Plan) -> NDArray[np.float64]:
    """(n, n) angles between stations as seen from what they look at, degrees; 180 where they look at nothing common."""
    poses = [station.pose for station in plan.stations]
    region = region_of_interest(poses)
    if region is None:
        return np.full((len(poses), len(poses)), 180.0)
    rays = np.array([pose.center for pose in poses]) - np.array(region.center)
    rays /= np.maximum(np.linalg.norm(rays, axis=1, keepdims=True), 1e-9)
    angles: NDArray[np.float64] = np.degrees(np.arccos(np.clip(rays @ rays.T, -1.0, 1.0)))
    return angles
