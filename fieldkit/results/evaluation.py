"""What reference.json and evaluation.json hold. Units are in the keys: _m metres, _deg degrees, _s seconds, _px pixels.

Where a reconstruction has no metric source, lengths are in the model's own unit and ``metric`` is false.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import Field, PositiveFloat, PositiveInt

from fieldkit.arrays import FloatArray
from fieldkit.geometry import Pose
from fieldkit.results.fields import Count, Length, Ordinal, Sha256, Share, Strict, Text, Vector, vector
from fieldkit.results.finding import DOUBTFUL, Finding
from fieldkit.results.frame import CameraReport, FrameEntry, VolumeEntry
from fieldkit.results.traits import PlantEntry, RowEntry, TraitsEntry
from fieldkit.vocabulary import Fidelity, MappingName, Mask

CLOUD_FILE, SCENE_FILE = "cloud.ply", "scene.ply"
PHOTO_FILE, FIELD_PICTURE = "photo.jpg", "field.jpg"
"""Of a plot of a flight, and of the field."""
Seconds = Annotated[float, Field(ge=0)]
Distance = Annotated[str, Field(pattern=r"^\d+\.\d{3,}$")]
"""A distance in metres as a key, with at least three decimals: "0.002"."""
ByDistance = dict[Distance, Share]

Source = Literal[
    "poses.csv", "geo.txt", "COLMAP", "OpenDroneMap", "Metashape", "EXIF GPS", "flight log", "markers", "none"
]


class FileEntry(Strict):
    """A file of the result."""

    name: Annotated[str, Field(min_length=1)]
    """Relative to the result's folder, with "/"."""
    bytes: Count
    sha256: Sha256


class StageTime(Strict):
    """What a stage took."""

    name: str
    wall_s: Seconds
    cpu_s: Seconds
    items: Count
    """Images, pairs or whatever the stage works on."""
    cached: Count
    """How many of them came from the cache."""


class DenseEntry(Strict):
    """How the dense cloud was made."""

    fidelity: Fidelity
    pixel_m: Length | None = None
    """What a pixel of the depth maps covers at the plants; null where nothing gives the scale."""
    mask: Mask
    fusion_rule: str
    seed: Count


class ImageReport(Strict):
    """What became of one photograph."""

    name: str
    features: Count
    registered: bool
    """Whether the mapper gave it a pose."""
    right: bool | None = None
    """Whether its pose agrees with what is known of it and is known to 10 mm at two standard deviations, or to 0.75 %
    of the distance to what is seen; null where nothing is known of it, or the pose is not known so well."""
    reason: Text = ""
    """Why it is not registered, or not right; empty otherwise."""
    stated: bool = False
    """Whether it counts by a pose that is stated to be exact, though the mapper gave it none."""
    sigma_m: Length | None = None
    """Standard deviation of its centre against the other photographs': of three axes together. Null without a
    scale."""
    burst: tuple[Text, ...] = ()
    """The photographs of a burst whose steady picture it is, the first gives its name; empty for a single one."""
    sway_m: Length | None = None
    """How far leaves moved within the burst: as of the plot."""
    observations: Count = 0
    """Sparse points seen in it."""
    reprojection_px: Length | None = None
    """Mean error of these, pixels of the full-size photograph."""
    position_residual_m: Length | None = None
    """From its centre to the known position, after alignment."""
    angle_residual_deg: Length | None = None
    """To the known orientation."""
    known_center_m: Vector | None = None
    """Where the metric source puts its projection centre, in the plot frame."""
    center_m: Vector | None = None
    """Where the reconstruction puts it, in the plot frame; null where the image has no pose."""
    yaw_deg: float | None = None
    """Of the optical axis, clockwise from the plot frame's +y."""
    pitch_deg: float | None = None
    """0 at the horizon, −90 straight down."""
    roll_deg: float | None = None

    @property
    def counts(self) -> bool:
        """Registered, and not known to be wrong; or of a stated pose."""
        return self.stated or (self.registered and self.right is not False)

    @property
    def pose(self) -> Pose | None:
        """Where the reconstruction puts it, in the plot frame; None where it has none."""
        if self.center_m is None or self.yaw_deg is None or self.pitch_deg is None:
            return None
        return Pose.from_yaw_pitch(self.center_m, self.yaw_deg, self.pitch_deg, self.roll_deg or 0.0)


