"""What a flight over many plots shows of the whole field: its canopy's heights, its surface, and an orthophoto."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np
import shapely
from scipy.ndimage import distance_transform_edt

from fieldkit.arrays import FloatArray
from fieldkit.clouds import Cloud, read_cloud
from fieldkit.clouds.canopy import Outline
from fieldkit.errors import UsageError
from fieldkit.evaluation.orthophoto import ORTHOPHOTO_FILE, SEAM_PX, write_orthophoto
from fieldkit.evaluation.rasters import (
    CANOPY_FILE,
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
from fieldkit.reconstruction.result import SparseResult
from fieldkit.results.evaluation import CLOUD_FILE, PlotEvaluation
from fieldkit.results.frame import Plane
from fieldkit.runtime.context import Context

ROOM_M = 1.0
"""Width of what is shown about the plots, metres."""
MARGIN_M = 0.2
"""Width about a plot that an orthophoto draws from the plot's photograph: leaves hang over, metres."""
_MOST_CELLS = 1_000_000_000
"""Most cells of a field's raster: 2.5 hectares of 5 mm."""


def write_field(
    folder: Path,
    sparse: SparseResult,
    outlines: Mapping[str, Outline],
    results: Sequence[PlotEvaluation],
    wanted: Rasters,
    context: Context,
) -> None:
    """Write what a flight shows of a field into canopy-height.tif, surface.tif, orthophoto.tif and field.jpg.

    Of canopy-height.tif and surface.tif a plot's cells without plants are its ground, as in its traits; between plots
    there are no heights. field.jpg shows the orthophoto with the plots' outlines, ids and heights. A remark says where
    nothing is written, since there would be too many cells or no plot's ground is known.

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
    frames = {result.name: result.frame for result in results if result.frame is not None}
    grounds = {name: frame.ground for name, frame in frames.items() if frame.ground is not None}
    if not grounds:
        context.progress.note("no rasters: no plot's ground is known")
        return
    level = float(np.median([plane.above(np.array(outlines[name]))[:, 2].mean() for name, plane in grounds.items()]))
    seen_m = [(pose.center[2] - level) / sparse.intrinsics[name].fx for name, pose in sparse.poses.items()]
    cell_m = wanted.cell_m or max(LEAST_SAMPLING_M, round(float(np.median(seen_m)), 3))
    projection = Projection(sparse.frame)
    drawn = {name: projection.shape(shapely.Polygon(outline), level) for name, outline in outlines.items()}
    area = shapely.union_all([*drawn.values()]).convex_hull.buffer(ROOM_M)
    corners = shapely.get_coordinates(area)
    try:
        grid = Grid.about(corners, cell_m, projection.epsg, multiple=SEAM_PX, most=_MOST_CELLS)
    except UsageError as error:  # after hours: the plots' results stay
        context.progress.note(f"no rasters: {error.message}")
        return
    if coarse := coarse_place(sparse.frame):
        context.progress.note(coarse)
    with context.progress.stage("Height models", len(grounds)) as advance:

        def measured() -> Iterator[HeightRasters]:
            for result in results:
                if plane := grounds.get(result.name):
                    cloud = next(file.name for file in result.files if file.name.endswith(CLOUD_FILE))
                    own = drawn[result.name]
                    yield _heights(read_cloud(folder / cloud), plane, own, [*drawn.values(), own], projection, cell_m)
                    advance(1)

        reasons = {name: entry.unknown.get("height_m") for name, entry in traits.items()}
        refused = "; ".join(f"{name}: {reason}" for name, reason in reasons.items() if reason)
        write_heights(folder, grid, measured(), refused)
    above, top = (_squares(folder / name, grid) for name in (CANOPY_FILE, SURFACE_FILE))
    nearest = distance_transform_edt(np.isnan(top), return_distances=False, return_indices=True)
    soil = (top - above)[tuple(nearest)]
    places = projection.to_plot(grid.places(np.where(np.isnan(top), soil, top), SEAM_PX))
    numbers, margins = range(2, len(drawn) + 2), [outline.buffer(MARGIN_M) for outline in drawn.values()]
    # What is in a plot is not of its neighbour's margin.
    owner = grid.painted([area, *margins, *drawn.values()], [1, *numbers, *numbers], SEAM_PX) - 1
    path = folder / ORTHOPHOTO_FILE
    write_orthophoto(path, sparse, folder / SURFACE_FILE, grid, projection, soil, places, owner, context)
    heights = {name: entry.height_m for name, entry in traits.items()}
    write_atomic(folder / FIELD_PICTURE, field_picture(path, drawn, heights))


def _heights(
    plants: Cloud,
    ground: Plane,
    outline: shapely.Geometry,
    painted: Sequence[shapely.Geometry],
    projection: Projection,
    cell_m: float,
) -> HeightRasters:
    """Of a plot, and of what hangs over its outline into no other plot.

    Args:
        plants: of the plot, plot frame.
        ground: below it.
        outline: its own, UTM.
        painted: the outlines of all plots, its own last.
        projection: of the plot frame.
        cell_m: edge of the cells.
    """
    points = projection.to_utm(plants.points)
    grid = Grid.about(np.concatenate([points[:, :2], shapely.get_coordinates(outline)]), cell_m, projection.epsg)
    owner = grid.painted(painted, [*[2] * (len(painted) - 1), 1])
    canopy, surface = np.full((2, grid.rows, grid.columns), np.nan, dtype=np.float32)
    own = grid.places(np.full(owner.shape, np.median(points[:, 2])))[owner == 1]
    canopy[owner == 1] = 0.0
    surface[owner == 1] = projection.to_utm(ground.above(projection.to_plot(own)[:, :2]))[:, 2]
    for values, heights in ((canopy, ground.heights(plants.points)), (surface, points[:, 2])):
        draw(values, grid, points, heights)
        values[owner == 2] = np.nan
    return HeightRaster(grid, canopy), HeightRaster(grid, surface)


def _squares(path: Path, grid: Grid) -> FloatArray:
    """Mean heights in a file in squares of `SEAM_PX` cells; NaN where it has none."""
    import rasterio
    from rasterio.enums import Resampling

    shape = grid.rows // SEAM_PX, grid.columns // SEAM_PX
    with rasterio.open(path) as file:
        heights = file.read(1, out_shape=shape, resampling=Resampling.average, masked=True)
    return np.asarray(heights.filled(np.nan), dtype=np.float64)
