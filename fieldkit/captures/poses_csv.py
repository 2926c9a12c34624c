"""``poses.csv``: where photographs were taken, in any metric frame or in degrees.

    image,x_m,y_m,z_m[,yaw_deg,pitch_deg[,roll_deg]][,accuracy_m]

Columns may stand in any order and have the names that Metashape and Pix4D give them (`read_columns`). Fields are
separated by commas, semicolons or tabs, or by blanks where there is none of these. In a file without decimal points
commas in numbers are decimal marks.
"""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fieldkit.captures.tables import keep_row, parse_number, read_text
from fieldkit.documents.csv_text import on_one_line
from fieldkit.errors import MetadataError, about
from fieldkit.geometry import Pose
from fieldkit.geometry.geodesy import on_earth
from fieldkit.geometry.priors import POSITION_SIGMA_M, PosePrior
from fieldkit.results.finding import Finding
from fieldkit.wording import count

_LIMITS = {
    "yaw_deg": (-360.0, 360.0),
    "pitch_deg": (-90.0, 90.0),
    "roll_deg": (-360.0, 360.0),
    "longitude": (-180.0, 180.0),
    "latitude": (-90.0, 90.0),
}
_FAR_M = 1e8
"""Largest coordinate that is believed, metres."""
_DEGREES_EXTENT = 0.1
"""Extent of a capture below which coordinates may be degrees."""
_DEGREES_DECIMALS = 5
"""Least decimals that degrees take to tell a capture's photographs apart."""


_DECIMALS = 5
"""Of metres and degrees that are written."""
_OPTIONAL = ("yaw_deg", "pitch_deg", "roll_deg", "accuracy_m")
LAYOUT = "image,x_m,y_m,z_m[,yaw_deg,pitch_deg[,roll_deg]][,accuracy_m]"
_FOOT_M = 0.3048
"""International foot, metres."""
_SURVEY_FOOT_M = 1200.0 / 3937.0
"""US survey foot, metres."""
_NAMES = {
    "image": "image name filename file photo label imagename photoname imagefile imagefilename",
    "x": "x e east easting",
    "y": "y n north northing",
    "z": "z altitude alt height elevation ellipsoidalheight",
    "longitude": "longitude lon long lng",
    "latitude": "latitude lat",
    "yaw_deg": "yaw",
    "pitch_deg": "pitch",
    "roll_deg": "roll",
    "accuracy": "accuracy accuracyx accuracyy accuracyxy accuracyz accuracyhorz accuracyvert accuracyhorizontal "
    "accuracyvertical horizontalaccuracy verticalaccuracy horzaccuracy vertaccuracy",
}
_KEYS = {name: key for key, names in _NAMES.items() for name in names.split()}
_LENGTHS = {
    **dict.fromkeys(("m", "meter", "meters", "metre", "metres"), 1.0),
    **dict.fromkeys(("cm", "centimeters", "centimetres"), 0.01),
    **dict.fromkeys(("mm", "millimeters", "millimetres"), 0.001),
    **dict.fromkeys(("ft", "feet", "foot", "intft"), _FOOT_M),
    **dict.fromkeys(("ftus", "usft", "ussurveyfeet", "ussurveyfoot", "surveyfeet"), _SURVEY_FOOT_M),
}
_DEGREES = frozenset({"deg", "degree", "degrees", "decimaldegrees", "dd", "°"})
_UNIT = re.compile(r"(?<![\s_])[\s_]*[(\[]([^()\[\]]*)[)\]]\s*$|[\s_](m|cm|mm|ft|ftus|usft|deg)\s*$")
_NOT_LETTERS = re.compile(r"[^a-z°]+")


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

    @classmethod
    def of(cls, image: str, pose: Pose, accuracy_m: float | None = None, *, roll: bool = False) -> PoseRow:
        """A photograph's pose; ``roll`` also gives the roll, which commanded poses do not have."""
        yaw, pitch, roll_deg = pose.yaw_pitch_roll_deg()
        x, y, z = pose.center.tolist()
        return cls(image, (x, y, z), yaw, pitch, roll_deg if roll else None, accuracy_m)

    def prior(self, source: str) -> PosePrior:
        """What it says in its frame of metres."""
        sigma = POSITION_SIGMA_M if self.accuracy_m is None else self.accuracy_m
        prior = PosePrior(np.array(self.position), sigma, source=source)
        return prior.with_angles((self.yaw_deg, self.pitch_deg, self.roll_deg))


def poses_table(rows: Sequence[PoseRow]) -> str:
    """The text of a poses.csv: metres and degrees, one line per photograph, with the columns that any of them has."""
    keys = [key for key in _OPTIONAL if any(getattr(row, key) is not None for row in rows)]
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["image", "x_m", "y_m", "z_m", *keys])
    for row in rows:
        values = (*row.position, *(getattr(row, key) for key in keys))
        writer.writerow([on_one_line(row.image), *(v if v is None else round(float(v), _DECIMALS) for v in values)])
    return text.getvalue()


