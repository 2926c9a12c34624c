"""The sections of plans and missions."""

from __future__ import annotations

from collections.abc import Iterator

from fieldkit.missions.export_record import geo_points, site_frame
from fieldkit.planning.run.outcome import best_so_far, models_of, weights_of
from fieldkit.present.content import (
    Block,
    Charts,
    Column,
    Details,
    KeyFigure,
    KeyFigures,
    Paragraph,
    Section,
    Table,
    Terms,
    View,
)
from fieldkit.present.html.charts import LineChart, Series
from fieldkit.present.html.text import decimal, metres, millimetres
from fieldkit.present.sections.parts import MissionPart, PlanPart
from fieldkit.present.sections.quality import MOST_ROWS
from fieldkit.present.style import format_seconds

_LATER = 0.97  # quantile of the values that the curve's axis shows; the first random sets are often far off


def plan_section(part: PlanPart, anchor: str, view: View | None, note: str) -> Section:
    """A plan's stations, and how the search found them."""
    blocks: list[Block] = [KeyFigures(tuple(_figures(part)))]
    if view is not None:
        blocks.append(view)
    elif note:
        blocks.append(Paragraph(note, faint=True))
    charts = tuple(_charts(part))
    if charts:
        blocks.append(Charts(charts))
    if part.plan is not None:
        blocks.append(_stations(part))
    if part.outcome is not None and part.outcome.finalists:
        blocks.append(_finalists(part))
    if part.settings is not None:
        blocks.append(Details("What the search was asked for", (Terms(tuple(_settings(part))),)))
    return Section(anchor, "Plan" if part.name == "plan" else f"Plan: {part.name}", tuple(blocks))


def mission_section(part: MissionPart, anchor: str, view: View | None) -> Section:
    """A mission's way over the plots."""
    flight = part.flight
    stations = flight.stations
    figures = [
        KeyFigure("photographs", f"{len(stations)}"),
        KeyFigure("plots", f"{len(flight.plots)}"),
        KeyFigure("length of the way", f"{flight.length_m:,.0f} m", "from take-off to landing"),
    ]
    if stations:
        heights = [station.height_m for station in stations]
        figures.append(KeyFigure("heights of photographs", f"{min(heights):.1f} to {max(heights):.1f} m", "above home"))
    columns = (
        Column("photograph"), Column("plot"), Column("station", True), Column("east of home, m", True),
        Column("north of home, m", True), Column("height above home, m", True),
        Column("yaw, °", True), Column("pitch, °", True),
    )  # fmt: skip
    shown = stations[:MOST_ROWS]
    positions = site_frame(part.record).points(geo_points(shown)).tolist()
    rows = tuple(
        (f"{number}", s.plot, f"{s.station}", *(metres(v) for v in position), decimal(s.yaw_deg % 360.0, 1),
         decimal(s.pitch_deg, 1))
        for number, (s, position) in enumerate(zip(shown, positions, strict=True), 1)
    )  # fmt: skip
    note = "" if len(stations) <= MOST_ROWS else f"The first {MOST_ROWS} of {len(stations)}."
    table = Table("Photographs in the order they are flown", columns, rows, note)
    blocks: tuple[Block, ...] = (KeyFigures(tuple(figures)), *([view] if view is not None else []))
    blocks += (table,) if len(rows) <= 14 else (Details(f"All {len(stations)} photographs", (table,)),)
    return Section(anchor, f"Mission: {part.mission_file or part.name}", blocks)


def _figures(part: PlanPart) -> Iterator[KeyFigure]:
    plan, settings, outcome = part.plan, part.settings, part.outcome
    if plan is not None:
        yield KeyFigure("camera poses", f"{len(plan.stations)}")
        if plan.method is not None and plan.method.chamfer_m is not None:
            spread = plan.method.chamfer_spread_m
            more = "" if spread is None or (plan.method.repeats or 0) < 2 else f" ± {millimetres(spread)}"
            yield KeyFigure(
                "chamfer distance", f"{millimetres(plan.method.chamfer_m)}{more} mm",
                "of what they reconstruct to its reference, on what the plan was made on",
            )  # fmt: skip
        elif plan.method is not None and plan.method.repeats == 0:
            yield KeyFigure("chamfer distance", "not confirmed", "no photograph was taken of these poses")
    if settings is not None and (part.trials or plan is None):
        yield KeyFigure("trials", f"{len(part.trials)} of {settings.evaluations}", "sets of poses that were tried")
    if outcome is not None:
        yield KeyFigure(
            "time",
            format_seconds(outcome.seconds),
            f"{format_seconds(outcome.evaluation_cpu_s + outcome.proposal_cpu_s)} of processor time",
        )


