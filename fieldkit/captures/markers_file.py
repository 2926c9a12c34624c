"""``markers.toml``: printed ArUco or AprilTag markers on the plot, and what is known of their size and distances.

    dictionary = "DICT_4X4_50"      # OpenCV's name; DICT_APRILTAG_36h11 and so on are AprilTags
    side_m = 0.12                   # of the black square as printed; the same for all markers

    [[distance]]                    # measured between the centres of two markers
    a = 3
    b = 7
    distance_m = 1.25

Either ``side_m`` or at least one distance is needed.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import cv2
from pydantic import AliasChoices, Field, TypeAdapter, ValidationInfo, field_validator, model_validator
from pydantic.dataclasses import dataclass

from fieldkit.captures.tables import read_text
from fieldkit.documents.toml_file import toml_document, validated
from fieldkit.errors import about
from fieldkit.results.fields import STRICT

_REMEDY = "Expected dictionary, then side_m or [[distance]] tables with a, b and distance_m (metres), or both."
_Marker = Annotated[int, Field(ge=0)]


@dataclass(frozen=True, config=STRICT)
class MarkerDistance:
    """A measured distance between the centres of markers ``a`` and ``b``, metres."""

    a: _Marker
    b: _Marker
    distance_m: Annotated[float, Field(gt=0.0, le=10_000.0)]

    @model_validator(mode="after")
    def _ordered(self) -> MarkerDistance:
        if self.a == self.b:
            raise ValueError(f"a and b are the same marker {self.a}")
        return self if self.a < self.b else MarkerDistance(self.b, self.a, self.distance_m)


@dataclass(frozen=True, config=STRICT)
class MarkersFile:
    """What is known of the markers."""

    dictionary: str
    """Name of one of OpenCV's predefined dictionaries."""
    side_m: Annotated[float, Field(gt=0.0, le=10.0)] | None = None
    """Length of the black square's side as printed, metres; None where not given."""
    distances: Annotated[tuple[MarkerDistance, ...], Field(validation_alias=AliasChoices("distance", "distances"))] = ()
    """Measured between centres."""

    @field_validator("dictionary")
    @classmethod
    def _known(cls, name: str) -> str:
        return dictionary_name(name[:80])

    @field_validator("distances")
    @classmethod
    def _of_the_dictionary(
        cls, distances: tuple[MarkerDistance, ...], info: ValidationInfo
    ) -> tuple[MarkerDistance, ...]:
        ids = len(marker_dictionary(info.data["dictionary"]).bytesList) if "dictionary" in info.data else 1 << 30
        seen: dict[tuple[int, int], int] = {}
        for number, entry in enumerate(distances, 1):
            if entry.b >= ids:
                raise ValueError(f"{number}: a marker's number is from 0 to {ids - 1}, not {entry.b}")
            first = seen.setdefault((entry.a, entry.b), number)
            if first != number:
                raise ValueError(f"{first} and {number} are between the same markers {entry.a} and {entry.b}")
        return distances

    @model_validator(mode="after")
    def _gives_scale(self) -> MarkersFile:
        if self.side_m is None and not self.distances:
            raise ValueError("neither side_m nor a distance is given, so the markers give no scale")
        return self


def dictionary_name(name: str) -> str:
    """OpenCV's spelling of a dictionary's name: "4x4_50" and "dict_4X4_50" are "DICT_4X4_50"."""
    wanted = name.strip().upper().removeprefix("DICT_")
    for known in _dictionary_names():
        if known.upper() == f"DICT_{wanted}":
            return known
    raise ValueError(f"there is no dictionary {name!r}; known are {', '.join(_dictionary_names())}")


def marker_dictionary(name: str) -> cv2.aruco.Dictionary:
    """OpenCV's predefined dictionary of that name. Raises ValueError as `dictionary_name` does."""
    return cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, dictionary_name(name)))


def _dictionary_names() -> list[str]:
    """As OpenCV's documentation writes them: its Python module has each AprilTag dictionary twice (36h11, 36H11)."""
    unique: dict[str, str] = {}
    for name in sorted(dir(cv2.aruco), reverse=True):
        if name.startswith("DICT_"):
            unique.setdefault(name.upper(), name)
    return sorted(unique.values())


def read_markers_file(path: Path) -> MarkersFile:
    """The content of a markers.toml."""
    with about(path, _REMEDY):
        return parse_markers_file(read_text(path))


def parse_markers_file(text: str) -> MarkersFile:
    """As `read_markers_file`, from text."""
    return validated(TypeAdapter(MarkersFile), toml_document(text))
