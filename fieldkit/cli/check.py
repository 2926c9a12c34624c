"""fieldkit check."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from typer import Option

from fieldkit.cli.common import (
    MISSION,
    RUN,
    SEED,
    FitOption,
    JsonOption,
    LogOption,
    OverwriteOption,
    SitePlotOptions,
    VehicleOption,
    answer,
    emit_json,
    say,
    show,
    table,
)
from fieldkit.cli.options import Panels
from fieldkit.cli.reconstruction_options import run_context
from fieldkit.errors import UsageError
from fieldkit.fieldcheck.settings import CheckSettings
from fieldkit.missions.settings import MissionSettings

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from fieldkit.fieldcheck.model import CheckReport
    from fieldkit.figures.content import Block, Level
    from fieldkit.sites.site import Site

_LEVELS: Mapping[str, Level] = {"fine": "good", "fly again": "problem"}


SETTINGS: Panels = {
    "Options": {
        "position_m": Option("--position-tolerance", metavar="M", min=0.01, max=100.0),
        "angle_deg": Option("--angle-tolerance", metavar="DEG", min=0.1, max=180.0),
    },
    RUN: {"seed": SEED},
}
AGAIN: Panels = {"Options": {name: MISSION[name] for name in ("format", "adjust", "plant_height")}}


@dataclass(frozen=True)
class AgainOptions:
    """The mission that flies stations again."""

    vehicle: VehicleOption = None
    output: Annotated[Path | None, Option("--output", "-o")] = None
    """Mission file for the stations to fly again; needs --vehicle and --site."""

    def check(self, site: Path | None) -> None:
        """Raise UsageError where a mission needs more than is given, or a vehicle is given without one."""
        if self.output is not None and (self.vehicle is None or site is None):
            raise UsageError("a mission needs a vehicle and a site", remedy="Give --vehicle and --site with -o.")
        if self.vehicle is not None and self.output is None:
            raise UsageError("--vehicle is of the mission to write", remedy="Say with -o where to, or leave it out.")


def command(
    captures: Path,
    *,
    plan: Path | None = None,
    flown: Annotated[Path | None, Option("--mission", metavar="FILE")] = None,
    place: SitePlotOptions,
    log: LogOption = None,
    fit: FitOption = None,
    again: AgainOptions,
    mission: Annotated[MissionSettings, AGAIN],
    settings: Annotated[CheckSettings, SETTINGS],
    overwrite: OverwriteOption = False,
    no_cache: Annotated[bool, Option(rich_help_panel=RUN)] = False,
    as_json: JsonOption = False,
) -> None:
    """Before leaving the field: will the photographs do, and which stations are to be flown again?

    Looks at every photograph's sharpness, exposure and place, and at whether matches join it with the others. Takes
    seconds, without dense stereo. With --vehicle, --site
    and -o it writes the mission that flies again what has to be. Without --plan it tells which photographs are blurred,
    dark or bright, and whether matches join them all. The exit code is 0 whatever was found: see "ok" of --json.

    Args:
        captures: Folder of photographs of one plot, or a folder of such folders.
        plan: plan.json that was flown, or the folder that holds it; none: quality only.
        flown: mission.json of passes over a trial: tell which plots lack photographs, by the tags alone.
        no_cache: Neither use nor keep what stages computed.

    Examples:
        fieldkit check dense/
        fieldkit check flight_7/ --plan plan.json
        fieldkit check flight/ --mission mission.json
        fieldkit check card/ --plan plan.json --site field.toml --plots plots.gpkg
        fieldkit check flight_7/ --plan plan.json --site field.toml --vehicle ardupilot-pitch -o again.plan
    """
    again.check(place.site)
    site = place.load(tell=None if as_json else say)
    if flown is not None:
        if plan is not None or site is not None or again.vehicle is not None:
            raise UsageError("--mission knows plots and lines", remedy="Give --plan, --site and --vehicle of stations.")
        _check_lines(captures, flown, log, as_json=as_json)
        return
    from fieldkit.fieldcheck.check import check

    with run_context(as_json=as_json, no_cache=no_cache) as context:
        reports = check(
            captures,
            settings,
            context,
            plan=plan,
            site=site,
            plot=place.plot,
            plant_height=mission.plant_height,
            log=log,
            fit=fit,
        )
    files = list(
        _missions(reports, plan, site, again, replace(mission, fit=fit, seed=settings.seed), overwrite=overwrite)
    )
    if as_json:
        plots = [_plain(report) for report in reports]
        one = plots[0] if len(plots) == 1 else {}
        emit_json({**one, "ok": all(r.ok for r in reports), "plots": plots, "files": files})
    else:
        _tell(reports)
        show(*files)
        if again.output is not None and not files:
            answer(f"No station is known to need another flight, so {again.output.name} was not written.")


def _check_lines(captures: Path, mission: Path, log: Path | None, *, as_json: bool) -> None:
    from fieldkit.fieldcheck.lines import check_flight
    from fieldkit.results.plan import station_number

    report = check_flight(captures, mission, log=log)
    again = [station_number(line) for line in report.fly_again]
    if as_json:
        facts = asdict(report)
        for line in facts["lines"]:
            line["line"] = station_number(line["line"])
        for plot in facts["plots"]:
            plot["lines"] = [station_number(line) for line in plot["lines"]]
        emit_json(facts | {"ok": report.ok, "summary": report.summary(), "fly_again": again})
        return
    missing = sum(line.missing for line in report.lines)
    show(report.summary())
    answer(f"{report.photographs} photographs; of {report.foreseen} foreseen, {missing} are missing.")
    if report.plots:
        rows = [
            (plot.plot, str(plot.foreseen), str(plot.there), ", ".join(str(station_number(k)) for k in plot.lines))
            for plot in sorted(report.plots, key=lambda plot: plot.there / plot.foreseen)
        ]
        show(table("Plots without all their photographs", ("plot", "foreseen>", "there>", "missing on lines"), rows))
    if again:
        answer(f"fieldkit export-mission {mission} --lines {','.join(map(str, again))} writes the mission for them.")


def _missions(
    reports: Sequence[CheckReport],
    plan: Path | None,
    site: Site | None,
    again: AgainOptions,
    settings: MissionSettings,
    *,
    overwrite: bool,
) -> Iterator[Path]:
    """Write the missions that are asked for, one for each plot with stations to fly again."""
    from fieldkit.fieldcheck.refly import write_refly

    output, vehicle = again.output, again.vehicle
    if output is None or site is None or vehicle is None or plan is None:
        return
    for report in reports:
        if not report.fly_again:
            continue
        target = output if len(reports) == 1 else output.with_name(f"{output.stem}-{report.name}{output.suffix}")
        yield from write_refly(
            report.fly_again,
            plan,
            vehicle,
            site,
            target,
            replace(settings, burst=report.burst),
            plot=report.plot,
            overwrite=overwrite,
        )


def _tell(reports: Sequence[CheckReport]) -> None:
    from rich.text import Text

    from fieldkit.figures.style import format_seconds
    from fieldkit.figures.terminal import rendered

    for report in reports:
        head = f"{report.name}: " if len(reports) > 1 else ""
        show([Text(f"{head}{report.summary()}", "bold")], rendered(check_blocks(report), most_rows=None))
        for sentence in report.unchecked:
            answer(sentence)
        answer(f"{format_seconds(report.seconds)} ({format_seconds(report.cpu_seconds)} of CPU).")


def _plain(report: CheckReport) -> dict[str, Any]:
    from fieldkit.results.plan import station_number

    facts = asdict(report)
    if report.burst <= 1:
        del facts["burst"], facts["sway_m"]
    facts["findings"] = [
        {"code": f.code, "station": f.station, "photograph": f.subject, "message": f.message, "remedy": f.remedy}
        for f in report.findings
    ]
    for row in (*facts["stations"], *facts["findings"]):  # as people number them
        row["station"] = None if row["station"] is None else station_number(row["station"])
        if "neighbours" in row:
            row["neighbours"] = [station_number(each) for each in row["neighbours"]]
    again = [station_number(each) for each in report.fly_again]
    return facts | {"ok": report.ok, "summary": report.summary(), "fly_again": again}


def check_blocks(report: CheckReport) -> list[Block]:
    """A plot's stations and what was found of them."""
    from fieldkit.figures.content import Mark, Table, column
    from fieldkit.figures.style import DASH, decimal
    from fieldkit.results.plan import station_number

    blocks: list[Block] = []
    if report.stations:
        columns = ("station>", "photograph", "edges, px>", "stops>", "off, m>", "turned, °>", "matches with", "verdict")
        rows = tuple(
            (
                str(station_number(each.station)),
                each.photograph or None,
                decimal(each.edge_px, 1),
                decimal(each.stops, 1),
                decimal(each.distance_m),
                decimal(each.turn_deg, 1),
                f"{each.matches}: {', '.join(str(station_number(n)) for n in each.neighbours)}"
                if each.neighbours
                else DASH,
                Mark(_LEVELS[each.verdict], each.verdict),
            )
            for each in report.stations
        )
        blocks.append(Table(report.name, tuple(map(column, columns)), rows))
    if report.findings:
        found = tuple(
            (
                "" if finding.station is None else str(station_number(finding.station)),
                finding.code,
                f"{replace(finding, station=None)}" + (f"\n→ {finding.remedy}" if finding.remedy else ""),
            )
            for finding in report.findings
        )
        heads, first = tuple(map(column, ("station>", "finding", "what was found"))), int(not report.stations)
        blocks.append(Table("Findings", heads[first:], tuple(row[first:] for row in found)))
    if report.extra:
        extra = tuple((name,) for name in report.extra[:20])
        blocks.append(Table("Photographs of no station", (column("photograph"),), extra))
    return blocks
