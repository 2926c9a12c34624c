"""Reading and writing PLY point clouds.

Read: ASCII and binary of both byte orders, any scalar types, elements and properties in any order. Faces, other
elements, list properties and properties fieldkit has no use for are passed over. Written: binary little endian.
"""

from __future__ import annotations

import io
import os
import struct
import warnings
from collections.abc import Iterable, Iterator
from itertools import islice
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from fieldkit.clouds.cloud import Cloud
from fieldkit.clouds.ply_header import Element, Header, read_header
from fieldkit.errors import CloudError
from fieldkit.files import write_atomic
from fieldkit.regular_files import open_regular
from fieldkit.wording import count

_COLOR_NAMES = (
    ("red", "green", "blue"),
    ("r", "g", "b"),
    ("diffuse_red", "diffuse_green", "diffuse_blue"),
)
_NORMAL_NAMES = (("nx", "ny", "nz"), ("normal_x", "normal_y", "normal_z"))
_FLOAT32_LIMIT_M = 16.0  # below it float32 is within 0.5 µm
_LARGEST_COORDINATE = 1e12  # beyond any place on Earth in millimetres: swapped bytes or damage
_TRUNCATED = "The file is damaged or was not copied completely: copy or export it again."

Columns = dict[str, NDArray[np.generic]]


def read_ply(path: Path) -> Cloud:
    """Read the vertices of a PLY file.

    Colours may be 8 or 16 bit integers or floating-point numbers in [0, 1]; rows with a coordinate that is not finite
    (how some exporters mark missing points) are left out. The unit is the file's own.
    """
    path = Path(path)
    try:
        with open_regular(path) as file:
            size = os.fstat(file.fileno()).st_size
            header = read_header(file, path)
            vertex = _vertex(header, path)
            file.seek(header.body)
            read = _read_binary if header.byte_order else _read_ascii
            columns = read(file, header, vertex, size - header.body, path)
    except OSError as error:
        reason = error.strerror or str(error)
        raise CloudError(f"cannot be read: {reason}", path=path, remedy="Check the path and permissions.") from error
    return _cloud(columns, path)


def write_ply(path: Path, cloud: Cloud) -> None:
    """Write a cloud as binary little endian PLY; equal clouds give equal bytes.

    Coordinates are float32 where every one of them is below 16 m (then exact to 0.5 µm), else float64; colours are
    uchar red, green, blue; normals float nx, ny, nz.
    """
    small = not len(cloud) or float(np.abs(cloud.points).max()) < _FLOAT32_LIMIT_M
    kind, code = ("float", "<f4") if small else ("double", "<f8")
    lines = ["ply", "format binary_little_endian 1.0", "comment unit: metre", f"element vertex {len(cloud)}"]
    lines += [f"property {kind} {name}" for name in "xyz"]
    fields = [("points", code, (3,))]
    if cloud.normals is not None:
        lines += [f"property float {name}" for name in _NORMAL_NAMES[0]]
        fields.append(("normals", "<f4", (3,)))
    if cloud.colors is not None:
        lines += [f"property uchar {name}" for name in _COLOR_NAMES[0]]
        fields.append(("colors", "u1", (3,)))
    rows = np.empty(len(cloud), dtype=np.dtype(fields))
    for name, _, _ in fields:
        rows[name] = getattr(cloud, name)
    write_atomic(path, "\n".join([*lines, "end_header\n"]).encode("ascii") + rows.tobytes())


def _vertex(header: Header, path: Path) -> Element:
    for element in header.elements:
        if element.name == "vertex":
            scalars = {p.name for p in element.properties if p.count is None}
            if not {"x", "y", "z"} <= scalars:
                raise CloudError("its vertices have no x, y and z", path=path, remedy="Export the cloud again.")
            return element
    raise CloudError("has no vertices", path=path, remedy="Give a point cloud; a material or scene is not one.")


def _short(path: Path, element: Element) -> CloudError:
    return CloudError(f"ends before its {count(element.rows, 'row')} of {element.name!r}", path=path, remedy=_TRUNCATED)


# Binary


def _read_binary(file: BinaryIO, header: Header, vertex: Element, size: int, path: Path) -> Columns:
    body, position = file.read(size), 0
    for element in header.elements:
        # Checked before anything is allocated: a header may promise any number of rows.
        least = sum(np.dtype(p.count or p.scalar).itemsize for p in element.properties)
        if element.rows * least > len(body) - position:
            raise _short(path, element)
        if element.has_lists:
            try:
                offsets, position = _row_offsets(body, position, header, element)
            except struct.error as error:
                raise _short(path, element) from error
            if element is vertex:
                return _gather(body, offsets, header, vertex)
        elif element is vertex:
            row = np.dtype([(p.name, header.byte_order + p.scalar) for p in vertex.properties])
            rows = np.frombuffer(body, dtype=row, count=vertex.rows, offset=position)
            return {p.name: rows[p.name] for p in vertex.properties}
        else:
            position += element.rows * least
    raise AssertionError("unreachable: the vertex element is in the header")


