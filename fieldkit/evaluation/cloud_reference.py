"""A bare cloud as a reference: a laser scan, or what another program reconstructed.

A reference's folder says where the plot lies, what volume counts and where the ground is. A cloud says less: the file
or a person names the frame; volume and ground are found from the points.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from fieldkit.arrays import FloatArray
from fieldkit.captures import Capture
from fieldkit.captures.crs import frame_about, height_datum, parse_crs, to_geodetic
from fieldkit.captures.programs import METRES
from fieldkit.clouds import Cloud, Volume, read_cloud
from fieldkit.clouds.ground import fit_ground_plane
from fieldkit.clouds.las import read_las
from fieldkit.errors import CloudError, EmptyCloudError, MetadataError, ReconstructionError, UsageError, about
from fieldkit.evaluation.reference import Reference
from fieldkit.geometry import Similarity
from fieldkit.geometry.geodesy import LocalFrame
from fieldkit.geometry.priors import SourceFrame
from fieldkit.reconstruction.dense.masks import EXG_THRESHOLD, excess_green
from fieldkit.reconstruction.pipeline import KnownPlot
from fieldkit.reconstruction.result import clearance
from fieldkit.regular_files import open_regular
from fieldkit.results.evaluation import CLOUD_FILE
from fieldkit.results.finding import Finding
from fieldkit.results.frame import Plane
from fieldkit.results.report_files import REFERENCE_FILE

_FRAME_REMEDY = (
    "Say it with --reference-frame: EPSG:CODE, or metres where the coordinates are those of the photographs' positions."
)
_MARGIN = 0.05  # of the cloud's diagonal, about its box
_FAR_M = 1000.0  # coordinates beyond are shifted, as those of positions are
_COARSE_STEP_M = 0.001
"""Step of coordinates from which they are told as coarse, metres."""
_CHUNK = 500_000
"""Number of points that are transformed at a time, which bounds memory."""
_CELL = 0.02  # of the cloud's width
_GROUND_COVERS = 0.25
"""Least share of the plot's cells that a ground covers."""
_MOST_BELOW = 0.01
"""Largest share of points below a ground."""
_MOST_GREEN = 0.5
"""Largest share of green points on a ground."""
_MAX_DIAGONAL_M = 2_000.0
"""Largest diagonal of a plot's cloud, metres."""


@dataclass(frozen=True, eq=False)
class CloudReference:
    """A cloud as captures are scored against it."""

    cloud: Cloud
    """Of the plants, plot frame."""
    origin: LocalFrame | None
    """Of the frame, whose axes are then east, north, up; None where the frame is that of the photographs' positions."""
    from_source: Similarity
    """From ``origin``'s frame, or the positions', to the plot frame."""
    volume: Volume
    """That counts, plot frame."""
    ground: Plane | None
    """Found in the cloud, or None."""
    findings: tuple[Finding, ...]
    """What was found from the cloud and not stated."""
    path: Path

    def known_plot(self, capture: Capture) -> KnownPlot:
        """What the reference fixes for a capture: scale and place are those of the capture's own positions."""
        source = capture.metric_source
        if source is not None and (capture.origin is None) != (self.origin is None):
            lies = "lies on the Earth" if self.origin is not None else "has coordinates without a place on the Earth"
            other = "do not" if self.origin is not None else "are a place on the Earth"
            raise MetadataError(
                f"the reference {self.path.name} {lies}, and the photographs' positions ({source}) {other}",
                path=capture.folder,
                remedy="Give both in the same kind of coordinates: --reference-frame EPSG:CODE goes with GPS, geo.txt "
                "and longitudes and latitudes, metres with others.",
            )
        frame = SourceFrame(source or "poses.csv", self.origin, self.from_source)
        return KnownPlot(frame, self.volume, self.ground)


AnyReference: TypeAlias = Reference | CloudReference


def known_plot_of(reference: AnyReference | None, capture: Capture) -> KnownPlot | None:
    """What a reference of either kind fixes for a capture; None without a reference."""
    if isinstance(reference, CloudReference):
        return reference.known_plot(capture)
    return None if reference is None else reference.known_plot()


