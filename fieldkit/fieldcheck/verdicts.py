"""What all measurements of a capture come to: a verdict for each station, and what else a person should know."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from fieldkit.arrays import FloatArray
from fieldkit.fieldcheck.consistency import Consistency, SeenPose
from fieldkit.fieldcheck.model import CheckReport, StationCheck, Verdict, finding_of
from fieldkit.fieldcheck.pictures import PictureVerdict
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
_TAGS = "Put the tags right (poses.csv beside the photographs comes before EXIF), or fly the station again."
_SCATTER_SIGMAS = 4.5
"""Scatters of positions beyond which a photograph is not at its station."""
_SEEN_SIGMAS = 3.0
"""Standard deviations of what matches show beyond which it is not."""
_IDENTIFIED_M = 0.35
"""Distance to a station within which a photograph without a good tag may be its, metres."""
_IDENTIFIED_DEG = 12.0
"""Angle within which it may, degrees."""
_GOOD_SCATTER_M = 0.12
"""Scatter of positions above which matches know better, metres."""
_TURN_DEG = 15.0
"""Turn of a tie off the poses from which it is none, degrees."""
_DIRECTION_DEG = 35.0
"""Angle of its direction off theirs from which it is none, degrees."""
_BRIDGE_DEG = 36.0
"""Angle about the plants within which a station that is flown again will tie others, degrees."""
_NEAR_DEG = 36.0
"""Angle about the plants within which a sound neighbour must show the same, degrees: guided matching finds 100 matches
and more on the recorded rigs."""
_GAP_SHARE = 0.8
"""Share of the angle to a station that is flown again within which it must."""
_THIN = 30
"""Matches of a station below which it is weakly tied."""


@dataclass(frozen=True)
class _Deviation:
    """Of a photograph from its station; None where nothing tells."""

    distance_m: float | None
    turn_deg: float | None
    source: str
    limit_m: float
    limit_deg: float

    @property
    def far(self) -> bool:
        return (self.distance_m is not None and self.distance_m > self.limit_m) or (
            self.turn_deg is not None and self.turn_deg > self.limit_deg
        )

    def words(self) -> str:
        """For people: 0.62 m and 14° from the plan."""
        said = [] if self.distance_m is None else [f"{self.distance_m:.2f} m"]
        said += [] if self.turn_deg is None else [f"{self.turn_deg:.0f}°"]
        return f"{' and '.join(said)} from the plan"


@dataclass(frozen=True, eq=False)
class Evidence:
    """All that was measured of a capture."""

    names: Sequence[str]
    """Of the photographs, by index."""
    plan: Plan
    placed: Placed
    """Photographs among the stations, by tags."""
    pictures: Mapping[str, PictureVerdict]
    """Sharpness and exposure by name."""
    graph: TieGraph
    consistency: Consistency
    """Of tags with ties."""
    settings: CheckSettings


def judge(report: CheckReport, evidence: Evidence) -> CheckReport:
    """A report with the verdicts on the stations, and findings of them behind its own."""
    shown = _shown_stations(evidence)
    photo_of = _photographs(evidence, shown)
    rows: list[StationCheck] = []
    findings: list[Finding] = []
    for station in range(len(evidence.plan.stations)):
        row, found = _judge_station(evidence, station, photo_of.get(station), shown)
        rows.append(row)
        findings += found
    again = {row.station for row in rows if row.verdict == "fly again"}
    joined = connect(evidence.plan, evidence.graph, {k: s for s, k in photo_of.items()}, again, _poses(evidence, shown))
    for station in sorted(joined.lonely):
        name = evidence.names[photo_of[station]]
        findings.append(
            finding_of(
                "no-matches",
                station,
                name,
                "it shows nothing that its neighbours show, though they are near enough",
                _FLY,
            )
        )
        rows[station] = replace(rows[station], verdict="fly again")
    rows = [
        replace(
            row,
            matches=joined.matches.get(row.station, 0),
            neighbours=tuple(sorted(joined.neighbours.get(row.station, ()))),
        )
        for row in rows
    ]
    findings += [
        finding_of(
            "few-matches",
            row.station,
            row.photograph,
            f"only {count(row.matches, 'match ties', 'matches tie')} it to its neighbours; it may fail to register",
            "None needed.",
        )
        for row in rows
        if row.verdict == "fine" and row.station in joined.thin
    ]
    findings += [
        finding_of(
            "few-matches",
            row.station,
            row.photograph,
            "nothing ties it while a station beside it is missing",
            "Check again once the stations beside it are flown.",
        )
        for row in rows
        if row.verdict == "fine" and row.station in joined.beside_gaps
    ]
    used = set(photo_of.values())
    extra = tuple(name for k, name in enumerate(evidence.names) if k not in used)
    findings.sort(key=lambda finding: (finding.station is not None, finding.station or 0))
    said = (*report.findings, *joined.findings, *findings)
    return replace(report, stations=tuple(rows), findings=said, extra=extra, components=joined.components)


def _shown_stations(evidence: Evidence) -> dict[int, int | None]:
    """For photographs whose tags are wrong or missing: the station that they show, or None."""
    found: dict[int, int | None] = {}
    consistency, taken = evidence.consistency, set[int]()
    asked = consistency.contradicted | consistency.untagged
    for k in sorted(asked, key=lambda k: -consistency.seen[k].matches):
        best, least = None, np.inf
        for s, station in enumerate(evidence.plan.stations):
            if s in taken:
                continue
            difference = consistency.seen[k].compare(station.pose, max(evidence.placed.scatter_m, 0.05), 2.0)
            near = difference.shift_m <= _IDENTIFIED_M or difference.shift_sigmas <= _SEEN_SIGMAS
            if near and difference.turn_deg <= _IDENTIFIED_DEG and difference.shift_sigmas < least:
                best, least = s, difference.shift_sigmas
        found[k] = best
        if best is not None:
            taken.add(best)
    return found


def _photographs(evidence: Evidence, shown: Mapping[int, int | None]) -> dict[int, int]:
    """Station to photograph: as the photographs show where tags are wrong, else by tags."""
    found = {station: k for k, station in shown.items() if station is not None}
    for k, station in evidence.placed.station_of.items():
        if shown.get(k) is None:
            found.setdefault(station, k)
    return found


def _poses(evidence: Evidence, shown: Mapping[int, int | None]) -> dict[int, Pose]:
    """The believed pose of each photograph, by index."""
    poses = {}
    for k in evidence.placed.station_of.keys() | shown.keys():
        seen = evidence.consistency.seen.get(k)
        if seen is not None and (k in shown or _knows_better(seen, evidence.placed.scatter_m)):
            poses[k] = seen.pose
        else:
            poses[k] = tag_pose(evidence.placed, k, evidence.plan)
    return poses


def tag_pose(placed: Placed, k: int, plan: Plan) -> Pose:
    """The pose that a photograph's tags say; without angles it is turned as its station is."""
    tags, station = placed.tags, plan.stations[placed.station_of[k]]
    if np.isfinite(tags.poses.yaws[k]):
        return tags.pose(k)
    return Pose.from_yaw_pitch(tags.poses.positions[k], station.yaw_deg, station.pitch_deg)