class WeakestMode(Strict):
    """What photographs' matches and positions tell least of a model: which could be off together."""

    photographs: tuple[Text, ...]
    """Those that could move, against all others."""
    sigma_m: Length
    """Standard deviation of it: root mean square distance from where they are."""
    moves_m: tuple[Vector, ...] = ()
    """How each would move with the others, plot frame: two standard deviations."""

    def turned(self, rotation: FloatArray) -> Self:
        """In a frame (3, 3) that is turned."""
        return self.model_copy(update={"moves_m": tuple(vector(rotation @ move) for move in self.moves_m)})


class ReconstructionEntry(Strict):
    """What every reconstruction says of itself. For a plot that failed, figures are 0, empty or null."""

    images: Count
    """Photographs that could be read."""
    registered: Count = 0
    """Images the mapper gave a pose."""
    right: Count = 0
    """Images that count: registered, and not known to be wrong; or of a stated pose."""
    models: tuple[Count, ...] = ()
    """Registered images of every model the mapper made, largest first; more than one: the images fell apart."""
    method: MappingName | None = None
    """Of mapping."""
    pose_rms_m: Length | None = None
    """Root mean square of the position residuals of the images that count; null without known positions."""
    metric_source: Source | None = None
    """What scale and place come from."""
    metric: bool = False
    """Whether lengths are metres."""
    position_bound_m: Length | None = None
    """The largest position residual that counts as right (median over images)."""
    weakest: WeakestMode | None = None
    """Null without a scale."""
    points: Count = 0
    """Of the plants' cloud."""
    gsd_m: Length | None = None
    """Ground sampling distance at the volume's centre: metres per pixel of the full-size photographs."""
    reprojection_px: Length | None = None
    """Mean over all observations."""
    track_length: Length | None = None
    """Mean number of images that see a sparse point."""
    observations: Count = 0
    sparse_points: Count = 0
    features_per_image: Length | None = None
    """Mean over all images."""
    pairs_tried: Count = 0
    pairs_verified: Count = 0
    points_per_plant_voxel: Length | None = None
    """Mean number of plants' points in a voxel that has any, without those that fill holes."""
    plant_voxel_m: Length | None = None
    """Edge of these voxels: 10 mm, or 10 ground sampling distances where that is more."""
    frame: FrameEntry | None = None
    volume: VolumeEntry | None = None
    cameras: tuple[CameraReport, ...] = ()
    dense: DenseEntry | None = None
    image_reports: tuple[ImageReport, ...] = ()
    findings: tuple[Finding, ...] = ()
    times: tuple[StageTime, ...] = ()
    seconds: Seconds
    """Wall time of the whole run, cached stages included."""
    cpu_seconds: Seconds
    files: tuple[FileEntry, ...] = ()
    date: str | None = None
    """Local date of the earliest photograph, ISO 8601; null where none says it."""
    traits: TraitsEntry | None = None
    """Of the plants (docs/traits.md); null where the plot failed."""
    plants: tuple[PlantEntry, ...] = ()
    """One by one; empty where they cannot be told apart, for the reason in ``traits.unknown``."""
    sway_m: Length | None = None
    """How far leaves moved between the photographs of a burst: standard deviation per axis over what pictures show of
    the plants, root mean square; median of the stations. Null without bursts."""
    stray: Share | None = None
    """Share of the points that were left out of the cloud: clumps smaller than leaves that touch nothing."""
    filled: Share | None = None
    """Share of the points that fill holes: one photograph's depths that all outlines bear out. Null without masks."""
    hidden_sides: Share | None = None
    """Share of the directions that plants' upright sides face from which no two photographs show them well enough, as
    expected from poses. Null without a cloud or a scale."""
    near_3px: Share | None = None
    """Share of the plants' pixels, over all photographs that count, with a point of the cloud within 3 pixels of a
    photograph 1600 pixels wide. Null without masks, and of references."""
    near_6px: Share | None = None
    """The same within 6."""
    inside: Share | None = None
    """Share of the cloud's points, over all these photographs, that fall on plants' pixels."""

    @property
    def poses(self) -> dict[str, Pose]:
        """Of the photographs that count, by name, in the plot frame."""
        return {image.name: pose for image in self.image_reports if image.counts and (pose := image.pose) is not None}

    @property
    def doubts(self) -> tuple[str, ...]:
        """Codes of findings with which the result must not be taken as it is."""
        return tuple(dict.fromkeys(finding.code for finding in self.findings if finding.code in DOUBTFUL))