def reference_file(path: Path) -> Path:
    """The file that a reference is known by: reference.json, or the cloud itself where it is a bare one."""
    path = Path(path)
    if path.is_dir():
        return path / REFERENCE_FILE
    beside = path.with_name(REFERENCE_FILE)
    return beside if path.name == CLOUD_FILE and beside.is_file() else path


def is_cloud(path: Path) -> bool:
    """Whether a file is a PLY, LAS or LAZ file, by its first bytes."""
    try:
        with open_regular(path) as file:
            return file.read(4) in (b"LASF", b"ply\n", b"ply\r")
    except OSError:
        return False


def open_reference(path: Path, frame: str = "", bounds: Volume | None = None) -> AnyReference:
    """A reference's folder, or a cloud.

    Args:
        path: folder, reference.json, or PLY, LAS or LAZ file.
        frame: of a cloud: "metres", ``EPSG:code``, or "" where the file says it.
        bounds: volume of a cloud that counts, plot frame; None takes the cloud's.
    """
    file = reference_file(path)
    if file.name != REFERENCE_FILE and is_cloud(file):
        with about(file):
            return _cloud_reference(file, frame, bounds)
    if frame:
        raise UsageError(
            "--reference-frame is that of a bare cloud",
            path=path,
            remedy="A reference's folder says its own: leave it out.",
        )
    return Reference(file if file.name == REFERENCE_FILE and file.is_file() else path)


def _cloud_reference(path: Path, frame: str, bounds: Volume | None) -> CloudReference:
    with open_regular(path) as file:
        is_las = file.read(4) == b"LASF"
    crs: Any = None
    units, noise, step = None, 0, 0.0  # metres per unit of the coordinates, where the file says it
    if is_las:
        las = read_las(path)
        cloud, crs, noise, step = las.cloud, las.crs, las.left_out, las.step_m
        if crs is not None or any(unit != 1.0 for unit in las.units_m):
            units = np.array(las.units_m)
    else:
        cloud = read_cloud(path)
    if not len(cloud):
        why = "has no points" if not noise else f"has {noise:,} points, all of them noise or withheld"
        raise EmptyCloudError(why, remedy="Give the cloud of the plot's plants.")
    if frame == METRES:
        crs = None
    elif frame:
        stated = parse_crs(frame)
        if crs is not None and not crs.equals(stated, ignore_axis_order=True) and crs.to_epsg() != stated.to_epsg():
            raise UsageError(f"--reference-frame says {stated.name}, and the file {crs.name}", remedy="Leave it out.")
        crs = stated if crs is None else crs
    elif crs is None:
        raise CloudError("does not say in which frame its coordinates are", remedy=_FRAME_REMEDY)
    if not is_las:
        _check_steps(cloud.points)
    if crs is None:
        origin, placed, said, odd = None, cloud, "in the frame of the photographs' positions", list[Finding]()
        middle = 0.5 * np.sum(cloud.bounds(), axis=0)
        shift = -np.round(middle) if np.abs(middle).max() > _FAR_M else np.zeros(3)
    else:
        origin, placed, odd = _local(cloud, crs, units, path.name)
        said, shift = f"in {crs.name}", np.zeros(3)
    to_plot = Similarity(1.0, np.eye(3), shift)
    said += f", without {noise:,} points that it marks as noise or withheld" if noise else ""
    reference = _with_volume(placed.transformed(to_plot), origin, to_plot, bounds, path, said)
    if step > _COARSE_STEP_M:
        said = f"its coordinates come in steps of {1000.0 * step:.3g} mm: distances to it are no finer"
        odd = [*odd, Finding(path.name, "reference-steps", said)]
    return replace(reference, findings=(*reference.findings, *odd))


def _check_steps(points: FloatArray) -> None:
    """Refuse coordinates that 32-bit numbers have rounded, as those of UTM in most PLY files are."""
    largest = float(np.abs(points).max())
    step = float(np.spacing(np.float32(largest)))
    if step > _COARSE_STEP_M and np.array_equal(points, points.astype(np.float32)):
        raise CloudError(
            f"has coordinates of {largest:,.0f} in 32-bit numbers, which lie {step:.2g} apart",
            remedy="Export the cloud as LAS or LAZ, or with coordinates in double precision.",
        )


