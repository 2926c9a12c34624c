"""Planning: from a plot to the cameras that reconstruct it best. The verb behind `fieldkit plan`."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

from fieldkit.errors import FieldkitError, ReconstructionError
from fieldkit.planning.methods.circle import expected_ring
from fieldkit.planning.methods.registry import METHODS, MethodEntry, method_entry
from fieldkit.planning.methods.subsets import even_subsets
from fieldkit.planning.plan_settings import PlanSettings
from fieldkit.planning.problem import FixedDesign, Limited, PlanningProblem, Trial
from fieldkit.planning.run.evaluations import Evaluations, evaluating
from fieldkit.planning.run.folder import RunFolder, create_run, open_run
from fieldkit.planning.run.loop import (
    Ending,
    Finalist,
    Watch,
    confirm,
    evaluate_again,
    no_watch,
    ranked,
    search,
    unless_ahead,
)
from fieldkit.planning.run.outcome import Outcome, write_outcome
from fieldkit.planning.run.request import resumed_settings, search_settings
from fieldkit.planning.run.run_setup import RunSetup, set_up_run
from fieldkit.planning.settings import SearchSettings
from fieldkit.runtime.context import Context
from fieldkit.runtime.machine import Spent
from fieldkit.runtime.threads import limit_threads
from fieldkit.scenes.renderer import RenderingError
from fieldkit.version import __version__

Expect = Callable[[RunFolder, int], None]
_NEARER = 0.1
"""By which share of its distance an optimum has to beat the even ring, which has the better traits."""


def plan(
    output: Path | str,
    settings: PlanSettings | SearchSettings,
    context: Context | None = None,
    *,
    overwrite: bool = False,
    resume: bool = False,
    watch: Watch = no_watch,
    expect: Expect = lambda _run, _total: None,
    methods: Mapping[str, MethodEntry] = METHODS,
) -> Outcome:
    """Find the cameras and write the plan.

    Args:
        output: the run's folder: search.json before the start, evaluations.jsonl during the run; at the end plan.json,
            outcome.json and plan.png.
        settings: what is asked; or all that search.json holds.
        context: None takes the usual cache and one process, and says nothing.
        overwrite: replace an earlier run in ``output``.
        resume: go on with the run in ``output``, or extend a finished one; no evaluation is repeated. What is asked
            has to be the run's own but for `settings.CHANGEABLE` and paths. Without such a run a new one begins.
        watch: called with every evaluation.
        expect: called before the first evaluation, with the run and the most evaluations that its search can have.
        methods: by name; other planners plug in here.

    Raises:
        UsageError: ``output`` exists, the settings contradict themselves or the run that goes on, or the method's
            packages are not installed.
        InputError: the source cannot be used, this machine cannot render, or the run's folder is damaged.
        ReconstructionError: no set of cameras could be evaluated.
        StorageError: the disk is full; the run can be resumed if anything was evaluated.

    Example:
        >>> plan("maize-plan", PlanSettings(scene="case-1", cameras=10, evaluations=60))
    """
    limit_threads()
    output, context = Path(output), context or Context.usual()
    planned = partial(_planned, context=context, watch=watch, expect=expect, methods=methods)
    asked = settings if isinstance(settings, PlanSettings) else None
    if resume and (output.exists() or (asked is not None and not asked.sources)):
        with open_run(output) as run:
            method_entry(run.settings.method, methods)
            wanted = settings if isinstance(settings, SearchSettings) else resumed_settings(run.settings, settings)
            if wanted != run.settings:
                run.save_settings(wanted)
            if run.settings.fieldkit != __version__:
                context.progress.note(
                    f"this run was begun with fieldkit {run.settings.fieldkit} and goes on with {__version__}: where "
                    "the changelog names the objective, values of the two do not compare"
                )
            return planned(run)
    new = settings if asked is None else search_settings(asked, methods=methods, workers=context.workers)
    assert isinstance(new, SearchSettings)
    method_entry(new.method, methods)
    with create_run(output, new, overwrite=overwrite) as run:
        try:
            return planned(run)
        except FieldkitError:
            if not run.entries:  # so that the same call, put right, is not refused
                shutil.rmtree(run.path, ignore_errors=True)
            raise


def _planned(
    run: RunFolder, context: Context, watch: Watch, expect: Expect, methods: Mapping[str, MethodEntry]
) -> Outcome:
    settings = run.settings
    context = replace(context, seed=settings.seed)
    entry = method_entry(settings.method, methods)
    setup = set_up_run(settings, run.path, context, count_matches=entry.matches)
    method = entry.make(setup.problem, settings)
    if isinstance(method, FixedDesign):
        expect(run, 0)
        return _chosen(method, run, setup, context, watch)
    expect(run, min(settings.evaluations, method.trials) if isinstance(method, Limited) else settings.evaluations)
    budget = settings.time_budget_s
    with evaluating(setup.objective, context) as evaluations:
        ending = search(method, evaluations, run, out_of_time=lambda s: budget is not None and s >= budget, watch=watch)
        even = even_subsets(setup.problem) if setup.photographs else ()
        confirmed = confirm(method, evaluations, run, watch=watch, even=even)
    if not confirmed:
        raise ReconstructionError(
            "no evaluation succeeded",
            path=run.path,
            remedy="evaluations.jsonl says why each failed; `fieldkit doctor` looks at this machine.",
        )
    return write_outcome(run, setup, confirmed, ending)


def _chosen(method: FixedDesign, run: RunFolder, setup: RunSetup, context: Context, watch: Watch) -> Outcome:
    """The best of several sets by their confirmations; without confirmations, the one expected to be best."""
    settings, progress = run.settings, context.progress
    confirming = settings.repeats > 0
    if confirming and not context.scheduler:  # its workers may be able to render
        try:
            setup.check_renderer()
        except RenderingError as error:
            progress.note(f"the plan is not confirmed: {error.message}. {error.remedy}")
            confirming = False
    spent = Spent.now()
    ring = _ring(setup.problem, settings) if confirming or settings.noise.wind_m else None
    trials: Sequence[Trial] = [ring] if ring is not None else []
    if confirming or ring is None:
        starts = settings.finalists - (ring is not None) if confirming else 1
        with progress.stage("Optimising the geometric score", starts) as advance:
            trials = method.choose(starts, context.workers, advance)
    cost = (spent.seconds, spent.cpu_seconds)
    confirmed = [Finalist(trial) for trial in trials]
    if confirming:
        with evaluating(setup.objective, context) as evaluations:
            chosen = trials if ring is None else [*trials, ring]
            confirmed = ranked(method, run, _confirmed(evaluations, run, chosen, ring, context, watch))
        if ring is not None:
            confirmed = unless_ahead(confirmed, ring.cameras, run, _NEARER)
    return write_outcome(run, setup, confirmed, Ending("exhausted"), choice_s=cost)


def _ring(problem: PlanningProblem, settings: SearchSettings) -> Trial | None:
    """The even ring that optima for plots of a kind have to beat; None for one plot or among recorded views.

    The score's order of good sets outdoors is not that of evaluations (docs/decisions.md).
    """
    if settings.plots == 1 or problem.views is not None or settings.finalists == 1:
        return None
    cameras, expected_m = expected_ring(problem, settings.weights)
    return Trial(settings.finalists - 1, cameras, "even ring", {"expected_m": expected_m})


def _confirmed(
    evaluations: Evaluations,
    run: RunFolder,
    trials: Sequence[Trial],
    ring: Trial | None,
    context: Context,
    watch: Watch,
) -> list[Finalist]:
    again = partial(evaluate_again, standard=None if ring is None else ring.cameras, nearer=_NEARER)
    if watch is not no_watch:
        return again(evaluations, run, trials, watch=watch)
    with context.progress.stage("Confirming", len(trials) * run.settings.repeats) as advance:
        return again(evaluations, run, trials, watch=lambda _: advance(1))
