"""How the photographs of evaluated plots kept to the plan that was flown: from every source there is."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fieldkit.captures import Capture, read_capture
from fieldkit.errors import FieldkitError, UsageError
from fieldkit.evaluation.adherence import Flight, planned_poses
from fieldkit.evaluation.commanded_poses import FlownMission
from fieldkit.evaluation.pose_table import Poses, capture_poses, plan_poses, pose_adherence, reconstructed_poses
from fieldkit.evaluation.recorded_angles import Matrix, read_angles
from fieldkit.flightlogs.adherence import PlannedPose
from fieldkit.geometry.priors import SourceFrame
from fieldkit.reconstruction.agreement import ANGLE_SIGMAS
from fieldkit.results.evaluation import AdherenceEntry, PlotEvaluation, PoseSource
from fieldkit.results.fields import clean_text
from fieldkit.results.plan import Plan
from fieldkit.results.report_files import describe_files

ADHERENCE_FILE = "adherence.csv"
_OWN_FRAME = "poses.csv"


@dataclass(frozen=True, eq=False)
class FlownPlan:
    """A plan that was flown, and what is known of the flight besides the photographs.

    Attributes:
        plan: in the plot frame of the reference; without one, in the frame of poses.csv.
        reference: the frame of the reference; None without one.
        flight: by its log; None without one.
        planned: the stations on the Earth, and ``datum`` of their heights; empty without a log.
        mission: that was uploaded; None where it was not given.
    """

    plan: Plan
    reference: SourceFrame | None
    flight: Flight | None = None
    planned: Sequence[PlannedPose] = ()
    datum: str = "none"
    mission: FlownMission | None = None

    @classmethod
    def of(
        cls, plan: Plan, reference: SourceFrame | None, flight: Flight | None = None,
        mission: FlownMission | None = None,
    ) -> FlownPlan:  # fmt: skip
        """A plan with what it is compared with.

        Raises:
            UsageError: there is a log, but no georeferenced reference that puts the plan on the Earth.
        """
        if flight is None:
            return cls(plan, reference, mission=mission)
        if reference is None:
            raise UsageError(
                "a plan is compared with a flight log on the reference's plot",
                remedy="Give --reference with --log and --plan, or leave --log or --plan out.",
            )
        planned, datum = planned_poses(plan, reference)
        return cls(plan, reference, flight, planned, datum, mission)

    def compare(self, plot: PlotEvaluation, name: str, folder: Path, capture: Capture) -> PlotEvaluation:
        """The plot's evaluation with its adherence.

        Args:
            plot: reconstructed.
            name: of the plot, as the flight knows it.
            folder: of its photographs.
            capture: that was reconstructed.
        """
        found = self.adherence(plot, name, folder, capture)
        return plot if found is None else plot.model_copy(update={"adherence": found})

    def adherence(self, plot: PlotEvaluation, name: str, folder: Path, capture: Capture) -> AdherenceEntry | None:
        """Every source's poses of a plot's photographs; None where none was taken near the plan's stations.

        Args:
            plot: reconstructed.
            name: of the plot, as the flight knows it.
            folder: of its photographs.
            capture: that was reconstructed.
        """
        if plot.frame is None or plot.metric_source is None or not plot.metric:
            return None
        frame = plot.frame.of_source(plot.metric_source)
        if self.reference is None and (frame.origin is not None or plot.metric_source != _OWN_FRAME):
            return None
        stations = plan_poses(self.plan, frame if self.reference is None else None)
        right = [image for image in plot.image_reports if image.right is not False]
        orientations = {image.name: image.pose.rotation for image in right if image.pose is not None}
        unknown: dict[PoseSource, str] = {}
        found: dict[PoseSource, Poses] = {"reconstructed": reconstructed_poses(plot.image_reports)}
        if not found["reconstructed"]:
            unknown["reconstructed"] = "no photograph has a pose that counts"
        flown = None
        if self.flight is None:
            unknown["reported"] = "no flight log was given"
            found["tagged"] = _poses(_as_meant(capture, orientations, frame, unknown), frame, "tagged", unknown)
        else:
            found["reported"] = _poses(capture, frame, "reported", unknown)
            flown = self.flight.adherence(name, self.planned, self.datum)
            try:
                tagged = _as_meant(read_capture(folder), orientations, frame, unknown)
                found["tagged"] = _poses(tagged, frame, "tagged", unknown)
            except FieldkitError as error:
                unknown["tagged"] = error.message
        commanded: Poses = {}
        why = "no mission file was given"
        if self.mission is not None:
            home = None if self.flight is None or self.flight.log.home is None else self.flight.log.home.amsl_m
            commanded, why = self.mission.by_station(stations, frame, home)
        if why:
            unknown["commanded"] = why
        names = [image.name for image in plot.image_reports]
        axes = np.eye(3) if frame.origin is None else frame.from_source.rotation.T
        return pose_adherence(
            names, stations, found, unknown=unknown, axes=axes, commanded=commanded, flown=flown
        )  # fmt: skip

    @property
    def without_place(self) -> str:
        """Why a plot has no adherence."""
        if self.reference is None:
            return "its place needs --reference, or a poses.csv in the plan's frame"
        return "no photograph was taken near the plan's stations"


def write_adherence(folder: Path, place: str, plot: PlotEvaluation) -> PlotEvaluation:
    """Write adherence.csv of a plot, and enter it in its files.

    Args:
        folder: of the evaluation.
        place: the plot's folder in it.
        plot: with its adherence; one without is given back as it is.

    Raises:
        StorageError: the place is full or not writable.
    """
    if plot.adherence is None:
        return plot
    from fieldkit.figures.spreadsheets import write_adherence_csv

    write_adherence_csv(folder / place / ADHERENCE_FILE, plot.adherence)
    names = [f"{place}/{ADHERENCE_FILE}"]
    return plot.model_copy(update={"files": (*plot.files, *describe_files(folder, names))})


def _as_meant(
    capture: Capture, orientations: Mapping[str, Matrix], frame: SourceFrame, unknown: dict[PoseSource, str]
) -> Capture:
    """A capture with its recorded angles read as orientations in the plot frame say; see `read_angles`."""
    found = {name: orientations[clean_text(name)] for name in capture.names if clean_text(name) in orientations}
    sigmas = [p.angle_sigma_deg for p in capture.priors.values() if p.angles is not None]
    bound = ANGLE_SIGMAS * float(np.median(sigmas)) if sigmas else 0.0
    reading = read_angles(capture, found, frame.from_source.rotation, bound)
    if reading.unused:
        unknown["tagged"] = f"angles of {len(reading.unused)} of {len(capture.photos)}: they contradict the photographs"
    return reading.capture


def _poses(capture: Capture, frame: SourceFrame, source: PoseSource, unknown: dict[PoseSource, str]) -> Poses:
    try:
        found = capture_poses(capture, frame)
    except FieldkitError as error:
        unknown[source] = error.message
        return {}
    if not found:
        unknown[source] = (
            "the log locates no photograph" if source == "reported" else "the photographs have no known positions"
        )
    return found
