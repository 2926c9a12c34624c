"""Whether a plan fits the plots of a site: their plants' height, size, row spacing, slope and heading.

Errors are what is unsafe: photographs that would be taken among plants. Everything else is written and said, for only
the people there know what they want of a plot: warnings, where the reconstruction will be another than the plan's, and
notes. What the site file does not say is not checked.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from fieldkit.errors import MissionError
from fieldkit.geometry.angles import wrapped_deg
from fieldkit.results.plan import Plan, Plans, station_number
from fieldkit.sites.plot_plants import BESIDE_M, PlanFacts, PlotPlants, facts_of, other_spacing, plants_on
from fieldkit.sites.site import Site, SitePlot

Severity = Literal["error", "warning", "note"]

STEEP_PERCENT = 10.0
"""Up to here plans have been tried on slopes (docs/vehicles-and-sites.md)."""
HIGHER_M = 0.05
"""By which plants may be higher than the plan's: points of plan.json stand for cells of this size."""
LOWER_SHARE = 0.8
"""Of the plan's height, below which plants are said to be lower."""
SEEN_SHARE = 0.9
"""Of a plot, that a plan has to show in three photographs or more."""
_VIEWS = 3
_GRID = 15
_FAR = 2.0  # times the median distance at which the plan photographs: what is farther is hardly resolved
_TURNED_DEG = 45.0
_NAMED = 4

Array = NDArray[np.float64]


@dataclass(frozen=True)
class FitFinding:
    """Something about a plan on a plot.

    Attributes:
        plot: its name.
        code: docs/vehicles-and-sites.md lists them.
        severity: with an error the plan is not flown there.
        message: what does not fit, without the plot's name.
        remedy: what to do about it; empty where there is nothing to do.
    """

    plot: str
    code: str
    severity: Severity
    message: str
    remedy: str = ""

    def __str__(self) -> str:
        return f"{self.plot}: {self.message}"


def fit_site(plans: Plans, site: Site, clearance_m: float) -> tuple[FitFinding, ...]:
    """What does not fit of a plan on the plots of a site, or is worth knowing, in the plots' order.

    Args:
        plans: made on another plot, or on one of these; or fitted to each.
        site: whose plots may say how high, large, steep and far apart.
        clearance_m: of the vehicle, from plants.
    """
    return tuple(
        finding
        for plot, facts in zip(site.plots, facts_of(plans, site.plots), strict=True)
        for finding in fit_plot(facts, plot, clearance_m)
    )


def fit_plot(facts: PlanFacts, plot: SitePlot, clearance_m: float) -> tuple[FitFinding, ...]:
    """The same of one plot."""
    parts = (
        _plants(facts, plot, clearance_m),
        _size(facts, plot, clearance_m),
        _spacing(facts, plot, clearance_m),
        _slope(facts, plot),
        _heading(facts, plot),
    )
    return tuple(finding for part in parts for finding in part)


def require_fit(findings: Sequence[FitFinding]) -> tuple[FitFinding, ...]:
    """The findings, where none is an error.

    Raises:
        MissionError: there are errors; the first is named, and the plots that have more are counted.
    """
    errors = [finding for finding in findings if finding.severity == "error"]
    if not errors:
        return tuple(findings)
    others = len({finding.plot for finding in errors} - {errors[0].plot})
    more = f" ({others} more {'plot does' if others == 1 else 'plots do'} not fit)" if others else ""
    raise MissionError(f"the plan does not fit {errors[0]}{more}", remedy=errors[0].remedy)


def plants_outgrown(plan: Plan, plant_height_m: float, *, plot: str = "plot") -> FitFinding | None:
    """What to say of plants that were measured on photographs of a plan's flight.

    Args:
        plan: that was flown.
        plant_height_m: of the highest plants above the ground, as measured.
        plot: for the finding.

    Returns:
        A warning where they are higher than those that the plan keeps clear of by more than `HIGHER_M`; else None, as
        where the plan does not say where plants are, or the height is no number.
    """
    top = PlanFacts(plan).top_m
    if top is None or not math.isfinite(plant_height_m) or plant_height_m <= top + HIGHER_M:
        return None
    return FitFinding(
        plot, "plants-outgrown", "warning",
        f"plants are {plant_height_m:.2f} m high, {plant_height_m - top:.2f} m higher than those that the plan keeps "
        f"clear of ({top:.2f} m)",
        f"Give plant_height_m = {math.ceil(20 * plant_height_m) / 20:.2f} for this plot and export the mission again: "
        "it is then flown clear of them, or refused.",
    )  # fmt: skip


