"""Poses of an evaluation's photographs from a flight log, and how a flight kept to its plan: achieved less planned."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from fieldkit.arrays import FloatArray
from fieldkit.captures import Capture, read_capture
from fieldkit.errors import FieldkitError, MetadataError
from fieldkit.evaluation.recorded_angles import read_angles
from fieldkit.figures.spreadsheets import adherence_csv
from fieldkit.files import write_atomic
from fieldkit.flightlogs import FlightLog, Matches, match_log, read_flight_log
from fieldkit.flightlogs.adherence import PoseRow, Poses, assigned, station_errors
from fieldkit.flightlogs.geotag import frame_of, local_poses, stamp
from fieldkit.flightlogs.model import Trigger
from fieldkit.geometry import Pose
from fieldkit.geometry.pose import wrapped_deg
from fieldkit.geometry.priors import SourceFrame
from fieldkit.reconstruction.agreement import ANGLE_SIGMAS
from fieldkit.reconstruction.known_poses import known_poses
from fieldkit.results.evaluation import (
    AchievedSource,
    AdherenceEntry,
    PlotEvaluation,
    pooled_spread,
    rms,
)
from fieldkit.results.fields import vector
from fieldkit.results.finding import Finding
from fieldkit.results.plan import Plan, station_number
from fieldkit.results.report_files import describe_files
from fieldkit.vocabulary import LEAST_POSITIONS
from fieldkit.wording import count

SOURCE = "flight log"
ADHERENCE_FILE = "adherence.csv"
ACHIEVED: tuple[AchievedSource, ...] = ("reported", "reconstructed", "tagged")
"""Sources of where a photograph was really taken, the first that knows enough first: the autopilot's estimate, as plans
are flown by it; then structure from motion, good to millimetres within a plot; then tags, which may be the commanded
poses copied, or GPS without corrections."""
_LEAST_STATIONS = 3
"""Least number of stations that say how a flight kept to its plan."""
_OWN_FRAME = "poses.csv"
NO_ADHERENCE = (
    "no photograph lies near its stations, or their place needs --reference, or a poses.csv in the plan's frame"
)
_STEEP_SINE = float(np.sin(np.radians(75.0)))


@dataclass(frozen=True, eq=False)
class LoggedFlight:
    """A flight and the photographs that were taken on it."""

    log: FlightLog
    matches: Matches
    """Of all plots' photographs, whose names are PLOT/IMAGE here."""
    captures: Mapping[str, Capture]
    """By plot, as read without what lies beside the photographs."""

    @classmethod
    def read(cls, log: Path, plots: Sequence[tuple[str, Path]]) -> LoggedFlight:
        """Read a log and match all plots' photographs to it at once: one camera has one clock.

        Plots that cannot be read are left out here; reading them again says why.
        """
        flight = read_flight_log(log)
        captures: dict[str, Capture] = {}
        for name, path in plots:
            try:
                captures[name] = read_capture(path, sidecars=False)
            except FieldkitError:
                continue
        stamps = [
            replace(stamp(photo), name=f"{name}/{photo.name}")
            for name, capture in captures.items()
            for photo in capture.photos
        ]
        return cls(*match_log(stamps, flight), captures)

    def capture(self, plot: str) -> Capture | None:
        """A plot's capture with the poses that the log gives; None where it could not be read."""
        capture = self.captures.get(plot)
        if capture is None:
            return None
        frame, _ = frame_of(self.log)
        names = [f"{plot}/{photo.name}" for photo in capture.photos]
        priors = {
            pose.image.removeprefix(f"{plot}/"): pose.prior(SOURCE)
            for pose in local_poses(self.log, self.matches, frame, names)
        }
        untold = {f"{plot}/{photo.name}": photo.name for photo in capture.photos if photo.name not in priors}
        findings = [
            Finding(
                photograph,
                "photo-without-trigger",
                "could belong to more than one trigger of the flight log"
                if name in self.matches.ambiguous
                else "no trigger in the flight log",
            )
            for name, photograph in untold.items()
        ]
        first = capture.photos[0].name
        findings += [Finding(first, "flight-log", text) for text in (*self.log.remarks, *self.matches.remarks)]
        enough = len(priors) >= LEAST_POSITIONS
        if not enough:
            located = count(len(priors), "photograph")
            text = f"the flight log locates {located}; scale and orientation need {LEAST_POSITIONS}"
            findings.append(Finding(first, "too-few-positions", text))
        return replace(
            capture,
            priors=priors,
            metric_source=SOURCE if enough else None,
            origin=frame if enough else None,
            height_source=SOURCE if enough else None,
            findings=(*capture.findings, *findings),
        )

    def triggers(self, plot: str) -> dict[str, Trigger]:
        """The triggers of a plot's photographs, by their names."""
        return {
            pair.photograph.removeprefix(f"{plot}/"): self.log.triggers[pair.trigger]
            for pair in self.matches.pairs
            if pair.photograph.startswith(f"{plot}/")
        }


