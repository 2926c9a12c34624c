"""What a flight over many plots shows of the whole field: its canopy's heights, its surface, and an orthophoto."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import shapely
from scipy.ndimage import gaussian_filter
from scipy.spatial import cKDTree

from fieldkit.arrays import FloatArray
from fieldkit.clouds import Cloud, read_cloud
from fieldkit.clouds.canopy import Outline
from fieldkit.errors import UsageError
from fieldkit.evaluation.orthophoto import MARGIN_M, ORTHOPHOTO_FILE, SEAM_PX, Field, write_orthophoto
from fieldkit.evaluation.rasters import (
    LEAST_SAMPLING_M,
    SURFACE_FILE,
    HeightRaster,
    HeightRasters,
    Rasters,
    coarse_place,
    draw,
    require_rasters,
    write_heights,
)
from fieldkit.evaluation.utm import Grid, Projection
from fieldkit.files import write_atomic
from fieldkit.pictures.field import FIELD_PICTURE, field_picture
from fieldkit.reconstruction.colmap_model import model_points
from fieldkit.reconstruction.result import SparseResult
from fieldkit.results.evaluation import CLOUD_FILE, PlotEvaluation
from fieldkit.results.frame import Plane
from fieldkit.runtime.context import Context

ROOM_M = 1.0
"""Width of what is shown about the plots, metres."""
_LOW = 0.05
"""Quantile of the sparse points' heights that is the ground's where none was found."""
_SMOOTHED = 1.0
"""Standard deviation of the filter that smooths the surface of an orthophoto, squares: edges of leaves fray else."""
_MOST_CELLS = 1_000_000_000
"""Most cells of a field's raster: 2.5 hectares of 5 mm."""


def write_field(
    folder: Path,
    sparse: SparseResult,
    outlines: Mapping[str, Outline],
    results: Sequence[PlotEvaluation],
    wanted: Rasters,
    context: Context,
) -> list[str]:
    """Write what a flight shows of a field; returns the files' names, none where it would have too many cells.

    Of canopy-height.tif and surface.tif a plot's cells without plants are its ground, as in its traits; between plots
    there are no heights. field.jpg shows orthophoto.tif with the plots' outlines, ids and heights.

    Args:
        folder: of the evaluation, with the plots' clouds.
        sparse: the mapped flight, georeferenced.
        outlines: by plot, plot frame.
        results: of the plots, in that order.
        wanted: edge of cells and pixels.
        context: told of the stages.
    """
    require_rasters(sparse.frame)
    traits = {result.name: result.traits for result in results if result.traits is not None}
    ground, projection = _Ground.of(outlines, results, sparse), Projection(sparse.frame)
    shapes = [shapely.Polygon(outline) for outline in outlines.values()]
    area = shapely.union_all(shapes).convex_hull.buffer(ROOM_M)
    feet = ground.below(shapely.get_coordinates(area))
    level = float(np.median(feet[:, 2]))
    seen_m = [(pose.center[2] - level) / sparse.intrinsics[name].fx for name, pose in sparse.poses.items()]
    cell_m = wanted.cell_m or max(LEAST_SAMPLING_M, round(float(np.median(seen_m)), 3))
    try:
        grid = Grid.about(projection.to_utm(feet), cell_m, projection.epsg, multiple=SEAM_PX, most=_MOST_CELLS)
    except UsageError as error:  # after hours: the plots' results stay
        context.progress.note(f"no rasters: {error.message}")
        return []
    if coarse := coarse_place(sparse.frame):
        context.progress.note(coarse)
    drawn = dict(zip(outlines, (projection.shape(shape, level) for shape in shapes), strict=True))
    with context.progress.stage("Height models", len(results)) as advance:

        def measured() -> Iterator[HeightRasters]:
            for result in results:
                if result.name in ground.planes:
                    cloud = next(file.name for file in result.files if file.name.endswith(CLOUD_FILE))
                    yield _heights(read_cloud(folder / cloud), result.name, ground, drawn, projection, cell_m)
                advance(1)

        reasons = {name: entry.unknown.get("height_m") for name, entry in traits.items()}
        refused = "; ".join(f"{name}: {reason}" for name, reason in reasons.items() if reason)
        names = write_heights(folder, grid, measured(), refused)
    outside = grid.painted([projection.shape(area, level)], [1], SEAM_PX) == 0
    places = _places(folder / SURFACE_FILE, grid, ground, projection)
    field = Field(grid, places, outside, [*drawn.values()], projection)
    write_orthophoto(folder / ORTHOPHOTO_FILE, sparse, field, context)
    heights = {name: entry.height_m for name, entry in traits.items()}
    write_atomic(folder / FIELD_PICTURE, field_picture(folder / ORTHOPHOTO_FILE, drawn, heights))
    return [*names, ORTHOPHOTO_FILE, FIELD_PICTURE]


