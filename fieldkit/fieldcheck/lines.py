"""Which photographs of a flight over a trial are missing, by plot, and which lines to fly again.

The photographs' tags are held against those that the mission is foreseen to give. What all tags have in common, a
receiver's offset, is taken out. Where on a line the first photograph is taken depends on chance; so one that is
foreseen counts as taken where there is one that looks the same way within most of a spacing along the line. Others are
extra.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from fieldkit.arrays import BoolArray, FloatArray
from fieldkit.captures import Capture, read_capture
from fieldkit.errors import CaptureError, MissionError
from fieldkit.evaluation.adherence import LoggedFlight
from fieldkit.evaluation.evaluate import find_plots
from fieldkit.fieldcheck.placement import read_tags
from fieldkit.geometry.pose import wrapped_deg
from fieldkit.geometry.stations import PoseArray
from fieldkit.results.mission import Home, load_mission
from fieldkit.sites.placement import SiteFrame
from fieldkit.wording import listed

_ALONG = 0.75
"""Share of a line's spacing within which a photograph stands for one that is foreseen: half, and what positions err."""
_ACROSS_M = 0.6
"""Least distance beside a line within which a photograph is its, metres: how well lines are flown, and gusts."""
_ACROSS = 0.4
"""The same as a share of the distance to the next line that looks the same way."""
_SAME_LOOK_DEG = 25.0
"""Angle within which photographs look the same way, degrees: compasses err, and gimbals lag in turns."""
_OFFSET_M = {"coarse": 6.0, "exact": 1.0}
"""Largest offset of all positions, metres: twice that of a receiver without corrections, and a base station's."""
_COARSE_M = 0.5
"""Accuracy of positions from which a receiver counts as one without corrections, metres."""
_STEP_M = 0.4
"""Step between offsets that are tried, metres."""
_PER_METRE = 0.02
"""What an offset costs a metre, against a photograph that lies a spacing away: none is taken out for nothing."""
_ROUNDS = 3
"""Rounds in which the offset is refined."""
_LACKING = 0.8
"""Share of a plot's photographs that are foreseen below which it lacks some."""
_NADIR_DEG = -80.0
"""Pitch from which headings say nothing of what a photograph shows, degrees: fields of view are taken as round."""


@dataclass(frozen=True, eq=False)
class Foreseen:
    """Photographs that a mission is to give."""

    poses: PoseArray
    """Metres east and north of home and above it; true headings."""
    lines: FloatArray
    """(n,) line of each, from 0; −1 of none."""
    showing: Mapping[str, list[int]]
    """By plot, those that show it."""
    home: Home


@dataclass(frozen=True)
class LineCheck:
    """A line of the mission."""

    line: int
    """From 0."""
    foreseen: int
    """Photographs."""
    missing: int
    """Of these."""


@dataclass(frozen=True)
class PlotCheck:
    """A plot that photographs are missing of."""

    plot: str
    foreseen: int
    """Photographs that show it."""
    there: int
    """Of these."""
    lines: tuple[int, ...]
    """From 0, on which those are missing."""


@dataclass(frozen=True)
class FlightCheck:
    """Whether the photographs of a flight over a trial are all there."""

    photographs: int
    """That have positions."""
    foreseen: int
    """Photographs."""
    extra: tuple[str, ...]
    """Photographs that stand for none that is foreseen."""
    shift_m: tuple[float, float]
    """East and north, that all positions have in common, which has been taken out."""
    lines: tuple[LineCheck, ...]
    """All of them."""
    plots: tuple[PlotCheck, ...]
    """Those that photographs are missing of."""

    @property
    def lacking(self) -> tuple[PlotCheck, ...]:
        """Plots with too few photographs."""
        return tuple(plot for plot in self.plots if plot.there < _LACKING * plot.foreseen)

    @property
    def fly_again(self) -> tuple[int, ...]:
        """Lines, from 0."""
        return tuple(sorted({line for plot in self.lacking for line in plot.lines}))

    @property
    def ok(self) -> bool:
        """Whether no plot lacks photographs."""
        return not self.lacking

    def summary(self) -> str:
        """What to do, in words: "Plots 118 and 119: fly line 7 again."."""
        if self.ok:
            return "Every plot has its photographs."
        groups: dict[tuple[int, ...], list[str]] = defaultdict(list)
        for plot in self.lacking:
            groups[plot.lines].append(plot.plot)
        said = []
        for lines, plots in groups.items():
            numbers = listed([str(line + 1) for line in lines], len(lines))
            said.append(
                f"{'Plots' if len(plots) > 1 else 'Plot'} {listed(plots, 12)}: fly "
                f"{'lines' if len(lines) > 1 else 'line'} {numbers} again."
            )
        return "\n".join(said)