def _charts(part: PlanPart) -> Iterator[LineChart]:
    trials = part.trials
    if len(trials) < 2:
        return
    values = [(trial.number + 1.0, 1000.0 * trial.value_m if trial.measured else None) for trial in trials]
    best = [
        (trial.number + 1.0, None if b is None else 1000.0 * b)
        for trial, b in zip(trials, best_so_far(trials), strict=True)
    ]
    measured = sorted(value for _, value in values if value is not None)
    known = [value for _, value in best if value is not None]
    if measured and known:
        at = "" if part.settings is None else f" at {part.settings.confirm_fidelity}"
        value_m = None if part.outcome is None else part.outcome.chamfer_m
        confirmed = None if value_m is None else (1000.0 * value_m, f"the plan, confirmed{at}")
        described = f"The best value fell from {known[0]:.2f} to {known[-1]:.2f} mm in {len(trials)} trials."
        yield LineChart(
            "The search: every trial, and the best so far", described, "trial", "value, mm",
            (Series("trial", tuple(values), "dots"), Series("best so far", tuple(best), "step")),
            level=confirmed,
            y_top=1.08 * measured[min(len(measured) - 1, int(_LATER * len(measured)))],
        )  # fmt: skip
    models = models_of(trials)
    if models:
        series = tuple(
            Series(name, tuple((t.number + 1.0, weights_of(t).get(name)) for t in trials)) for name in models[:6]
        )
        yield LineChart(
            "Weights of the models that proposed trials",
            f"Models: {', '.join(models[:6])}.",
            "trial",
            "weight, 0 to 1",
            series,
        )


def _stations(part: PlanPart) -> Table:
    assert part.plan is not None
    columns = (
        Column("station"), Column("x, m", True), Column("y, m", True), Column("z, m", True), Column("yaw, °", True),
        Column("pitch, °", True),
    )  # fmt: skip
    stations = part.plan.stations
    rows = tuple(
        (f"{number}", *(metres(v) for v in s.position_m), decimal(s.yaw_deg % 360.0, 1), decimal(s.pitch_deg, 1))
        for number, s in enumerate(stations[:MOST_ROWS])
    )
    return Table(
        "Stations", columns, rows, "Plot frame: metres from the plot's centre on the ground; z is the height above it."
    )


def _finalists(part: PlanPart) -> Table:
    assert part.outcome is not None
    columns = (
        Column("trial"), Column("how it was proposed"), Column("in the search, mm", True),
        Column("confirmed, mm", True), Column("spread, mm", True), Column("photographs used", True),
    )  # fmt: skip
    rows = tuple(
        (f"{f.number + 1}{', the plan' if k == 0 else ''}", f.origin, millimetres(f.search_value_m),
         millimetres(f.value_m), millimetres(f.spread_m), ", ".join(str(n) for n in f.right))
        for k, f in enumerate(part.outcome.finalists)
    )  # fmt: skip
    note = (
        "Finalists are evaluated again with new random numbers: the lowest of many noisy values is partly luck. "
        "Compare values within a column only: confirmations may be at a finer quality than the search."
    )
    return Table("Finalists", columns, rows, note)


def _settings(part: PlanPart) -> Iterator[tuple[str, str]]:
    assert part.settings is not None
    s, e = part.settings, part.settings.envelope
    yield "planned on", f"{s.source.kind} {s.source.name}"
    yield "method", f"{s.method} (preset {s.preset}, mapping {s.mapping})"
    yield "trials", f"{s.evaluations} at {s.fidelity}, seed {s.seed}"
    yield "confirmations", f"{s.finalists} finalists, {s.repeats} each, at {s.confirm_fidelity}"
    yield (
        "heights",
        f"{e.height_m[0]:g} to {e.height_m[1]:g} m above the ground, within {e.margin_m:g} m of the plants' box",
    )
    yield "distances", f"{e.clearance_m:g} m from plants, {e.separation_m:g} m between stations"
    yield "gimbal pitch", f"{e.pitch_deg[0]:g}° to {e.pitch_deg[1]:g}°".replace("-", "−")
    if s.vehicle is not None:
        yield "vehicle", s.vehicle.title
    n = s.noise
    if n.any:
        yield (
            "planned for",
            f"pose errors of {n.pose_m:g} m and {n.pose_deg:g}°, image noise {n.image_grey:g}, wind {n.wind_m:g} m",
        )