def believed_poses(
    placed: Placed, plan: Plan, consistency: Consistency, pictures: Mapping[str, PictureVerdict], names: Sequence[str]
) -> dict[int, Pose]:
    """Poses of sound photographs whose tags nothing contradicts, by index."""
    return {
        k: tag_pose(placed, k, plan)
        for k in placed.station_of
        if k not in consistency.contradicted and not pictures[names[k]].problem
    }


def _judge_station(
    evidence: Evidence, station: int, k: int | None, shown: Mapping[int, int | None]
) -> tuple[StationCheck, list[Finding]]:
    if k is None:
        missing = finding_of("missing", station, "", "it has no photograph", _FLY)
        return StationCheck(station, verdict="fly again"), [missing]
    name = evidence.names[k]
    picture, deviation = evidence.pictures[name], _deviation(evidence, station, k, shown)
    verdict: Verdict = "fine"
    findings = []
    if picture.problem:
        verdict = "fly again"
        findings.append(finding_of(picture.problem, station, name, picture.message, _FLY))
    else:  # where it is to be flown again anyway, its tags do not matter
        verdict, finding = _judge_place(evidence, station, k, shown, deviation)
        findings += [] if finding is None else [finding]
    row = StationCheck(
        station,
        name,
        verdict,
        edge_px=picture.edge_px,
        blur_ratio=picture.blur_ratio,
        stops=picture.stops,
        clipped=picture.clipped,
        distance_m=deviation.distance_m,
        turn_deg=deviation.turn_deg,
        source=deviation.source,
    )
    return row, findings


