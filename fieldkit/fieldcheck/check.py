"""`fieldkit check` as a function: will the photographs of a flight do? Asked in the field, answered in seconds."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from fieldkit.arrays import FloatArray
from fieldkit.captures import Capture, Photo, read_capture
from fieldkit.captures.bursts import by_station
from fieldkit.captures.quality import PictureVerdict, judge_pictures
from fieldkit.errors import CaptureError, UsageError
from fieldkit.evaluation.adherence import LoggedFlight
from fieldkit.evaluation.evaluate import find_plots
from fieldkit.fieldcheck.model import OTHER_PLOT, CheckReport, finding_of
from fieldkit.fieldcheck.placement import Placed, angles_as_meant, place_tags, read_tags
from fieldkit.fieldcheck.settings import CheckSettings
from fieldkit.fieldcheck.ties import TieGraph, find_ties, with_guided_ties
from fieldkit.fieldcheck.verdicts import judge, tag_pose
from fieldkit.reconstruction.guided import region_of_interest
from fieldkit.reconstruction.mapping.view_graph import connected_parts
from fieldkit.reconstruction.stages import load_pictures
from fieldkit.reconstruction.steady import quick_sway_px
from fieldkit.results.finding import Finding
from fieldkit.results.plan import Plan
from fieldkit.results.plan_file import load_plan
from fieldkit.runtime.context import Context
from fieldkit.runtime.executor import map_threads
from fieldkit.runtime.machine import Spent
from fieldkit.sites.fitted import flown_plan
from fieldkit.sites.placement import PlotFrame
from fieldkit.sites.plot_plants import PlantHeight, heights_taken, with_plant_height
from fieldkit.sites.site import Site, SitePlot
from fieldkit.sites.site_file import load_site, named_plots
from fieldkit.wording import count, listed

MAX_STATIONS = 200
"""Most stations of a plan that is checked."""
MAX_PHOTOGRAPHS = 300
"""Most photographs of a check."""
_NO_DATUM_M = 120.0
"""Height difference that no two datums explain, metres."""
_MOVED_M = 0.5
"""Accuracy beyond which a receiver counts as one without corrections, metres."""
_TOLD_SIGMAS = 2.0
"""Standard deviations of positions from which a common shift is told."""
_TOLD_TURN_DEG = 2.0
"""Common turn of headings from which it is told, degrees."""
_COARSE_SCATTER_M = 0.12
"""Scatter of positions about the plan from which it is told, metres."""
_OF_THE_WAY = 0.3  # to another plot: nearer to it than that, photographs are its
_SWAY_STATIONS = 4
"""Most stations whose bursts tell sway."""
_SWAY_PHOTOGRAPHS = 3
"""Photographs of each of these bursts."""
_SWAY_SIDE_PX = 500
"""Their longer side, pixels."""
_HALF_METRE_OUT = 4.0
"""Motion half a metre out along leaves, as traits' errors are by, is 3 to 5 times the mean over plants (simulated)."""