def _plants(facts: PlanFacts, plot: SitePlot, clearance_m: float) -> Iterator[FitFinding]:
    height, top, plants = plot.plant_height_m, facts.top_m, plants_on(facts, plot)
    if height is None:
        made_for = "" if top is None else f"; the plan's are {top:.2f} m high"
        yield FitFinding(
            plot.name, "plant-height-unknown", "error",
            f"nobody says how high its plants are, and a mission has to keep clear of them{made_for}",
            "Measure the highest plants: plant_height_m in the plots file gives each plot's, --plant-height METRES one "
            "for all. --plant-height unknown keeps clear of plants 30 % taller than the plan's.",
        )  # fmt: skip
        return
    if plants is None:
        yield FitFinding(
            plot.name, "plants-unknown", "warning",
            f"not checked against plants: neither the plan nor the site says where those of {height:.2f} m stand",
            "Make the plan again with fieldkit plan, which writes them into plan.json, or give the plot's outline.",
        )  # fmt: skip
        return
    if top is None:
        return
    if height > top + HIGHER_M:
        before = PlotPlants(facts.points, (), plants.cell_m)
        lost = _among(facts, PlotPlants(plants.points, (), plants.cell_m), clearance_m, unless=before)
        higher = f"plants of {height:.2f} m are {height - top:.2f} m higher than the plan's"
        if lost:
            yield FitFinding(
                plot.name, "plants-too-high", "error",
                f"{higher}: {_stations(lost)} would stand in them, or nearer to them than {clearance_m:g} m",
                "Fit the plan to them with --fit, or plan again on plants of this height.",
            )  # fmt: skip
        else:
            yield FitFinding(
                plot.name, "plants-higher", "warning",
                f"{higher}; the mission keeps clear of them, but they fill more of the pictures than planned",
                "Fit the plan to them with --fit, or look at what the photographs show.",
            )  # fmt: skip
    elif height < LOWER_SHARE * top:
        yield FitFinding(
            plot.name, "plants-lower", "note",
            f"plants of {height:.2f} m are {top - height:.2f} m lower than the plan's: they are photographed from "
            "farther away than planned",
        )  # fmt: skip


def _size(facts: PlanFacts, plot: SitePlot, clearance_m: float) -> Iterator[FitFinding]:
    if plot.size_m is None:
        return
    length, width = plot.size_m
    sizes = f"{length:.1f} × {width:.1f} m"
    beyond = plants_on(facts, _without(plot, "row_spacing_m"))
    if beyond is not None and beyond.blocks:
        inside = _among(facts, PlotPlants(np.zeros((0, 3)), beyond.blocks, beyond.cell_m), clearance_m)
        if inside:
            why = (
                "reaches beyond the plan's plants"
                if len(beyond.points)
                else "counts as full, for the plan knows no plants"
            )
            yield FitFinding(
                plot.name, "plot-larger", "error",
                f"the plot of {sizes} {why}, and {_stations(inside)} would stand among its "
                f"plants of {plot.plant_height_m:.2f} m, or nearer to them than {clearance_m:g} m",
                "Plan on a plot of this size, or give length_m and width_m of what is planted there.",
            )  # fmt: skip
    share = _shown(facts, (length, width))
    extent = None if facts.box is None else facts.box[1] - facts.box[0]
    told = "" if extent is None else f"; the plan knows plants on {extent[0]:.1f} × {extent[1]:.1f} m"
    if share is not None and share < SEEN_SHARE:
        yield FitFinding(
            plot.name, "plot-size", "warning",
            f"{share:.0%} of the plot of {sizes} is in {_VIEWS} or more of the plan's photographs{told}",
            "Plan on a plot of this size; one plan photographs one part of a larger plot.",
        )  # fmt: skip
    elif share is None and extent is not None and ((length, width) > extent + 2 * BESIDE_M).any():
        yield FitFinding(
            plot.name, "plot-size", "warning", f"the plot of {sizes} reaches beyond the plan's{told}",
            "Plan on a plot of this size; one plan photographs one part of a larger plot.",
        )  # fmt: skip
    elif share is None and extent is None:
        yield FitFinding(
            plot.name, "size-unknown", "note",
            f"whether the plan shows all of the plot of {sizes} cannot be told: it has neither camera nor plants",
        )  # fmt: skip


def _spacing(facts: PlanFacts, plot: SitePlot, clearance_m: float) -> Iterator[FitFinding]:
    wanted, known = plot.row_spacing_m, facts.spacing_m if plot.row_spacing_m is not None else None
    if wanted is None:
        return
    if known is None:
        yield FitFinding(
            plot.name, "row-spacing-unknown", "note",
            f"whether rows {wanted:.2f} m apart are as the plan's cannot be told: no rows along x are found in the "
            "plan's plants",
        )  # fmt: skip
        return
    if not other_spacing(known, wanted):
        return
    plants = plants_on(facts, plot)
    assert plants is not None
    inside = _among(facts, PlotPlants(np.zeros((0, 3)), plants.blocks[:1], plants.cell_m), clearance_m)
    rows = f"rows are {wanted:.2f} m apart, the plan's {known:.2f} m"
    if inside:
        yield FitFinding(
            plot.name, "rows-elsewhere", "error",
            f"{rows}: {_stations(inside)} may stand among plants, being lower than {clearance_m:g} m over them",
            "Plan on a plot with these rows, or leave row_spacing_m out where you know that the stations stand clear.",
        )  # fmt: skip
    else:
        yield FitFinding(
            plot.name, "row-spacing", "warning",
            f"{rows}: what hides what differs; the mission stays above all that the plan's plants cover",
            "Compare the scores of such plots with those of the plan's spacing.",
        )  # fmt: skip


