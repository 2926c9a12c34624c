"""Georeferenced plots in UTM: clouds as LAZ, and height models of the canopy and the surface as rasters."""

from __future__ import annotations

import importlib.util
from collections.abc import Iterable
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from fieldkit.arrays import Float32Array, FloatArray
from fieldkit.clouds import Cloud, write_cloud
from fieldkit.errors import UsageError
from fieldkit.evaluation.utm import Grid, Projection, optimized
from fieldkit.files import write_atomic
from fieldkit.geometry import Similarity
from fieldkit.reconstruction.agreement import POSITION_SIGMAS
from fieldkit.reconstruction.result import MetricFrame, Reconstruction
from fieldkit.results.traits import TraitsEntry
from fieldkit.runtime.progress import Progress

CANOPY_FILE, SURFACE_FILE = "canopy-height.tif", "surface.tif"

COARSE_M = 0.3
"""Standard deviation of positions from which they do not say on which plot something lies."""
_RASTERS_OFF = "the rasters may lie that far off, the surface's heights too"
LEAST_SAMPLING_M = 0.005
"""Edge of a cell where nobody gives one, or the depth maps' pixel where that is larger."""
MOST_CELLS = 100_000_000
"""Most cells of a plot's raster."""
NODATA = -9999.0
"""Value of a cell without a height."""
REFUSED_TAG = "height_refused"
"""Of a canopy's raster: why the traits of its plot give no height."""
_COLORED_PX = 2000
"""Longer side of the copy of a raster that its colours are chosen by, cells."""
_CANOPY_COLORS = ("#f7fcb9", "#addd8e", "#41ab5d", "#006837", "#00331b")
_SURFACE_COLORS = ("#543005", "#bf812d", "#f6e8c3", "#80cdc1", "#003c30")


@dataclass(frozen=True)
class Rasters:
    """That rasters are to be written."""

    cell_m: float | None = None
    """Edge of their cells; None takes `LEAST_SAMPLING_M`, or the depth maps' pixel where that is larger."""
    at_origin: bool = False
    """Put the plot frame's origin at that of the positions' frame, sideways, since the positions are too coarse to say
    where it lies."""


@dataclass(frozen=True, eq=False)
class HeightRaster:
    """Heights on a grid of UTM."""

    grid: Grid
    heights: Float32Array
    """(rows, columns), metres; NaN where nothing was seen."""


HeightRasters = tuple[HeightRaster, HeightRaster]
"""A canopy above the ground, and its surface above the datum of the frame's origin, on one grid."""


def to_utm(cloud: Cloud, frame: MetricFrame) -> tuple[Cloud, int]:
    """A cloud of the plot frame in WGS 84 / UTM, and the zone's EPSG code.

    Heights keep the datum of the frame's origin. Normals are turned by the plot frame's rotation only; the meridian
    convergence (under 3° within a zone) is left out of them.
    """
    projection = Projection(frame)
    turned = cloud.transformed(frame.plot_from_source.inverse())
    return replace(turned, points=projection.to_utm(cloud.points)), projection.epsg


def write_georeferenced(path: Path, cloud: Cloud, frame: MetricFrame, progress: Progress) -> bool:
    """Write a cloud as LAZ in its UTM zone where it has one; returns whether it did."""
    if frame.origin is None or len(cloud) == 0:
        return False
    if any(importlib.util.find_spec(name) is None for name in ("laspy", "lazrs", "pyproj")):
        progress.note(f"{path.name} is not written: install the extra, pip install 'fieldkit[geo]'")
        return False
    try:
        moved, epsg = to_utm(cloud, frame)
    except ValueError as error:  # UTM ends at 84° north and 80° south
        progress.note(f"{path.name} is not written: {error}")
        return False
    write_cloud(path, moved, crs_epsg=epsg)
    return True


def require_rasters(frame: MetricFrame | None = None) -> None:
    """Refuse rasters where they cannot be written."""
    if any(importlib.util.find_spec(name) is None for name in ("rasterio", "pyproj")):
        raise UsageError("rasters need the extra 'geo'", remedy="pip install 'fieldkit[geo]', or do without rasters.")
    if frame is not None and frame.origin is None:
        raise UsageError(
            "the plot has no place on Earth, since its positions are not geographic",
            remedy="Give photographs with GPS tags or a geo.txt, or do without rasters.",
        )


