"""The results of a planning run: outcome.json and the plan."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from pydantic import BaseModel

from fieldkit.documents.json_file import read_json_object, schema_text, validated
from fieldkit.errors import about
from fieldkit.files import write_atomic
from fieldkit.planning.methods.registry import METHODS
from fieldkit.planning.problem import PlanningProblem
from fieldkit.planning.run.folder import LogEntry, RunFolder, searched
from fieldkit.planning.run.loop import Ending, Finalist, Stopped
from fieldkit.planning.run.run_setup import RunSetup
from fieldkit.planning.settings import SearchSettings
from fieldkit.results.fields import Count, Length, Strict
from fieldkit.results.plan import PlanMethod, PlanPlants
from fieldkit.results.plan_file import PLAN_FILE, plan_from_poses, save_plan

OUTCOME_FILE = "outcome.json"
_MAX_BYTES = 16 << 20
"""Largest outcome.json that is read, bytes."""
_REMEDY = "Give the folder of a finished run of `fieldkit plan`."


class FinalistReport(Strict):
    """A finalist with its confirmations."""

    number: Count
    """Of the trial."""
    origin: str
    search_value_m: Length | None
    """Value in the search; null without a search."""
    expected_m: Length | None = None
    """Expected by the geometric score, if the method uses only the score."""
    value_m: Length | None
    """Mean of the confirmations; null without any."""
    spread_m: Length | None
    """Standard deviation over the confirmations."""
    kind_m: Length | None = None
    """Expected on plots of the kind after all evaluations; finalists are chosen by it."""
    right: tuple[Count, ...]
    """Photographs with right poses, per confirmation."""


class Outcome(Strict):
    """outcome.json: the results of a run."""

    method: str
    cameras: Count
    plots: Count = 1
    """Number of plots that the plan is for: 1 is its own; with more, each confirmation is on another plot."""
    chamfer_m: Length | None
    """The chosen set's value by its confirmations; null without any."""
    chamfer_spread_m: Length | None
    expected_m: Length | None = None
    """Expected of it by the geometric score, if the method uses only the score."""
    weights: tuple[Length, Length, Length] | None = None
    """Of the geometric score's gap, noise and tie, if the method uses it."""
    evaluations: Count
    """Of the search."""
    failed_evaluations: Count
    """Of these, those that broke or gave no cloud."""
    confirmations: Count
    seconds: Length
    """Since the run began, without interruptions."""
    evaluation_cpu_s: Length
    proposal_cpu_s: Length
    """Of the method: the run's cost beside its evaluations."""
    stopped: Stopped
    """Why the search ended: it converged, its evaluations are used up, or the method has no more to try."""
    gain_m: Length | None = None
    """Bound on how much worse the search's best set is than the best possible one, if it converged."""
    noise_m: Length | None = None
    """Standard deviation of an evaluation, if it converged: ``gain_m`` is below it."""
    finalists: tuple[FinalistReport, ...]
    """The best first: it is the plan."""
    photographs: tuple[str, ...] = ()
    """The plan's views in its stations' order, if it is a choice among recorded photographs."""


def write_outcome(
    run: RunFolder, setup: RunSetup, confirmed: Sequence[Finalist], ending: Ending, choice_cpu_s: float = 0.0
) -> Outcome:
    """Write the results of a finished run; plan.json last, so that its presence means that all are there.

    ``choice_cpu_s`` are CPU seconds of a method that chose without a search.
    """
    settings, chosen = run.settings, confirmed[0]
    trials = searched(run.entries)
    values_m = {entry.number: entry.value_m for entry in trials}
    gain = ending.gain
    outcome = Outcome(
        method=settings.method,
        cameras=settings.cameras,
        plots=settings.plots,
        chamfer_m=chosen.value_m,
        chamfer_spread_m=chosen.spread_m,
        expected_m=chosen.trial.notes.get("expected_m"),
        weights=settings.weights if settings.method in METHODS and METHODS[settings.method].by_score else None,
        evaluations=len(trials),
        failed_evaluations=sum(bool(entry.failure) for entry in trials),
        confirmations=sum(len(finalist.entries) for finalist in confirmed),
        seconds=run.seconds,
        evaluation_cpu_s=sum(entry.cpu_s for entry in run.entries),
        proposal_cpu_s=choice_cpu_s + sum(entry.proposal_cpu_s for entry in run.entries),
        stopped=ending.stopped,
        gain_m=None if gain is None else gain.bound_m,
        noise_m=None if gain is None else gain.noise_m,
        finalists=tuple(
            FinalistReport(
                number=f.trial.number,
                origin=f.trial.origin,
                search_value_m=values_m.get(f.trial.number),
                expected_m=f.trial.notes.get("expected_m"),
                value_m=f.value_m,
                spread_m=f.spread_m,
                kind_m=f.kind_m,
                right=tuple(entry.right for entry in f.entries),
            )
            for f in confirmed
        ),
        photographs=tuple(setup.photographs[k] for k in setup.problem.numbers(chosen.trial.cameras))
        if setup.photographs
        else (),
    )
    write_atomic(run.path / OUTCOME_FILE, outcome.model_dump_json(indent=2) + "\n")
    plan = plan_from_poses(
        chosen.trial.cameras.poses(),
        setup.problem.camera,
        envelope=setup.problem.envelope.in_plan(),
        plants=plants_of(setup.problem),
        plant_height_m=setup.plant_height_m,
        source=settings.source,
        method=PlanMethod(
            name=settings.method,
            seed=settings.seed,
            repeats=len(chosen.entries),
            **{key: getattr(outcome, key) for key in PlanMethod.model_fields.keys() & Outcome.model_fields.keys()},
        ),
    )
    save_plan(run.path / PLAN_FILE, plan)
    return outcome


def read_outcome(path: Path) -> Outcome:
    """outcome.json of a run's folder."""
    file = path / OUTCOME_FILE
    with about(file, _REMEDY):
        return validated(Outcome, read_json_object(file, noun="run", max_bytes=_MAX_BYTES))


def run_schemas() -> dict[str, str]:
    """JSON Schemas (2020-12) by file: of search.json, outcome.json and a line of evaluations.jsonl."""
    models: dict[str, type[BaseModel]] = {"search": SearchSettings, "outcome": Outcome, "evaluations": LogEntry}
    return {f"{n}.schema.json": schema_text(m.model_json_schema(mode="validation")) for n, m in models.items()}


def plants_of(problem: PlanningProblem) -> PlanPlants:
    """The plants within the flight box and half a metre about it, as plan.json holds them."""
    envelope = problem.envelope
    return envelope.plan_plants(envelope.plants if len(envelope.plants) else problem.reference.points)