def read_poses_csv(path: Path) -> tuple[list[PoseRow], list[Finding]]:
    """The rows of a poses.csv and what is odd about it."""
    with about(path, f"Expected {LAYOUT}."):
        return parse_poses_csv(read_text(path))


def parse_poses_csv(text: str) -> tuple[list[PoseRow], list[Finding]]:
    """As `read_poses_csv`, from text."""
    numbered = [(n, line) for n, line in enumerate(text.split("\n"), 1) if line.strip()]
    lines = [(n, line) for n, line in numbered if not line.lstrip().startswith("#")]
    # Metashape and Pix4D put "#" before the column names; the last such line above the first row counts.
    above = [(n, line) for n, line in numbered if line.lstrip().startswith("#") and (not lines or n < lines[0][0])]
    for number, line in reversed(above):
        bare = line.lstrip().lstrip("#")
        if names_an_image(_split(bare, _delimiter(bare), number, lenient=True)):
            lines.insert(0, (number, bare))
            break
    if not lines:
        raise MetadataError("the file is empty")
    delimiter = _delimiter(lines[0][1])
    header = _split(lines[0][1], delimiter, lines[0][0])
    if any(parse_number(field) is not None for field in header):
        raise MetadataError("the first line has no column names", remedy=f"Put a header first: {LAYOUT}.")
    columns, findings = read_columns(header)
    fields = [(number, _fields(line, delimiter, columns, number)) for number, line in lines[1:]]
    numeric = [k for key, k in columns.index.items() if key != "image"] + [k for k, _ in columns.accuracies]
    comma = not any("." in row[k] for _, row in fields for k in numeric if k < len(row))
    rows: dict[str, tuple[int, PoseRow]] = {}
    decimals = 0
    for number, row_fields in fields:
        row = _read_row(row_fields, columns, number, comma)
        if row is None:
            continue
        decimals = max(decimals, _decimals(row_fields, columns))
        if odd := keep_row(rows, row.image, row, number, "pose"):
            findings.append(Finding(row.image, "pose-repeated", odd))
    if not rows:
        raise MetadataError("there is a header but no line below it")
    found = [row for _, row in rows.values()]
    if decimals >= _DEGREES_DECIMALS and not columns.geographic:
        _refuse_degrees(found)
    return found, findings


def _delimiter(header: str) -> str:
    return next((mark for mark in (";", "\t", ",") if mark in header), " ")


def _split(line: str, delimiter: str, number: int, *, lenient: bool = False) -> list[str]:
    if delimiter == " ":
        return line.split()
    try:
        return [field.strip() for field in next(csv.reader([line], delimiter=delimiter, strict=True))]
    except (csv.Error, StopIteration) as error:
        if lenient:
            return []
        raise MetadataError(f"line {number}: {error}", remedy="Check the quotes on this line.") from error


def _fields(line: str, delimiter: str, columns: PoseColumns, number: int) -> list[str]:
    fields = _split(line, delimiter, number)
    extra = len(fields) - columns.count
    if delimiter == " " and extra > 0 and columns.index["image"] == 0:  # a name with blanks
        fields = [" ".join(fields[: extra + 1]), *fields[extra + 1 :]]
    while len(fields) > columns.count and not fields[-1]:
        fields.pop()
    if len(fields) > columns.count:
        commas = "With decimal commas, separate the fields by semicolons; a name with a comma needs quotes."
        message = f"line {number} has {count(len(fields), 'field')}, the header {columns.count}"
        raise MetadataError(message, remedy=commas if delimiter == "," else "")
    return fields


def _decimals(fields: Sequence[str], columns: PoseColumns) -> int:
    """Decimals that x and y are both written with."""
    plane = (fields[columns.index[key]] for key in columns.coordinates[:2])
    return min(len(text.replace(",", ".").partition(".")[2]) for text in plane)


def _refuse_degrees(rows: Sequence[PoseRow]) -> None:
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
        remedy="Name the columns longitude, latitude and altitude if they are degrees, or give x, y, z in metres.",
    )


