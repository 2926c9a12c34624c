"""``poses.csv``: where photographs were taken, in any metric frame or in degrees.

    image,x_m,y_m,z_m[,yaw_deg,pitch_deg[,roll_deg]][,accuracy_m]

Columns may stand in any order and have the names that Metashape and Pix4D give them (`pose_columns`). Fields are
separated by commas, semicolons or tabs, or by blanks where there is none of these. Where commas do not separate fields,
they are decimal marks or stand between thousands.
"""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fieldkit.captures.pose_columns import LAYOUT, PoseColumns, names_an_image, read_columns
from fieldkit.captures.tables import NumberStyle, keep_row, number_style, parse_number, read_text
from fieldkit.errors import MetadataError
from fieldkit.geometry.geodesy import on_earth
from fieldkit.results.finding import Finding
from fieldkit.wording import count

_LIMITS = {
    "yaw_deg": (-360.0, 360.0), "pitch_deg": (-90.0, 90.0), "roll_deg": (-360.0, 360.0),
    "longitude": (-180.0, 180.0), "latitude": (-90.0, 90.0),
}  # fmt: skip
_FAR_M = 1e8
_DEGREES_EXTENT, _DEGREES_DECIMALS = 0.1, 5
"""Degrees of one capture differ by less, and take at least so many decimals to tell its photographs apart."""


@dataclass(frozen=True)
class PoseRow:
    """One line: metres and degrees; None where a column is absent or the field empty."""

    image: str
    position: tuple[float, float, float]
    """X, y, z; where ``geographic`` longitude and latitude in degrees and the altitude in metres."""
    yaw_deg: float | None = None
    pitch_deg: float | None = None
    roll_deg: float | None = None
    accuracy_m: float | None = None
    geographic: bool = False


def read_poses_csv(path: Path) -> tuple[list[PoseRow], list[Finding]]:
    """The rows of a poses.csv and what is odd about it."""
    return parse_poses_csv(read_text(path), path)


def parse_poses_csv(text: str, path: Path | None = None) -> tuple[list[PoseRow], list[Finding]]:
    """As `read_poses_csv`, from text; ``path`` is for messages."""
    numbered = [(n, line) for n, line in enumerate(text.split("\n"), 1) if line.strip()]
    lines = [(n, line) for n, line in numbered if not line.lstrip().startswith("#")]
    # Metashape and Pix4D put "#" before the column names; the last such line above the first row counts.
    above = [(n, line) for n, line in numbered if line.lstrip().startswith("#") and (not lines or n < lines[0][0])]
    for number, line in reversed(above):
        bare = line.lstrip().lstrip("#")
        if names_an_image(_split(bare, _delimiter(bare), number, path, lenient=True)):
            lines.insert(0, (number, bare))
            break
    if not lines:
        raise MetadataError("the file is empty", path=path, remedy=f"Expected {LAYOUT}.")
    delimiter = _delimiter(lines[0][1])
    header = _split(lines[0][1], delimiter, lines[0][0], path)
    if any(parse_number(field) is not None for field in header):
        raise MetadataError("the first line has no column names", path=path, remedy=f"Put a header first: {LAYOUT}.")
    columns, findings = read_columns(header, path)
    fields = [(number, _fields(line, delimiter, columns, number, path)) for number, line in lines[1:]]
    style = number_style(
        row[k] for _, row in fields for k in range(min(columns.count, len(row))) if k != columns.index["image"]
    )
    if not style.certain:
        findings.append(Finding("poses.csv", "number-ambiguous", _ambiguous(style)))
    rows: dict[str, tuple[int, PoseRow]] = {}
    decimals = 0
    for number, row_fields in fields:
        row = _read_row(row_fields, columns, number, style, path)
        if row is None:
            continue
        decimals = max(decimals, _decimals(row_fields, columns, style))
        if odd := keep_row(rows, row.image, row, number, "pose", path):
            findings.append(Finding(row.image, "pose-repeated", odd))
    if not rows:
        raise MetadataError("there is a header but no line below it", path=path, remedy=f"Expected {LAYOUT}.")
    found = [row for _, row in rows.values()]
    if decimals >= _DEGREES_DECIMALS and not columns.geographic:
        _refuse_degrees(found, path)
    return found, findings


def _delimiter(header: str) -> str:
    return next((mark for mark in (";", "\t", ",") if mark in header), " ")


def _split(line: str, delimiter: str, number: int, path: Path | None, *, lenient: bool = False) -> list[str]:
    if delimiter == " ":
        return line.split()
    try:
        return [field.strip() for field in next(csv.reader([line], delimiter=delimiter, strict=True))]
    except (csv.Error, StopIteration) as error:
        if lenient:
            return []
        raise MetadataError(f"line {number}: {error}", path=path, remedy="Check the quotes on this line.") from error