def _slope(facts: PlanFacts, plot: SitePlot) -> Iterator[FitFinding]:
    along, across = plot.gradient
    if (along, across) == (0.0, 0.0):
        return
    stations = np.array([station.position_m for station in facts.plan.stations], dtype=np.float64)
    rise = stations[:, 0] * along + stations[:, 1] * across
    shifted = f"stations are shifted by {rise.min():+.2f} to {rise.max():+.2f} m".replace("-", "−")
    if plot.slope_percent > STEEP_PERCENT:
        yield FitFinding(
            plot.name, "slope-steep", "warning",
            f"the ground rises by {plot.slope_percent:.1f} %; plans have been tried to {STEEP_PERCENT:g} %; {shifted}",
            "Plan on a plot with this slope.",
        )  # fmt: skip
    else:
        yield FitFinding(
            plot.name, "slope", "note", f"the ground rises by {plot.slope_percent:.1f} %: {shifted}, and pitches turn"
        )


def _heading(facts: PlanFacts, plot: SitePlot) -> Iterator[FitFinding]:
    if facts.plan.row_heading_deg is None:
        return
    turn = wrapped_deg(plot.row_heading_deg - facts.plan.row_heading_deg)
    if abs(turn) <= _TURNED_DEG:
        return
    remedy = ""
    if abs(turn) > 90.0:
        back = (plot.row_heading_deg + 180.0) % 360.0 % 360.0
        remedy = f"The other direction of its rows, row_heading_deg = {back:.1f}, turns it by {180.0 - abs(turn):.0f}°."
    yield FitFinding(
        plot.name, "turned", "note",
        f"lies turned by {abs(turn):.0f}° against the plot that the plan was made on: at the same hour light and shade "
        "fall otherwise on its rows",
        remedy,
    )  # fmt: skip


def _among(facts: PlanFacts, plants: PlotPlants, clearance_m: float, *, unless: PlotPlants | None = None) -> list[int]:
    """Indices of stations in the air that plants take, but for those that are in other plants' as well."""
    stations = np.array([station.position_m for station in facts.plan.stations], dtype=np.float64)
    found = plants.among(stations, clearance_m)
    if unless is not None and found.any():
        found &= ~unless.among(stations, clearance_m)
    rows: list[int] = np.flatnonzero(found).tolist()
    return rows


def _stations(indices: list[int]) -> str:
    named = ", ".join(str(station_number(index)) for index in indices[:_NAMED])
    more = f" and {len(indices) - _NAMED} more" if len(indices) > _NAMED else ""
    return f"station{'s' if len(indices) > 1 else ''} {named}{more}"


def _shown(facts: PlanFacts, size_m: tuple[float, float]) -> float | None:
    """Share of a plot about the origin that is in `_VIEWS` pictures or more, hiding apart; None without a camera.

    Looked at are places at half the plants' height; those count that are at most twice as far away as the plan's
    stations are, in the median, from the middle of its plants.
    """
    plan, box = facts.plan, facts.box
    if plan.camera is None:
        return None
    camera = plan.camera.without_distortion()
    height = 0.5 * (facts.top_m or 0.0)
    xs, ys = (np.linspace(-0.5 * side, 0.5 * side, _GRID) for side in size_m)
    places = np.array([(x, y, height) for x in xs for y in ys])
    middle = np.array([0.0, 0.0, height]) if box is None else np.array([*(0.5 * (box[0] + box[1])), height])
    stations = np.array([station.position_m for station in plan.stations], dtype=np.float64)
    far = _FAR * float(np.median(np.linalg.norm(stations - middle, axis=1)))
    counts = np.zeros(len(places), dtype=np.int64)
    for station in plan.stations:
        pixels = camera.project(station.pose.to_camera(places))
        with np.errstate(invalid="ignore"):
            pictured = ((pixels >= 0.0) & (pixels <= (camera.width, camera.height))).all(axis=1)
        counts += pictured & (np.linalg.norm(places - np.array(station.position_m), axis=1) <= far)
    return float((counts >= min(_VIEWS, len(plan.stations))).mean())


def _without(plot: SitePlot, key: str) -> SitePlot:
    return plot.model_copy(update={key: None})
