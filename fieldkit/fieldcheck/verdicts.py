"""What all measurements of a capture come to: a verdict for each station, and what else a person should know."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from fieldkit.arrays import FloatArray
from fieldkit.captures.quality import PictureVerdict
from fieldkit.fieldcheck.model import CheckReport, StationCheck, finding_of
from fieldkit.fieldcheck.placement import Placed, axis_turn_deg
from fieldkit.fieldcheck.settings import CheckSettings
from fieldkit.fieldcheck.ties import TieGraph, tie_errors_deg
from fieldkit.geometry import Pose
from fieldkit.reconstruction.guided import region_of_interest
from fieldkit.reconstruction.mapping.view_graph import connected_parts
from fieldkit.results.finding import Finding
from fieldkit.results.plan import Plan, station_number
from fieldkit.wording import count

_FLY = "Fly this station again."
_SCATTER_SIGMAS = 4.5
"""Scatters of positions beyond which a photograph is not at its station."""
_TURN_DEG = 15.0
"""Turn of a tie off the poses from which it is none, degrees."""
_DIRECTION_DEG = 35.0
"""Angle of its direction off theirs from which it is none, beside what positions blur, degrees."""
_DIRECTION_SIGMAS = 3.7
"""Standard deviations of positions that blur a direction."""
_BRIDGE_DEG = 36.0
"""Angle about the plants within which a station that is flown again will tie others, degrees."""
_NEAR_DEG = 36.0
"""Angle about the plants within which a sound neighbour must show the same, degrees: guided matching finds 100 matches
and more on the recorded rigs."""
_GAP_SHARE = 0.8
"""Share of the angle to a station that is flown again within which it must."""
_THIN = 30
"""Matches of a station below which it is weakly tied."""


def judge(
    report: CheckReport,
    names: Sequence[str],
    plan: Plan,
    placed: Placed,
    pictures: Mapping[str, PictureVerdict],
    graph: TieGraph,
    settings: CheckSettings,
) -> CheckReport:
    """A report with the verdicts on the stations, and findings of them behind its own.

    Args:
        report: without stations.
        names: of the photographs, by index.
        plan: that was flown.
        placed: photographs among its stations, by tags.
        pictures: sharpness and exposure by name.
        graph: what the photographs show of each other.
        settings: tolerances.
    """
    photo_of = {station: k for k, station in placed.station_of.items()}
    rows: list[StationCheck] = []
    findings: list[Finding] = []
    for station in range(len(plan.stations)):
        k = photo_of.get(station)
        if k is None:
            row = StationCheck(station)
            odd: Finding | None = finding_of("missing", station, "", "it has no photograph", _FLY)
        else:
            row, odd = _judged(station, k, names[k], plan, placed, pictures[names[k]], settings)
        rows.append(row if odd is None else replace(row, verdict="fly again"))
        findings += [] if odd is None else [odd]
    again = {row.station for row in rows if row.verdict == "fly again"}
    joined = connect(plan, graph, placed, again)
    for station in sorted(joined.lonely):
        message = "no match with its neighbours, though they are near enough, fits where it is said to be taken"
        findings.append(finding_of("no-matches", station, names[photo_of[station]], message, _FLY))
        rows[station] = replace(rows[station], verdict="fly again")
    rows = [
        replace(
            row,
            matches=joined.matches.get(row.station, 0),
            neighbours=tuple(sorted(joined.neighbours.get(row.station, ()))),
        )
        for row in rows
    ]
    for row in rows:
        if row.station in joined.thin:
            message = (
                f"only {count(row.matches, 'match ties', 'matches tie')} it to its neighbours; it may fail to register"
            )
            remedy = "None needed."
        elif row.station in joined.beside_gaps:
            message = "nothing ties it while a station beside it is missing"
            remedy = "Check again once the stations beside it are flown."
        else:
            continue
        findings.append(finding_of("few-matches", row.station, row.photograph, message, remedy))
    extra = tuple(name for k, name in enumerate(names) if k not in placed.station_of)
    findings.sort(key=lambda finding: (finding.station is not None, finding.station or 0))
    said = (*report.findings, *joined.findings, *findings)
    return replace(report, stations=tuple(rows), findings=said, extra=extra, components=joined.components)


def tag_pose(placed: Placed, k: int, plan: Plan) -> Pose:
    """The pose that a photograph's tags say; without angles it is turned as its station is."""
    tags, station = placed.tags, plan.stations[placed.station_of[k]]
    if np.isfinite(tags.poses.yaws[k]):
        return tags.pose(k)
    return Pose.from_yaw_pitch(tags.poses.positions[k], station.yaw_deg, station.pitch_deg)


