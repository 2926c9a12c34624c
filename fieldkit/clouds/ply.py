"""Reading and writing clouds of any supported format, told apart by content, and PLY itself (Turk 1994).

Read: ASCII and binary of both byte orders, any scalar types, elements and properties in any order. What fieldkit has no
use for is passed over; lists may only stand behind the vertices, as faces do. Written: binary little endian.
"""

from __future__ import annotations

import io
import os
import warnings
from itertools import islice
from pathlib import Path
from typing import BinaryIO, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fieldkit.clouds.cloud import Cloud
from fieldkit.clouds.las import DAMAGED, opened, read_las, write_las
from fieldkit.errors import CloudError, UsageError, about
from fieldkit.files import write_atomic
from fieldkit.wording import count

_SCALARS = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2", "ushort": "u2",
    "uint16": "u2", "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4", "float": "f4", "float32": "f4",
    "double": "f8", "float64": "f8",
}  # fmt: skip
"""PLY's scalar types, old and new names, as NumPy's type codes."""
_FORMATS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
_MAX_HEADER_BYTES = 1 << 20
"""Most bytes that are searched for the header's end."""
_COLOR_NAMES = ("red", "green", "blue")
_NORMAL_NAMES = ("nx", "ny", "nz")
_FLOAT32_LIMIT_M = 16.0  # below it float32 is within 0.5 µm
_LARGEST_COORDINATE = 1e12  # beyond any place on Earth in millimetres: swapped bytes or damage

Columns = dict[str, NDArray[np.generic]]


class _Element(NamedTuple):
    """One element of a file: its number of rows, and NumPy's type code of each property; None of a list."""

    name: str
    rows: int
    kinds: dict[str, str | None]


class _Header(NamedTuple):
    order: str
    """"<", ">" or "" for ASCII."""
    before: list[_Element]
    """Elements before the vertices."""
    vertex: _Element
    body: int
    """Offset of the first byte behind the header."""


def read_cloud(path: Path | str) -> Cloud:
    """Read a PLY, LAS or LAZ file, whatever its name ends in."""
    path = Path(path)
    with opened(path) as file:
        start = file.read(4)
    if start == b"LASF":
        return read_las(path).cloud
    if start.startswith(b"ply"):
        return read_ply(path)
    raise CloudError(
        "is empty" if not start else "is neither PLY, LAS nor LAZ",
        path=path,
        remedy="Give a point cloud as PLY, LAS or LAZ.",
    )


def write_cloud(path: Path, cloud: Cloud, *, crs_epsg: int | None = None) -> None:
    """Write a cloud in the format that the name's ending asks for: .ply, .las or .laz."""
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix in (".las", ".laz"):
        write_las(path, cloud, crs_epsg=crs_epsg)
    elif suffix == ".ply":
        write_ply(path, cloud)
    else:
        raise UsageError("point clouds are written as .ply, .las or .laz", path=path, remedy="Choose one of them.")


def read_ply(path: Path) -> Cloud:
    """Read the vertices of a PLY file.

    Colours are red, green and blue of 8 bits, normals nx, ny and nz; rows with a coordinate that is not finite (how
    some exporters mark missing points) are left out. The unit is the file's own.
    """
    with opened(Path(path)) as file, about(path, DAMAGED):
        size = os.fstat(file.fileno()).st_size
        header = _read_header(file)
        file.seek(header.body)
        return _cloud((_read_binary if header.order else _read_ascii)(file, header, size - header.body), header)


def write_ply(path: Path, cloud: Cloud) -> None:
    """Write a cloud as binary little endian PLY; equal clouds give equal bytes.

    Coordinates are float32 where every one of them is below 16 m (then exact to 0.5 µm), else float64; colours are
    uchar red, green, blue; normals float nx, ny, nz; points that fill holes uchar filled 1.
    """
    small = not len(cloud) or float(np.abs(cloud.points).max()) < _FLOAT32_LIMIT_M
    kind, code = ("float", "<f4") if small else ("double", "<f8")
    lines = ["ply", "format binary_little_endian 1.0", "comment unit: metre", f"element vertex {len(cloud)}"]
    lines += [f"property {kind} {name}" for name in "xyz"]
    fields: list[tuple[str, str, tuple[int, ...]]] = [("points", code, (3,))]
    if cloud.normals is not None:
        lines += [f"property float {name}" for name in _NORMAL_NAMES]
        fields.append(("normals", "<f4", (3,)))
    if cloud.colors is not None:
        lines += [f"property uchar {name}" for name in _COLOR_NAMES]
        fields.append(("colors", "u1", (3,)))
    if cloud.filled is not None:
        lines.append("property uchar filled")
        fields.append(("filled", "u1", ()))
    rows = np.empty(len(cloud), dtype=np.dtype(fields))
    for name, _, _ in fields:
        rows[name] = getattr(cloud, name)
    write_atomic(path, "\n".join([*lines, "end_header\n"]).encode("ascii") + rows.tobytes())