def height_rasters(plants: Cloud, scene: Cloud, frame: MetricFrame, cell_m: float) -> HeightRasters:
    """Heights of a plot's canopy and surface.

    Of plants it is that of the highest point in a cell. Where only ground was seen a canopy has 0; a surface has the
    median of the ground's points, since a cloud of everything has points that float above bare soil.

    Args:
        plants: above the ground, plot frame; not empty.
        scene: with the ground, plot frame.
        frame: georeferenced, with a ground.
        cell_m: edge of the cells.
    """
    if frame.ground is None:
        raise UsageError("there is no canopy height: no ground was found", remedy="Leave --rasters out.")
    (standing, epsg), (everything, _) = (to_utm(cloud, frame) for cloud in (plants, scene))
    grid = Grid.about(np.concatenate([standing.points, everything.points]), cell_m, epsg)
    if grid.rows * grid.columns > MOST_CELLS:
        raise UsageError(
            f"a raster of {grid.columns} × {grid.rows} cells of {1000 * cell_m:g} mm is too large",
            remedy="Give larger cells with --gsd.",
        )
    canopy, surface = np.full((2, grid.rows, grid.columns), np.nan, dtype=np.float32)
    draw(canopy, grid, everything.points, np.zeros(len(scene)))  # stones and dead leaves are no plants
    draw(surface, grid, everything.points, everything.points[:, 2], 0.5)
    draw(canopy, grid, standing.points, frame.ground.heights(plants.points))  # plants stand above the ground
    draw(surface, grid, standing.points, standing.points[:, 2])
    return HeightRaster(grid, canopy), HeightRaster(grid, surface)


def draw(values: Float32Array, grid: Grid, utm: FloatArray, heights: FloatArray, share: float = 1.0) -> None:
    """Give each cell that has any of some places (n, 3) that quantile of their heights (n,): 1 the highest."""
    row, column = grid.cells(utm)
    place = row * grid.columns + column
    order = np.lexsort((heights, place))
    where, first, count = np.unique(place[order], return_index=True, return_counts=True)
    values.reshape(-1)[where] = heights[order][first + ((count - 1) * share).astype(int)]


def write_rasters(folder: Path, found: Reconstruction, wanted: Rasters, traits: TraitsEntry | None = None) -> list[str]:
    """Write both rasters of a reconstruction with a scene, and their styles; returns the files' names.

    Where ``traits`` refuse the plants' height, the canopy's raster says so.
    """
    frame, scene = found.sparse.frame, found.scene
    require_rasters(frame)
    if wanted.at_origin:
        motion = frame.plot_from_source
        motion = Similarity(motion.scale, motion.rotation, motion.translation * (0, 0, 1))
        frame = replace(frame, plot_from_source=motion)
    if scene is None:
        raise ValueError("rasters need the scene")
    cell_m = wanted.cell_m or max(LEAST_SAMPLING_M, round(found.pixel_m, 3))
    rasters = height_rasters(found.plants, scene, frame, cell_m)
    refused = "" if traits is None else traits.unknown.get("height_m", "")
    return write_heights(folder, rasters[0].grid, [rasters], refused)


def write_heights(folder: Path, grid: Grid, plots: Iterable[HeightRasters], refused: str = "") -> list[str]:
    """Write the rasters of one or many plots as one Cloud Optimized GeoTIFF each, with QGIS styles; the files' names.

    Float32 metres, nodata −9999, deflate, tiles and overviews (average) within the file. Where plots overlap the
    highest counts.

    Args:
        folder: that they are written into.
        grid: of the files; the plots' lie within.
        plots: one at a time in memory.
        refused: why plants may be higher than the canopy's says: the reason that the traits give instead of a height.
            It goes into the band's description and the tag `REFUSED_TAG`.
    """
    require_rasters()
    names = (CANOPY_FILE, SURFACE_FILE)
    folder.mkdir(parents=True, exist_ok=True)
    with ExitStack() as stack:
        profile = {"count": 1, "dtype": "float32", "nodata": NODATA}
        rasters = (
            optimized(folder / name, grid, profile, COMPRESS="DEFLATE", PREDICTOR="FLOATING_POINT") for name in names
        )
        files = [stack.enter_context(raster) for raster in rasters]
        for plot in plots:
            for file, raster in zip(files, plot, strict=True):
                window = grid.window(raster.grid)
                highest = np.fmax(file.read(1, window=window, masked=True).filled(np.nan), raster.heights)
                file.write(np.where(np.isfinite(highest), highest, np.float32(NODATA)), 1, window=window)
        for name, file in zip(names, files, strict=True):
            canopy = name == CANOPY_FILE
            least = f", AT LEAST: {refused}" if refused else ""
            file.set_band_description(1, f"canopy height, m{least}" if canopy else "surface height, m")
            file.update_tags(units="metre", **({REFUSED_TAG: refused} if refused and canopy else {}))
            share = min(1.0, _COLORED_PX / max(file.shape))
            small = file.read(1, out_shape=tuple(max(1, int(share * side)) for side in file.shape), masked=True)
            write_style(folder / name, color_span(small.filled(np.nan), canopy=canopy), canopy=canopy)
    return [name for file in names for name in (file, Path(file).with_suffix(".qml").name)]


