"""Reading and writing LAS and LAZ (ASPRS LAS 1.4 R15), for georeferenced clouds. Needs the extra `geo`."""

from __future__ import annotations

import io
import os
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from fieldkit.arrays import ByteArray, Float32Array, FloatArray
from fieldkit.clouds.cloud import Cloud
from fieldkit.errors import CloudError, about
from fieldkit.files import write_atomic
from fieldkit.regular_files import open_regular

_FINEST_SCALE_M = 1e-4
"""Finest step of written coordinates, metres: below a cloud's own noise."""
_CHUNK_POINTS = 500_000  # what is allocated at a time, whatever the header promises
_NORMALS = ("nx", "ny", "nz")
_OTHER_NORMALS = (_NORMALS, ("NormalX", "NormalY", "NormalZ"))
_WITH_COLOR = (2, 3, 5, 7, 8, 10)  # point formats
_LINEAR_UNITS = 3076
"""GeoTIFF key of the unit of easting and northing (ProjLinearUnitsGeoKey, OGC 19-008r4, 7.5)."""
_VERTICAL_UNITS = 4099
"""GeoTIFF key of the unit of heights (VerticalUnitsGeoKey, OGC 19-008r4, 7.5)."""
_UNITS_M = {9001: 1.0, 9002: 0.3048, 9003: 1200.0 / 3937.0}  # by EPSG code: metre, foot, US survey foot
_NOISE = (7, 18)  # classes of low and high noise
_CREATION_DATE = slice(90, 94)  # of the header: day of year and year
DAMAGED = "The file is damaged or was not copied completely: copy or export it again."
_LEAST_HEADER = 227  # bytes, LAS 1.0 to 1.2
_RECORD_HEADER = 54
"""Bytes before the content of a variable length record (LAS 1.4)."""
_EXTENDED_RECORD_HEADER = 60
"""Bytes before the content of an extended variable length record (LAS 1.4)."""
_MAX_RATIO = 200
"""LAZ makes scans 5 to 20 times smaller; equal points thousands of times, and such a file of 7 KB fills gigabytes."""
_FREE_BYTES = 64 << 20
"""Bytes that a packed file may come to whatever its size."""
_LEAST_CHUNK_BYTES = 20  # a chunk starts with one uncompressed point, 20 bytes in the shortest format


@dataclass(frozen=True, eq=False)
class LasCloud:
    """A LAS file's points and their coordinate reference system."""

    cloud: Cloud
    """In the system's own coordinates (for UTM easting, northing and height), metres."""
    crs: Any = None
    """Pyproj's of what the file says its coordinates are in, or None."""
    units_m: tuple[float, float, float] = (1.0, 1.0, 1.0)
    """Metres per unit of the file's x, y and z."""
    step_m: float = 0.0
    """Of the coarsest of its coordinates: they are whole numbers of steps."""
    left_out: int = 0
    """Points of the file that are noise (classes 7 and 18) or withheld, so deleted."""


def read_las(path: Path) -> LasCloud:
    """Read a LAS or LAZ file of any version and point format that laspy knows.

    Colours that use only the lower 8 of their 16 bits, as some writers leave them, are taken as 8-bit ones. Normals
    are read from the extra dimensions nx, ny, nz or NormalX, NormalY, NormalZ. Noise (classes 7 and 18) and withheld
    points, which are deleted ones, are left out (ASPRS LAS 1.4 R15, tables 8 and 17). Coordinates in feet, as its
    reference system or its GeoTIFF keys state them, become metres.
    """
    with opened(Path(path)) as file, about(path, DAMAGED), _damage_reported():
        return _read(_laspy(), file)


@contextmanager
def opened(path: Path) -> Iterator[BinaryIO]:
    """A cloud's file; errors within are of it."""
    try:
        with about(path), open_regular(path) as file:
            yield file
    except OSError as error:
        reason = error.strerror or str(error)
        raise CloudError(f"cannot be read: {reason}", path=path, remedy="Check the path and permissions.") from error