def _read_header(file: BinaryIO) -> _Header:
    def broken(message: str) -> CloudError:
        remedy = "Export the cloud again, as PLY with x, y and z."
        return CloudError(f"broken PLY header: {message}", remedy=remedy)

    start = file.read(_MAX_HEADER_BYTES)
    if not start.startswith((b"ply\n", b"ply\r")):
        raise CloudError("is not a PLY file", remedy="Give a point cloud as PLY, LAS or LAZ.")
    newline = b"\n" if start.startswith((b"ply\n", b"ply\r\n")) else b"\r"
    order: str | None = None
    elements: list[_Element] = []
    position = start.index(newline) + 1
    while True:
        end = start.find(newline, position)
        line = start[position : end if end >= 0 else None].rstrip(b"\r ").decode("latin-1")
        if line == "end_header":
            position = len(start) if end < 0 else end + 1
            break
        if end < 0:
            raise broken("the header has no end")
        position = end + 1
        match line.split():
            case [] | ["comment" | "obj_info", *_]:
                pass
            case ["format", name, _]:
                if name not in _FORMATS:
                    raise broken(f"unknown format {name!r}")
                order = _FORMATS[name]
            case ["element", name, rows]:
                if not (rows.isascii() and rows.isdigit() and len(rows) <= 18):
                    raise broken(f"{rows[:40]!r} is not a number of rows")
                if any(element.name == name for element in elements):
                    raise broken(f"the element {name!r} is there twice")
                elements.append(_Element(name, int(rows), {}))
            case ["property", kind, name] if elements and kind in _SCALARS:
                if name in elements[-1].kinds:
                    raise broken(f"the property {name!r} is there twice")
                elements[-1].kinds[name] = _SCALARS[kind]
            case ["property", "list", counted, kind, name] if elements and {counted, kind} <= set(_SCALARS):
                elements[-1].kinds[name] = None
            case ["property", *words] if elements:
                raise broken(f"unknown property {' '.join(words)[:60]!r}")
            case _:
                raise broken(f"unexpected line {line[:60]!r}")
    if order is None:
        raise broken("no format line")
    at = next((k for k, element in enumerate(elements) if element.name == "vertex"), None)
    if at is None:
        raise CloudError("has no vertices", remedy="Give a point cloud; a material or scene is not one.")
    if not all(elements[at].kinds.get(axis) for axis in "xyz"):
        raise CloudError("its vertices have no x, y and z", remedy="Export the cloud again.")
    if any(None in element.kinds.values() for element in elements[: at + 1]):
        remedy = "Export it with x, y, z, colours and normals only."
        raise CloudError("has lists in or before its vertices, which are not read", remedy=remedy)
    return _Header(order, elements[:at], elements[at], position)


def _short(element: _Element) -> CloudError:
    return CloudError(f"ends before its {count(element.rows, 'row')} of {element.name!r}")


def _read_binary(file: BinaryIO, header: _Header, size: int) -> Columns:
    for element in (*header.before, header.vertex):
        row = np.dtype([(name, f"{header.order}{kind}") for name, kind in element.kinds.items()])
        # Checked before anything is allocated: a header may promise any number of rows.
        if element.rows * row.itemsize > size:
            raise _short(element)
        size -= element.rows * row.itemsize
        body = file.read(element.rows * row.itemsize)
    rows = np.frombuffer(body, dtype=row)
    return {name: rows[name] for name in header.vertex.kinds}


def _read_ascii(file: BinaryIO, header: _Header, size: int) -> Columns:
    kinds = header.vertex.kinds
    with io.TextIOWrapper(file, encoding="latin-1") as text:  # ends lines at \n, \r\n and \r alike
        lines = (line for line in text if not line.isspace())
        for element in (*header.before, header.vertex):
            # A value takes a digit and a separator (the last may have none), so this bounds what is allocated.
            if 2 * element.rows * len(element.kinds) > size + 1:
                raise _short(element)
            if element is not header.vertex and sum(1 for _ in islice(lines, element.rows)) < element.rows:
                raise _short(element)
        if not header.vertex.rows:
            return {name: np.zeros(0) for name in kinds}
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # NumPy warns of an empty file; the row count below tells
                values = np.loadtxt(
                    islice(lines, header.vertex.rows), comments=None, usecols=range(len(kinds)), ndmin=2
                )
        except (ValueError, IndexError) as error:
            raise CloudError(f"has a row that cannot be read: {error}") from error
    if len(values) < header.vertex.rows:
        raise _short(header.vertex)
    return {name: values[:, k] for k, name in enumerate(kinds)}


def _cloud(columns: Columns, header: _Header) -> Cloud:
    with np.errstate(invalid="ignore", over="ignore"):
        points = np.empty((len(columns["x"]), 3))
        for axis, name in enumerate("xyz"):
            points[:, axis] = columns[name]
        known = np.asarray(np.isfinite(points).all(axis=1))
        finite = slice(None) if known.all() else known  # no copies of large clouds
        points = points[finite]
        largest = max(points.max(), -points.min()) if len(points) else 0.0
        if largest > _LARGEST_COORDINATE:
            raise CloudError(
                f"has coordinates up to {largest:.3g}, which is no place on Earth",
                remedy="Its values or byte order are damaged: export it again.",
            )
        kinds = header.vertex.kinds
        colors = normals = None
        if all(kinds.get(name) == "u1" for name in _COLOR_NAMES):
            colors = np.stack([columns[name][finite] for name in _COLOR_NAMES], axis=1).astype(np.uint8)
        if all(name in columns for name in _NORMAL_NAMES):
            normals = np.stack([columns[name][finite] for name in _NORMAL_NAMES], axis=1).astype(np.float32)
            normals[~np.isfinite(normals).all(axis=1)] = 0.0
        return Cloud(points, colors, normals)