def check_flight(captures: Path, mission: Path, *, log: Path | None = None) -> FlightCheck:
    """Say of which plots photographs are missing, by their tags.

    Args:
        captures: folder of the flight's photographs.
        mission: mission.json of the passes that were flown.
        log: flight log whose poses count instead of the photographs' own.
    """
    foreseen = of_record(mission)
    ((name, folder), *others), _ = find_plots(captures)
    if others:
        raise CaptureError(
            "holds several folders of photographs", path=captures, remedy="Give the one of the flight over the trial."
        )
    flight = None if log is None else LoggedFlight.read(log, [(name, folder)])
    return compared((None if flight is None else flight.capture(name)) or read_capture(folder), foreseen)


def of_record(mission: Path) -> Foreseen:
    """What mission.json foresees of passes."""
    record = load_mission(mission)
    passings = [passing for flight in record.flights for passing in flight.passings]
    if not passings:
        raise MissionError(
            "is no mission of passes over a field", path=mission, remedy="Give --plan for stations about plots."
        )
    yaws, pitches, lines = np.array([(shot.yaw_deg, shot.pitch_deg, shot.line) for shot in passings]).T
    poses = PoseArray(SiteFrame(record.home).points(passings), yaws, pitches)
    showing = {plot.name: [k for k, shot in enumerate(passings) if plot.name in shot.plots] for plot in record.plots}
    return Foreseen(poses, lines, showing, record.home)


def compared(capture: Capture, foreseen: Foreseen) -> FlightCheck:
    """A capture's tags against what is foreseen."""
    tags = read_tags(capture)
    if capture.origin is None or not tags.known.any():
        raise CaptureError(
            "the photographs have no positions on Earth", path=capture.folder, remedy="Give the flight's --log."
        )
    known = np.flatnonzero(tags.known)
    latitude, longitude, _ = capture.origin.to_geodetic(tags.poses.positions[known])
    level = SiteFrame(foreseen.home).to_local(latitude, longitude, np.zeros(len(known)))[:, :2]
    taken = PoseArray(np.column_stack([level, np.zeros(len(known))]), tags.poses.yaws[known], tags.poses.pitches[known])
    shift = _shift_m(taken, foreseen, _OFFSET_M["coarse" if tags.sigma_m > _COARSE_M else "exact"])
    taken = taken.moved(0.0, np.array([-shift[0], -shift[1], 0.0]))
    covered, used = covering(taken, foreseen)
    lines = []
    for line in np.unique(foreseen.lines).astype(int).tolist():
        own = foreseen.lines == line
        lines.append(LineCheck(line, int(own.sum()), int((own & ~covered).sum())))
    return FlightCheck(
        len(known),
        len(covered),
        tuple(tags.names[k] for k in known[~used]),
        (float(shift[0]), float(shift[1])),
        tuple(lines),
        _plots(foreseen, covered),
    )


def _plots(foreseen: Foreseen, covered: BoolArray) -> tuple[PlotCheck, ...]:
    found = []
    for plot, shots in foreseen.showing.items():
        missing = [k for k in shots if not covered[k]]
        if missing:
            lines = tuple(sorted({int(foreseen.lines[k]) for k in missing}))
            found.append(PlotCheck(plot, len(shots), len(shots) - len(missing), lines))
    return tuple(found)


