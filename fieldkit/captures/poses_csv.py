"""``poses.csv``: where photographs were taken, in any metric frame.

    image,x_m,y_m,z_m[,yaw_deg,pitch_deg[,roll_deg]][,accuracy_m]

Columns may stand in any order. ``name`` for ``image`` and ``x`` for ``x_m`` are accepted, and ``x_mm``, ``x_cm`` are
converted. Fields are separated by commas, semicolons (then decimal commas are allowed) or tabs.
"""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from fieldkit.captures.model import Finding
from fieldkit.captures.tables import keep_row, parse_number, read_text
from fieldkit.errors import MetadataError

_LAYOUT = "image,x_m,y_m,z_m[,yaw_deg,pitch_deg[,roll_deg]][,accuracy_m]"
_ALIASES = {
    "image": ("image", "name", "filename", "file", "photo", "label"),
    "yaw_deg": ("yaw_deg", "yaw"),
    "pitch_deg": ("pitch_deg", "pitch"),
    "roll_deg": ("roll_deg", "roll"),
    "accuracy_m": ("accuracy_m", "accuracy"),
}
_UNITS = {"": 1.0, "_m": 1.0, "_cm": 0.01, "_mm": 0.001}
_LIMITS = {"yaw_deg": (-360.0, 360.0), "pitch_deg": (-90.0, 90.0), "roll_deg": (-360.0, 360.0)}
_FAR_M = 1e8


@dataclass(frozen=True)
class PoseRow:
    """One line: metres and degrees; None where a column is absent or the field empty."""

    image: str
    position: tuple[float, float, float]
    yaw_deg: float | None = None
    pitch_deg: float | None = None
    roll_deg: float | None = None
    accuracy_m: float | None = None


@dataclass(frozen=True)
class _Columns:
    index: dict[str, int]
    names: dict[str, str]
    scale: float
    count: int


def read_poses_csv(path: Path) -> tuple[list[PoseRow], list[Finding]]:
    """The rows of a poses.csv and what is odd about it.

    Raises:
        MetadataError: unreadable or malformed; the message names the line and the column.
    """
    return parse_poses_csv(read_text(path), path)


def parse_poses_csv(text: str, path: Path | None = None) -> tuple[list[PoseRow], list[Finding]]:
    """As `read_poses_csv`, from text; ``path`` is for messages."""
    lines = [(n, line) for n, line in enumerate(text.split("\n"), 1) if line.strip() and not line.startswith("#")]
    if not lines:
        raise MetadataError("the file is empty", path=path, remedy=f"Expected {_LAYOUT}.")
    header = lines[0][1]
    delimiter = ";" if ";" in header else "\t" if "\t" in header else ","
    columns, findings = _read_header(_split(header, delimiter, lines[0][0], path), path)
    rows: dict[str, tuple[int, PoseRow]] = {}
    for number, line in lines[1:]:
        row = _read_row(_split(line, delimiter, number, path), columns, number, delimiter, path)
        if odd := keep_row(rows, row.image, row, number, "pose", path):
            findings.append(Finding(row.image, "pose-repeated", odd))
    if not rows:
        raise MetadataError("there is a header but no line below it", path=path, remedy=f"Expected {_LAYOUT}.")
    return [row for _, row in rows.values()], findings


def _split(line: str, delimiter: str, number: int, path: Path | None) -> list[str]:
    try:
        return [field.strip() for field in next(csv.reader([line], delimiter=delimiter, strict=True))]
    except (csv.Error, StopIteration) as error:
        raise MetadataError(f"line {number}: {error}", path=path, remedy="Check the quotes on this line.") from error


def _read_header(fields: Sequence[str], path: Path | None) -> tuple[_Columns, list[Finding]]:
    if any(parse_number(field) is not None for field in fields):
        raise MetadataError("the first line has no column names", path=path, remedy=f"Put a header first: {_LAYOUT}.")
    index: dict[str, int] = {}
    names: dict[str, str] = {}
    units: set[str] = set()
    findings: list[Finding] = []
    for position, field in enumerate(fields):
        key, unit = _column(field.strip().lower())
        if key is None:
            if field:
                findings.append(Finding("poses.csv", "unknown-column", f"column {field[:80]!r} is not used"))
            continue
        if key in index:
            raise MetadataError(f"column {key} appears twice", path=path, remedy=f"Expected {_LAYOUT}.")
        index[key], names[key] = position, field
        if unit is not None:
            units.add(unit)
    missing = [key for key in ("image", "x", "y", "z") if key not in index]
    if missing:
        raise MetadataError(f"no column {', '.join(missing)}", path=path, remedy=f"Expected {_LAYOUT}.")
    if len({_UNITS[unit] for unit in units}) > 1:
        raise MetadataError("x, y and z are in different units", path=path, remedy="Give all three in metres.")
    return _Columns(index, names, _UNITS[units.pop()], len(fields)), findings


def _column(name: str) -> tuple[str | None, str | None]:
    """The column a header means, and the unit suffix for a coordinate."""
    for key, aliases in _ALIASES.items():
        if name in aliases:
            return key, None
    if name[:1] in ("x", "y", "z") and name[1:] in _UNITS:
        return name[0], name[1:]
    return None, None


def _read_row(fields: list[str], columns: _Columns, line: int, delimiter: str, path: Path | None) -> PoseRow:
    while len(fields) > columns.count and not fields[-1]:
        fields.pop()
    if len(fields) > columns.count:
        remedy = f"Expected {_LAYOUT}."
        if delimiter == ",":
            remedy = "With decimal commas, separate the fields by semicolons; a name with a comma needs quotes."
        raise MetadataError(
            f"line {line} has {len(fields)} fields, the header {columns.count}", path=path, remedy=remedy
        )

    def field(key: str) -> str:
        position = columns.index.get(key)
        return fields[position] if position is not None and position < len(fields) else ""

    def number(key: str, *, needed: bool = False) -> float | None:
        text = field(key)
        if not text and not needed:
            return None
        value = parse_number(text, decimal_comma=delimiter != ",")
        low, high = _LIMITS.get(key, (-_FAR_M, _FAR_M))
        what = f"line {line}, column {columns.names.get(key, key)}"
        if value is None:
            raise MetadataError(
                f"{what}: {text[:40]!r} is not a number" if text else f"{what} is empty",
                path=path,
                remedy="Write plain numbers such as 1.25; leave a line out when a position is not known.",
            )
        if not low <= value <= high:
            raise MetadataError(f"{what}: {value:g} is outside {low:g} … {high:g}", path=path, remedy="Check the unit.")
        return value

    image = field("image")
    if not image:
        raise MetadataError(f"line {line}: no image name", path=path, remedy=f"Expected {_LAYOUT}.")
    accuracy = number("accuracy_m")
    if accuracy is not None and accuracy <= 0:
        raise MetadataError(
            f"line {line}, column {columns.names['accuracy_m']}: {accuracy:g} is not positive",
            path=path,
            remedy="Give one standard deviation in metres, or leave the field empty.",
        )
    x, y, z = (float(number(key, needed=True) or 0.0) * columns.scale for key in "xyz")
    return PoseRow(image, (x, y, z), number("yaw_deg"), number("pitch_deg"), number("roll_deg"), accuracy)