def _local(cloud: Cloud, crs: Any, units: FloatArray | None, subject: str) -> tuple[LocalFrame, Cloud, list[Finding]]:
    """The cloud in a local east-north-up frame in its middle, and what is to be known of its datum.

    Normals are left out: their frame is seldom known.
    """
    points = cloud.points if units is None else cloud.points / units
    ends = range(0, len(points), _CHUNK)
    pieces, odd = zip(*(to_geodetic(points[k : k + _CHUNK], crs, subject) for k in ends), strict=True)
    geodetic = np.concatenate(pieces)
    if units is not None and not crs.is_geocentric:
        geodetic[:, 2] = cloud.points[:, 2]  # a file knows more than its system: heights in metres beside feet
    origin = frame_about(geodetic[:: max(1, len(geodetic) // _CHUNK)], height_datum(crs))
    local = np.concatenate([origin.to_local(*geodetic[k : k + _CHUNK].T) for k in ends])
    return origin, Cloud(local, cloud.colors), odd[0]


def _ground(cloud: Cloud) -> Plane | None:
    """The ground in a cloud, z up; None where there is none, as where plants were cut out: leaves are planes, too."""
    try:
        found = fit_ground_plane(cloud.points, up=(0.0, 0.0, 1.0))
    except ReconstructionError:
        return None
    heights = found.heights(cloud.points)
    on = np.abs(heights) <= found.tolerance_m
    cells = np.floor(cloud.points[:, :2] / (_CELL * np.ptp(cloud.points[:, :2], axis=0).max())).astype(np.int64)
    covered = len(np.unique(cells[on], axis=0)) / len(np.unique(cells, axis=0))
    below = float(np.mean(heights < -2.0 * found.tolerance_m))
    green = 0.0
    if cloud.colors is not None:
        green = float(np.mean(excess_green(cloud.colors[on][None]) > EXG_THRESHOLD))
    return found if covered >= _GROUND_COVERS and below <= _MOST_BELOW and green < _MOST_GREEN else None


def _with_volume(
    cloud: Cloud, origin: LocalFrame | None, to_plot: Similarity, bounds: Volume | None, path: Path, said: str
) -> CloudReference:
    if bounds is not None:
        over = (cloud.points[:, :2] >= bounds.lower[:2]) & (cloud.points[:, :2] <= bounds.upper[:2])
        cloud = cloud.select(over.all(axis=1))
        if not len(cloud):
            raise EmptyCloudError("has no points within --bounds", remedy="Check them: metres, plot frame.")
    lower, upper = cloud.bounds()
    diagonal = float(np.linalg.norm(upper - lower))
    if diagonal > _MAX_DIAGONAL_M:
        raise CloudError(
            f"is {diagonal:,.0f} m across, which is no plot",
            remedy="Cut out the plot, and check the unit of its coordinates.",
        )
    ground = _ground(cloud)
    above = cloud if ground is None else cloud.select(ground.heights(cloud.points) > clearance(ground))
    if not len(above):
        above, ground = cloud, None
    plants = above if bounds is None else above.select(bounds.contains(above.points))
    if not len(plants):
        raise EmptyCloudError("has no points within --bounds", remedy="Check them: metres, plot frame.")
    if ground is None:
        about = "no ground was found in it, so all of it is taken for plants"
    else:
        about = (
            f"{len(cloud) - len(above):,} of {len(cloud):,} points are on the ground that was found in it and left out"
        )
    box = "its box, from --bounds" if bounds is not None else "its extent"
    message = f"the reference is the cloud {path.name} alone, {said}, z up: the volume is {box}; {about}"
    volume = bounds or Volume.around(plants.points, margin_m=_MARGIN * diagonal)
    return CloudReference(
        plants, origin, to_plot, volume, ground, (Finding(path.name, "reference-from-cloud", message),), path
    )
