"""An orthophoto of a field: photographs resampled over the surface of its plants, seams beside its plots.

What a photograph hides behind plants is not looked for: where it looks almost straight down there is little of that.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.ndimage import find_objects

from fieldkit.arrays import BoolArray, FloatArray, IntArray
from fieldkit.captures import read_image
from fieldkit.evaluation.utm import BLOCK, Grid, Projection, optimized
from fieldkit.geometry import Intrinsics, Pose
from fieldkit.reconstruction.result import SparseResult
from fieldkit.runtime.context import Context

ORTHOPHOTO_FILE = "orthophoto.tif"
SEAM_PX = 8
"""Edge of the squares that seams run between, pixels of the orthophoto."""
MARGIN_M = 0.2
"""Width about a plot that is drawn from its photograph: leaves hang over, metres."""
_SHARPER = 1.25
"""How many times as fine as the orthophoto photographs are resampled from, at most: finer pixels would flicker."""
_GAIN_SIDE_PX = 500
"""Longer side of the photographs whose brightness is compared."""
_GAIN_BLUR_PX = 9
"""Edge of the squares there that are compared."""
_GAIN_STEP_M = 0.5
"""Distance between the places that are compared, metres."""
_LARGEST_GAIN = 2.0
"""Largest factor that a photograph is made brighter or darker by."""
_STEEPEST = 1.0
"""Tangent of the largest angle from straight down that a place is shown under: beyond, leaves hide most of it."""
_QUALITY = 90
"""Of the JPEG compression."""
_TILE = 2 * BLOCK // SEAM_PX
"""Side of what is drawn at once, squares."""
Camera = tuple[Intrinsics, Pose]
Region = tuple[slice, slice]


@dataclass(frozen=True, eq=False)
class Field:
    """The surface of a field in squares of `SEAM_PX` pixels, and its plots."""

    grid: Grid
    """Of the orthophoto; its sides are multiples of `SEAM_PX`."""
    places: FloatArray
    """(rows + 2, columns + 2, 3) of the squares' middles in the plot frame, metres; one square more on each side."""
    outside: BoolArray
    """(rows, columns) which are not of the field."""
    plots: Sequence[shapely.Polygon]
    """UTM."""
    projection: Projection

    @property
    def squares(self) -> FloatArray:
        """(rows, columns, 3) `places` without those beyond."""
        return self.places[1:-1, 1:-1]

    def near(self, pose: Pose) -> Region:
        """Rows and columns of the squares that a camera may show steeply enough."""
        reach = _STEEPEST * max(0.0, pose.center[2] - float(self.places[..., 2].min())) / self.grid.cell_m
        (row,), (column,) = self.grid.cells(self.projection.to_utm(pose.center[None]))
        rows, columns = (slice(*np.maximum(0, [at - reach, at + reach]).astype(int) // SEAM_PX) for at in (row, column))
        return rows, columns

    def painted(self) -> IntArray:
        """(rows, columns) number of the plot that a square is of, from 1; 0 between plots and their margins."""
        shapes = [plot.buffer(width) for width in (MARGIN_M, 0.0) for plot in self.plots]
        # What is in a plot is not of its neighbour's margin.
        return self.grid.painted(shapes, [*range(1, len(self.plots) + 1)] * 2, SEAM_PX)


def write_orthophoto(path: Path, sparse: SparseResult, field: Field, context: Context) -> list[str]:
    """Write an orthophoto as a Cloud Optimized GeoTIFF: RGB with a mask, JPEG within.

    Each plot with its margin is drawn from the photograph that shows all of it and looks at it closest to straight
    down; where none shows all of it, from few. The rest is drawn from the photograph that looks straightest down on it,
    which is that of the nearest centre. Photographs are made equally bright by a factor each.

    Args:
        path: of the file.
        sparse: the mapped flight.
        field: what is shown.
        context: told of the stage.

    Returns:
        The photographs that were used.
    """
    names = sorted(sparse.poses, key=lambda name: sparse.poses[name].forward[2])
    cameras = [(sparse.intrinsics[name], sparse.poses[name]) for name in names]
    shown = seams(cameras, field)
    regions = {index: region for index, region in enumerate(find_objects(shown + 1)) if region is not None}
    step = max(1, round(_GAIN_STEP_M / (SEAM_PX * field.grid.cell_m)))
    gains = _gains(sparse, [names[index] for index in regions], field.squares[::step, ::step].reshape(-1, 3))
    options = {"count": 4, "dtype": "uint8", "photometric": "RGB", "alpha": "YES", "interleave": "pixel"}
    weights = [float(np.count_nonzero(shown[region] == index)) for index, region in regions.items()]
    stage = context.progress.stage("Orthophoto", len(regions), weights=weights)
    with optimized(path, field.grid, **options, COMPRESS="JPEG", QUALITY=str(_QUALITY)) as file, stage as advance:
        for (index, region), gain in zip(regions.items(), gains, strict=True):
            _draw(file, sparse, names[index], shown == index, region, gain, field)
            advance(1)
    return [names[index] for index in regions]


def seams(cameras: Sequence[Camera], field: Field) -> IntArray:
    """(rows, columns) which photograph each square of a field is drawn from; −1 where none shows it.

    Args:
        cameras: of the photographs; those first that look straightest down.
        field: its surface and plots.
    """
    shown = np.full(field.outside.shape, -1, dtype=np.int64)
    least = np.where(field.outside, 0.0, _STEEPEST**2).astype(np.float32)
    for index, (camera, pose) in enumerate(cameras):
        near = field.near(pose)
        places, slope = field.squares[near], _slope(pose, field.squares[near])
        better = slope < least[near]
        better[better] = camera.sees(pose.to_camera(places[better]))
        shown[near][better], least[near][better] = index, slope[better]
    painted = field.painted()
    for number in range(1, len(field.plots) + 1):
        own = np.column_stack(np.nonzero(painted == number))
        while len(own):
            places = field.squares[own[:, 0], own[:, 1]]
            best, seen = _showing(cameras, places)
            if not seen.any():
                break
            shown[own[seen, 0], own[seen, 1]] = best
            own = own[~seen]
    return shown


def _showing(cameras: Sequence[Camera], places: FloatArray) -> tuple[int, BoolArray]:
    """The photograph that shows most of some places (n, 3), of equal ones that which looks straightest down; which."""
    slopes = np.array([_slope(pose, places.mean(axis=0)) for _, pose in cameras])
    best, seen = -1, np.zeros(len(places), dtype=np.bool_)
    for index in np.argsort(slopes, kind="stable")[: np.count_nonzero(slopes < _STEEPEST**2)]:
        camera, pose = cameras[index]
        own = camera.sees(pose.to_camera(places))
        if own.sum() > seen.sum():
            best, seen = int(index), own
        if seen.all():
            break
    return best, seen


def _slope(pose: Pose, places: NDArray[Any]) -> NDArray[Any]:
    """Squared tangent of the angle from straight down at which a camera looks at places (..., 3)."""
    away = places - pose.center
    slope = (away[..., 0] ** 2 + away[..., 1] ** 2) / away[..., 2] ** 2
    return np.asarray(np.where(away[..., 2] < 0.0, slope, np.inf))


def _gains(sparse: SparseResult, names: Sequence[str], places: FloatArray) -> FloatArray:
    """Factors (photographs,) that make photographs equally bright where they show the same places (n, 3).

    Least squares of the logarithms: brightness = place · photograph.
    """
    logs = np.full((len(names), len(places)), np.nan)
    for row, name in zip(logs, names, strict=True):
        image = cv2.blur(
            read_image(sparse.capture.photo(name), max_side=_GAIN_SIDE_PX, gray=True), (_GAIN_BLUR_PX,) * 2
        )
        camera = sparse.intrinsics[name].scaled(image.shape[1], image.shape[0])
        local = sparse.poses[name].to_camera(places)
        seen = camera.sees(local)
        column, line = np.minimum(camera.project(local[seen]).astype(int), (camera.width - 1, camera.height - 1)).T
        row[seen] = np.log(np.maximum(image[line, column], 1))
    known = np.isfinite(logs)
    weights = known / np.maximum(known.sum(axis=0), 1)  # of each photograph in a place's mean
    values = np.where(known, logs, 0.0)
    off = np.where(known, logs - (weights * values).sum(axis=0), 0.0)
    equations = np.diag(known.sum(axis=1) + 1.0) - weights @ known.T
    gains: FloatArray = np.exp(-np.linalg.solve(equations, off.sum(axis=1)))
    return np.clip(gains, 1.0 / _LARGEST_GAIN, _LARGEST_GAIN)


def _draw(
    file: Any, sparse: SparseResult, name: str, own: BoolArray, region: Region, gain: float, field: Field
) -> None:
    """Draw the squares that are a photograph's ``own`` (rows, columns); all are within ``region``."""
    from rasterio.windows import Window

    pose, photo = sparse.poses[name], sparse.capture.photo(name)
    pixel_m = (pose.center[2] - float(np.median(field.squares[own][:, 2]))) / sparse.intrinsics[name].fx
    side = max(photo.width, photo.height) * min(1.0, _SHARPER * pixel_m / field.grid.cell_m)
    image = cv2.convertScaleAbs(read_image(photo, max_side=round(side)), alpha=gain)
    camera = sparse.intrinsics[name].scaled(image.shape[1], image.shape[0])
    for rows, columns in _tiles(region):
        squares = own[rows, columns]
        if not squares.any():
            continue
        height, width = squares.shape
        around = field.places[rows.start : rows.stop + 2, columns.start : columns.stop + 2]
        fine = cv2.resize(around, None, fx=SEAM_PX, fy=SEAM_PX, interpolation=cv2.INTER_LINEAR)
        fine = fine[SEAM_PX:-SEAM_PX, SEAM_PX:-SEAM_PX]
        local = pose.to_camera(np.asarray(fine, dtype=np.float64).reshape(-1, 3))
        x, y = (camera.project(local).T.reshape(2, *fine.shape[:2]) - 0.5).astype(np.float32)
        drawn = cv2.remap(image, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        corner = SEAM_PX * columns.start, SEAM_PX * rows.start
        window = Window(*corner, SEAM_PX * width, SEAM_PX * height)
        colors = np.concatenate([drawn.transpose(2, 0, 1), np.full((1, *drawn.shape[:2]), 255, np.uint8)])
        here = squares.repeat(SEAM_PX, axis=0).repeat(SEAM_PX, axis=1)
        file.write(np.where(here, colors, file.read(window=window)), window=window)


def _tiles(region: Region) -> Iterator[Region]:
    """A region of squares in parts that are read and written at once."""
    rows, columns = (
        [slice(at, min(at + _TILE, part.stop)) for at in range(part.start // _TILE * _TILE, part.stop, _TILE)]
        for part in region
    )
    yield from itertools.product(rows, columns)