def _judged(
    station: int,
    k: int,
    name: str,
    plan: Plan,
    placed: Placed,
    picture: PictureVerdict,
    settings: CheckSettings,
) -> tuple[StationCheck, Finding | None]:
    """A station's photograph, and why it is to be flown again."""
    poses, wanted = placed.tags.poses, plan.stations[station]
    distance = float(np.linalg.norm(poses.positions[k] - np.array(wanted.position_m)))
    turn = None
    if np.isfinite(poses.yaws[k]):
        turn = axis_turn_deg(float(poses.yaws[k]), float(poses.pitches[k]), wanted.yaw_deg, wanted.pitch_deg)
    row = StationCheck(
        station,
        name,
        edge_px=picture.edge_px,
        blur_ratio=picture.blur_ratio,
        stops=picture.stops,
        clipped=picture.clipped,
        distance_m=distance,
        turn_deg=turn,
    )
    if picture.problem:
        return row, finding_of(picture.problem, station, name, picture.message, _FLY)
    far = distance > max(settings.position_m, _SCATTER_SIGMAS * placed.scatter_m)
    if not far and (turn is None or turn <= settings.angle_deg):
        return row, None
    turned = "" if turn is None else f" and {turn:.0f}°"
    return row, finding_of("displaced", station, name, f"it was taken {distance:.2f} m{turned} from the plan", _FLY)


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


def connect(plan: Plan, graph: TieGraph, placed: Placed, again: set[int]) -> Connection:
    """Groups of stations that verified matches join.

    A tie that contradicts what tags say joins nothing. Stations that will be flown ``again`` are counted on to join
    their neighbours.
    """
    angles, station_of = _view_angles(plan), placed.station_of
    poses = {k: tag_pose(placed, k, plan) for k in station_of}
    ties: dict[tuple[int, int], int] = {}
    held: set[int] = set()
    for (i, j), tie in graph.ties.items():
        if i not in poses or j not in poses:
            continue
        turn, direction = tie_errors_deg(poses[i], poses[j], tie.rotation, tie.translation)
        length = max(float(np.linalg.norm(poses[i].center - poses[j].center)), 1e-9)
        blur = np.degrees(np.arctan(_DIRECTION_SIGMAS * np.sqrt(2.0) * placed.scatter_m / length))
        if turn > _TURN_DEG or direction > _DIRECTION_DEG + blur:
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
        matches,
        neighbours,
        tuple(len(part) for part in parts),
        frozenset(lonely),
        frozenset(thin),
        frozenset(gaps),
        _apart([part for part in parts if not set(part) <= lonely]),
    )


def _should_be_held(angles: FloatArray, station: int, good: Sequence[int], again: Collection[int]) -> bool:
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
            "disconnected",
            None,
            "",
            f"blind matching leaves {len(parts)} groups of stations that do not hang together: {told}",
            "Mapping by the tags may still join them. For later flights plan stations nearer to each other.",
        ),
    )


def _view_angles(plan: Plan) -> FloatArray:
    """(n, n) angles between stations as seen from what they look at, degrees; 180 where they look at nothing common."""
    poses = [station.pose for station in plan.stations]
    region = region_of_interest(poses)
    if region is None:
        return np.full((len(poses), len(poses)), 180.0)
    rays = np.array([pose.center for pose in poses]) - np.array(region.center)
    rays /= np.maximum(np.linalg.norm(rays, axis=1, keepdims=True), 1e-9)
    angles: FloatArray = np.degrees(np.arccos(np.clip(rays @ rays.T, -1.0, 1.0)))
    return angles
