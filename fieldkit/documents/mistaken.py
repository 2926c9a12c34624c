"""What people give by mistake in the place of something else: the one table of slips, and how each is noticed."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from difflib import get_close_matches
from functools import wraps
from importlib import import_module
from itertools import islice
from pathlib import Path
from typing import NamedTuple, ParamSpec, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from fieldkit.documents.toml_file import parse_toml
from fieldkit.errors import MetadataError, UsageError
from fieldkit.geometry.geodesy import great_circle_m, on_earth
from fieldkit.regular_files import read_regular

P = ParamSpec("P")
T = TypeVar("T")


class Slip(NamedTuple):
    """One thing given in the place of another."""

    given: str
    looks_like: str
    """Words that end a message."""
    remedy: str


SWAPPED = Slip(
    "longitude and latitude in the other order",
    "latitude and longitude look swapped",
    "GeoJSON and geo.txt give the longitude first, a site file the latitude.",
)
PROJECTED = Slip(
    "metres for degrees",
    "metres of a map projection look like this",
    "Export it in WGS 84 (EPSG:4326): in QGIS, Save Features As… with that CRS.",
)
DEGREES = Slip(
    "degrees for metres",
    "these look like degrees",
    "Name them longitude and latitude, with the CRS WGS 84 (EPSG:4326), or give metres.",
)
CENTIMETRES = Slip("centimetres or millimetres for metres", "in centimetres?", "Write metres.")
MISSPELT = Slip("a name that nearly is one", "Did you mean {}?", "")
OTHER_KIND = Slip("a file of another kind", "is {}, not {}", "")


def look_swapped(
    latitude_deg: float, longitude_deg: float, near: tuple[float, float] | None = None, within_m: float = 0.0
) -> bool:
    """Whether coordinates that cannot be right would be so with latitude and longitude swapped.

    Args:
        latitude_deg, longitude_deg: of no place on Earth, or of one that is too far away.
        near: latitude and longitude of the place that it should lie near; None where any place on Earth would do.
        within_m: how near.
    """
    if not on_earth(longitude_deg, latitude_deg):
        return False
    return near is None or float(great_circle_m(longitude_deg, latitude_deg, *near)[0]) <= within_m


def look_like_degrees(x: ArrayLike, y: ArrayLike) -> bool:
    """Whether all coordinates, said to be metres, are within ±180 and ±90."""
    return bool(np.abs(x).max(initial=0.0) <= 180.0 and np.abs(y).max(initial=0.0) <= 90.0)


def as_centimetres(value: float, most: float) -> str:
    """Words after a length in metres that is too large, where it would not be in centimetres; else empty."""
    return f": {CENTIMETRES.looks_like} {value:g} cm are {value / 100.0:g} m" if most < value <= 100.0 * most else ""


def nearest(given: str, known: Iterable[str], likeness: float = 0.6) -> str | None:
    """The name of those known that was probably meant."""
    return next(iter(get_close_matches(given[:200], list(known), n=1, cutoff=likeness)), None)


def did_you_mean(given: str, known: Iterable[str], otherwise: str) -> str:
    """A remedy: the nearest name that is known, or ``otherwise``."""
    near = nearest(given, known)
    return otherwise if near is None else MISSPELT.looks_like.format(near)


def check_names(where: str, given: Iterable[str], known: Iterable[str]) -> None:
    """Raise UsageError for the first argument or field that is not known, with the nearest one that is."""
    names = list(known)
    for name in given:
        if name not in names:
            raise UsageError(f"{where} has no {name}", remedy=did_you_mean(name, names, f"It has {', '.join(names)}."))


def checked_call(function: Callable[P, T]) -> Callable[P, T]:
    """The function, whose wrong arguments are a UsageError."""
    signature = inspect.signature(function)
    open_ended = any(each.kind is each.VAR_KEYWORD for each in signature.parameters.values())

    @wraps(function)
    def called(*arguments: P.args, **keywords: P.kwargs) -> T:
        if not open_ended and not keywords.keys() <= signature.parameters.keys():
            fields = _settings_fields(signature)
            for name in keywords:
                if name in fields and name not in signature.parameters:
                    remedy = f"Give it as {fields[name]}({name}=…)."
                    raise UsageError(f"{function.__name__} has no {name}", remedy=remedy)
            check_names(function.__name__, keywords, [*signature.parameters, *fields])
        try:
            signature.bind(*arguments, **keywords)
        except TypeError as error:
            raise UsageError(f"{function.__name__}: {error}", remedy=f"It takes {signature}.") from None
        return function(*arguments, **keywords)

    called.__module__ = "fieldkit"  # where it is found by its name
    return called


def _settings_fields(signature: inspect.Signature) -> dict[str, str]:
    """The class of settings, among fieldkit's names, of each field that a verb takes in its ``settings``."""
    if "settings" not in signature.parameters:
        return {}
    kind = str(signature.parameters["settings"].annotation).partition(" |")[0]
    owner = getattr(import_module("fieldkit"), kind)
    return dict.fromkeys(getattr(owner, "model_fields", None) or owner.__dataclass_fields__, kind)


