"""Poses of an evaluation's photographs from a flight log, and how the flight kept to the plan."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from fieldkit.captures import Capture, read_capture
from fieldkit.errors import FieldkitError, MetadataError, UsageError
from fieldkit.evaluation.pose_table import ACHIEVED, station_names
from fieldkit.flightlogs import FlightLog, Matches, match, read_flight_log
from fieldkit.flightlogs.adherence import Adherence, PlannedPose, adherence
from fieldkit.flightlogs.geotag import frame_of, local_poses, stamp
from fieldkit.geometry import Pose
from fieldkit.geometry.priors import PosePrior, SourceFrame
from fieldkit.results.evaluation import AdherenceEntry, PlotEvaluation, StationErrorEntry
from fieldkit.results.fields import clean_text
from fieldkit.results.finding import Finding
from fieldkit.results.plan import Plan
from fieldkit.wording import count

SOURCE = "flight log"
_LEAST_POSITIONS = 3
_LEAST_STATIONS = 3


@dataclass(frozen=True, eq=False)
class Flight:
    """A flight and the photographs that were taken on it.

    Attributes:
        log: as read.
        matches: of all plots' photographs, whose names are PLOT/IMAGE here.
        captures: by plot, as read without what lies beside the photographs.
    """

    log: FlightLog
    matches: Matches
    captures: Mapping[str, Capture]

    @classmethod
    def read(cls, log: Path, plots: Sequence[tuple[str, Path]]) -> Flight:
        """Read a log and match all plots' photographs to it at once: one camera has one clock.

        Plots that cannot be read are left out here; reading them again says why.

        Raises:
            MetadataError: the log cannot be used.
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
        return cls(flight, match(stamps, flight.triggers), captures)

    def capture(self, plot: str) -> Capture | None:
        """A plot's capture with the poses that the log gives; None where it could not be read.

        Raises:
            MetadataError: the log holds no position.
        """
        capture = self.captures.get(plot)
        if capture is None:
            return None
        frame, _ = frame_of(self.log)
        names = [f"{plot}/{photo.name}" for photo in capture.photos]
        found = {p.image.removeprefix(f"{plot}/"): p for p in local_poses(self.log, self.matches, frame, names)}
        priors = {
            name: PosePrior(np.array(pose.position), pose.accuracy_m, source=SOURCE).with_angles(
                (pose.yaw_deg, pose.pitch_deg, None)
            )
            for name, pose in found.items()
        }
        ambiguous = {n.removeprefix(f"{plot}/") for n in self.matches.ambiguous if n in names}
        findings = [
            Finding(p.name, "photo-without-trigger", _without(p.name in ambiguous))
            for p in capture.photos
            if p.name not in priors
        ]
        first = capture.photos[0].name
        findings += [Finding(first, "flight-log", text) for text in (*self.log.remarks, *self.matches.remarks)]
        enough = len(priors) >= _LEAST_POSITIONS
        if not enough:
            located = count(len(priors), "photograph")
            text = f"the flight log locates {located}; scale and orientation need {_LEAST_POSITIONS}"
            findings.append(Finding(first, "too-few-positions", text))
        return replace(
            capture,
            priors=priors,
            metric_source=SOURCE if enough else None,
            origin=frame if enough else None,
            height_source=SOURCE if enough else None,
            findings=(*capture.findings, *findings),
        )

    def adherence(self, plot: str, planned: Sequence[PlannedPose], datum: str) -> AdherenceEntry | None:
        """How the photographs of a plot kept to its plan; None where none was taken near it."""
        pairs = [pair for pair in self.matches.pairs if pair.photograph.startswith(f"{plot}/")]
        triggers = [self.log.triggers[pair.trigger] for pair in pairs]
        names = [pair.photograph.removeprefix(f"{plot}/") for pair in pairs]
        found = adherence(planned, triggers, datum=datum)
        return adherence_entry(found, names) if found.errors else None


def planned_poses(plan: Plan, source: SourceFrame) -> tuple[list[PlannedPose], str]:
    """A plan's stations on the Earth, where the reference that it was made on lies, and the datum of their heights.

    Args:
        plan: in the reference's plot frame.
        source: the reference's georeferenced frame.

    Raises:
        UsageError: the reference is not georeferenced.
    """
    if source.origin is None:
        raise UsageError(
            f"the reference's positions come from {source.source}, so its plan has no place on the Earth",
            remedy="Leave --plan out, or build the reference with GPS positions.",
        )
    to_source = source.from_source.inverse()
    poses = []
    for name, station in zip(station_names(plan), plan.stations, strict=True):
        # Rows are the camera's axes: in the source's frame they are those in the plot's times the rotation between.
        rotation = station.pose.rotation @ source.from_source.rotation
        yaw, pitch, _ = Pose(rotation, np.zeros(3)).yaw_pitch_roll_deg()
        place = to_source.apply(np.array(station.position_m))
        latitude, longitude, height = (float(v[0]) for v in source.origin.to_geodetic(place))
        poses.append(PlannedPose(name, latitude, longitude, height, yaw % 360.0, pitch))
    return poses, "amsl" if source.origin.datum == "sea level" else "none"