def _read_row(fields: Sequence[str], columns: PoseColumns, line: int, comma: bool) -> PoseRow | None:
    """A line's pose; None where it gives a photograph no position at all."""

    def field(position: int | None) -> str:
        return fields[position] if position is not None and position < len(fields) else ""

    def number(position: int | None, key: str, *, needed: bool = False) -> float | None:
        text = field(position)
        if not text and not needed:
            return None
        value = parse_number(text, decimal_comma=comma)
        low, high = _LIMITS.get(key, (-_FAR_M, _FAR_M))
        what = f"line {line}, column {columns.names[position] if position is not None else key}"
        if value is None:
            raise MetadataError(
                f"{what}: {text[:40]!r} is not a number" if text else f"{what} is empty",
                remedy="Write plain numbers such as 1.25, all with one decimal mark, none between thousands; leave a "
                "line out when a position is not known.",
            )
        if not low <= value <= high:
            raise MetadataError(f"{what}: {value:g} is outside {low:g} … {high:g}", remedy="Check the unit.")
        return value

    image = field(columns.index["image"])
    if not image:
        raise MetadataError(f"line {line}: no image name")
    if len(fields) == columns.count and not any(field(columns.index[key]) for key in columns.coordinates):
        return None
    deviations = [(number(k, "accuracy"), unit, k) for k, unit in columns.accuracies]
    for value, _, k in deviations:
        if value is not None and value <= 0:
            raise MetadataError(
                f"line {line}, column {columns.names[k]}: {value:g} is not positive",
                remedy="Give one standard deviation in metres, or leave the field empty.",
            )
    first, second, up = (float(number(columns.index[key], key, needed=True) or 0.0) for key in columns.coordinates)
    plane = 1.0 if columns.geographic else columns.scale
    yaw, pitch, roll = (number(columns.index.get(key), key) for key in ("yaw_deg", "pitch_deg", "roll_deg"))
    accuracy = max((value * unit for value, unit, _ in deviations if value is not None), default=None)
    position = (first * plane, second * plane, up * columns.scale)
    return PoseRow(image, position, yaw, pitch, roll, accuracy, columns.geographic)


@dataclass(frozen=True)
class PoseColumns:
    """Where a table keeps what."""

    index: dict[str, int]
    """Column by what it means: ``image``, ``x`` and ``y`` or ``longitude`` and ``latitude``, ``z``, angles."""
    accuracies: tuple[tuple[int, float], ...]
    """Columns of standard deviations, and metres per their unit."""
    names: tuple[str, ...]
    """The header's own names, by column."""
    scale: float
    """Metres per unit of x, y and z (of z alone beside longitude and latitude)."""

    @property
    def count(self) -> int:
        """Of columns, named or not."""
        return len(self.names)

    @property
    def geographic(self) -> bool:
        """Whether positions are longitude and latitude."""
        return "longitude" in self.index

    @property
    def coordinates(self) -> tuple[str, str, str]:
        """What the three columns of positions mean."""
        return ("longitude", "latitude", "z") if self.geographic else ("x", "y", "z")


def read_columns(fields: Sequence[str]) -> tuple[PoseColumns, list[Finding]]:
    """The columns that a header names, and a finding for those that are not used."""
    index: dict[str, int] = {}
    units: dict[str, float] = {}
    accuracies: list[tuple[int, float]] = []
    unused: list[str] = []
    for position, field in enumerate(fields):
        key, unit = _column(field)
        if key == "accuracy":
            accuracies.append((position, unit or 1.0))
        elif key is None:
            unused += [field] if field else []
        elif key in index:
            raise MetadataError(f"column {key} appears twice")
        else:
            index[key] = position
            if unit is not None:
                units[key] = unit
    plane = ("longitude", "latitude") if {"longitude", "latitude"} & set(index) else ("x", "y")
    missing = [key for key in ("image", *plane, "z") if key not in index]
    if missing:
        raise MetadataError(f"no column {', '.join(missing)}")
    if plane[0] != "x" and {"x", "y"} & set(index):
        # Beside degrees, as some exports have both, projected coordinates say nothing more.
        unused += [fields[index.pop(key)] for key in ("x", "y") if key in index]
    lengths = {units[key] for key in (*plane, "z") if key in units and key in ("x", "y", "z")}
    if len(lengths) > 1:
        raise MetadataError("x, y and z are in different units", remedy="Give all three in metres.")
    findings = []
    if unused:
        listed = ", ".join(repr(name[:80]) for name in unused[:8]) + (" …" if len(unused) > 8 else "")
        said = f"columns {listed} are not used" if len(unused) > 1 else f"column {listed} is not used"
        findings.append(Finding("poses.csv", "unknown-column", said))
    return PoseColumns(index, tuple(accuracies), tuple(fields), lengths.pop() if lengths else 1.0), findings


def names_an_image(fields: Sequence[str]) -> bool:
    """Whether a line looks like a header: it names a column of images and one of positions."""
    keys = {_column(field)[0] for field in fields}
    return "image" in keys and bool(keys & {"x", "longitude", "z"})


def _column(field: str) -> tuple[str | None, float | None]:
    """What a header's field means, and metres per unit of a length."""
    text = field.strip().lower()
    found = _UNIT.search(text)
    unit = _NOT_LETTERS.sub("", (found[1] or found[2] or "") if found else "")
    bare = text[: found.start()] if found else text
    whole = _NOT_LETTERS.sub("", bare)
    # Metashape's X/Easting and Z/Altitude: what stands behind the slash says what it is.
    key = _KEYS.get(whole) or (_KEYS.get(_NOT_LETTERS.sub("", bare.rpartition("/")[2])) if "/" in bare else None)
    if key in ("x", "y") and unit in _DEGREES:
        return {"x": "longitude", "y": "latitude"}[key], None
    if key in ("x", "y", "z", "accuracy"):
        if unit and unit not in _LENGTHS:
            return None, None
        return key, _LENGTHS.get(unit, 1.0)
    return key, None