class ReferenceReport(ReconstructionEntry):
    """reference.json: a reference cloud and how it was made."""

    kind: Literal["reference"] = "reference"
    version: Literal[1] = 1
    fieldkit: str
    """Version that wrote it."""
    source: Text
    """Name of the folder of photographs."""
    method: MappingName
    metric_source: Source
    gsd_m: Length
    frame: FrameEntry
    volume: VolumeEntry
    dense: DenseEntry
    scene_points: Count | None
    """Of the scene's cloud, ground included; null where it was not asked for."""
    settings: dict[str, Any]
    """Every choice that changes the result."""


class CorrectionEntry(Strict):
    """How ICP moved a plot's cloud onto the reference (--refine)."""

    translation_m: Vector
    angle_deg: Length
    scale: PositiveFloat
    rms_m: Length
    """Of the correspondences' distances afterwards."""


class ErrorEntry(Strict):
    """Why a plot has no score."""

    type: str
    message: Text
    remedy: Text


AchievedSource = Literal["reported", "reconstructed", "tagged"]


class StationErrorEntry(Strict):
    """A photograph's pose against its station: achieved less planned, by the source `AdherenceEntry.achieved_by`."""

    station: str
    image: str
    east_m: float
    north_m: float
    up_m: float | None
    """Null where log and plan have no datum in common."""
    yaw_deg: float | None
    """Of the heading; null where the log does not say it."""
    pitch_deg: float | None
    """Of the gimbal; null where the log does not say it."""
    speed_mps: Length | None = None
    """Of the vehicle at the shutter."""
    turning_dps: Length | None = None
    """How fast the camera turned at the shutter, degrees per second."""


class AdherenceEntry(Strict):
    """How a flight kept to its plan (--plan)."""

    stations: tuple[StationErrorEntry, ...]
    """Those that were photographed, in the plan's order."""
    missing: tuple[str, ...]
    """Stations without a photograph."""
    extra: tuple[str, ...]
    """Photographs that belong to no station."""
    horizontal_rms_m: Length | None
    """Of the position errors over ground; null without a station."""
    yaw_rms_deg: Length | None
    pitch_rms_deg: Length | None
    achieved_by: AchievedSource = "reported"
    """Which source ``stations`` and the figures above are by: the first of these that knows three stations' poses."""
    shift_m: Vector | None = None
    """East, north, up: what all photographs of that source have in common against their stations (median): the offset
    of a receiver above all. It is in ``stations`` and the statistics, and left out of the matching."""

    @classmethod
    def of(
        cls,
        stations: Sequence[StationErrorEntry],
        missing: Sequence[str],
        extra: Sequence[str],
        achieved_by: AchievedSource = "reported",
        shift_m: Vector | None = None,
    ) -> Self:
        """With the statistics of the stations' errors."""
        return cls(
            stations=tuple(stations),
            missing=tuple(missing),
            extra=tuple(extra),
            horizontal_rms_m=rms([float(np.hypot(error.east_m, error.north_m)) for error in stations]),
            yaw_rms_deg=rms([error.yaw_deg for error in stations]),
            pitch_rms_deg=rms([error.pitch_deg for error in stations]),
            achieved_by=achieved_by,
            shift_m=shift_m,
        )


class Prediction(Strict):
    """What the chamfer distance to the plot's true plants is likely to be, from figures that need no reference."""

    chamfer_m: Length | None
    """Median of what is to be expected; null where nothing can be said."""
    low_m: Length | None
    high_m: Length | None
    """Nine in ten plots like those of the fit lie between low_m and high_m."""
    reason: Text
    """Why nothing can be said; empty otherwise."""
    model: Ordinal
    """Version of the fit."""