def _judge_place(
    evidence: Evidence, station: int, k: int, shown: Mapping[int, int | None], deviation: _Deviation
) -> tuple[Verdict, Finding | None]:
    """Where a good photograph was taken, and what its tags say of that."""
    name, consistency = evidence.names[k], evidence.consistency
    if k in shown and shown[k] is None:
        message = f"by its matches it was taken {deviation.words()}, which its tags do not say"
        return "fly again", finding_of("displaced", station, name, message, _FLY)
    if k in consistency.contradicted:
        return "fix tags", finding_of("mis-tagged", station, name, _contradiction(evidence, k), _TAGS)
    if k in consistency.untagged:
        message = "it has no position; by its matches it is of this station"
        return "fix tags", finding_of("no-position", station, name, message, _TAGS)
    if deviation.far:
        alone = "" if k in consistency.seen else "; no matches tell whether the tags or the flight are wrong"
        message = f"it was taken {deviation.words()}{alone}"
        return "fly again", finding_of("displaced", station, name, message, _FLY)
    return "fine", None


def _deviation(evidence: Evidence, station: int, k: int, shown: Mapping[int, int | None]) -> _Deviation:
    """By tags; by the photographs where tags are wrong, or scatter so much that the photographs know better."""
    placed, settings = evidence.placed, evidence.settings
    wanted = evidence.plan.stations[station]
    seen = evidence.consistency.seen.get(k)
    if seen is not None and (k in shown or _knows_better(seen, placed.scatter_m)):
        return _by_matches(seen, wanted.pose, settings)
    if placed.station_of.get(k) != station:
        return _Deviation(None, None, "", settings.position_m, settings.angle_deg)
    tags = placed.tags
    distance = float(np.linalg.norm(tags.poses.positions[k] - np.array(wanted.position_m)))
    turn = None
    if np.isfinite(tags.poses.yaws[k]):
        turn = axis_turn_deg(float(tags.poses.yaws[k]), float(tags.poses.pitches[k]), wanted.yaw_deg, wanted.pitch_deg)
    limit = max(settings.position_m, _SCATTER_SIGMAS * placed.scatter_m)
    return _Deviation(distance, turn, "tags", limit, settings.angle_deg)


def _knows_better(seen: SeenPose, scatter_m: float) -> bool:
    return scatter_m > _GOOD_SCATTER_M and seen.sigma_m < scatter_m


def _by_matches(seen: SeenPose, wanted: Pose, settings: CheckSettings) -> _Deviation:
    distance = float(np.linalg.norm(seen.pose.center - wanted.center))
    cosine = float(np.clip(seen.pose.forward @ wanted.forward, -1.0, 1.0))
    limit = settings.position_m + _SEEN_SIGMAS * seen.sigma_m
    return _Deviation(distance, float(np.degrees(np.arccos(cosine))), "photographs", limit, settings.angle_deg + 4.0)


def _contradiction(evidence: Evidence, k: int) -> str:
    """How a photograph's tags differ from what it shows."""
    if k not in evidence.placed.station_of:
        return "its tags put it far from every station, but it shows what this station shows"
    tags = tag_pose(evidence.placed, k, evidence.plan)
    difference = evidence.consistency.seen[k].compare(tags, 0.0, 0.0)
    told = evidence.placed.station_of[k]
    return (
        f"its tags (nearest station {station_number(told)}) are {difference.shift_m:.1f} m and "
        f"{difference.turn_deg:.0f}° off what it shows beside the others"
    )


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
