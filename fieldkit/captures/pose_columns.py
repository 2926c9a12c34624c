"""Which columns of a table of poses mean what: fieldkit's own names, and those of Metashape and Pix4D.

Metashape writes ``#Label,X/Easting,Y/Northing,Z/Altitude,…,Yaw,Pitch,Roll`` or ``X/Longitude,Y/Latitude``, Pix4D
``imageName X Y Z Omega Phi Kappa`` or ``imagename,latitude [decimal degrees],…``.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from fieldkit.errors import MetadataError
from fieldkit.results.finding import Finding

LAYOUT = "image,x_m,y_m,z_m[,yaw_deg,pitch_deg[,roll_deg]][,accuracy_m]"
_FOOT_M, _SURVEY_FOOT_M = 0.3048, 1200.0 / 3937.0
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
_UNIT = re.compile(r"[\s_]*[(\[]([^)\]]*)[)\]]\s*$|[\s_](m|cm|mm|ft|ftus|usft|deg)\s*$")
_NOT_LETTERS = re.compile(r"[^a-z°]+")


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


def read_columns(fields: Sequence[str], path: Path | None) -> tuple[PoseColumns, list[Finding]]:
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
            raise MetadataError(f"column {key} appears twice", path=path, remedy=f"Expected {LAYOUT}.")
        else:
            index[key] = position
            if unit is not None:
                units[key] = unit
    plane = ("longitude", "latitude") if {"longitude", "latitude"} & set(index) else ("x", "y")
    missing = [key for key in ("image", *plane, "z") if key not in index]
    if missing:
        raise MetadataError(f"no column {', '.join(missing)}", path=path, remedy=f"Expected {LAYOUT}.")
    if plane[0] != "x" and {"x", "y"} & set(index):
        # Beside degrees, as some exports have both, projected coordinates say nothing more.
        unused += [fields[index.pop(key)] for key in ("x", "y") if key in index]
    lengths = {units[key] for key in (*plane, "z") if key in units and key in ("x", "y", "z")}
    if len(lengths) > 1:
        raise MetadataError("x, y and z are in different units", path=path, remedy="Give all three in metres.")
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