class PlotEvaluation(ReconstructionEntry):
    """A capture of one plot: how it reconstructed and, with a reference, how close it comes to it."""

    name: Text
    """Of the plot's folder."""
    rows: tuple[RowEntry, ...] = ()
    """One by one, of a plot of a flight that says how far its rows are apart."""
    outline: tuple[tuple[float, float], ...] = ()
    """Corners (x, y) of a plot of a flight, in the frame of all its plots."""
    unregistered: dict[str, PositiveInt] = {}  # noqa: RUF012 - pydantic copies it
    """Number of images that do not count, by reason (up to its colon; image_reports hold the whole)."""
    chamfer_m: Length | None = None
    """accuracy_m + completeness_m."""
    accuracy_m: Length | None = None
    """Mean distance from this plot's points to the reference."""
    completeness_m: Length | None = None
    """Mean distance from the reference's points to this plot's."""
    f_score: ByDistance | None = None
    """By distance in metres: harmonic mean of precision and recall."""
    precision: ByDistance | None = None
    """Share of this plot's points within the distance of the reference."""
    recall: ByDistance | None = None
    """Share of the reference's points within the distance of this plot's."""
    correction: CorrectionEntry | None = None
    """Null without --refine."""
    adherence: AdherenceEntry | None = None
    """Null without --plan, and where no photograph was taken near the plan's stations."""
    prediction: Prediction | None = None
    """Null with a reference, and where the plot failed."""
    error: ErrorEntry | None = None
    """Null where the plot was reconstructed and, with a reference, scored."""


class FlightEntry(Strict):
    """The photographs of a flight over many plots, which were mapped once."""

    images: Count
    registered: Count
    right: Count
    """Those that count, as of a plot."""
    loose: Count
    """Those of them that nothing confirms, or whose place is not known well."""
    unregistered: dict[str, PositiveInt]
    """As of a plot."""
    pose_rms_m: Length | None
    """As of a plot."""
    picture: tuple[tuple[float, float], ...] = ()
    """Corners (x, y) of field.jpg, counter-clockwise from the lower right, in the plots' frame; none without it."""


class EvaluationReport(Strict):
    """evaluation.json: captures of one or many plots, scored."""

    kind: Literal["evaluation"] = "evaluation"
    version: Literal[1] = 1
    fieldkit: str
    """Version that wrote it."""
    source: Text
    """Name of the folder of captures."""
    reference_sha256: Sha256 | None
    """Of the reference.json scored against; null without a reference."""
    refine: bool
    distances_m: tuple[PositiveFloat, ...]
    settings: dict[str, Any]
    """Every choice that changes the result."""
    plots: tuple[PlotEvaluation, ...]
    flight: FlightEntry | None = None
    """Null where each plot has photographs of its own."""
    seconds: Seconds
    cpu_seconds: Seconds
    files: tuple[FileEntry, ...]

    @property
    def failed(self) -> int:
        """Plots without a result."""
        return sum(plot.error is not None for plot in self.plots)


def rms(values: Sequence[float | None]) -> float | None:
    """Root mean square of those that are known; None without one."""
    known = np.array([value for value in values if value is not None])
    return float(np.sqrt((known**2).mean())) if len(known) else None


def pooled_spread(groups: Sequence[Sequence[float]]) -> tuple[float, int] | None:
    """Standard deviation within groups of repeats, and its degrees of freedom; None without a repeat."""
    squares, freedom = 0.0, 0
    for group in groups:
        if len(group) > 1:
            values = np.asarray(group, dtype=np.float64)
            squares += float(((values - values.mean()) ** 2).sum())
            freedom += len(values) - 1
    return (float(np.sqrt(squares / freedom)), freedom) if freedom else None


def distance_key(distance_m: float) -> str:
    """A distance in metres as a key of the score tables: at least three decimals, none lost."""
    from decimal import Decimal

    value = Decimal(repr(float(distance_m)))
    if not value.is_finite() or value <= 0:
        raise ValueError(f"a distance must be a positive number of metres, not {distance_m}")
    text = f"{value:f}"
    decimals = len(text.partition(".")[2].rstrip("0"))
    return f"{value:.{max(3, decimals)}f}"