_PICTURES = frozenset({".jpg", ".jpeg", ".png", ".tif", ".tiff", ".dng", ".arw", ".cr2", ".nef"})
_SUFFIXES = {
    ".plan": "mission",
    ".waypoints": "mission",
    ".kmz": "mission",
    ".geojson": "file of plots or zones",
    ".shp": "file of plots or zones",
    ".gpkg": "file of plots or zones",
    ".kml": "file of plots or zones",
    ".tlog": "flight log",
    ".bin": "flight log",
    ".ulg": "flight log",
    ".ply": "point cloud",
    ".las": "point cloud",
    ".laz": "point cloud",
} | dict.fromkeys(_PICTURES, "picture")
_MARKERS = {
    "campaign.toml": "campaign",
    "demo.json": "demo",
    "reference.json": "reference",
    "evaluation.json": "evaluation",
    "plan.json": "plan",
    "search.json": "run of fieldkit plan without a plan yet",
}
"""By the file that a result's folder holds; campaigns and demos hold others' files, too."""
_KEYS = {"home": "site file", "dialect": "vehicle profile", "mount": "vehicle profile", "plot": "scene file"}
_MOST_BYTES = 1 << 20
"""Most bytes of a file that is looked into."""
_MOST_ENTRIES = 200
"""Most entries of a folder that are looked at."""


def refuse_other(path: Path, noun: str, remedy: str = "") -> None:
    """Say what was given instead, where that can be told; nothing is said of what may be the right thing.

    Args:
        path: a file or folder, or a missing file of a result's folder.
        noun: what is wanted: "plan", "reference", "evaluation", "campaign", "site file", "scene file", "vehicle
            profile" or "mission".
        remedy: of the error; else what is said about the file (`fieldkit.errors.about`).
    """
    given = path.parent if path.name in _MARKERS and not path.exists() and path.name != path.as_posix() else path
    found = next(_kinds(given), None)
    if found is not None and found != noun:
        message = OTHER_KIND.looks_like.format(_with_article(found), _with_article(noun))
        raise MetadataError(message, path=None if given == path and not remedy else given, remedy=remedy)


def _with_article(noun: str) -> str:
    return f"{'an' if noun[0] in 'aeiou' else 'a'} {noun}"


def _kinds(path: Path) -> Iterator[str]:
    """What it is, if that can be told."""
    with suppress(OSError, ValueError, RecursionError):
        if path.is_dir():
            held = {entry.name for entry in islice(path.iterdir(), _MOST_ENTRIES)}
            yield from (kind for name, kind in _MARKERS.items() if name in held)
            inside = (entry for part in sorted(held) for entry in _first(path / part))
            result = any(name.endswith((".json", ".ply")) for name in held)  # with its own pictures
            if not result and any(entry.suffix.lower() in _PICTURES for entry in inside):
                yield "folder of photographs"
        elif path.is_file() and path.name in _MARKERS:
            yield _MARKERS[path.name]
        elif path.suffix.lower() == ".toml":
            document = parse_toml(read_regular(path, _MOST_BYTES).decode("utf-8-sig"))
            yield from (kind for key, kind in _KEYS.items() if key in document)
        elif path.is_file() and path.suffix.lower() in _SUFFIXES:
            yield _SUFFIXES[path.suffix.lower()]


def _first(path: Path) -> list[Path]:
    """A file, or the first entries of a folder: a card has a folder for each plot."""
    return list(islice(path.iterdir(), _MOST_ENTRIES)) if path.is_dir() else [path]
