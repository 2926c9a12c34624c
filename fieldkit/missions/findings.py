"""What a check of a mission has to say."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from fieldkit.missions.autopilots.execution import Photograph

Severity = Literal["error", "warning"]


@dataclass(frozen=True)
class Finding:
    """Something wrong, or worth knowing.

    Attributes:
        code: docs/missions.md lists them.
        severity: a mission with an error should not be flown.
        message: for people.
        item: number of the item concerned, as the file counts.
        station: the photograph concerned, by its place in the file, from 0.
    """

    code: str
    severity: Severity
    message: str
    item: int | None = None
    station: int | None = None


@dataclass(frozen=True)
class Deviation:
    """How far a photograph is from the plan's.

    Attributes:
        item: that releases the shutter.
        station: the photograph, by its place in the file.
        planned: name of the plan's station.
        metres: between the places.
        heading_deg, pitch_deg: predicted less planned; None where the prediction has none.
    """

    item: int
    station: int
    planned: str
    metres: float
    heading_deg: float | None
    pitch_deg: float | None


@dataclass(frozen=True)
class Report:
    """What was found in a mission.

    Attributes:
        photographs: as the vehicle would take them, also those that are never taken.
        findings: errors first, then by item.
        deviations: from the plan, where one was given.
        seconds: of the flight, estimated.
        length_m: of all legs.
    """

    photographs: tuple[Photograph, ...]
    findings: tuple[Finding, ...]
    deviations: tuple[Deviation, ...]
    seconds: float
    length_m: float

    @property
    def ok(self) -> bool:
        """Whether there is no error."""
        return not any(finding.severity == "error" for finding in self.findings)

    @property
    def taken(self) -> tuple[Photograph, ...]:
        """The photographs that are taken, wherever that is."""
        return tuple(photograph for photograph in self.photographs if not photograph.never)


def error(code: str, message: str, item: int | None = None, station: int | None = None) -> Finding:
    """A finding that speaks against flying."""
    return Finding(code, "error", message, item, station)


def warning(code: str, message: str, item: int | None = None, station: int | None = None) -> Finding:
    """A finding that is worth knowing."""
    return Finding(code, "warning", message, item, station)
