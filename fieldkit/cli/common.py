"""What commands share: options, and the way they print. Imports Typer and the standard library only."""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from typer import Argument, Option

from fieldkit.cli.boundary import answer as answer
from fieldkit.cli.boundary import emit_json as emit_json
from fieldkit.cli.boundary import say as say
from fieldkit.documents.csv_text import finite_numbers
from fieldkit.errors import UsageError
from fieldkit.wording import count

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    from rich.console import RenderableType

    from fieldkit.figures.content import Cell
    from fieldkit.missions.export import Routed
    from fieldkit.results.finding import Finding
    from fieldkit.sites.plot_plants import PlantHeight
    from fieldkit.sites.site import Site
    from fieldkit.sites.site_file import Tell

_MOST_NOISE_M = 5.0
"""Largest pose noise that is believed, metres."""
_MOST_ROWS = 30
"""Most kinds of findings that are printed."""
_MOST_MOVED = 20
"""Most kinds of moved stations that are printed."""
_REMEDY = {1: "Write one number", 2: "Write two numbers with a comma between", 3: "Write three numbers with commas"}
RUN, OUTPUT = "Run", "Output"
"""Headings in help of the options that every command has."""

JsonOption = Annotated[
    bool, Option("--json", rich_help_panel=OUTPUT, help="Print one JSON object on stdout and nothing else there.")
]
DebugOption = Annotated[
    bool, Option("--debug", rich_help_panel=OUTPUT, help="Show tracebacks and other libraries' warnings.")
]
# COLMAP takes no larger seed.
SEED = Option(
    "--seed", min=0, max=2**31 - 1, rich_help_panel=RUN, help="The same seed gives the same result, byte for byte."
)
SeedOption = Annotated[int, SEED]
CampaignArgument = Annotated[
    Path | None, Argument(help="The campaign's folder; the one about the current folder where not given.")
]
FitOption = Annotated[
    bool | None, Option("--fit/--no-fit", help="As at the export: compare with the stations fitted to each plot.")
]
MissionOutputOption = Annotated[Path, Option("--output", "-o", help="The mission file; its suffix may be left out.")]
PlotsOption = Annotated[
    Path | None,
    Option(
        "--plots",
        help="Plots, in place of those of the site file: GeoJSON, Shapefile (.shp or .zip), KML or GeoPackage.",
    ),
]


def only_plots(text: str) -> list[str]:
    """The plots of --only."""
    return [name for name in map(str.strip, text.split(",")) if name]


def line_numbers(text: str) -> list[int]:
    """The lines of --lines: "7", "7,9" or "7-12"."""
    numbers: list[int] = []
    for part in text.split(","):
        first, _, last = part.partition("-")
        try:
            numbers += range(int(first), int(last or first) + 1)
        except ValueError:
            raise UsageError(f"--lines: {part!r} is no number of a line", remedy='Give "7", "7,9" or "7-12".') from None
    return numbers


PlotIdOption = Annotated[
    str | None,
    Option(
        "--plot-id",
        metavar="FIELD",
        help="Field of the plots file that holds the plots' ids. Without: plot_id, id, name or fid.",
    ),
]


@dataclass(frozen=True)
class SiteOptions:
    """A site with its plots."""

    site: Path | None = None
    """Site file: where the plots lie, fence, zones and obstacles."""
    plots: PlotsOption = None
    plot_id: PlotIdOption = None

    def load(self, *, tell: Tell | None = None) -> Site | None:
        """The site with its plots; None without --site."""
        if self.site is None:
            given = [f"--{name.replace('_', '-')}" for name, value in asdict(self).items() if value is not None]
            if given:
                raise UsageError(f"{given[0]} goes with a site file", remedy="Give --site, too.")
            return None
        from fieldkit.sites.site_file import load_site

        return load_site(self.site, self.plots, self.plot_id, tell=tell)


@dataclass(frozen=True)
class SitePlotOptions(SiteOptions):
    """A plot of a site."""

    plot: Annotated[str | None, Option(metavar="NAME")] = None
    """Of the site, where it has several."""


def plant_height(given: str) -> PlantHeight:
    """What --plant-height says."""
    from fieldkit.sites.site import TALLEST_M

    if given == "unknown":
        return "unknown"
    try:
        metres = float(given)
    except ValueError:
        metres = math.nan
    if not 0.0 <= metres <= TALLEST_M:
        raise UsageError(
            f"--plant-height: {given} is no height of plants",
            remedy=f'Give metres from 0 to {TALLEST_M:g}, like 1.64, or "unknown".',
        )
    return metres


MISSION: Mapping[str, Any] = {
    "format": Option(),
    "only": Annotated[str | None, Option(metavar="PLOT[,PLOT…]", parser=only_plots)],
    "plant_height": Annotated[str | None, Option(metavar="METRES", parser=plant_height)],
    "adjust": Option(),
}
"""Options of the commands that write missions, for `MissionSettings`."""