def write_las(path: Path, cloud: Cloud, *, crs_epsg: int | None = None) -> None:
    """Write LAS 1.4, point format 7; compressed (LAZ) where the name ends in .laz. Equal clouds give equal bytes.

    Coordinates are stored in steps of 0.1 mm from whole-metre offsets (coarser only where the cloud spans more than
    200 km); normals as extra dimensions nx, ny, nz. The creation date is left blank.

    Args:
        path: the file to write.
        cloud: in the coordinates of the reference system.
        crs_epsg: EPSG code of a projected system in metres, such as 32632 (see `geodesy.utm_epsg`).
    """
    with about(path := Path(path)):
        laspy = _laspy()
        crs = None if crs_epsg is None else _projected_crs(crs_epsg)
    header = laspy.LasHeader(version="1.4", point_format=7)
    header.generating_software = "fieldkit"
    header.offsets, header.scales = _grid(cloud.points)
    if crs is not None:
        header.add_crs(crs)
    if cloud.normals is not None:
        header.add_extra_dims([laspy.ExtraBytesParams(name=name, type=np.float32) for name in _NORMALS])
    las = laspy.LasData(header)
    las.points = laspy.ScaleAwarePointRecord.zeros(len(cloud), header=header)
    las.x, las.y, las.z = cloud.points.T
    las.return_number[:] = 1
    las.number_of_returns[:] = 1
    if cloud.colors is not None:
        # Eight bits become sixteen by repeating them, as the specification asks, so that 255 is full scale.
        las.red, las.green, las.blue = (cloud.colors.astype(np.uint16) * 257).T
    if cloud.normals is not None:
        for axis, name in enumerate(_NORMALS):
            las[name] = cloud.normals[:, axis]
    buffer = io.BytesIO()
    las.write(buffer, do_compress=path.suffix.lower() == ".laz", laz_backend=laspy.LazBackend.Lazrs)
    data = bytearray(buffer.getvalue())
    data[_CREATION_DATE] = bytes(4)
    write_atomic(path, bytes(data))


def _laspy() -> Any:
    try:
        import laspy
        import lazrs  # noqa: F401
    except ImportError as error:
        raise CloudError(
            "LAS and LAZ files need laspy with lazrs, which are not installed",
            remedy="Install them with: pip install 'fieldkit[geo]'",
        ) from error
    return laspy


@contextmanager
def _damage_reported() -> Iterator[None]:
    """Turn whatever the LAS libraries raise about a file's content into a CloudError."""
    try:
        yield
    except (CloudError, OSError):
        raise
    except Exception as error:
        detail = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise CloudError(f"cannot be read as LAS: {detail}") from error
    except BaseException as error:
        # A panic in lazrs' Rust code is not an Exception; Ctrl-C and the like pass.
        if type(error).__name__ != "PanicException":
            raise
        raise CloudError("cannot be read as LAS: its compression is damaged") from error


def _read(laspy: Any, file: BinaryIO) -> LasCloud:
    _check_sizes(file)
    with laspy.open(file, closefd=False, laz_backend=laspy.LazBackend.Lazrs, encoding_errors="replace") as reader:
        header = reader.header
        names = set(header.point_format.dimension_names)
        normal_names = next((n for n in _OTHER_NORMALS if names.issuperset(n)), None)
        points: list[FloatArray] = []
        colors: list[NDArray[np.uint16]] = []
        normals: list[Float32Array] = []
        count = left_out = 0
        for whole in reader.chunk_iterator(_CHUNK_POINTS):
            good = ~np.isin(np.asarray(whole.classification), _NOISE) & ~np.asarray(whole.withheld, dtype=bool)
            chunk = whole if good.all() else whole[good]
            count, left_out = count + len(whole), left_out + len(whole) - len(chunk)
            points.append(np.stack([chunk.x, chunk.y, chunk.z], axis=1).astype(np.float64))
            if header.point_format.id in _WITH_COLOR:
                colors.append(np.stack([chunk.red, chunk.green, chunk.blue], axis=1))
            if normal_names:
                normals.append(np.stack([chunk[n] for n in normal_names], axis=1).astype(np.float32))
            if len(whole) < _CHUNK_POINTS:
                break  # the last one, or the file ends early
        if count != header.point_count:
            raise CloudError(f"ends after {count} of {header.point_count} points")
        xyz = np.concatenate(points) if points else np.zeros((0, 3))
        if not np.isfinite(xyz).all():
            raise CloudError("has coordinates that are not finite")
        oriented = np.concatenate(normals) if normals else None
        if oriented is not None:
            oriented[~np.isfinite(oriented).all(axis=1)] = 0.0
        crs = _crs(header)
        units = _units(header, crs)
        xyz *= units
        cloud = Cloud(xyz, _eight_bit(np.concatenate(colors)) if colors else None, oriented)
        step = float(np.max(np.asarray(header.scales) * units))
        x, y, z = units.tolist()
        return LasCloud(cloud, crs, (x, y, z), step, left_out)


def _check_sizes(file: BinaryIO) -> None:
    """Refuse a file that promises more than it can hold (ASPRS LAS 1.4 R15, tables 3, 7 and 24), and go to its start.

    laspy and lazrs take the numbers of records and chunks as promised and reserve memory for them. A damaged number
    would fill the memory, and a reservation that fails in lazrs ends the whole process.
    """
    size = file.seek(0, os.SEEK_END)
    file.seek(0)
    header = file.read(375)
    if len(header) < _LEAST_HEADER:
        raise CloudError("ends within its header")
    header_size, points, records = struct.unpack_from("<HII", header, 94)
    if not _LEAST_HEADER <= header_size <= points <= size:
        raise CloudError("has a header that contradicts the file's size")
    if records * _RECORD_HEADER > points - header_size:
        raise CloudError(f"promises {records} records, more than it can hold")
    if header[25] >= 4 and len(header) == 375:
        first, count = struct.unpack_from("<QI", header, 235)
        _check_extended_records(file, first, count, size)
    (record,) = struct.unpack_from("<H", header, 105)
    (count,) = struct.unpack_from("<I", header, 107)
    if header[25] >= 4 and len(header) == 375:
        (count,) = struct.unpack_from("<Q", header, 247)
    if header[104] & 0x80:  # the point format's top bit says "compressed"
        _check_chunk_table(file, points, size)
        room = max(_FREE_BYTES, _MAX_RATIO * (size - points))
    else:
        room = size - points
    if count * record > room:
        raise CloudError(f"promises {count:,} points, more than it can hold")
    file.seek(0)