def check(
    captures: Path,
    settings: CheckSettings | None = None,
    context: Context | None = None,
    *,
    plan: Path | Plan | None = None,
    site: Path | Site | None = None,
    plot: str | None = None,
    plant_height: PlantHeight | None = None,
    log: Path | None = None,
    fit: bool | None = None,
) -> tuple[CheckReport, ...]:
    """Say of one or several plots whether the photographs will do, and which stations to fly again.

    Args:
        captures: folder of the photographs of one plot, or of such folders, one per plot; they are only read.
        settings: tolerances and the seed; None takes the usual ones.
        context: None takes the usual cache and one process, and says nothing.
        plan: that was flown; None looks at sharpness, exposure and matches only.
        site: where the plots lie; None takes the plan's row heading.
        plot: of the site, where there is one folder; None takes the one with the folder's name, or the only one.
        plant_height: as of `fieldkit.missions.export_mission`.
        log: flight log whose poses count instead of the photographs' own.
        fit: whether the plan was fitted to each plot of the site, as of `fieldkit.missions.export_mission`.
    """
    settings = settings or CheckSettings()
    context = replace(context or Context.usual(), seed=settings.seed)
    plots, empty = find_plots(captures)
    if empty:
        context.progress.note(f"passed over, for there are no photographs in them: {', '.join(empty)}")
    if plot is not None and len(plots) > 1:
        raise UsageError(
            f"--plot names one plot, and there are {len(plots)} folders of photographs",
            path=captures,
            remedy="Give one plot's folder, or leave it out: folders are then matched with plots by their names.",
        )
    loaded = plan if plan is None or isinstance(plan, Plan) else load_plan(plan)
    if loaded is None and site is not None:
        raise UsageError("a site says where a plan's stations lie, and no plan is given", remedy="Give --plan, too.")
    if loaded is not None and len(loaded.stations) > MAX_STATIONS:
        raise UsageError(
            f"the plan has {len(loaded.stations)} stations; {MAX_STATIONS} are the most that are checked",
            remedy="Leave --plan out: a dense capture is checked without one.",
        )
    stated = load_site(site) if isinstance(site, Path) else site
    place = None if stated is None else with_plant_height(stated, loaded, plant_height)
    taken = () if stated is None or place is None else heights_taken(stated, place, plant_height)
    flight = None if log is None else LoggedFlight.read(log, plots)
    reports = []
    for name, folder in plots:
        spent = Spent.now()
        chosen = None if place is None else plot_of(place, plot, name)
        flown = loaded if chosen is None or loaded is None else flown_plan(loaded, chosen, fit)
        capture = by_station((None if flight is None else flight.capture(name)) or read_capture(folder))
        report = check_capture(flown, settings, context, name, folder, capture, place, chosen)
        own = (each for each in taken if chosen is not None and each.subject == chosen.name)
        findings = (*report.findings, *(replace(each, subject="", message=str(each)) for each in own))
        reports.append(replace(report, findings=findings, seconds=spent.seconds, cpu_seconds=spent.cpu_seconds))
    return tuple(reports)


def plot_of(site: Site, name: str | None, folder: str = "") -> SitePlot:
    """A site's plot of that name or, without one, of the folder's; else its only one."""
    found = next((plot for plot in site.plots if plot.name == (folder if name is None else name)), None)
    if found is not None:
        return found
    if name is not None or len(site.plots) == 1:
        return site.plots[0] if name is None else named_plots(site, [name])[0]
    raise UsageError(
        f"the site has {len(site.plots)} plots"
        + (f" and none is called {folder!r}, as the folder is" if folder else ""),
        remedy=f"Name the plot with --plot: {listed([plot.name for plot in site.plots])}.",
    )


def check_capture(
    plan: Plan | None,
    settings: CheckSettings,
    context: Context,
    name: str,
    folder: Path,
    capture: Capture,
    site: Site | None,
    plot: SitePlot | None,
) -> CheckReport:
    """One plot's report, without what it took."""
    if len(capture.photos) > MAX_PHOTOGRAPHS:
        raise CaptureError(
            f"{len(capture.photos)} photographs are too many for a check; {MAX_PHOTOGRAPHS} are the most",
            path=folder,
            remedy="Give the photographs of one plot.",
        )
    with context.progress.stage("Sharpness and exposure", len(capture.photos)) as advance:
        pictures = load_pictures(capture.photos, context, advance)
    known = [capture.priors.get(name) for name in capture.names]
    positions = [None if p is None else p.position for p in known]
    graph = find_ties(capture, context, fallback=None if plan is None else plan.camera, positions=positions)
    looks = judge_pictures(capture, pictures)
    sizes = [max(1, len(photo.burst)) for photo in capture.photos]
    burst, plot_name = int(np.bincount(sizes).argmax()), None if plot is None else plot.name
    report = CheckReport(name, sum(sizes), (), (), plot_name, burst=burst)
    if plan is None:
        with context.progress.stage("Guided matches"):
            tags = read_tags(capture)
            oriented = tags.known & np.isfinite(tags.poses.yaws)
            sound = [k for k, name in enumerate(capture.names) if oriented[k] and not looks[name].problem]
            full = with_guided_ties(graph, capture.photos, {k: tags.pose(k) for k in sound}, context)
        return _without_plan(report, capture, looks, full)
    capture, angles = angles_as_meant(capture, plan, site, plot)
    placed = place_tags(capture, plan, site, plot)
    report = replace(report, placement=placed.placement)
    if not placed.station_of:
        return _without_stations(report, capture, plan, looks, graph)
    with context.progress.stage("Guided matches"):
        poses = {k: tag_pose(placed, k, plan) for k in placed.station_of if not looks[capture.names[k]].problem}
        full = with_guided_ties(graph, capture.photos, poses, context)
    moved_m = leaves_move_m(capture.photos, graph, plan, placed.station_of, context.workers)
    report = replace(report, sway_m=moved_m)
    bursts = burst_findings(report, capture.photos, placed.station_of)
    shift = None if not np.isfinite(placed.shift_m).all() else tuple(float(v) for v in placed.shift_m)
    report = replace(
        report,
        findings=(*_left_out(capture), *angles, *common_findings(placed, settings, site, plot), *bursts),
        shift_m=shift,  # type: ignore[arg-type]
        turn_deg=placed.turn_deg,
        unchecked=tuple(_unchecked(placed)),
    )
    return judge(report, capture.names, plan, placed, looks, full, settings)


