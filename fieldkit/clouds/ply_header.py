"""The header of a PLY file (Turk 1994; paulbourke.net/dataformats/ply)."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from fieldkit.errors import CloudError

SCALARS = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2", "ushort": "u2",
    "uint16": "u2", "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4", "float": "f4", "float32": "f4",
    "double": "f8", "float64": "f8",
}  # fmt: skip
"""PLY's scalar types, old and new names, as NumPy's type codes."""

_FORMATS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
_MAX_HEADER_BYTES = 1 << 20
_BROKEN = "Export the cloud again, as PLY with x, y and z."


@dataclass(frozen=True)
class Property:
    """One property of an element."""

    name: str
    """As in the file."""
    scalar: str
    """NumPy type code of the value, or of a list's items."""
    count: str | None = None
    """NumPy type code of a list's length, or None for a scalar."""


@dataclass(frozen=True)
class Element:
    """One element with its number of rows and its properties in order."""

    name: str
    rows: int
    properties: tuple[Property, ...]

    @property
    def has_lists(self) -> bool:
        return any(p.count is not None for p in self.properties)


@dataclass(frozen=True)
class Header:
    """What a PLY file says it holds."""

    byte_order: str
    """"<", ">" or "" for ASCII."""
    elements: tuple[Element, ...]
    """In file order."""
    body: int
    """Offset of the first byte after the header."""


def read_header(file: BinaryIO, path: Path) -> Header:
    """Parse the header; the file is left anywhere."""
    lines, body = _header_lines(file, path)
    byte_order: str | None = None
    elements: list[Element] = []
    for line in lines:
        words = line.split()
        if not words or words[0] in ("comment", "obj_info"):
            continue
        if words[0] == "format" and len(words) == 3:
            if words[1] not in _FORMATS:
                raise _error(path, f"unknown format {words[1]!r}")
            byte_order = _FORMATS[words[1]]
        elif words[0] == "element" and len(words) == 3:
            if any(e.name == words[1] for e in elements):
                raise _error(path, f"the element {words[1]!r} is there twice")
            elements.append(Element(words[1], _row_count(path, words[2]), ()))
        elif words[0] == "property" and elements:
            elements[-1] = _with_property(path, elements[-1], words[1:])
        else:
            raise _error(path, f"unexpected line {line[:60]!r}")
    if byte_order is None:
        raise _error(path, "no format line")
    return Header(byte_order, tuple(elements), body)


def _header_lines(file: BinaryIO, path: Path) -> tuple[list[str], int]:
    file.seek(0)
    start = file.read(_MAX_HEADER_BYTES)
    if not start.startswith((b"ply\n", b"ply\r")):
        raise CloudError("is not a PLY file", path=path, remedy="Give a point cloud as PLY, LAS or LAZ.")
    newline = b"\n" if start.startswith((b"ply\n", b"ply\r\n")) else b"\r"
    lines: list[str] = []
    position = 0
    while True:
        end = start.find(newline, position)
        raw = start[position:] if end < 0 else start[position:end]
        line = raw.rstrip(b"\r ").decode("latin-1")
        if line == "end_header":
            return lines[1:], len(start) if end < 0 else end + 1
        if end < 0:
            raise _error(path, "the header has no end")
        lines.append(line)
        position = end + 1


def _row_count(path: Path, word: str) -> int:
    if not (word.isascii() and word.isdigit() and len(word) <= 18):
        raise _error(path, f"{word[:40]!r} is not a number of rows")
    return int(word)


def _with_property(path: Path, element: Element, words: list[str]) -> Element:
    if len(words) == 2 and words[0] in SCALARS:
        prop = Property(words[1], SCALARS[words[0]])
    elif len(words) == 4 and words[0] == "list" and words[1] in SCALARS and words[2] in SCALARS:
        if SCALARS[words[1]].startswith("f"):
            raise _error(path, f"the list {words[3]!r} is counted by a floating-point number")
        prop = Property(words[3], SCALARS[words[2]], SCALARS[words[1]])
    else:
        raise _error(path, f"unknown property {' '.join(words)[:60]!r}")
    if any(p.name == prop.name for p in element.properties):
        raise _error(path, f"the property {prop.name!r} is there twice")
    return Element(element.name, element.rows, (*element.properties, prop))


def _error(path: Path, message: str) -> CloudError:
    return CloudError(f"broken PLY header: {message}", path=path, remedy=_BROKEN)