def campaign_folder(given: Path | None) -> Path:
    """The folder of a campaign: as given, else the one that the current folder lies in."""
    if given is not None:
        return given
    from fieldkit.results.visit import CAMPAIGN_FILE, find_campaign

    found = find_campaign(Path.cwd())
    if found is None:
        raise UsageError("which campaign?", remedy=f"Give its folder, or work in a folder with {CAMPAIGN_FILE}.")
    return found


def vehicles_like(incomplete: str) -> list[str]:
    """The names of vehicles that begin so, for the Tab key."""
    from fieldkit.vehicles.vehicle_file import vehicle_names

    return [name for name in vehicle_names() if name.startswith(incomplete)]


VEHICLE = Option("--vehicle", autocompletion=vehicles_like, metavar="NAME", help="Vehicle profile, by name or file.")
VehicleOption = Annotated[str | None, VEHICLE]
LogOption = Annotated[
    Path | None,
    Option("--log", help="Flight log (.tlog, .BIN, .ulg): poses of its triggers, in place of poses.csv and GPS."),
]
OutputOption = Annotated[
    Path, Option("--output", "-o", help="The result's folder. It appears when the run is complete.")
]
OverwriteOption = Annotated[bool, Option("--overwrite", rich_help_panel=RUN, help="Replace an existing result.")]
ResumeOption = Annotated[bool, Option("--resume", rich_help_panel=RUN, help="Go on with an interrupted run.")]


def scenes_like(incomplete: str) -> list[str]:
    """The names of fieldkit's own scenes that begin so, for the Tab key."""
    from fieldkit.scenes.library import scene_names

    return [name for name in scene_names() if name.startswith(incomplete)]


def show(*parts: str | Path | Iterable[RenderableType]) -> None:
    """Print a command's answer on stdout: lines, which are not broken, and tables and texts. No string is markup."""
    from rich.console import Console

    class Answer(Console):
        def on_broken_pipe(self) -> None:
            """A reader that has gone (``| head``) is no error."""

    out = Answer(highlight=False)
    with suppress(BrokenPipeError):  # raised by an earlier Rich
        for part in parts:
            if isinstance(part, str | Path):
                out.print(str(part), markup=False, soft_wrap=True)
                continue
            for thing in part:
                out.print(thing, markup=False)


def table(caption: str, columns: Sequence[str], rows: Iterable[Sequence[Cell]]) -> Iterator[RenderableType]:
    """A table with all its rows, for `show`."""
    from fieldkit.figures.content import Table, column
    from fieldkit.figures.terminal import rendered

    return rendered([Table(caption, tuple(map(column, columns)), tuple(map(tuple, rows)))], most_rows=None)


def read_numbers(option: str, text: str, counts: tuple[int, ...], *, least: float = 0.0) -> tuple[float, ...]:
    """The numbers of an option such as ``--pose-noise 0.02,1``."""
    numbers = finite_numbers(text)
    if len(numbers) not in counts or min(numbers) < least:
        raise UsageError(
            f"{option}: cannot be {text}", remedy=" or ".join(_REMEDY[n] for n in counts) + f", not below {least:g}."
        )
    return numbers


def read_pose_noise(text: str) -> tuple[float, float]:
    """Metres and degrees of ``--pose-noise M,DEG``. Raises UsageError: it is none, or more than a receiver is off."""
    metres, degrees = read_numbers("--pose-noise", text, (2,))
    if metres > _MOST_NOISE_M:
        from fieldkit.documents.mistaken import CENTIMETRES

        raise UsageError(
            f"--pose-noise: {metres:g} m is more than any receiver is off: {CENTIMETRES.looks_like}",
            remedy="Write metres and degrees, like --pose-noise 0.02,1.",
        )
    return metres, degrees


def show_findings(findings: Sequence[Finding], file: Path) -> None:
    """A table of them; those that say the same are one row."""
    from fieldkit.missions.findings import group_text, ranked

    groups = ranked(findings)
    rows = [
        (group[0].code, group[0].severity, "" if group[0].item is None else str(group[0].item), group_text(group))
        for group in groups[:_MOST_ROWS]
    ]
    show(table(f"Findings in {file.name}", ["code", "severity", "item>", "what"], rows))
    if len(groups) > _MOST_ROWS:
        answer(f"and {count(len(groups) - _MOST_ROWS, 'more kind')}")
    if len(groups) < len(findings):
        answer(f"{len(findings)} findings in all: --json lists each of them")


def tell_fit(routed: Routed) -> None:
    """What does not fit, warnings first, and which stations are not flown as planned; what is the same of several plots
    once.
    """
    from fieldkit.results.finding import grouped, places_text

    for group in sorted(grouped(routed.fit, exact=True), key=lambda group: group[0].severity != "warning"):
        first = group[0]
        where = f"{places_text(group)}: " if first.place else ""
        answer(f"{first.severity.capitalize()}: {where}{first.message}. {first.remedy}".rstrip())
    moved = grouped((each.finding for each in routed.moved), exact=True)
    for group in moved[:_MOST_MOVED]:
        answer(f"Moved: {places_text(group)}: {group[0].message}")
    if len(moved) > _MOST_MOVED:
        answer(f"Moved: {count(len(moved) - _MOST_MOVED, 'more kind')}; --json lists all.")