def _check_extended_records(file: BinaryIO, position: int, count: int, size: int) -> None:
    for _ in range(count):
        if position + _EXTENDED_RECORD_HEADER > size:
            raise CloudError("promises extended records it does not hold")
        file.seek(position + 20)
        (length,) = struct.unpack("<Q", file.read(8))
        position += _EXTENDED_RECORD_HEADER + length
        if position > size:
            raise CloudError("promises extended records it does not hold")


def _check_chunk_table(file: BinaryIO, points: int, size: int) -> None:
    table = _signed(file, points)
    if table == -1:  # written to a stream: the offset stands at the end
        table = _signed(file, size - 8)
    if not points < table <= size - 8:
        raise CloudError("has no table of its compressed chunks")
    file.seek(table + 4)
    chunks = int.from_bytes(file.read(4), "little")
    if chunks * _LEAST_CHUNK_BYTES > size:
        raise CloudError(f"promises {chunks} compressed chunks, more than it can hold")


def _signed(file: BinaryIO, position: int) -> int:
    file.seek(position)
    return int.from_bytes(file.read(8), "little", signed=True)


def _eight_bit(colors: NDArray[np.uint16]) -> ByteArray | None:
    """16-bit colours as 8 bits; None where all are zero, which is what files without colours hold."""
    highest = int(colors.max(initial=0))
    if highest == 0:
        return None
    scaled = colors if highest <= 255 else np.rint(colors / 257.0)
    return np.asarray(scaled, dtype=np.uint8)


def _crs(header: Any) -> Any:
    try:
        return header.parse_crs()
    except Exception:
        # Other programs' CRS records are often malformed; the points are good without.
        return None


def _units(header: Any, crs: Any) -> FloatArray:
    """Metres per unit of x, y and z (3,). Heights are in the plane's unit where nothing else is said of them."""
    axes = [] if crs is None else crs.axis_info
    if axes and crs.is_geographic:
        raise CloudError(
            f"has its points in degrees ({crs.name})",
            remedy="Reproject it to a projected system in metres, such as UTM.",
        )
    plane = float(axes[0].unit_conversion_factor) if axes else 1.0
    up = float(axes[2].unit_conversion_factor) if len(axes) > 2 else plane
    keys = _unit_keys(header)
    if not axes:
        plane = keys.get(_LINEAR_UNITS, 1.0)
        up = plane
    if len(axes) < 3:
        up = keys.get(_VERTICAL_UNITS, up)
    units = np.array([plane, plane, up])
    return np.where(np.abs(units - 1.0) < 1e-9, 1.0, units)


def _unit_keys(header: Any) -> dict[int, float]:
    """Metres per unit by GeoTIFF key, of those that state one of length."""
    try:
        found = header.vlrs.get("GeoKeyDirectoryVlr")
        keys = [(int(key.id), int(key.value_offset)) for key in found[0].geo_keys] if found else []
    except Exception:  # malformed, as CRS records often are
        return {}
    return {
        key: _UNITS_M[value] for key, value in keys if key in (_LINEAR_UNITS, _VERTICAL_UNITS) and value in _UNITS_M
    }


def _projected_crs(epsg: int) -> Any:
    import pyproj

    remedy = "Give the code of a projected system in metres, such as 32632 for UTM zone 32 north."
    try:
        crs = pyproj.CRS.from_epsg(epsg)
    except pyproj.exceptions.CRSError as error:
        raise CloudError(f"EPSG:{epsg} is not a known coordinate reference system", remedy=remedy) from error
    if not crs.is_projected or any(axis.unit_name != "metre" for axis in crs.axis_info):
        raise CloudError(f"EPSG:{epsg} ({crs.name}) is not a projected system in metres", remedy=remedy)
    return crs


def _grid(points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Offsets (3,) in whole metres and scales (3,) so that every coordinate fits 32 bits."""
    if not len(points):
        return np.zeros(3), np.full(3, _FINEST_SCALE_M)
    lower, upper = points.min(axis=0), points.max(axis=0)
    offsets = np.floor(0.5 * (lower + upper))
    scale = _FINEST_SCALE_M
    while (np.abs([lower - offsets, upper - offsets]) / scale).max() > 2**31 - 2:
        scale *= 10.0
    return offsets, np.full(3, scale)
