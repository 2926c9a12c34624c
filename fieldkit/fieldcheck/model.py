"""What a check in the field is told and what it says: values only."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from fieldkit.results.finding import Finding
from fieldkit.results.plan import station_number
from fieldkit.vehicles.wash import WINDY_M
from fieldkit.wording import listed

Verdict = Literal["fine", "fly again"]
"""Of a station: nothing to do, or it must be photographed anew."""

OTHER_PLOT = "other-plot"
"""All photographs lie where the site has another plot."""
_ASTRAY = 0.75
"""Share of the stations without a photograph there with which a flight is hardly the plan's."""
_MOST = 0.9  # of a capture without a plan hangs together where it will do

Placement = Literal["site", "poses.csv", "row heading", "none"]
"""How photographs were put into the plan's frame: by the site's plot; as poses.csv has them; by the plan's own row
heading; not at all, for nothing says where they were taken."""


def finding_of(code: str, station: int | None, photograph: str, message: str, remedy: str) -> Finding:
    """Something that is not as planned, at a station (from 0) or of the whole capture; docs/commands/check.md."""
    return Finding(photograph, code, message, remedy=remedy, station=station)


@dataclass(frozen=True)
class StationCheck:
    """One station of the plan and its photograph."""

    station: int
    """Number in the plan, from 0."""
    photograph: str = ""
    """File name; empty where there is none."""
    verdict: Verdict = "fine"
    edge_px: float | None = None
    """Width (σ) of the photograph's strong edges in the direction that is worst, in a picture 1600 pixels wide."""
    blur_ratio: float | None = None
    """The same against the capture's other photographs."""
    stops: float | None = None
    """Brightness against the capture's median."""
    clipped: float | None = None
    """Share that is black or white."""
    distance_m: float | None = None
    """From the station, what is common to all photographs taken out; None where nothing tells."""
    turn_deg: float | None = None
    """Of the optical axis from the plan's."""
    matches: int = 0
    """Verified ones, with photographs that tie it."""
    neighbours: tuple[int, ...] = ()
    """These photographs' stations."""


@dataclass(frozen=True)
class CheckReport:
    """Whether the photographs of one plot will do."""

    name: str
    """Of the plot's folder."""
    photographs: int
    """That could be read."""
    stations: tuple[StationCheck, ...]
    """One for each of the plan, in its order."""
    findings: tuple[Finding, ...]
    """In the stations' order; those of the whole capture first."""
    plot: str | None = None
    """Of the site; None without one."""
    extra: tuple[str, ...] = ()
    """Photographs that belong to no station."""
    placement: Placement = "none"
    """How photographs were put into the plan's frame."""
    shift_m: tuple[float, float, float] | None = None
    """East or along the row, north, up: by which all photographs lie beside the plan; None where that could not be
    told. It has been taken out of the stations' distances."""
    turn_deg: float | None = None
    """By which all headings are off."""
    take_again: tuple[str, ...] | None = None
    """Photographs that will not do, where there is no plan; None with one."""
    components: tuple[int, ...] = ()
    """Sizes of the groups that hang together by matches, largest first."""
    unchecked: tuple[str, ...] = ()
    """Sentences: what could not be looked at, and why."""
    burst: int = 1
    """Photographs that most stations have."""
    sway_m: float | None = None
    """How far leaves move between these, half a metre out; None without bursts."""
    seconds: float = 0.0
    cpu_seconds: float = 0.0
    """What the check took."""

    @property
    def fly_again(self) -> tuple[int, ...]:
        """Stations to photograph anew."""
        return tuple(each.station for each in self.stations if each.verdict == "fly again")

    @property
    def too_windy(self) -> bool:
        """Whether leaves move too far."""
        return self.sway_m is not None and self.sway_m > WINDY_M

    @property
    def leaves_move(self) -> str:
        """How far, in words."""
        return f"leaves move by about {1000.0 * (self.sway_m or 0.0):.0f} mm"

    @property
    def ok(self) -> bool:
        """Whether nothing is left to do; never where photographs could not be told from each other."""
        if self.take_again is not None:
            return not self.take_again and self.components[0] >= _MOST * sum(self.components)
        fine = all(each.verdict == "fine" for each in self.stations)
        return bool(self.stations) and fine and not self.too_windy and self._elsewhere() != OTHER_PLOT

    def _elsewhere(self) -> str:
        """The code of what says that the whole flight was elsewhere; empty if nothing does."""
        codes = [finding.code for finding in self.findings]
        astray = codes.count("displaced") + codes.count("missing")
        if OTHER_PLOT not in codes and self.photographs >= astray > _ASTRAY * len(self.stations):
            return "displaced"
        return next((code for code in codes if code in (OTHER_PLOT, "shifted")), "")

    def summary(self) -> str:
        """What to do, in words."""
        again = self.fly_again
        if self.take_again is not None:
            said = [f"Take {listed(list(self.take_again), 8)} again."] if self.take_again else []
            if len(self.components) > 1:
                said.append(f"Matches join {self.components[0]} of {sum(self.components)} photographs.")
            return " ".join(said) or f"All {self.photographs} will do: sharp, well exposed, and joined by matches."
        if not self.stations:
            return "Which photograph is of which station could not be told."
        elsewhere, said = self._elsewhere(), []
        if elsewhere == "displaced":
            said.append("Hardly a photograph was taken at a station: are they of this plot, and is this its plan?")
        elif elsewhere:
            finding = next(finding for finding in self.findings if finding.code == elsewhere)
            said.append(f"{finding.message[0].upper()}{finding.message[1:]}. {finding.remedy}")
        if elsewhere == OTHER_PLOT:
            return said[0]
        if again:
            said.append(f"Fly {_stations(again)} again.")
        else:
            count = len(self.stations)
            said.append(f"All {count} will do." if count > 1 else "It will do.")
        if self.sway_m is not None:
            said.append(f"{self.leaves_move.capitalize()}{': too windy' * self.too_windy}.")
        return " ".join(said)


def _stations(numbers: tuple[int, ...]) -> str:
    return f"station{'s' * (len(numbers) > 1)} {listed([str(station_number(n)) for n in numbers], len(numbers))}"