def _fields(line: str, delimiter: str, columns: PoseColumns, number: int, path: Path | None) -> list[str]:
    fields = _split(line, delimiter, number, path)
    extra = len(fields) - columns.count
    if delimiter == " " and extra > 0 and columns.index["image"] == 0:  # a name with blanks
        fields = [" ".join(fields[: extra + 1]), *fields[extra + 1 :]]
    while len(fields) > columns.count and not fields[-1]:
        fields.pop()
    if len(fields) > columns.count:
        remedy = f"Expected {LAYOUT}."
        if delimiter == ",":
            remedy = "With decimal commas, separate the fields by semicolons; a name with a comma needs quotes."
        raise MetadataError(
            f"line {number} has {count(len(fields), 'field')}, the header {columns.count}", path=path, remedy=remedy
        )
    return fields


def _ambiguous(style: NumberStyle) -> str:
    if style.decimal == ",":
        return "commas are read as decimal marks (1,234 as 1.234); if they stand between thousands, remove them"
    return "commas are read as marks between thousands (1,234 as 1234); write decimals with one mark throughout"


def _decimals(fields: Sequence[str], columns: PoseColumns, style: NumberStyle) -> int:
    """Decimals that x and y are both written with."""
    plane = (fields[columns.index[key]] for key in columns.coordinates[:2])
    return min(len(text.replace(style.decimal, ".").partition(".")[2]) for text in plane)


def _refuse_degrees(rows: Sequence[PoseRow], path: Path | None) -> None:
    """Longitude and latitude under the names x and y: a whole flight would be a millimetre wide."""
    plane = np.array([row.position[:2] for row in rows])
    extent = np.ptp(plane, axis=0)
    if len(rows) < 2 or not 0.0 < extent.max() < _DEGREES_EXTENT or np.abs(plane.mean(axis=0)).max() < 1.0:
        return
    if not (on_earth(*plane.max(axis=0)[::-1]) or on_earth(*plane.max(axis=0))):
        return
    x, y = rows[0].position[:2]
    raise MetadataError(
        f"x and y look like degrees, not metres ({x:.6f}, {y:.6f}; all photographs within {extent.max():.2g})",
        path=path,
        remedy="Name the columns longitude, latitude and altitude if they are degrees, or give x, y, z in metres.",
    )


def _read_row(
    fields: Sequence[str], columns: PoseColumns, line: int, style: NumberStyle, path: Path | None
) -> PoseRow | None:
    """A line's pose; None where it gives a photograph no position at all."""

    def field(position: int | None) -> str:
        return fields[position] if position is not None and position < len(fields) else ""

    def number(position: int | None, key: str, *, needed: bool = False) -> float | None:
        text = field(position)
        if not text and not needed:
            return None
        value = parse_number(text, style)
        low, high = _LIMITS.get(key, (-_FAR_M, _FAR_M))
        what = f"line {line}, column {columns.names[position] if position is not None else key}"
        if value is None:
            raise MetadataError(
                f"{what}: {text[:40]!r} is not a number" if text else f"{what} is empty",
                path=path,
                remedy="Write plain numbers such as 1.25; leave a line out when a position is not known.",
            )
        if not low <= value <= high:
            raise MetadataError(f"{what}: {value:g} is outside {low:g} … {high:g}", path=path, remedy="Check the unit.")
        return value

    image = field(columns.index["image"])
    if not image:
        raise MetadataError(f"line {line}: no image name", path=path, remedy=f"Expected {LAYOUT}.")
    if len(fields) == columns.count and not any(field(columns.index[key]) for key in columns.coordinates):
        return None
    deviations = [(number(k, "accuracy"), unit, k) for k, unit in columns.accuracies]
    for value, _, k in deviations:
        if value is not None and value <= 0:
            raise MetadataError(
                f"line {line}, column {columns.names[k]}: {value:g} is not positive",
                path=path,
                remedy="Give one standard deviation in metres, or leave the field empty.",
            )
    first, second, up = (float(number(columns.index[key], key, needed=True) or 0.0) for key in columns.coordinates)
    plane = 1.0 if columns.geographic else columns.scale
    yaw, pitch, roll = (number(columns.index.get(key), key) for key in ("yaw_deg", "pitch_deg", "roll_deg"))
    accuracy = max((value * unit for value, unit, _ in deviations if value is not None), default=None)
    position = (first * plane, second * plane, up * columns.scale)
    return PoseRow(image, position, yaw, pitch, roll, accuracy, columns.geographic)