def _shift_m(taken: PoseArray, foreseen: Foreseen, most_m: float) -> FloatArray:
    """(2,) the offset with which photographs lie where some are foreseen, the least of those alike.

    Beyond the field's edge nothing is foreseen; so an offset from line to line costs more than it gives. Within a
    spacing the middles of whole lines decide: to and fro, lines may begin late alike, each its own way.
    """
    places, lines = foreseen.poses.positions[:, :2], foreseen.lines
    tree, spacing = cKDTree(places), _spacing_m(foreseen)
    steps = np.arange(-most_m, most_m + _STEP_M / 2, _STEP_M)
    shifts = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
    some = taken.positions[:: max(1, len(taken.positions) // 400), :2]
    away, _ = tree.query((some[None] - shifts[:, None]).reshape(-1, 2), distance_upper_bound=2.0 * spacing)
    costs = np.minimum(away.reshape(len(shifts), -1) / spacing, 2.0).mean(axis=1)
    shift: FloatArray = shifts[int((costs + _PER_METRE * np.hypot(*shifts.T)).argmin())]
    for _ in range(_ROUNDS):
        away, at = tree.query(taken.positions[:, :2] - shift, distance_upper_bound=spacing)
        near = np.flatnonzero(np.isfinite(away))
        on, middles = lines[at[near]], []
        for line in np.unique(on).tolist():
            (low, high), (first, last) = (
                _ends(p) for p in (taken.positions[near[on == line], :2], places[lines == line])
            )
            if np.hypot(*(high - low - last + first)) <= spacing:  # whole
                middles.append((low + high - first - last) / 2.0)
        if middles:
            shift = np.mean(middles, axis=0)
    return shift


def _ends(places: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Lowest and highest (2,) of places (n, 2)."""
    return places.min(axis=0), places.max(axis=0)


def _spacing_m(foreseen: Foreseen) -> float:
    """Usual distance from one photograph of a line to the next."""
    steps = np.hypot(*np.diff(foreseen.poses.positions[:, :2], axis=0).T)[np.diff(foreseen.lines) == 0]
    return float(np.median(steps))


def covering(taken: PoseArray, foreseen: Foreseen) -> tuple[BoolArray, BoolArray]:
    """(n,) which foreseen photographs one is there for, and (m,) which photographs those are.

    Args:
        taken: m poses in the frame of those that are foreseen, offset taken out.
        foreseen: n of them.
    """
    poses, lines = foreseen.poses, foreseen.lines
    covered, used = np.zeros(len(lines), dtype=bool), np.zeros(len(taken.yaws), dtype=bool)
    gaps = _gaps_m(poses, lines)
    for line in np.unique(lines).tolist():
        own = np.flatnonzero(lines == line)
        places = poses.positions[own, :2]
        way = places[-1] - places[0]
        if not (length := float(np.hypot(*way))) > 0.0:
            continue
        way /= length
        along, foreseen_at = (taken.positions[:, :2] - places[0]) @ way, (places - places[0]) @ way
        across = np.abs((taken.positions[:, :2] - places[0]) @ (way[1], -way[0]))
        reach = _ALONG * length / (len(own) - 1)
        near = (across <= max(_ACROSS_M, _ACROSS * gaps[line])) & _looks(taken, poses, int(own[len(own) // 2]))
        near &= (along >= -reach) & (along <= length + reach)
        used |= near
        there = np.sort(along[near])
        if len(there):
            after = np.searchsorted(there, foreseen_at).clip(0, len(there) - 1)
            least = np.minimum(np.abs(there[after] - foreseen_at), np.abs(there[(after - 1).clip(0)] - foreseen_at))
            covered[own] = least <= reach
    return covered, used


def _looks(taken: PoseArray, poses: PoseArray, k: int) -> BoolArray:
    """(m,) which photographs look as a foreseen one does; those without angles do."""
    pitch = np.abs(np.nan_to_num(taken.pitches - poses.pitches[k])) <= _SAME_LOOK_DEG
    if not poses.pitches[k] > _NADIR_DEG:
        return np.asarray(pitch)
    return np.asarray(pitch & (np.abs(np.nan_to_num(wrapped_deg(taken.yaws - poses.yaws[k]))) <= _SAME_LOOK_DEG))


def _gaps_m(poses: PoseArray, lines: FloatArray) -> dict[float, float]:
    """Distance from the middle of each line to the nearest place of another one that looks alike; 0 without one."""
    found: dict[float, float] = {}
    for line in np.unique(lines).tolist():
        own = np.flatnonzero(lines == line)
        others = np.flatnonzero((lines != line) & _looks(poses, poses, int(own[0])))
        middle = poses.positions[own[len(own) // 2], :2]
        found[line] = float(np.hypot(*(poses.positions[others, :2] - middle).T).min()) if len(others) else 0.0
    return found