def _left_out(capture: Capture) -> list[Finding]:
    """Files that could not be used: their stations are missing below, and this says why."""
    return [finding for finding in capture.findings if finding.left_out]


_DAMAGED = {"truncated", "unreadable", "empty-file", "not-an-image"}
_SHIFTED = {
    "coarse": "More than such a receiver is off as a rule: look whether it is this plot that the pictures show.",
    "exact": "The base station's position, or the site file's, is wrong, or the flight was off: look whether the "
    "plants are in the pictures.",
}


def common_findings(
    placed: Placed, settings: CheckSettings, site: Site | None = None, plot: SitePlot | None = None
) -> list[Finding]:
    """What all photographs have in common: of the receiver, the compass, or the whole flight.

    A shift is told where it is more than the positions' accuracy allows; the frame of a poses.csv may lie anywhere.
    One that leads to another plot of the site is told as that.
    """
    found = []
    if placed.placement == "site" and np.isfinite(placed.shift_m).all():
        level, sigma = float(np.hypot(*placed.shift_m[:2])), placed.tags.sigma_m
        if level > max(settings.position_m, _TOLD_SIGMAS * sigma):
            code, remedy = "shifted", _SHIFTED["coarse" if sigma > _MOVED_M else "exact"]
            there = None if site is None or plot is None else _plot_there(site, plot, placed.shift_m)
            if there is not None:
                code, remedy = OTHER_PLOT, f"{there} lies there: check them with --plot {there}."
            found.append(
                finding_of(
                    code,
                    None,
                    "",
                    f"all photographs lie {level:.2f} m beside the plan ({placed.shift_m[0]:+.2f} m along x, "
                    f"{placed.shift_m[1]:+.2f} m along y), which has been taken out",
                    remedy,
                )
            )
    if placed.placement == "site" and abs(placed.shift_m[2]) > _NO_DATUM_M:
        message = f"all photographs lie {placed.shift_m[2]:+.0f} m above the plan, which has been taken out"
        remedy = "No two datums are so far apart: is home's height in the site file right, and in metres?"
        found.append(finding_of("shifted", None, "", message, remedy))
    if placed.turn_deg is not None and abs(placed.turn_deg) > _TOLD_TURN_DEG:
        found.append(
            finding_of(
                "turned",
                None,
                "",
                f"all headings are {placed.turn_deg:+.1f}° off the plan's, which has been taken out",
                "Calibrate the compass; nothing to do where the plants are in the pictures.",
            )
        )
    return found


def _plot_there(site: Site, plot: SitePlot, shift_m: FloatArray) -> str | None:
    """The other plot of a site that lies about (3,) metres away in a plot's frame."""
    others = [each for each in site.plots if each.name != plot.name]
    if not others:
        return None
    latitudes, longitudes = [each.latitude_deg for each in others], [each.longitude_deg for each in others]
    places = PlotFrame.of(site, plot).to_plot(latitudes, longitudes, np.zeros(len(others)))[:, :2]
    off = np.hypot(*(places - shift_m[:2]).T)
    nearest = int(np.argmin(off))
    return others[nearest].name if off[nearest] < _OF_THE_WAY * float(np.hypot(*places[nearest])) else None


def _unchecked(placed: Placed) -> list[str]:
    said = []
    if placed.placement == "row heading":
        said.append("Where the plot lies was not checked, only how the photographs stand to each other: no --site.")
    if not np.isfinite(placed.tags.poses.yaws).any():
        said.append("The photographs have no angles, so headings were checked by matches only.")
    if placed.scatter_m > _COARSE_SCATTER_M:
        said.append(
            f"Positions scatter by {placed.scatter_m:.2f} m about the plan, so they tell nearness no better than that."
        )
    return said


