"""Planned, commanded, reported, tagged and reconstructed poses of a plot's photographs, and their differences."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fieldkit.captures import Capture
from fieldkit.geometry import Pose
from fieldkit.geometry.angles import wrapped_deg
from fieldkit.geometry.priors import SourceFrame
from fieldkit.geometry.stations import PoseArray, associate
from fieldkit.reconstruction.known_poses import known_poses
from fieldkit.results.evaluation import (
    AchievedSource,
    AdherenceEntry,
    ImageReport,
    PhotographPosesEntry,
    PoseDifferenceEntry,
    PoseEntry,
    PoseSource,
    SpreadEntry,
    StationErrorEntry,
)
from fieldkit.results.fields import clean_text, finite, vector
from fieldkit.results.plan import Plan, station_number

POSE_SOURCES: tuple[PoseSource, ...] = ("planned", "commanded", "reported", "tagged", "reconstructed")
ACHIEVED: tuple[AchievedSource, ...] = ("reported", "reconstructed", "tagged")
"""Sources of where a photograph was really taken, the first that knows enough first: the autopilot's estimate, as plans
are flown by it; then structure from motion, good to millimetres within a plot; then tags, which may be the commanded
poses copied, or GPS without corrections."""
LEAST_STATIONS = 3
_STEEP_SINE = float(np.sin(np.radians(75.0)))

Poses = Mapping[str, PoseEntry]
"""By photograph, or by station."""


def pose_entry(position: ArrayLike, rotation: NDArray[np.float64] | None) -> PoseEntry:
    """A pose as evaluation.json holds it.

    Args:
        position: (3,) metres, plot frame.
        rotation: (3, 3) camera from plot frame; None where it is not known.
    """
    yaw, pitch = (None, None) if rotation is None else _yaw_pitch(rotation)
    return PoseEntry(position_m=vector(np.asarray(position, dtype=np.float64)), yaw_deg=yaw, pitch_deg=pitch)


def pose_array(poses: Iterable[PoseEntry]) -> PoseArray:
    """As arrays, in their order."""
    return PoseArray.of([(pose.position_m, pose.yaw_deg, pose.pitch_deg) for pose in poses])


def station_names(plan: Plan) -> list[str]:
    """Of a plan's stations, as all of fieldkit's results name them."""
    return [f"station {station_number(k)}" for k in range(len(plan.stations))]


def plan_poses(plan: Plan, to_plot: SourceFrame | None = None) -> dict[str, PoseEntry]:
    """A plan's stations in the plot frame, by their names.

    Args:
        plan: made on the reference whose plot frame this is.
        to_plot: where the plan's frame is that of a metric source instead, how it lies in the plot frame.
    """
    entries = {}
    for name, station in zip(station_names(plan), plan.stations, strict=True):
        pose = station.pose
        if to_plot is not None:
            motion = to_plot.from_source
            pose = Pose(pose.rotation @ motion.rotation.T, motion.apply(pose.center))
        entries[name] = pose_entry(pose.center, pose.rotation)
    return entries


def capture_poses(capture: Capture, frame: SourceFrame) -> dict[str, PoseEntry]:
    """Poses that lie beside the photographs or in them, in the plot frame; those without a position are left out.

    Names are as `ImageReport` has them (`clean_text`).

    Args:
        capture: as read, or as the flight log locates it.
        frame: the plot's.

    Raises:
        ReconstructionError: the capture's frame and the plot's are not related.
    """
    entries = {}
    turn = frame.from_source.rotation
    for name, known in known_poses(replace(capture, program=None), frame).poses.items():
        if known.position is None:
            continue
        prior = capture.priors[name]
        entry = pose_entry(known.position, None)
        if prior.yaw_deg is not None or prior.pitch_deg is not None:
            camera = Pose.from_yaw_pitch(np.zeros(3), prior.yaw_deg or 0.0, prior.pitch_deg or 0.0, prior.roll_deg)
            yaw, pitch = _yaw_pitch(camera.rotation @ turn.T)
            angles = {
                "yaw_deg": None if prior.yaw_deg is None else yaw,
                "pitch_deg": None if prior.pitch_deg is None else pitch,
            }
            entry = entry.model_copy(update=angles)
        entries[clean_text(name)] = entry
    return entries


def reconstructed_poses(images: Sequence[ImageReport]) -> dict[str, PoseEntry]:
    """Poses by structure from motion, of the photographs that count."""
    entries = {}
    for image in images:
        pose = image.pose
        if pose is not None and image.right is not False:
            entries[image.name] = pose_entry(pose.center, pose.rotation)
    return entries


def pose_adherence(
    photographs: Sequence[str],
    stations: Poses,
    found: Mapping[PoseSource, Poses],
    *,
    unknown: Mapping[PoseSource, str],
    axes: NDArray[np.float64],
    commanded: Poses | None = None,
    flown: AdherenceEntry | None = None,
) -> AdherenceEntry | None:
    """How a plot's photographs kept to their plan, by every source.

    Args:
        photographs: their names, in order.
        stations: the plan's, by name, in its order; plot frame.
        found: reported, tagged and reconstructed poses by photograph; what a source does not know is left out.
        unknown: why a source says nothing at all.
        axes: (3, 3) rows are east, north and up in the plot frame; those of `PoseDifferenceEntry` and the errors.
        commanded: by station.
        flown: by the flight log, with its assignment of photographs, its errors, speeds and turning.

    Returns:
        None where no photograph was taken near a station.
    """
    station_of = {} if flown is None else {error.image: error.station for error in flown.stations}
    shifts: dict[PoseSource, NDArray[np.float64]] = {}
    for source in ACHIEVED:
        _assign(station_of, stations, found.get(source, {}))
        shifts[source] = _shift(station_of, stations, found.get(source, {}), axes)
    if not station_of:
        return None
    table = _table(photographs, station_of, stations, commanded or {}, found)
    achieved = _achieved_by(table)
    if flown is not None and achieved == "reported":
        errors = flown.stations
    else:
        errors = _errors(table, achieved, list(stations), axes)
    taken = set(station_of.values())
    shift = shifts[achieved]
    return AdherenceEntry(
        stations=errors,
        missing=tuple(name for name in stations if name not in taken),
        extra=tuple(row.image for row in table if row.station is None and _somewhere(row)),
        horizontal_rms_m=_rms([float(np.hypot(e.east_m, e.north_m)) for e in errors]),
        yaw_rms_deg=_rms([e.yaw_deg for e in errors]),
        pitch_rms_deg=_rms([e.pitch_deg for e in errors]),
        achieved_by=achieved,
        shift_m=vector(shift) if np.isfinite(shift).all() else None,
        photographs=table,
        differences=differences(table, axes),
        unknown={s: clean_text(unknown[s]) for s in POSE_SOURCES if s in unknown},
    )


def _table(
    photographs: Sequence[str], station_of: Mapping[str, str], stations: Poses, commanded: Poses,
    found: Mapping[PoseSource, Poses],
) -> tuple[PhotographPosesEntry, ...]:  # fmt: skip
    rows = []
    for name in photographs:
        station = station_of.get(name)
        rows.append(
            PhotographPosesEntry(
                image=name,
                station=station,
                planned=None if station is None else stations[station],
                commanded=None if station is None else commanded.get(station),
                reported=found.get("reported", {}).get(name),
                tagged=found.get("tagged", {}).get(name),
                reconstructed=found.get("reconstructed", {}).get(name),
            )
        )
    return tuple(rows)


def _achieved_by(table: Sequence[PhotographPosesEntry]) -> AchievedSource:
    """The first source that knows enough photographs of stations, else the one that knows most."""
    known = {s: sum(getattr(row, s) is not None and row.station is not None for row in table) for s in ACHIEVED}
    return next((s for s in ACHIEVED if known[s] >= LEAST_STATIONS), max(ACHIEVED, key=lambda s: known[s]))


def differences(table: Sequence[PhotographPosesEntry], axes: NDArray[np.float64]) -> tuple[PoseDifferenceEntry, ...]:
    """Statistics of every two sources' differences, the later one's poses less the earlier one's.

    Args:
        table: of a plot's photographs.
        axes: (3, 3) rows are the directions in which positions are compared.
    """
    entries = []
    for less, of in combinations(POSE_SOURCES, 2):
        pairs = [(a, b) for row in table if (a := getattr(row, of)) is not None and (b := getattr(row, less))]
        if not pairs:
            continue
        apart = np.array([_apart(a, b, axes) for a, b in pairs])
        east, north, up, yaw, pitch = (spread(column[np.isfinite(column)]) for column in apart.T)
        entries.append(
            PoseDifferenceEntry(
                of=of, less=less, east_m=east, north_m=north, up_m=up, yaw_deg=yaw, pitch_deg=pitch
            )
        )  # fmt: skip
    return tuple(entries)


def spread(values: NDArray[np.float64]) -> SpreadEntry | None:
    """Statistics of differences (n,); None without any."""
    if not len(values):
        return None
    return SpreadEntry(
        count=len(values),
        bias=float(values.mean()),
        std_dev=float(values.std(ddof=1)) if len(values) > 1 else None,
        rms=float(np.sqrt((values**2).mean())),
        max=float(np.abs(values).max()),
    )


def _assign(station_of: dict[str, str], stations: Poses, poses: Poses) -> None:
    """Give photographs that have no station yet those that are left, by the poses of one source."""
    free = [name for name in stations if name not in station_of.values()]
    left = [name for name in poses if name not in station_of]
    both = [name for name in station_of if name in poses]
    shift = None
    if len(both) >= LEAST_STATIONS:
        # Those that an earlier source has assigned say how far this one lies beside the plan.
        apart = [np.subtract(poses[n].position_m, stations[station_of[n]].position_m) for n in both]
        shift = np.median(np.array(apart, dtype=np.float64), axis=0)
    found = associate(pose_array(poses[n] for n in left), pose_array(stations[n] for n in free), offset_m=shift)
    station_of.update({left[a]: free[b] for a, b in found.station_of.items()})


def _shift(
    station_of: Mapping[str, str], stations: Poses, poses: Poses, axes: NDArray[np.float64]
) -> NDArray[np.float64]:
    apart = [np.subtract(poses[n].position_m, stations[s].position_m) for n, s in station_of.items() if n in poses]
    if not apart:
        return np.full(3, np.nan)
    return np.asarray(np.median(np.array(apart, dtype=np.float64) @ axes.T, axis=0))


def _errors(
    table: Sequence[PhotographPosesEntry], source: PoseSource, order: Sequence[str], axes: NDArray[np.float64]
) -> tuple[StationErrorEntry, ...]:
    errors = []
    for row in table:
        pose: PoseEntry | None = getattr(row, source)
        if pose is None or row.station is None or row.planned is None:
            continue
        east, north, up, yaw, pitch = (float(v) for v in _apart(pose, row.planned, axes))
        errors.append(
            StationErrorEntry(
                station=row.station, image=row.image, east_m=east, north_m=north, up_m=up,
                yaw_deg=finite(yaw), pitch_deg=finite(pitch), speed_mps=None, turning_dps=None,
            )
        )  # fmt: skip
    return tuple(sorted(errors, key=lambda error: order.index(error.station)))


def _apart(a: PoseEntry, b: PoseEntry, axes: NDArray[np.float64]) -> NDArray[np.float64]:
    """(5,): east, north, up, yaw and pitch of a less those of b; NaN where an angle is not known."""
    yaw = np.nan if a.yaw_deg is None or b.yaw_deg is None else wrapped_deg(a.yaw_deg - b.yaw_deg)
    pitch = np.nan if a.pitch_deg is None or b.pitch_deg is None else a.pitch_deg - b.pitch_deg
    return np.array([*(axes @ np.subtract(a.position_m, b.position_m)), yaw, pitch], dtype=np.float64)


def _yaw_pitch(rotation: NDArray[np.float64]) -> tuple[float, float]:
    yaw, pitch, _ = Pose(rotation, np.zeros(3)).yaw_pitch_roll_deg()
    if abs(rotation[2, 2]) > _STEEP_SINE:
        # Straight down the axis has no heading: there its yaw would follow every tenth of a degree of roll.
        right = rotation[0]
        yaw = float(np.degrees(np.arctan2(-right[1], right[0])))
    return float(wrapped_deg(yaw)), float(pitch)


def _somewhere(row: PhotographPosesEntry) -> bool:
    return any(getattr(row, source) is not None for source in ACHIEVED)


def _rms(values: Sequence[float | None]) -> float | None:
    known = np.array([v for v in values if v is not None])
    return float(np.sqrt((known**2).mean())) if len(known) else None
