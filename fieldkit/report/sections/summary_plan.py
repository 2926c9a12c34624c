"""The summary of plans and missions."""

from __future__ import annotations

from collections.abc import Iterator

from fieldkit.figures.content import Statement
from fieldkit.figures.style import format_length, format_seconds, format_with_error, percent
from fieldkit.planning.run.outcome import best_so_far
from fieldkit.report.sections.loaded import FlownMission, Loaded, PlanRun, Results
from fieldkit.wording import count

_LATE = 0.1  # the last tenth of a search
_GAIN = 0.01  # least improvement, as a share
_FEWEST_TRIALS = 20  # before late improvement is reported


def plan_statements(loaded: Loaded[PlanRun], _: Results) -> Iterator[Statement]:
    """The quality of a plan by its confirmations, and against the circles tried."""
    result = loaded.report
    plan, settings, outcome = result.plan, result.settings, result.outcome
    where = f" on “{settings.source.name}”" if settings is not None else ""
    if plan is None:
        assert settings is not None
        yield Statement(
            "problem",
            f"The search for {settings.cameras} camera poses{where} is not finished: {len(result.trials)} of "
            f"{settings.evaluations} trials are done.",
            "Go on with: fieldkit plan --resume -o and the run's folder.",
        )
        return
    text = f"The plan has {count(len(plan.stations), 'camera pose')}{where}."
    method = plan.method
    if method is not None and method.chamfer_m is not None:
        spread = ""
        if method.known_spread_m is not None:
            spread = f" (standard deviation of {method.repeats} confirmations)"
        value = format_with_error(method.chamfer_m, method.known_spread_m)
        text += f" What they reconstruct there is {value}{spread} from its reference (chamfer distance)."
    elif method is not None and method.repeats == 0:
        text += " It was not confirmed: no photograph was taken of them."
    yield Statement("fact", text)
    if settings is None:
        return
    measured = [trial for trial in result.trials if trial.measured]
    if outcome is not None and outcome.finalists and settings.method != "circle":
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
                f"At the search's own quality ({settings.fidelity}) the plan's value is {format_length(chosen)}, "
                f"{percent(abs(1 - chosen / best), 0)} % {better} than the best of {count(len(circles), 'circle')} "
                f"tried ({format_length(best)}).",
                "" if chosen < best else "A circle does as well here: fly that, or search on with --evaluations.",
            )
    broken = sum(bool(trial.failure) for trial in result.trials)
    if broken:
        yield Statement(
            "problem" if broken > 0.2 * len(result.trials) else "note",
            f"{broken} of {count(len(result.trials), 'trial')} gave no cloud.",
            "evaluations.jsonl says why, in each line's “failure”.",
        )
    yield from _still_improving(result)


def _still_improving(result: PlanRun) -> Iterator[Statement]:
    best = [value for value in best_so_far(result.trials) if value is not None]
    if len(best) < _FEWEST_TRIALS or result.settings is None:
        return
    tail = max(1, round(_LATE * len(best)))
    before, last = best[-tail - 1], best[-1]
    if last < (1 - _GAIN) * before:
        more = round(1.5 * result.settings.evaluations)
        yield Statement(
            "note",
            f"The search still got better in its last {count(tail, 'trial')}: from {format_length(before)} to "
            f"{format_length(last)}, so more trials may find better poses.",
            f"Go on with: fieldkit plan --resume --evaluations {more} -o and the run's folder "
            f"(a trial took {format_seconds(_pace(result))} here).",
        )


def _pace(result: PlanRun) -> float:
    return max(trial.finished_s for trial in result.trials) / len(result.trials)


def mission_statements(loaded: Loaded[FlownMission], _: Results) -> Iterator[Statement]:
    """A sentence on a mission."""
    result, flight = loaded.report, loaded.report.flight
    over = count(len(flight.plots), "plot")
    advice = ""
    if not result.mission_file:
        advice = "Only its record is here; the file that the vehicle takes is not beside it."
    elif result.changed:
        advice = f"{result.mission_file} was changed since it was exported; this is of the file as it was."
    yield Statement(
        "note" if result.changed else "fact",
        f"The mission “{flight.name}” takes {count(len(flight.stations), 'photograph')} over {over} on a way of "
        f"{format_length(flight.length_m)} in {format_seconds(flight.time_s)}, from take-off to landing.",
        advice,
    )
