"""Planning: from a plot to the cameras that reconstruct it best. The verb behind `fieldkit plan`."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import replace
from functools import partial
from pathlib import Path

from fieldkit.errors import FieldkitError, ReconstructionError
from fieldkit.planning.methods.baselines import Uniform
from fieldkit.planning.methods.registry import METHODS, MethodEntry, method_entry
from fieldkit.planning.plan_settings import PlanSettings
from fieldkit.planning.problem import FixedDesign, Trial
from fieldkit.planning.run.folder import RunFolder, create_run, open_run
from fieldkit.planning.run.loop import Ending, Finalist, Watch, confirm, evaluating, finalists, no_watch, search
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
        output: the run's folder: search.json before the start, evaluations.jsonl during the run; at the end plan.json
            and outcome.json.
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
    setup = set_up_run(settings, run.path, context, count_matches=entry.by_score)
    method = entry.make(setup.problem, settings)
    if isinstance(method, FixedDesign):
        expect(run, 0)
        return _chosen(method, run, setup, context, watch)
    expect(run, min(settings.evaluations, getattr(method, "trials", settings.evaluations)))
    with evaluating(setup.objective, context) as evaluations:
        ending = search(method, evaluations, run, watch=watch)
        chosen, standard = finalists(method, run, _even_subsets(setup))
        confirmed = confirm(method, evaluations, run, chosen, watch=watch, standard=standard)
    if not confirmed:
        raise ReconstructionError(
            "no evaluation succeeded",
            path=run.path,
            remedy="evaluations.jsonl says why each failed; `fieldkit doctor` looks at this machine.",
        )
    return write_outcome(run, setup, confirmed, ending)


def _even_subsets(setup: RunSetup) -> list[Trial]:
    """The uniform subsets of a recorded set, which a search's best has to beat; none elsewhere."""
    if not setup.photographs:
        return []
    uniform = Uniform(setup.problem)
    return [trial for k in range(uniform.trials) if (trial := uniform.propose(k, (), ())) is not None]


def _chosen(method: FixedDesign, run: RunFolder, setup: RunSetup, context: Context, watch: Watch) -> Outcome:
    """The best of several sets by their confirmations; without confirmations, the one expected to be best."""
    settings, progress = run.settings, context.progress
    confirming = settings.repeats > 0
    if confirming and not context.scheduler:  # its workers may be able to render
        try:
            setup.objective.prepare()
        except RenderingError as error:
            progress.note(f"the plan is not confirmed: {error.message}. {error.remedy}")
            confirming = False
    spent = Spent.now()
    starts = settings.finalists if confirming else 1
    with progress.stage("Optimising the geometric score", starts) as advance:
        trials = method.choose(starts, context.workers, advance)
    choice_cpu_s = spent.cpu_seconds
    confirmed = [Finalist(trial) for trial in trials]
    if confirming:
        with evaluating(setup.objective, context) as evaluations, ExitStack() as shown:
            if watch is no_watch:  # else who watches shows it
                advance = shown.enter_context(progress.stage("Confirming", len(trials) * settings.repeats))
                watch = lambda _: advance(1)  # noqa: E731
            confirmed = confirm(method, evaluations, run, trials, watch=watch)
    return write_outcome(run, setup, confirmed, Ending("exhausted"), choice_cpu_s)
