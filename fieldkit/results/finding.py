"""Something a person should know: of a photograph, a plot, a plan on a plot, a mission's item or a station."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from typing import Annotated, Any, Literal

from pydantic import AliasChoices, Field, model_serializer
from pydantic.dataclasses import dataclass
from pydantic.json_schema import SkipJsonSchema

from fieldkit.errors import MissionError
from fieldkit.results.fields import STRICT, Count, Text
from fieldkit.results.plan import station_number
from fieldkit.wording import by_key, count, listed

Severity = Literal["error", "warning", "note"]

OTHER_PLANTS = "other-plants"
"""The cloud is hardly of the reference's plants: its distance says nothing of its quality."""

PLANTS_APART = "plants-apart"
"""Some plants stand far from the others: weeds or neighbours, perhaps."""

PLOTS_TOGETHER = "plots-together"
"""Photographs of several plots were reconstructed as one."""

VOLUME_CUTS_PLANTS = "volume-cuts-plants"
"""Plants reach the top of what was reconstructed."""

OUTLINE_UNSURE = "outline-unsure"
"""A plot's outline may lie over other plants than its own."""

POSES_STATED = "poses-stated"
"""Photographs count by stated poses that nothing in the pictures confirms."""

POSITIONS_LAG = "positions-lag"
"""Recorded positions are those of a moment before or after the photographs."""

WEAKLY_TIED = "weakly-tied"
"""Photographs' places are known too poorly, by their matches and positions."""

SIDES_HIDDEN = "sides-hidden"
"""Sides of the plants that no two photographs show well enough."""

NO_RASTERS, COARSE_RASTERS = "no-rasters", "coarse-rasters"
"""Why there are none; that they may lie metres off."""

DOUBTFUL = frozenset({
    OTHER_PLANTS, "few-plant-points", "volume-below-ground", "cameras-off-level", "steep-ground",
    VOLUME_CUTS_PLANTS, "refinement-not-converged", WEAKLY_TIED, POSITIONS_LAG,
    PLOTS_TOGETHER, OUTLINE_UNSURE, "far-from-reference",
})  # fmt: skip
"""Codes of findings with which a result must not be taken as it is."""

TOLD = DOUBTFUL | {
    "too-few-positions",
    "several-places",
    "several-take-offs",
    "mixed-cameras",
    "altitude-zero",
    "gps-datum",
    "gps-repeated",
    "no-colours",
    "undistorted-model",
    "heights-joined",
    "other-camera",
    "scale-uncertain",
    "no-ground",
    POSES_STATED,
    SIDES_HIDDEN,
    "leaves-swayed",
}
"""Codes that are told beside a result's figures."""

_NUMBER = re.compile(r"[-+]?[0-9][0-9.,:]*")
_MOST_KINDS = 6
"""Most kinds of findings that are told."""


@dataclass(frozen=True, config=STRICT)
class Finding:
    """Something a person should know about one file or plot."""

    subject: Annotated[Text, Field(validation_alias=AliasChoices("name", "subject"))]
    """The file."""
    code: str
    """Kebab-case; docs/captures.md lists those of captures."""
    message: Text
    left_out: bool = False
    """Whether the file was not used because of it."""
    severity: SkipJsonSchema[Severity] = "warning"
    """With an error a plan or mission must not be flown."""
    remedy: SkipJsonSchema[Text] = ""
    """What to do about it; empty where there is nothing to do."""
    item: SkipJsonSchema[Count | None] = None
    """Number of a mission's item, as its file counts."""
    photograph: SkipJsonSchema[Count | None] = None
    """Of a mission, by its place in the file, from 0."""
    station: SkipJsonSchema[Count | None] = None
    """Of the plan, from 0."""

    @property
    def place(self) -> str:
        """For people: "station 4 of plot-7", "station 4", or the subject."""
        if self.station is None:
            return self.subject
        return f"station {station_number(self.station)}{f' of {self.subject}' if self.subject else ''}"

    @property
    def kind(self) -> tuple[str, str, str]:
        """What findings that say the same of several places have in common: all but numbers and the place's name."""
        text = self.message if self.station is None else self.message.replace(self.place, "a station")
        return self.severity, self.code, _NUMBER.sub("#", text)

    def __str__(self) -> str:
        return f"{self.place}: {self.message}" if self.place else self.message

    @model_serializer
    def stored(self) -> dict[str, Any]:
        """As files and `--json` have one about photographs."""
        return {"name": self.subject, "code": self.code, "message": self.message, "left_out": self.left_out}


def grouped(findings: Iterable[Finding], *, exact: bool = False) -> list[list[Finding]]:
    """Findings by what they say, in the order of the first of each; with ``exact`` to the last number."""
    groups = by_key(((f.severity, f.code, f.message, f.remedy) if exact else f.kind, f) for f in findings)
    return list(groups.values())


def places_text(findings: Sequence[Finding]) -> str:
    """For people, the places of findings that say the same: "13 photographs (station 1, 2 … of plot-1 and plot-2)"."""
    plots = list(dict.fromkeys(finding.subject for finding in findings))
    stations = sorted({finding.station for finding in findings if finding.station is not None})
    if len(findings) == 1 or not stations:
        return findings[0].place if len(findings) == 1 else listed(plots, 4)
    numbers = listed([str(station_number(station)) for station in stations], 14)
    return f"{count(len(findings), 'photograph')} (station {numbers} of {listed(plots, 4)})"


def finding_lines(findings: Iterable[Finding]) -> list[str]:
    """For people, findings by what they say, up to six kinds of them."""
    groups = grouped(findings)
    rest = len(groups) - _MOST_KINDS
    more = [f"and {count(rest, 'more kind')}; --json lists each of them"] if rest > 0 else []
    return [*map(_line, groups[:_MOST_KINDS]), *more]


def _line(group: Sequence[Finding]) -> str:
    place, alike = places_text(group), len({finding.message for finding in group}) == 1
    return f"{place}{'' if alike else ', the first'}: {group[0].message}" if place else group[0].message


class Refused(MissionError):
    """All that speaks against flying a plan."""

    def __init__(self, findings: Sequence[Finding]) -> None:
        errors = [finding for finding in findings if finding.severity == "error"]
        lines = finding_lines(errors)
        remedies = dict.fromkeys(group[0].remedy for group in grouped(errors)[:_MOST_KINDS] if group[0].remedy)
        super().__init__(
            "the plan cannot be flown" + (f": {lines[0]}" if len(lines) == 1 else "".join(f"\n- {x}" for x in lines)),
            remedy="\n  ".join(remedies),
        )
        self.findings = tuple(findings)