@dataclass(frozen=True, eq=False)
class _Ground:
    """The ground of a field: of each place that of the nearest plot whose ground is known."""

    planes: Mapping[str, Plane]
    """By plot; of the field under "" where no plot's is known."""
    middles: cKDTree

    @classmethod
    def of(cls, outlines: Mapping[str, Outline], results: Sequence[PlotEvaluation], sparse: SparseResult) -> _Ground:
        frames = {result.name: result.frame for result in results if result.frame is not None}
        planes = {name: frame.ground for name, frame in frames.items() if frame.ground is not None}
        if planes:
            return cls(planes, cKDTree([np.mean(outlines[name], axis=0) for name in planes]))
        low = float(np.quantile(model_points(sparse.model)[:, 2], _LOW))
        return cls({"": sparse.frame.ground or Plane((0.0, 0.0, 1.0), low, 0.0, 0.0, 0.0)}, cKDTree(np.zeros((1, 2))))

    def below(self, places: FloatArray) -> FloatArray:
        """Points (n, 3) of the ground at places (n, 2 or more), plot frame."""
        nearest, feet = self.middles.query(places[:, :2])[1], np.empty((len(places), 3))
        for number, plane in enumerate(self.planes.values()):
            feet[nearest == number] = plane.above(places[nearest == number, :2])
        return feet


def _heights(
    plants: Cloud,
    name: str,
    ground: _Ground,
    outlines: Mapping[str, shapely.Geometry],
    projection: Projection,
    cell_m: float,
) -> HeightRasters:
    """Of a plot, and of what hangs over its outline into no other plot. Outlines are in UTM."""
    plane, outline = ground.planes[name], outlines[name]
    grid = Grid.about(shapely.get_coordinates(outline.buffer(MARGIN_M)), cell_m, projection.epsg)
    owner = grid.painted([*outlines.values(), outline], [*[2] * len(outlines), 1])
    points = projection.to_utm(plants.points)
    within, own = grid.holds(points), owner == 1
    canopy, surface = np.full((2, grid.rows, grid.columns), np.nan, dtype=np.float32)
    soil = plane.above(projection.to_plot(grid.places(float(np.median(points[:, 2])))[own])[:, :2])
    canopy[own], surface[own] = 0.0, projection.to_utm(soil)[:, 2]
    for values, heights in ((canopy, plane.heights(plants.points)), (surface, points[:, 2])):
        draw(values, grid, points[within], heights[within])
        values[owner == 2] = np.nan
    return HeightRaster(grid, canopy), HeightRaster(grid, surface)


def _places(surface: Path, grid: Grid, ground: _Ground, projection: Projection) -> FloatArray:
    """The squares of a `Field`: on the smoothed surface, and on the ground where the file has none."""
    import rasterio
    from rasterio.enums import Resampling

    with rasterio.open(surface) as file:
        shape = grid.rows // SEAM_PX, grid.columns // SEAM_PX
        read = file.read(1, out_shape=shape, resampling=Resampling.average, masked=True).filled(np.nan)
    utm = grid.places(float(np.nanmedian(read)) if np.isfinite(read).any() else 0.0, SEAM_PX, beyond=1)
    known = np.pad(np.isfinite(read), 1)
    utm[known, 2] = read[known[1:-1, 1:-1]]
    places = projection.to_plot(utm)
    feet = ground.below(places.reshape(-1, 3))[:, 2].reshape(known.shape)
    above = np.where(known, places[..., 2] - feet, 0.0)
    places[..., 2] = feet + gaussian_filter(above, _SMOOTHED)
    return places