@dataclass(frozen=True, eq=False)
class ComparedPlan:
    """A plan that was flown, and what is known of the flight besides the photographs."""

    plan: Plan
    """In the plot frame of the reference; without one, in the frame of poses.csv."""
    reference: SourceFrame | None
    """The frame of the reference; None without one."""
    flight: LoggedFlight | None = None
    """By its log; None without one."""

    def adherence(self, plot: PlotEvaluation, name: str, capture: Capture) -> AdherenceEntry | None:
        """How a plot's photographs kept to the plan; None where none was taken near its stations."""
        if plot.frame is None or plot.metric_source is None or not plot.metric:
            return None
        frame = plot.frame.of_source(plot.metric_source)
        if self.reference is None and (frame.origin is not None or plot.metric_source != _OWN_FRAME):
            return None
        poses: dict[AchievedSource, Poses] = {"reconstructed": {n: _row(pose) for n, pose in plot.poses.items()}}
        if self.flight is None:
            poses["tagged"] = known_rows(_as_meant(capture, plot.poses, frame), frame)
        else:
            poses["reported"] = known_rows(capture, frame)
        axes = np.eye(3) if frame.origin is None else frame.from_source.rotation.T
        stations = _stations(self.plan, frame if self.reference is None else None)
        entry = _kept([image.name for image in plot.image_reports], stations, poses, axes)
        if entry is None or self.flight is None or entry.achieved_by != "reported":
            return entry
        triggers = self.flight.triggers(name)
        errors = [
            error.model_copy(update={key: getattr(triggers[error.image], key) for key in ("speed_mps", "turning_dps")})
            for error in entry.stations
        ]
        return entry.model_copy(update={"stations": tuple(errors)})


def write_adherence(folder: Path, place: str, plot: PlotEvaluation) -> PlotEvaluation:
    """Write adherence.csv of a plot with adherence into its folder ``place`` of an evaluation, and enter it there."""
    if plot.adherence is None:
        return plot
    write_atomic(folder / place / ADHERENCE_FILE, adherence_csv(plot.adherence))
    files = describe_files(folder, [f"{place}/{ADHERENCE_FILE}"])
    return plot.model_copy(update={"files": (*plot.files, *files)})


def _kept(
    photographs: Sequence[str], stations: Poses, poses: Mapping[AchievedSource, Poses], axes: FloatArray
) -> AdherenceEntry | None:
    """How a plot's photographs kept to their plan; None where none was taken near a station.

    Args:
        photographs: their names, in order.
        stations: the plan's, by name, in its order; plot frame.
        poses: by source; what one does not know is left out.
        axes: (3, 3) rows are east, north and up in the plot frame.
    """
    station_of: dict[str, str] = {}
    shifts: dict[AchievedSource, FloatArray] = {}
    for source in ACHIEVED:
        own = poses.get(source, {})
        # Photographs that an earlier source has assigned say how far this one lies beside the plan.
        apart = _apart(station_of, stations, own)
        offset = np.median(apart, axis=0) if len(apart) >= _LEAST_STATIONS else None
        free = {name: pose for name, pose in stations.items() if name not in station_of.values()}
        station_of |= assigned(free, {name: pose for name, pose in own.items() if name not in station_of}, offset)
        shifts[source] = _apart(station_of, stations, own)
    if not station_of:
        return None
    known = {source: len(shift) for source, shift in shifts.items()}
    achieved = next((s for s in ACHIEVED if known[s] >= _LEAST_STATIONS), max(ACHIEVED, key=lambda s: known[s]))
    somewhere = {name for own in poses.values() for name in own}
    return AdherenceEntry.of(
        station_errors(stations, poses.get(achieved, {}), station_of, axes),
        [name for name in stations if name not in station_of.values()],
        [name for name in photographs if name in somewhere and name not in station_of],
        achieved,
        vector(np.median(shifts[achieved] @ axes.T, axis=0)) if known[achieved] else None,
    )


def _apart(station_of: Mapping[str, str], stations: Poses, poses: Poses) -> FloatArray:
    """(n, 3) positions of photographs less those of their stations."""
    return np.array([np.subtract(poses[n][0], stations[s][0]) for n, s in station_of.items() if n in poses], np.float64)


def _row(pose: Pose) -> PoseRow:
    """Of a camera in the plot frame."""
    rotation = pose.rotation
    yaw, pitch, _ = pose.yaw_pitch_roll_deg()
    if abs(rotation[2, 2]) > _STEEP_SINE:
        # Straight down the axis has no heading: there its yaw would follow every tenth of a degree of roll.
        yaw = float(np.degrees(np.arctan2(-rotation[0, 1], rotation[0, 0])))
    return vector(pose.center), float(wrapped_deg(yaw)), float(pitch)