def _of_pictures(looks: Mapping[str, PictureVerdict], remedy: str) -> list[Finding]:
    return [finding_of(look.problem, None, name, look.message, remedy) for name, look in looks.items() if look.problem]


def _without_plan(
    report: CheckReport, capture: Capture, looks: Mapping[str, PictureVerdict], graph: TieGraph
) -> CheckReport:
    """Of photographs that keep to no plan: which will not do as they are, and whether matches join them all."""
    poor = _of_pictures(looks, "Take it again, or do without it.")
    damaged = [finding for finding in capture.findings if finding.code in _DAMAGED]
    groups = sorted(connected_parts(range(len(capture.names)), graph.ties), key=len, reverse=True)
    alone = [capture.names[k] for group in groups[1:] for k in group]
    message = f"no matches join {listed(alone)} with the {len(groups[0])} photographs that hang together"
    remedy = "Mapping may still join them. If they show the same plants, take photographs between, 10 to 20° apart."
    apart = [finding_of("disconnected", None, "", message, remedy)] if alone else []
    return replace(
        report,
        findings=(*capture.findings, *apart, *poor),
        take_again=tuple(dict.fromkeys(finding.subject for finding in (*damaged, *poor))),
        components=tuple(map(len, groups)),
        unchecked=("Where they were taken was not checked: no --plan.",),
    )


def _without_stations(
    report: CheckReport,
    capture: Capture,
    plan: Plan,
    looks: Mapping[str, PictureVerdict],
    graph: TieGraph,
) -> CheckReport:
    """Where nothing says which photograph is of which station: their number and quality only."""
    findings = [*_left_out(capture), *_of_pictures(looks, "Fly its station again.")]
    why = "the photographs have no positions that fit the plan; give --site, or --log"
    lacking = len(plan.stations) - len(capture.photos)
    if lacking > 0:
        unseen = count(lacking, "stations has", "stations have", of=len(plan.stations))
        message = f"{unseen} no photograph; which, nothing tells"
        findings.append(finding_of("missing", None, "", message, "Give --log, or fly all stations again."))
    tied = {k for pair in graph.ties for k in pair}
    return replace(
        report,
        findings=tuple(findings),
        unchecked=(
            f"Which photograph is of which station: {why}.",
            f"{len(tied)} of {count(len(capture.photos), 'photograph')} with matches to others.",
        ),
    )


def leaves_move_m(
    photos: Sequence[Photo], graph: TieGraph, plan: Plan, station_of: Mapping[int, int], workers: int
) -> float | None:
    """How far leaves move, half a metre out: RMS per axis, the median of some stations; None where nothing tells."""
    middle = region_of_interest([station.pose for station in plan.stations])
    bursts = {k: photos[k].burst for k in station_of if len(photos[k].burst) > 1}
    chosen = list(bursts)[:: -(-len(bursts) // _SWAY_STATIONS) or 1]
    if middle is None or not chosen:
        return None
    some = [bursts[k][:: -(-len(bursts[k]) // _SWAY_PHOTOGRAPHS)] for k in chosen]
    sway_px = np.array(map_threads(partial(quick_sway_px, side=_SWAY_SIDE_PX), some, workers=workers))
    away_m = [float(np.linalg.norm(plan.stations[station_of[k]].pose.center - middle.center)) for k in chosen]
    moved_m = sway_px * away_m / [graph.cameras.cameras[graph.cameras.camera_of[k]].fx for k in chosen]
    return _HALF_METRE_OUT * float(np.nanmedian(moved_m)) if np.isfinite(moved_m).any() else None


def burst_findings(report: CheckReport, photos: Sequence[Photo], station_of: Mapping[int, int]) -> Iterator[Finding]:
    """Leaves that move too far, and stations with fewer photographs than most."""
    if report.too_windy:
        yield finding_of(
            "too-windy",
            None,
            "",
            f"{report.leaves_move} between the photographs of a station; from 10 mm on heights are off by 3 to 13 cm "
            "and areas by 6 to 27 %, of which bursts take a third away",
            "Wait for calmer air and fly again.",
        )
    for k, station in sorted(station_of.items(), key=lambda each: each[1]):
        if (number := max(1, len(photos[k].burst))) < report.burst:
            message = f"it has {number} of {report.burst} photographs"
            yield finding_of("short-burst", station, photos[k].name, message, "None needed: it counts as photographed.")
