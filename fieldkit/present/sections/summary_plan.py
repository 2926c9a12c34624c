"""The summary of plans and missions."""

from __future__ import annotations

from collections.abc import Iterator

from fieldkit.planning.run.outcome import best_so_far
from fieldkit.present.content import Statement
from fieldkit.present.html.text import count, millimetres, percent
from fieldkit.present.sections.parts import MissionPart, PlanPart
from fieldkit.present.style import format_seconds

_LATE = 0.1  # a search that still improved in its last tenth
_GAIN = 0.01  # by this share at least
_FEWEST_TRIALS = 20  # before that is said


def plan_statements(part: PlanPart) -> Iterator[Statement]:
    """How good a plan is by its own confirmations, and against the circles that were tried."""
    plan, settings, outcome = part.plan, part.settings, part.outcome
    where = f" on “{settings.source.name}”" if settings is not None else ""
    if plan is None:
        assert settings is not None
        yield Statement(
            "problem",
            f"The search for {settings.cameras} camera poses{where} is not finished: {len(part.trials)} of "
            f"{settings.evaluations} trials are done.",
            "Go on with: fieldkit plan --resume -o and the run's folder.",
        )
        return
    text = f"The plan has {count(len(plan.stations), 'camera pose')}{where}."
    method = plan.method
    if method is not None and method.chamfer_m is not None:
        spread = ""
        if method.chamfer_spread_m is not None and (method.repeats or 0) > 1:
            spread = (
                f" ± {millimetres(method.chamfer_spread_m)} mm (standard deviation of {method.repeats} confirmations)"
            )
        value = millimetres(method.chamfer_m)
        text += f" What they reconstruct there is {value} mm{spread} from its reference (chamfer distance)."
    elif method is not None and method.repeats == 0:
        text += " It was not confirmed: no photograph was taken of them."
    yield Statement("fact", text)
    if settings is None:
        return
    measured = [trial for trial in part.trials if trial.measured]
    if outcome is not None and outcome.finalists and settings.method not in ("circle", "circle-aim"):
        circles = [trial.value_m for trial in measured if trial.origin.startswith("circle")]
        chosen = outcome.finalists[0].search_value_m
        if outcome.finalists[0].origin.startswith("circle"):
            yield Statement(
                "note", f"The plan is one of {count(len(circles), 'circle')} tried: nothing else was better.",
                "More trials may find something: search on with --resume and more --evaluations.",
            )  # fmt: skip
        elif circles and chosen:
            best = min(circles)
            better = "lower" if chosen < best else "higher"
            yield Statement(
                "good" if chosen < best else "note",
                f"At the search's own quality ({settings.fidelity}) the plan's value is {millimetres(chosen)} mm, "
                f"{percent(abs(1 - chosen / best), 0)} % {better} than the best of {count(len(circles), 'circle')} "
                f"tried ({millimetres(best)} mm).",
                "" if chosen < best else "A circle does as well here: fly that, or search on with --evaluations.",
            )
    broken = sum(bool(trial.failure) for trial in part.trials)
    if broken:
        yield Statement(
            "problem" if broken > 0.2 * len(part.trials) else "note",
            f"{broken} of {count(len(part.trials), 'trial')} gave no cloud.",
            "evaluations.jsonl says why, in each line's “failure”.",
        )
    yield from _still_improving(part)


def _still_improving(part: PlanPart) -> Iterator[Statement]:
    best = [value for value in best_so_far(part.trials) if value is not None]
    if len(best) < _FEWEST_TRIALS or part.settings is None:
        return
    tail = max(1, round(_LATE * len(best)))
    before, last = best[-tail - 1], best[-1]
    if last < (1 - _GAIN) * before:
        more = round(1.5 * part.settings.evaluations)
        yield Statement(
            "note",
            f"The search still got better in its last {count(tail, 'trial')}: from {millimetres(before)} to "
            f"{millimetres(last)} mm, so more trials may find better poses.",
            f"Go on with: fieldkit plan --resume --evaluations {more} -o and the run's folder "
            f"(a trial took {format_seconds(_pace(part))} here).",
        )


def _pace(part: PlanPart) -> float:
    return max(trial.finished_s for trial in part.trials) / len(part.trials)


def mission_statement(part: MissionPart) -> Statement:
    """What a mission does."""
    flight = part.flight
    over = count(len(flight.plots), "plot")
    advice = ""
    if not part.mission_file:
        advice = "Only its record is here; the file that the vehicle takes is not beside it."
    elif part.changed:
        advice = f"{part.mission_file} was changed since it was exported; this is of the file as it was."
    return Statement(
        "note" if part.changed else "fact",
        f"The mission “{flight.name}” takes {count(len(flight.stations), 'photograph')} over {over} on a way of "
        f"{flight.length_m:,.0f} m.",
        advice,
    )
