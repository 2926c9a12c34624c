"""What a check of a mission has to say."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import partial

from fieldkit.missions.autopilots.execution import Photograph
from fieldkit.missions.coverage import Coverage
from fieldkit.results.finding import Finding, Severity, grouped
from fieldkit.routing.mission import Shot


def ranked(findings: Iterable[Finding]) -> list[list[Finding]]:
    """Findings by what they say, errors first."""
    return sorted(grouped(findings), key=lambda group: group[0].severity != "error")


def group_text(group: list[Finding]) -> str:
    """For people: "35 photographs: …"; with the first one's place where they differ."""
    first, number = group[0], len(group)
    if number == 1:
        return first.message
    what = "photographs" if first.photograph is not None else "legs" if first.code.startswith("leg-") else "items"
    if first.item is None:
        what = "times"
    alike = len({finding.message for finding in group}) == 1
    example = "" if alike else ", the first" if first.item is None else f", the first at item {first.item}"
    return f"{number} {what}{example}: {first.message}"


@dataclass(frozen=True)
class Deviation:
    """How far a photograph is from the plan's."""

    item: int
    """That releases the shutter."""
    photograph: int
    """By its place in the file, from 0."""
    planned: Shot
    metres: float
    """Between the places."""
    heading_deg: float | None
    pitch_deg: float | None
    """Predicted less planned; None where the prediction has none."""


@dataclass(frozen=True)
class Report:
    """What was found in a mission."""

    photographs: tuple[Photograph, ...]
    """As the vehicle would take them, also those that are never taken."""
    findings: tuple[Finding, ...]
    """Errors first, then by item."""
    deviations: tuple[Deviation, ...]
    """From the plan, where one was given."""
    seconds: float
    """Of the flight, from take-off to landing, estimated."""
    length_m: float
    """From take-off to landing."""
    unchecked: Mapping[str, str] | None = None
    """Plots that are not checked against plants, and why; None where no plots are known."""
    burst: int = 1
    """Photographs that each station should have."""
    coverage: Coverage | None = None
    """What ``taken`` show; None where home is not known."""

    @property
    def ok(self) -> bool:
        """Whether there is no error. That alone does not say that it may be flown: see `may_be_flown`."""
        return not any(finding.severity == "error" for finding in self.findings)

    @property
    def may_be_flown(self) -> bool | None:
        """Whether there is no error; None where there is none and plants could not be checked."""
        return (True if self.unchecked == {} else None) if self.ok else False

    @property
    def taken(self) -> tuple[Photograph, ...]:
        """The photographs that are taken, wherever that is."""
        return tuple(photograph for photograph in self.photographs if not photograph.never)


def _finding(
    severity: Severity,
    code: str,
    message: str,
    item: int | None = None,
    photograph: int | None = None,
    planned: Shot | None = None,
) -> Finding:
    plot, station = ("", None) if planned is None else (planned.plot, planned.station)
    return Finding(plot, code, message, severity=severity, item=item, photograph=photograph, station=station)


error = partial(_finding, "error")
"""A finding that speaks against flying."""
warning = partial(_finding, "warning")
"""A finding that is worth knowing."""