def adherence_entry(found: Adherence, images: Sequence[str]) -> AdherenceEntry:
    """What evaluation.json says of a flight's adherence; ``images`` are the triggers' photographs."""
    stations = tuple(
        StationErrorEntry(
            station=clean_text(e.station),
            image=clean_text(images[e.trigger]),
            east_m=e.east_m,
            north_m=e.north_m,
            up_m=e.up_m,
            yaw_deg=e.yaw_deg,
            pitch_deg=e.pitch_deg,
            speed_mps=e.speed_mps,
            turning_dps=e.turning_dps,
        )
        for e in found.errors
    )
    return AdherenceEntry(
        stations=stations,
        missing=tuple(clean_text(name) for name in found.missing),
        extra=tuple(clean_text(images[k]) for k in found.extra),
        horizontal_rms_m=_rms([e.horizontal_m for e in found.errors]),
        yaw_rms_deg=_rms([e.yaw_deg for e in found.errors]),
        pitch_rms_deg=_rms([e.pitch_deg for e in found.errors]),
    )


def flown_noise(plots: Sequence[PlotEvaluation], path: Path) -> tuple[float, float]:
    """Standard deviations of a vehicle's pose errors, of evaluated plots: what plans are to survive.

    Positions: of each coordinate, about each plot's mean error. What all stations of a plot have in common lies between
    the reference's GPS and the vehicle's, often metres and in height always; it moves no camera against another.
    Angles: of yaw and pitch about 0, since an offset of the compass or the mount turns every photograph away from what
    it was aimed at.

    Where plots know their poses from different sources (`AdherenceEntry.achieved_by`), only those by the best one
    count: the autopilot's report, then structure from motion, then tags.

    Args:
        plots: of an evaluation with --plan, or of a campaign's.
        path: where they lie, for the errors.

    Returns:
        Metres and degrees, to 0.01 mm and 10⁻⁵ degrees.

    Raises:
        MetadataError: the evaluation does not say how a flight kept to its plan, or of too few stations.
    """
    known = [plot.adherence for plot in plots if plot.adherence is not None]
    if not known:
        raise MetadataError(
            "the evaluation does not say how a flight kept to its plan", path=path,
            remedy="Evaluate the flight again with --plan and --reference, or give --pose-noise M,DEG.",
        )  # fmt: skip
    best = next(source for source in ACHIEVED if any(each.achieved_by == source for each in known))
    flown = [each for each in known if each.achieved_by == best]
    position, angles = position_noise_m(flown), _angle_errors(flown)
    turned = _rms(angles)
    stations = sum(len(each.stations) for each in flown)
    if stations < _LEAST_STATIONS or position is None:
        raise MetadataError(
            f"the evaluation has the pose errors of {count(stations, 'station')}; {_LEAST_STATIONS} of a plot are the "
            "least",
            path=path, remedy="Take an evaluation of a longer flight, or give --pose-noise M,DEG.",
        )  # fmt: skip
    if turned is None or len(angles) < _LEAST_STATIONS:
        what = "flight's log" if best == "reported" else "photographs"
        raise MetadataError(
            f"the {what} said nothing of heading and gimbal, so the evaluation has no angle errors", path=path,
            remedy="Take an evaluation of a log with attitude and gimbal, or give --pose-noise M,DEG.",
        )  # fmt: skip
    return round(position, 5), round(turned, 5)


def position_noise_m(flown: Sequence[AdherenceEntry]) -> float | None:
    """Standard deviation of a coordinate, about each plot's mean error; None where no plot has two errors of one."""
    squares, degrees_of_freedom = 0.0, 0
    for each in flown:
        for name in ("east_m", "north_m", "up_m"):
            errors = np.array([e for station in each.stations if (e := getattr(station, name)) is not None])
            if len(errors) > 1:
                squares += float(((errors - errors.mean()) ** 2).sum())
                degrees_of_freedom += len(errors) - 1
    return float(np.sqrt(squares / degrees_of_freedom)) if degrees_of_freedom else None


def angle_noise_deg(flown: Sequence[AdherenceEntry]) -> float | None:
    """Root mean square of yaw and pitch errors; None without any."""
    return _rms(_angle_errors(flown))


def _angle_errors(flown: Sequence[AdherenceEntry]) -> list[float]:
    return [e for each in flown for s in each.stations for e in (s.yaw_deg, s.pitch_deg) if e is not None]


def _rms(values: Sequence[float | None]) -> float | None:
    known = np.array([v for v in values if v is not None])
    return float(np.sqrt((known**2).mean())) if len(known) else None


def _without(ambiguous: bool) -> str:
    return "could belong to more than one trigger of the flight log" if ambiguous else "no trigger in the flight log"
