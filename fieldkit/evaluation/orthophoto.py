"""An orthophoto of a field: photographs resampled over the surface of its plants, seams beside its plots.

What a photograph hides behind plants is not looked for: where it looks almost straight down there is little of that.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from fieldkit.arrays import BoolArray, FloatArray, IntArray
from fieldkit.captures import read_image
from fieldkit.evaluation.rasters import CANOPY_FILE, SURFACE_FILE
from fieldkit.evaluation.utm import Grid, Projection, optimized
from fieldkit.geometry import Intrinsics, Pose
from fieldkit.reconstruction.result import SparseResult
from fieldkit.runtime.context import Context

ORTHOPHOTO_FILE = "orthophoto.tif"
MARGIN_M = 0.2
"""Width about a plot that is drawn from the plot's photograph: leaves hang over, metres."""
SEAM_PX = 8
"""Edge of the squares that seams run between, pixels of the orthophoto."""
_SHARPER = 1.25
"""How many times as fine as the orthophoto photographs are resampled from, at most: finer pixels would flicker."""
_MEDIAN_PX = 5
"""Edge of the squares whose median takes stray points and small holes off the surface, pixels."""
_GAIN_SIDE_PX = 500
"""Longer side of the photographs whose brightness is compared."""
_GAIN_BLUR_PX = 9
"""Edge of the squares there that are compared."""
_GAIN_SQUARES = 12
"""Distance between the places that are compared, squares."""
_LARGEST_GAIN = 2.0
"""Largest factor that a photograph is made brighter or darker by."""
_STEEPEST = 1.0
"""Tangent of the largest angle from straight down that a place is shown under: beyond, leaves hide most of it."""
_QUALITY = "90"
"""Of the JPEG compression."""
_TILE = 64
"""Side of what is drawn at once, squares."""
Camera = tuple[Intrinsics, Pose]


def write_orthophoto(
    folder: Path,
    sparse: SparseResult,
    grid: Grid,
    projection: Projection,
    area: shapely.Geometry,
    plots: Sequence[shapely.Geometry],
    context: Context,
) -> None:
    """Write orthophoto.tif, a Cloud Optimized GeoTIFF: RGB with a mask, JPEG within.

    Each plot with its margin is drawn from the photograph that shows all of it and looks at it closest to straight
    down; where none shows all of it, from few. The rest is drawn from the photograph that looks straightest down on it,
    which is that of the nearest centre. Photographs are made equally bright by a factor each.

    Args:
        folder: with canopy-height.tif and surface.tif; where they have no heights the nearest ground goes on.
        sparse: the mapped flight.
        grid: of all three files; its sides are multiples of `SEAM_PX`.
        projection: of the plot frame.
        area: what is shown, UTM.
        plots: outlines in it.
        context: told of the stage.
    """
    import rasterio
    from rasterio.enums import Resampling

    names = sorted(sparse.poses, key=lambda name: sparse.poses[name].forward[2])
    # What is in a plot is not of its neighbour's margin.
    painted = [area, *(outline.buffer(MARGIN_M) for outline in plots), *plots]
    owner = grid.painted(painted, [0, *2 * list(range(1, len(plots) + 1))], SEAM_PX, beyond=-1)
    profile = {"count": 4, "dtype": "uint8", "photometric": "RGB", "alpha": "YES", "interleave": "pixel"}
    with (
        rasterio.open(folder / CANOPY_FILE) as canopy,
        rasterio.open(folder / SURFACE_FILE) as surface,
        optimized(folder / ORTHOPHOTO_FILE, grid, profile, COMPRESS="JPEG", QUALITY=_QUALITY) as file,
    ):
        mean = {"out_shape": owner.shape, "resampling": Resampling.average, "masked": True}
        above, top = (raster.read(1, **mean).filled(np.nan).astype(np.float64) for raster in (canopy, surface))
        nearest = distance_transform_edt(np.isnan(top), return_distances=False, return_indices=True)
        soil = (top - above)[tuple(nearest)]
        places = projection.to_plot(grid.places(np.where(np.isnan(top), soil, top), SEAM_PX))
        shown = seams([(sparse.intrinsics[name], sparse.poses[name]) for name in names], places, owner)
        used = np.unique(shown[shown >= 0]).tolist()
        gains = _gains(sparse, [names[index] for index in used], places[::_GAIN_SQUARES, ::_GAIN_SQUARES])
        with context.progress.stage("Orthophoto", len(used)) as advance:
            for index, gain in zip(used, gains, strict=True):
                name, own = names[index], shown == index
                photo, high_m = sparse.capture.photo(name), sparse.poses[name].center[2] - np.median(places[own][:, 2])
                share = min(1.0, _SHARPER * high_m / (sparse.intrinsics[name].fx * grid.cell_m))
                read_px = round(share * max(photo.width, photo.height))
                image = cv2.convertScaleAbs(read_image(photo, max_side=read_px), alpha=gain)
                for part, squares in _tiles(grid, own):
                    window = grid.window(part)
                    here, bare = (of[squares].repeat(SEAM_PX, axis=0).repeat(SEAM_PX, axis=1) for of in (own, soil))
                    read = surface.read(1, window=window, masked=True).filled(np.nan)
                    rough = np.where(np.isfinite(read), read, bare).astype(np.float32)
                    smooth = np.asarray(cv2.medianBlur(rough, _MEDIAN_PX), dtype=np.float64)
                    drawn = _resampled(
                        image, sparse, name, projection.to_plot(part.places(smooth)), cv2.BORDER_REPLICATE
                    )
                    drawn = np.dstack([drawn, np.full(here.shape, 255, dtype=np.uint8)]).transpose(2, 0, 1)
                    file.write(np.where(here, drawn, file.read(window=window)), window=window)
                advance(1)


