"""What a flight over many plots shows of the whole field: its canopy's heights, its surface, and an orthophoto."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import shapely

from fieldkit.clouds import Cloud, read_cloud
from fieldkit.clouds.canopy import Outline
from fieldkit.evaluation.orthophoto import ORTHOPHOTO_FILE, SEAM_PX, write_orthophoto
from fieldkit.evaluation.rasters import (
    LEAST_SAMPLING_M,
    HeightRaster,
    HeightRasters,
    Rasters,
    draw,
    require_rasters,
    write_heights,
)
from fieldkit.evaluation.utm import Grid, Projection
from fieldkit.files import write_atomic
from fieldkit.pictures.field import field_picture
from fieldkit.reconstruction.result import SparseResult
from fieldkit.results.evaluation import CLOUD_FILE, FIELD_PICTURE, PlotEvaluation
from fieldkit.results.frame import Plane
from fieldkit.runtime.context import Context

ROOM_M = 1.0
"""Width of what is shown about the plots, metres."""
_MOST_CELLS = 1e9
"""Most cells of a field's raster: 2.5 hectares of 5 mm. Where there would be more, they are larger."""


def write_field(
    folder: Path,
    sparse: SparseResult,
    outlines: Mapping[str, Outline],
    results: Sequence[PlotEvaluation],
    wanted: Rasters,
    context: Context,
) -> Outline:
    """Write what a flight shows of a field into canopy-height.tif, surface.tif, orthophoto.tif and field.jpg.

    Of canopy-height.tif and surface.tif a plot's cells without plants are its ground, as in its traits; between plots
    there are no heights. field.jpg shows the orthophoto with the plots' outlines, ids and heights. Nothing is written
    where no plot's ground is known, which a remark says.

    Args:
        folder: of the evaluation, with the plots' clouds.
        sparse: the mapped flight, georeferenced.
        outlines: by plot, plot frame.
        results: of the plots.
        wanted: edge of cells and pixels.
        context: told of the stages.

    Returns:
        The corners of field.jpg, plot frame, counter-clockwise from the lower right; none where nothing is written.
    """
    require_rasters(sparse.frame)
    frames = {result.name: result.frame for result in results if result.frame is not None}
    grounds = {name: frame.ground for name, frame in frames.items() if frame.ground is not None}
    if not grounds:
        context.progress.note("no rasters: no plot's ground is known")
        return ()
    level = float(np.median([plane.above(np.array(outlines[name]))[0, 2] for name, plane in grounds.items()]))
    projection, shown = Projection(sparse.frame), [result.name for result in results if result.images > 1]
    plots = {name: projection.shape(shapely.Polygon(outlines[name]), level) for name in shown}
    area = shapely.union_all([*plots.values()]).convex_hull.buffer(ROOM_M)
    pixels = [result.dense.pixel_m or 0.0 for result in results if result.dense is not None]
    cell_m = wanted.cell_m or round(max([LEAST_SAMPLING_M, *pixels]), 3)
    cell_m = max(cell_m, round(math.sqrt(area.envelope.area / _MOST_CELLS), 3))
    grid = Grid.about(shapely.get_coordinates(area), cell_m, projection.epsg, SEAM_PX)
    traits = {result.name: result.traits for result in results if result.traits is not None}
    reasons = {name: entry.unknown.get("height_m") for name, entry in traits.items()}
    clouds = {result.name: file.name for result in results for file in result.files if file.name.endswith(CLOUD_FILE)}
    with context.progress.stage("Height models"):
        write_heights(
            folder,
            grid,
            (
                _heights(read_cloud(folder / clouds[name]), plane, [*plots.values(), plots[name]], projection, cell_m)
                for name, plane in grounds.items()
            ),
            "; ".join(f"{name}: {reason}" for name, reason in reasons.items() if reason),
        )
    write_orthophoto(folder, sparse, grid, projection, area, [*plots.values()], context)
    heights = {name: entry.height_m for name, entry in traits.items()}
    picture, shape = field_picture(folder / ORTHOPHOTO_FILE, plots, heights)
    write_atomic(folder / FIELD_PICTURE, picture)
    corners = projection.to_plot(shapely.get_coordinates(shapely.force_3d(shape, level), include_z=True)[:4])
    return tuple((float(x), float(y)) for x, y, _ in corners)


def _heights(
    plants: Cloud, ground: Plane, outlines: Sequence[shapely.Geometry], projection: Projection, cell_m: float
) -> HeightRasters:
    """Of a plot, and of what hangs over its outline into no other plot. Its outline is the last of all, in UTM."""
    points, corners = projection.to_utm(plants.points), shapely.get_coordinates(outlines[-1])
    grid = Grid.about(np.concatenate([points[:, :2], corners]), cell_m, projection.epsg)
    owner = grid.painted(outlines, [*[2] * (len(outlines) - 1), 1])
    canopy, surface = np.full((2, grid.rows, grid.columns), np.nan, dtype=np.float32)
    own = projection.to_plot(grid.places(np.full(owner.shape, np.median(points[:, 2])))[owner == 1])
    canopy[owner == 1], surface[owner == 1] = 0.0, projection.to_utm(ground.above(own[:, :2]))[:, 2]
    for values, heights in ((canopy, ground.heights(plants.points)), (surface, points[:, 2])):
        draw(values, grid, points, heights)
        values[owner == 2] = np.nan
    return HeightRaster(grid, canopy), HeightRaster(grid, surface)
