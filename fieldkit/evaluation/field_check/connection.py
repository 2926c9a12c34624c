"""Whether the photographs hang together by matches, counting on what is flown again."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from fieldkit.evaluation.field_check.model import CheckFinding
from fieldkit.evaluation.field_check.pose_graph import tie_errors_deg
from fieldkit.evaluation.field_check.ties import TieGraph
from fieldkit.geometry import Pose
from fieldkit.reconstruction.prior_mapping import region_of_interest
from fieldkit.results.plan import Plan, station_number

_TURN_DEG, _DIRECTION_DEG = 15.0, 35.0
_BRIDGE_DEG = 36.0
_NEAR_DEG = 36.0
"""So near about the plants, guided matching finds 100 matches and more on the recorded rigs."""
_THIN = 30


@dataclass(frozen=True)
class Connection:
    """How stations hang together.

    Attributes:
        matches: of each station's ties.
        neighbours: stations that tie it.
        components: sizes of the groups, largest first.
        lonely: stations without a tie whose neighbours are so near that there must be some.
        thin: stations with few matches, and nothing flown again that would add any.
        findings: of the whole capture.
    """

    matches: Mapping[int, int]
    neighbours: Mapping[int, frozenset[int]]
    components: tuple[int, ...]
    lonely: frozenset[int]
    thin: frozenset[int]
    findings: tuple[CheckFinding, ...]


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
    groups = _groups(sorted({*good, *again}), {*ties, *bridges})
    parts = sorted((sorted(group - again) for group in groups), key=lambda part: (-len(part), part))
    parts = [part for part in parts if part]
    lonely = {s for s in good if s not in held and any(angles[s, o] <= _NEAR_DEG for o in good if o != s)}
    bridged = {s for pair in bridges for s in pair}
    thin = {s for s in good if s not in lonely and matches[s] < _THIN and s not in bridged}
    return Connection(
        matches, neighbours, tuple(len(part) for part in parts), frozenset(lonely), frozenset(thin),
        _apart([part for part in parts if not set(part) <= lonely]),
    )  # fmt: skip


def _apart(parts: list[list[int]]) -> tuple[CheckFinding, ...]:
    if len(parts) < 2:
        return ()
    told = "; ".join(", ".join(str(station_number(s)) for s in part) for part in parts)
    return (
        CheckFinding(
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


def _groups(nodes: Sequence[int], pairs: Collection[tuple[int, int]]) -> list[set[int]]:
    """Nodes that pairs of them join."""
    place = {node: k for k, node in enumerate(nodes)}
    ends = np.array([(place[a], place[b]) for a, b in pairs if a in place and b in place], dtype=np.intp).reshape(-1, 2)
    links = coo_array((np.ones(len(ends)), (ends[:, 0], ends[:, 1])), shape=(len(place), len(place)))
    count, group_of = connected_components(links, directed=False)
    return [{node for node, k in place.items() if group_of[k] == group} for group in range(count)]
