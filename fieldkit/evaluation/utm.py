"""Between a plot frame and UTM, and Cloud Optimized GeoTIFFs on grids in UTM."""

from __future__ import annotations

import tempfile
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from fieldkit.arrays import FloatArray, IntArray
from fieldkit.files import write_atomic
from fieldkit.reconstruction.result import MetricFrame

_BLOCK = 256
"""Side of a raster's blocks, cells."""
_CACHE_MB = 256
"""Memory for blocks of rasters, megabytes: else GDAL takes a twentieth of the machine's."""
_SOUTHERN = 32700
"""EPSG codes of southern zones are above."""


class Projection:
    """Between the plot frame of a georeferenced result and WGS 84 / UTM, exact (PROJ).

    Heights there are above the datum of the frame's origin. Raises ValueError beyond −80…84° of latitude.
    """

    def __init__(self, frame: MetricFrame) -> None:
        from pyproj import Transformer

        if frame.origin is None:
            raise ValueError("the frame is not georeferenced")
        origin, self.epsg = frame.origin, frame.origin.utm_epsg()
        self._motion = frame.plot_from_source
        south = " +south" if self.epsg > _SOUTHERN else ""
        self._proj = Transformer.from_pipeline(
            f"+proj=pipeline +ellps=WGS84 +step +inv +proj=topocentric +lat_0={origin.latitude_deg!r} "
            f"+lon_0={origin.longitude_deg!r} +h_0={origin.altitude_m!r} +step +inv +proj=cart "
            f"+step +proj=utm +zone={self.epsg % 100}{south}"
        )

    def to_utm(self, points: FloatArray) -> FloatArray:
        """Easting, northing and height of points (..., 3) of the plot frame, metres."""
        source = self._motion.inverse().apply(points)
        return np.stack(self._proj.transform(*np.moveaxis(source, -1, 0)), axis=-1)

    def to_plot(self, utm: FloatArray) -> FloatArray:
        """The way back, (..., 3)."""
        east, north, height = np.moveaxis(utm, -1, 0)
        source = self._proj.transform(east, north, height, direction="INVERSE")
        return self._motion.apply(np.stack(source, axis=-1))

    def shape(self, polygon: shapely.Geometry, z: float) -> shapely.Geometry:
        """A polygon of the plot frame, at a height there, in UTM."""
        return shapely.transform(polygon, lambda xy: self.to_utm(np.insert(xy, 2, z, axis=1))[:, :2])


@dataclass(frozen=True)
class Grid:
    """Square cells in UTM, the first the north-western one. Grids of the same cells fit each other."""

    left: int
    """Easting of the outer corner of the first cell, cells."""
    top: int
    """Northing of the same, cells, southwards."""
    columns: int
    rows: int
    cell_m: float
    """Edge of a cell, metres."""
    epsg: int

    @classmethod
    def about(cls, utm: FloatArray, cell_m: float, epsg: int, multiple: int = 1) -> Grid:
        """The least grid with a cell for each of some places (n, 2 or more).

        Args:
            utm: easting, northing, metres.
            cell_m: edge of the cells.
            epsg: of the zone.
            multiple: number of cells of which corner and sides are multiples.
        """
        cells = np.floor(utm[:, :2] * (1.0, -1.0) / (multiple * cell_m)).astype(np.int64)
        left, top, columns, rows = (multiple * np.array([*cells.min(axis=0), *np.ptp(cells, axis=0) + 1])).tolist()
        return cls(left, top, columns, rows, cell_m, epsg)

    def transform(self, step: int = 1) -> Any:
        """From columns and rows of squares of so many cells to easting and northing, as rasterio takes it."""
        from rasterio import Affine

        edge_m = step * self.cell_m
        return Affine(edge_m, 0.0, self.left * self.cell_m, 0.0, -edge_m, -self.top * self.cell_m)

    def window(self, part: Grid) -> Any:
        """Where a file of these cells has some of them, as rasterio takes it."""
        from rasterio.windows import Window

        return Window(part.left - self.left, part.top - self.top, part.columns, part.rows)

    def cells(self, utm: FloatArray) -> IntArray:
        """Rows and columns (2, n) of the cells of places (n, 2 or more)."""
        south_east = np.floor(utm[:, 1::-1] * (-1.0, 1.0) / self.cell_m).astype(np.int64)
        return (south_east - (self.top, self.left)).T

    def places(self, heights: FloatArray, step: int = 1) -> FloatArray:
        """(rows, columns, 3) easting and northing of the middles of squares of so many cells, and heights."""
        rows, columns = heights.shape
        east = (self.left + step * (np.arange(columns) + 0.5)) * self.cell_m
        south = (self.top + step * (np.arange(rows) + 0.5)) * self.cell_m
        return np.stack([*np.meshgrid(east, -south), heights], axis=-1)

    def painted(
        self, shapes: Iterable[shapely.Geometry], numbers: Iterable[int], step: int = 1, beyond: int = 0
    ) -> IntArray:
        """(rows, columns) number of the last of some polygons in UTM that a square's middle lies in, or ``beyond``."""
        from rasterio import features

        pairs, shape = zip(shapes, numbers, strict=True), (self.rows // step, self.columns // step)
        return np.asarray(
            features.rasterize(pairs, shape, beyond, transform=self.transform(step), dtype="int32"), dtype=np.int64
        )


@contextmanager
def optimized(path: Path, grid: Grid, profile: Mapping[str, Any], **options: str) -> Iterator[Any]:
    """A raster to be written and read by windows (rasterio, "w+"); in the end a Cloud Optimized GeoTIFF.

    Args:
        path: of the file.
        grid: its cells.
        profile: of its bands, as rasterio's ``open`` takes it.
        options: of GDAL's driver COG.
    """
    import rasterio
    import rasterio.shutil

    scratch = tempfile.TemporaryDirectory(prefix=".raster-", dir=path.parent)
    with rasterio.Env(GDAL_CACHEMAX=_CACHE_MB), scratch as folder:
        plain, made = str(Path(folder) / "plain.tif"), Path(folder) / path.name
        with rasterio.open(
            plain,
            "w+",
            driver="GTiff",
            width=grid.columns,
            height=grid.rows,
            crs=f"EPSG:{grid.epsg}",
            transform=grid.transform(),
            tiled=True,
            sparse_ok=True,
            bigtiff="IF_SAFER",
            **profile,
        ) as file:
            yield file
        options |= {"OVERVIEWS": "IGNORE_EXISTING", "OVERVIEW_RESAMPLING": "AVERAGE", "BIGTIFF": "IF_SAFER"}
        rasterio.shutil.copy(plain, str(made), driver="COG", BLOCKSIZE=str(_BLOCK), SPARSE_OK="TRUE", **options)
        write_atomic(path, made.read_bytes())