def coarse_place(frame: MetricFrame, so: str = _RASTERS_OFF) -> str:
    """That positions may lie metres off, and what follows (``so``); empty where they do not."""
    sigma_m = (frame.bound_m or 0.0) / POSITION_SIGMAS
    if sigma_m <= COARSE_M:
        return ""
    return f"positions are good to {sigma_m:.1f} m only: {so}"


def color_span(heights: Float32Array, *, canopy: bool) -> tuple[float, float]:
    """Heights between which a raster's colours lie, metres: from 0 to the highest of a canopy, 96 % of a surface's."""
    known = heights[np.isfinite(heights)]
    if not len(known):
        return 0.0, 0.0
    low, high = (0.0, known.max()) if canopy else np.quantile(known, [0.02, 0.98])
    return float(low), float(high)


def write_style(path: Path, span: tuple[float, float], *, canopy: bool) -> None:
    """Write the QGIS style of a raster beside it."""
    low, high = span
    text = style_text(low, max(high, low + 0.01), _CANOPY_COLORS if canopy else _SURFACE_COLORS)
    write_atomic(path.with_suffix(".qml"), text)


def style_text(low: float, high: float, colors: tuple[str, ...]) -> str:
    """A QGIS style: colours between two heights, with a legend in metres.

    Without its colour ramp the style would be lost at the first change in QGIS. Older QGIS reads the ramp's
    properties from ``prop`` elements, newer from ``Option`` elements.
    """
    shares = np.linspace(0.0, 1.0, len(colors))
    channels = [",".join(str(v) for v in (*bytes.fromhex(color[1:]), 255)) for color in colors]
    stops = ":".join(f"{share:g};{channel}" for share, channel in list(zip(shares, channels, strict=True))[1:-1])
    properties = (("color1", channels[0]), ("color2", channels[-1]), ("discrete", "0"), ("stops", stops))
    options = "".join(f'<Option type="QString" name="{name}" value="{text}"/>' for name, text in properties)
    props = "".join(f'<prop k="{name}" v="{text}"/>' for name, text in properties)
    items = "".join(
        f'<item value="{value:.3f}" label="{value:.2f} m" color="{color}" alpha="255"/>'
        for value, color in zip(low + shares * (high - low), colors, strict=True)
    )
    span = f'{{0}}="{low:.3f}" {{1}}="{high:.3f}"'
    return (
        "<!DOCTYPE qgis PUBLIC 'http://mrcc.com/qgis.dtd' 'SYSTEM'>\n"
        '<qgis version="3.22"><pipe><rasterrenderer type="singlebandpseudocolor" band="1" opacity="1" alphaBand="-1" '
        f"{span.format('classificationMin', 'classificationMax')}><rastershader>"
        '<colorrampshader colorRampType="INTERPOLATED" classificationMode="1" clip="0" '
        f"{span.format('minimumValue', 'maximumValue')}>"
        f'<colorramp type="gradient" name="[source]"><Option type="Map">{options}</Option>{props}</colorramp>{items}'
        '<rampLegendSettings useContinuousLegend="1" suffix=" m" orientation="2" direction="0"/>'
        "</colorrampshader></rastershader></rasterrenderer></pipe></qgis>\n"
    )