def _stations(plan: Plan, to_plot: SourceFrame | None) -> dict[str, PoseRow]:
    """A plan's stations in the plot frame; ``to_plot`` leads into it where the plan is in a metric source's frame."""
    poses = [station.pose for station in plan.stations]
    if to_plot is not None:
        poses = [to_plot.from_source.apply_pose(pose) for pose in poses]
    return {f"station {station_number(k)}": _row(pose) for k, pose in enumerate(poses)}


def known_rows(capture: Capture, frame: SourceFrame) -> dict[str, PoseRow]:
    """Positions and angles that lie beside a capture's photographs or in them, or that its flight log gives.

    Empty where the capture's frame and the plot's are not related.
    """
    try:
        known = known_poses(replace(capture, program=None), frame).by_name
    except FieldkitError:
        return {}
    rows: dict[str, PoseRow] = {}
    for name, known_prior in known.items():
        if known_prior.position is None:
            continue
        prior, yaw, pitch = capture.priors[name], None, None
        if prior.yaw_deg is not None or prior.pitch_deg is not None:
            camera = Pose.from_yaw_pitch(np.zeros(3), prior.yaw_deg or 0.0, prior.pitch_deg or 0.0, prior.roll_deg or 0)
            _, yaw, pitch = _row(Pose(camera.rotation @ frame.from_source.rotation.T, known_prior.position))
        rows[name] = (
            vector(known_prior.position),
            None if prior.yaw_deg is None else yaw,
            None if prior.pitch_deg is None else pitch,
        )
    return rows


def _as_meant(capture: Capture, poses: Mapping[str, Pose], frame: SourceFrame) -> Capture:
    """A capture with its recorded angles read as orientations in the plot frame say; see `read_angles`."""
    sigmas = [p.angle_sigma_deg for p in capture.priors.values() if p.angles is not None]
    bound = ANGLE_SIGMAS * float(np.median(sigmas)) if sigmas else 0.0
    rotations = {name: pose.rotation for name, pose in poses.items()}
    return read_angles(capture, rotations, frame.from_source.rotation, bound).capture


def flown_noise(plots: Sequence[PlotEvaluation], path: Path) -> tuple[float, float]:
    """Standard deviations of a vehicle's pose errors, of evaluated plots: what plans are to survive.

    Positions: of each coordinate, about each plot's mean error. What all stations of a plot have in common lies between
    the reference's GPS and the vehicle's, often metres and in height always; it moves no camera against another.
    Angles: of yaw and pitch about 0, since an offset of the compass or the mount turns every photograph away from what
    it was aimed at.

    Where plots know their poses from different sources (`AdherenceEntry.achieved_by`), only those by the best one
    count: the autopilot's report, then structure from motion, then tags. To 0.01 mm and 10⁻⁵ degrees.
    """
    known = [plot.adherence for plot in plots if plot.adherence is not None]
    if not known:
        raise MetadataError(
            "the evaluation does not say how a flight kept to its plan",
            path=path,
            remedy="Evaluate the flight again with --plan and --reference, or give --pose-noise M,DEG.",
        )
    best = next(source for source in ACHIEVED if any(entry.achieved_by == source for entry in known))
    flown = [entry for entry in known if entry.achieved_by == best]
    position, turned = pose_noise(flown)
    stations = sum(len(entry.stations) for entry in flown)
    if stations < _LEAST_STATIONS or position is None or turned is None:
        what = "position" if position is None or stations < _LEAST_STATIONS else "heading and gimbal"
        raise MetadataError(
            f"the evaluation has the errors of {what} of too few of {count(stations, 'station')}: {_LEAST_STATIONS} of "
            "a plot are the least",
            path=path,
            remedy="Take an evaluation of a longer flight whose log has attitude and gimbal, or give --pose-noise "
            "M,DEG.",
        )
    return round(position, 5), round(turned, 5)


def pose_noise(flown: Sequence[AdherenceEntry]) -> tuple[float | None, float | None]:
    """Standard deviation of a coordinate about each plot's mean error, metres, and root mean square of yaw and pitch
    errors, degrees; None where no plot has two errors of one, or any.
    """
    pooled = pooled_spread(
        [
            [error for station in entry.stations if (error := getattr(station, name)) is not None]
            for entry in flown
            for name in ("east_m", "north_m", "up_m")
        ]
    )
    angles = [angle for entry in flown for s in entry.stations for angle in (s.yaw_deg, s.pitch_deg)]
    return None if pooled is None else pooled[0], rms(angles)