def _row_offsets(body: bytes, position: int, header: Header, element: Element) -> tuple[NDArray[np.int64], int]:
    """Offsets (rows, properties) of every value of an element with lists, and where the element ends."""
    order = header.byte_order
    steps = [
        (None if p.count is None else struct.Struct(order + _STRUCT[p.count]), np.dtype(p.scalar).itemsize)
        for p in element.properties
    ]
    offsets = np.empty((element.rows, len(steps)), dtype=np.int64)
    for row in range(element.rows):
        for column, (counter, size) in enumerate(steps):
            offsets[row, column] = position
            if counter is None:
                position += size
            else:
                (length,) = counter.unpack_from(body, position)
                if length < 0:
                    raise struct.error("a list of negative length")
                position += counter.size + length * size
        if position > len(body):
            raise struct.error("past the end")
    return offsets, position


_STRUCT = {"i1": "b", "u1": "B", "i2": "h", "u2": "H", "i4": "i", "u4": "I"}


def _gather(body: bytes, offsets: NDArray[np.int64], header: Header, vertex: Element) -> Columns:
    data = np.frombuffer(body, dtype=np.uint8)
    columns: Columns = {}
    for column, prop in enumerate(vertex.properties):
        if prop.count is None:
            kind = np.dtype(header.byte_order + prop.scalar)
            columns[prop.name] = data[offsets[:, column, None] + np.arange(kind.itemsize)].view(kind)[:, 0]
    return columns


# ASCII


def _read_ascii(file: BinaryIO, header: Header, vertex: Element, size: int, path: Path) -> Columns:
    with io.TextIOWrapper(file, encoding="latin-1") as text:  # ends lines at \n, \r\n and \r alike
        lines = (line for line in text if not line.isspace())
        for element in header.elements:
            # A value takes a digit and a separator (the last may have none), so this bounds what is allocated.
            if 2 * element.rows * len(element.properties) > size + 1:
                raise _short(path, element)
            if element is vertex:
                return _ascii_columns(lines, vertex, path)
            if sum(1 for _ in islice(lines, element.rows)) < element.rows:
                raise _short(path, element)
    raise AssertionError("unreachable: the vertex element is in the header")


def _ascii_columns(lines: Iterator[str], vertex: Element, path: Path) -> Columns:
    if not vertex.rows:
        return {p.name: np.zeros(0) for p in vertex.properties}
    rows: Iterable[str] = islice(lines, vertex.rows)
    if vertex.has_lists:
        rows = (_without_lists(line, vertex) for line in rows)
    names = [p.name for p in vertex.properties if p.count is None]
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # NumPy warns of an empty file; the row count below tells
            values = np.loadtxt(rows, dtype=np.float64, comments=None, usecols=range(len(names)), ndmin=2)
    except (ValueError, IndexError) as error:
        raise CloudError(f"has a row that cannot be read: {error}", path=path, remedy=_TRUNCATED) from error
    if len(values) < vertex.rows:
        raise _short(path, vertex)
    kinds = {p.name: p.scalar for p in vertex.properties}
    return {name: _as_declared(values[:, i], kinds[name]) for i, name in enumerate(names)}


def _as_declared(values: NDArray[np.float64], kind: str) -> NDArray[np.generic]:
    """Integers as the header has them, which decides how a colour is scaled; others stay float64."""
    if kind.startswith("f"):
        return values
    limits = np.iinfo(kind)
    return np.nan_to_num(values).clip(limits.min, limits.max).astype(kind)


def _without_lists(line: str, element: Element) -> str:
    words, kept, position = line.split(), [], 0
    for prop in element.properties:
        if prop.count is None:
            kept += words[position : position + 1]
            position += 1
        else:
            length = int(words[position]) if position < len(words) else 0
            position += 1 + max(length, 0)
    return " ".join(kept)


# Columns to a cloud


def _cloud(columns: Columns, path: Path) -> Cloud:
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
                path=path,
                remedy="Its values or byte order are damaged: export it again.",
            )
        colors = _first(columns, _COLOR_NAMES, finite)
        normals = _first(columns, _NORMAL_NAMES, finite)
        return Cloud(
            points,
            None if colors is None else _eight_bit(colors),
            None if normals is None else _known(np.stack([n.astype(np.float32) for n in normals], axis=1)),
        )


def _first(
    columns: Columns, alternatives: tuple[tuple[str, ...], ...], rows: NDArray[np.bool_] | slice
) -> list[NDArray[np.generic]] | None:
    for names in alternatives:
        if all(name in columns for name in names):
            return [columns[name][rows] for name in names]
    return None


def _eight_bit(channels: list[NDArray[np.generic]]) -> NDArray[np.uint8]:
    """Three colour channels (n,) as (n, 3) of 8 bits.

    16-bit integers are divided by 257; floating-point numbers run from 0 to 1, or from 0 to 255 if any is above 1.
    """
    kind = channels[0].dtype
    if all(channel.dtype == np.uint8 for channel in channels):
        return np.stack(channels, axis=1).astype(np.uint8, copy=False)
    values = np.stack([np.nan_to_num(c.astype(np.float64), posinf=0.0, neginf=0.0) for c in channels], axis=1)
    if kind.kind == "f" and (not values.size or values.max() <= 1.0):
        values *= 255.0
    elif kind.kind == "u" and kind.itemsize == 2:
        values /= 257.0
    colors: NDArray[np.uint8] = np.rint(values.clip(0.0, 255.0)).astype(np.uint8)
    return colors


def _known(normals: NDArray[np.float32]) -> NDArray[np.float32]:
    """Normals as they are, those that are not finite as zero, which means unknown."""
    normals[~np.isfinite(normals).all(axis=1)] = 0.0
    return normals
