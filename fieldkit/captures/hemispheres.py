"""Coordinates without a hemisphere letter: their sign is that of the other photographs, or they are refused."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from fieldkit.captures.model import Photo
from fieldkit.results.finding import Finding
from fieldkit.wording import count

_NEAR_DEG = 0.5
_LETTERS = {"latitude": ("GPSLatitudeRef", "north or south"), "longitude": ("GPSLongitudeRef", "east or west")}


def settle_hemispheres(photos: Sequence[Photo]) -> tuple[list[Photo], list[Finding]]:
    """Photographs whose geotags have signs, and what was taken from the others or is not used.

    Assuming north and east would mirror a layout, which puts a plot upside down without any sign of it.
    """
    settled = list(photos)
    findings: list[Finding] = []
    for which in _LETTERS:
        settled, found = _settled(settled, which)
        findings += found
    return settled, findings


def _settled(photos: list[Photo], which: str) -> tuple[list[Photo], list[Finding]]:
    known = [
        _value(photo, which) for photo in photos if photo.geotag is not None and which not in photo.geotag.unsigned
    ]
    result: list[Photo] = []
    taken: list[str] = []
    refused: list[str] = []
    for photo in photos:
        if photo.geotag is None or which not in photo.geotag.unsigned:
            result.append(photo)
            continue
        size = abs(_value(photo, which))
        signs = {value < 0 for value in known if abs(abs(value) - size) < _NEAR_DEG}
        if len(signs) == 1:
            taken.append(photo.name)
            tag = replace(photo.geotag, unsigned=tuple(u for u in photo.geotag.unsigned if u != which))
            value = -size if signs.pop() else size
            tag = replace(tag, latitude_deg=value) if which == "latitude" else replace(tag, longitude_deg=value)
            result.append(replace(photo, geotag=tag))
        else:
            refused.append(photo.name)
            result.append(replace(photo, geotag=None))
    tag_name, sides = _LETTERS[which]
    findings = []
    if taken:
        message = f"{_count(taken)} no {tag_name}; {sides} is taken from the other photographs"
        findings.append(Finding(taken[0], "gps-hemisphere", message))
    if refused:
        message = (
            f"{_count(refused)} no {tag_name}, and nothing else says whether the {which} is {sides}; the position is "
            "not used. Put the positions into a geo.txt"
        )
        findings.append(Finding(refused[0], "gps-hemisphere", message))
    return result, findings


def _value(photo: Photo, which: str) -> float:
    assert photo.geotag is not None
    return photo.geotag.latitude_deg if which == "latitude" else photo.geotag.longitude_deg


def _count(names: list[str]) -> str:
    return count(len(names), "photograph has", "photographs have")
