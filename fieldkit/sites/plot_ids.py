"""Which field of a plots file holds the plots' ids, and how an id is written as a file's name."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from fieldkit.cache import digest
from fieldkit.sites.vector_files import Feature
from fieldkit.wording import count, listed

ID_FIELDS = ("plot_id", "id", "name", "fid")
"""Looked for in this order, whatever their case."""
_MOST_FIELDS = 12
"""Most fields that are named."""
_MAX_NAME_BYTES = 200
"""Most bytes of a file's name that a plot gives; disks take 255."""
_DEVICE = re.compile(r"(con|prn|aux|nul|com[0-9]|lpt[0-9])(\..*)?", re.IGNORECASE)
_UNSAFE = set('/\\:*?"<>|%')


def plot_file_name(plot: str, reserved: Collection[str] = ()) -> str:
    """A plot's id as the name of a file or folder: what file systems refuse is written %XX.

    Different ids have different names, and none of them is a ``reserved`` one, in whatever case.
    """
    safe = "".join(f"%{ord(c):02X}" if c in _UNSAFE or ord(c) < 32 else c for c in plot)
    if safe.startswith(".") or safe.endswith("."):
        safe = safe.replace(".", "%2E")
    if _DEVICE.fullmatch(safe) or safe.casefold() in {name.casefold() for name in reserved}:
        safe = f"%{ord(safe[0]):02X}{safe[1:]}"
    encoded = safe.encode()
    if len(encoded) <= _MAX_NAME_BYTES:
        return safe
    return f"{encoded[: _MAX_NAME_BYTES - 20].decode('utf-8', 'ignore')}%{digest(plot)[:16]}"


class IdProblem(ValueError):
    """No field gives every plot an id of its own.

    Attributes:
        remedy: what to do.
    """

    def __init__(self, message: str, remedy: str) -> None:
        super().__init__(message)
        self.remedy = remedy


@dataclass(frozen=True)
class PlotIds:
    """The ids of a file's plots."""

    ids: tuple[Any, ...]
    """One for each feature, in their order; text where the file has text or whole numbers."""
    field: str | None
    """That they are from, as the file writes it; None where plots are counted."""

    def sentence(self) -> str:
        """For people, who are to see it before the ids are used: ``32 plots, ids from "plot_id": A01 … D08``."""
        shown = [str(each)[:80] for each in self.ids]
        named = " … ".join([shown[0], shown[-1]]) if len(shown) > 3 else ", ".join(shown)
        plots = count(len(shown), "plot")
        if self.field is None:
            return f"{plots}, counted in the file's order, which has no ids: {named}. --plot-id FIELD takes others"
        return f'{plots}, ids from "{self.field}": {named}'


def plot_ids(features: Sequence[Feature], field: str | None = None) -> PlotIds:
    """The ids of a file's plots: of the first of `ID_FIELDS` that it has.

    Args:
        field: that holds the ids, by its name in the file (case counts only where two differ in nothing else); None
            looks for one.
    """
    fields = list(dict.fromkeys(name for feature in features for name in feature.properties))
    wanted = ID_FIELDS if field is None else (field, field.casefold())
    chosen = next((name for each in wanted for name in fields if each in (name, name.casefold())), None)
    if chosen is None:
        if field is not None:
            remedy = f"--plot-id takes one of the file's fields: {_list(fields)}."
            raise IdProblem(f'no plot has a field "{field}"', remedy)
        return PlotIds(tuple(f"plot-{feature.number}" for feature in features), None)
    ids = [_id(feature.properties, chosen) for feature in features]
    if problem := _problem(ids, features, chosen):
        others = _list([name for name in fields if name != chosen]) or "FIELD"
        raise IdProblem(problem, f"Give every plot an id of its own, or say which field holds them: --plot-id {others}")
    return PlotIds(tuple(ids), chosen)


def _id(properties: Mapping[str, Any], name: str) -> Any:
    """Whole numbers as text, text without blanks about it; anything else as it is."""
    value = properties.get(name)
    if isinstance(value, str):
        return value.strip() or None
    if isinstance(value, float) and value.is_integer() and abs(value) < 10**15:
        value = int(value)
    if isinstance(value, int) and not isinstance(value, bool) and abs(value) < 10**18:
        return str(value)
    return value


def _problem(ids: Sequence[Any], features: Sequence[Feature], name: str) -> str:
    """Why these are no ids; "" where they are."""
    seen: dict[str, tuple[int, str]] = {}
    for feature, own in zip(features, ids, strict=True):
        if own is None:
            return f'feature {feature.number}: has no "{name}", which others have'
        first, alike = seen.setdefault(str(own).casefold(), (feature.number, str(own)))
        shown = str(own)[:80]
        if first != feature.number and alike == str(own):
            return f'feature {feature.number}: is called "{shown}", as feature {first} is (field "{name}")'
        if first != feature.number:
            return (
                f'feature {feature.number}: is called "{shown}" and feature {first} "{alike[:80]}" (field "{name}"): '
                "on Windows and macOS names that differ in case only are one file"
            )
    return ""


def _list(names: Sequence[str]) -> str:
    return listed([name[:40] for name in names], _MOST_FIELDS)