def seams(cameras: Sequence[Camera], places: FloatArray, owner: IntArray) -> IntArray:
    """(rows, columns) which photograph each square of a field is drawn from; −1 where none shows it.

    Args:
        cameras: of the photographs.
        places: (rows, columns, 3) the squares' middles, in the cameras' frame.
        owner: (rows, columns) number of the plot that a square is of, from 1; 0 between plots, −1 beyond the field.
    """
    shown = np.full(owner.shape, -1, dtype=np.int64)
    least = np.where(owner < 0, 0.0, _STEEPEST**2)
    for index, (camera, pose) in enumerate(cameras):
        slope = _slope(pose, places)
        better = slope < least
        better[better] = camera.sees(places[better], pose)
        shown[better], least[better] = index, slope[better]
    for number in range(1, owner.max() + 1):
        own = owner == number
        while own.any():
            middle = places[own].mean(axis=0)
            slopes = np.array([_slope(pose, middle) for _, pose in cameras])
            straightest = np.argsort(slopes, kind="stable")[: np.count_nonzero(slopes < _STEEPEST**2)].tolist()
            seen = {k: cameras[k][0].sees(places[own], cameras[k][1]) for k in straightest}
            best = max(seen, key=lambda k: np.count_nonzero(seen[k]), default=-1)  # of equal ones the first
            if best < 0 or not seen[best].any():
                break
            shown[own] = np.where(seen[best], best, shown[own])
            own[own] = ~seen[best]
    return shown


def _slope(pose: Pose, places: FloatArray) -> NDArray[Any]:
    """Squared tangent of the angle from straight down at which a camera looks at places (..., 3)."""
    x, y, z = np.moveaxis(places - pose.center, -1, 0)
    return np.asarray(np.where(z < 0.0, (x**2 + y**2) / z**2, np.inf))


def _gains(sparse: SparseResult, names: Sequence[str], places: FloatArray) -> FloatArray:
    """Factors (photographs,) that make photographs equally bright where they show the same places (rows, columns, 3).

    Least squares of the logarithms: brightness = place · photograph.
    """
    rows = []
    for name in names:
        image = cv2.blur(
            read_image(sparse.capture.photo(name), max_side=_GAIN_SIDE_PX, gray=True), (_GAIN_BLUR_PX,) * 2
        )
        logs = np.log(np.maximum(image, 1).astype(np.float32))
        rows.append(_resampled(logs, sparse, name, places, cv2.BORDER_CONSTANT).reshape(-1))
    values = np.ma.masked_invalid(rows)
    known = (~np.ma.getmaskarray(values)).astype(np.float64)
    off = (values - values.mean(axis=0)).sum(axis=1).filled(0.0)
    equations = np.diag(known.sum(axis=1) + 1.0) - known / np.maximum(known.sum(axis=0), 1.0) @ known.T
    gains: FloatArray = np.exp(-np.linalg.solve(equations, off))
    return np.clip(gains, 1.0 / _LARGEST_GAIN, _LARGEST_GAIN)


def _resampled(image: NDArray[Any], sparse: SparseResult, name: str, places: FloatArray, border: int) -> NDArray[Any]:
    """Pixels of a photograph, of whatever size, at places (rows, columns, 3)."""
    local = sparse.poses[name].to_camera(places.reshape(-1, 3))
    pixels = sparse.intrinsics[name].scaled(image.shape[1], image.shape[0]).project(local) - 0.5
    x, y = pixels.astype(np.float32).T.reshape(2, *places.shape[:2])
    return cv2.remap(image, x, y, cv2.INTER_LINEAR, borderMode=border, borderValue=np.nan)


def _tiles(grid: Grid, own: BoolArray) -> Iterator[tuple[Grid, tuple[slice, slice]]]:
    """Parts of a field with squares that are a photograph's own: their pixels, and which squares they are."""
    for top, left in np.ndindex(*(-(-count // _TILE) for count in own.shape)):
        squares = slice(_TILE * top, _TILE * (top + 1)), slice(_TILE * left, _TILE * (left + 1))
        rows, columns = (SEAM_PX * count for count in own[squares].shape)
        at = grid.left + SEAM_PX * squares[1].start, grid.top + SEAM_PX * squares[0].start
        if own[squares].any():
            yield replace(grid, left=at[0], top=at[1], columns=columns, rows=rows), squares
