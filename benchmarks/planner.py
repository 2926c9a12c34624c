"""`python -m benchmarks planner`: comparison of methods on simulated plots and on recorded sets."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from benchmarks.captures import rig_capture
from benchmarks.curves import draw_regret
from benchmarks.objective import NO_DATA
from benchmarks.planner_rest import value_against_rest
from benchmarks.planner_runs import Contender, Place, Ran, figures, run_all, run_name
from benchmarks.planner_transfer import carry, transfer_table
from benchmarks.result import Cell, ResultTable, StudyResult, spread
from benchmarks.rigs import load_rig
from benchmarks.suite import run_studies
from fieldkit.cache import StageCache
from fieldkit.errors import UsageError
from fieldkit.evaluation.reference import build_reference
from fieldkit.pictures.mission import draw_plan
from fieldkit.pictures.panels import png
from fieldkit.planning.run.request import KIND_PLOTS
from fieldkit.planning.settings import GivenPlot
from fieldkit.results.plan import PlanSource
from fieldkit.runtime.context import Context
from fieldkit.runtime.progress import Progress
from fieldkit.scenes.library import find_scene
from fieldkit.scenes.scene_file import read_scene, write_scene
from fieldkit.vocabulary import MappingName, SearchFidelity
from fieldkit_sim.generator import plots_of_kind

RECORDED_FIDELITY: SearchFidelity = "standard"
PLANNERS = ("bosfm", "bosfm-tuned", "field")
_OPTIMISED = ("circle", "circle-aim", "two-rings", "hemisphere", "mcp", "geometric", "smith", "score")
"""Methods optimised on another plot, to compare carried plans with."""
_SIMULATED = ("random", *_OPTIMISED, *PLANNERS)
_RECORDED = ("random", "uniform", "match-graph", *PLANNERS)
_SEVERAL = ("random", "circle", "circle-aim", "two-rings", "hemisphere", "smith", "score", *PLANNERS)
"""Methods that depend on the seed; circles only through the photographs that register in a trial."""
_KIND = {"score-kind": "score", "field-kind": "field"}
"""Methods that plan for plots of a kind, by their names here."""
_CARRIED = ("circle-aim", "score", *PLANNERS, *_KIND)
_REPEATS = 2
_SUBSETS = 20
_LIKE, _LIKE_SEED = "like:", 7001
"""Prefix and first seed of new plots; seeds of runs are smaller."""
_OURS = ("score", "field", *_KIND)
"""Methods that are not baselines."""


@dataclass(frozen=True)
class PlannerOptions:
    """Options of the studies."""

    data: Path | None
    """Folder of the recorded sets, or None."""
    cache: StageCache
    """Stages of recorded photographs."""
    runs: Path
    """Folder that keeps every run; finished ones are not repeated, interrupted ones are resumed."""
    scenes: tuple[str, ...] = ("tuning-1",)
    """Of ``simulated`` and ``transfer``; recorded sets of ``chosen``."""
    evaluations: int = 100
    """Of each search."""
    seeds: int = 3
    """Of methods that have one."""
    cameras: int = 10
    """N of ``simulated``."""
    mapping: MappingName = "prior"
    """Of the evaluations."""
    fidelity: SearchFidelity = "standard"
    """Of searches on simulated plots; recorded sets are searched at `RECORDED_FIDELITY`."""
    workers: int = 2
    """Processes."""
    methods: tuple[str, ...] = ()
    """To compare; all where empty."""
    onto: tuple[str, ...] = ("test-case-1", "test-case-4")
    """Scenes that plans of ``scenes`` are carried to in ``transfer``; "like:N" for N new plots of each scene's kind."""


RIGS: Mapping[str, tuple[int, ...]] = {"basil_rig": (13, 10), "arabidopsis_rig": (16,)}
"""Recorded sets and the numbers of views to choose."""


"""Numbers of views to choose for the kind."""


def _simulated(options: PlannerOptions, progress: Progress) -> StudyResult:
    found = {
        f"{name}, {options.cameras} cameras": _on_scene(name, _SIMULATED, options, progress) for name in options.scenes
    }
    return _study("simulated", "Planners on simulated plots", found, _scene_notes(options))


def _on_scene(name: str, methods: Sequence[str], options: PlannerOptions, progress: Progress) -> list[Ran]:
    return run_all(
        Place.scene(name),
        _contenders(methods, options),
        options.runs,
        cameras=options.cameras,
        mapping=options.mapping,
        fidelity=options.fidelity,
        confirm_fidelity="fine",
        repeats=_REPEATS,
        workers=options.workers,
        cache=options.cache,
        progress=progress,
    )


def _scene_notes(options: PlannerOptions) -> tuple[str, ...]:
    return (
        (
            f"{options.evaluations} evaluations at {options.fidelity} and mapping {options.mapping}; each run's best "
            f"sets, three at most, were evaluated again at fine, {_REPEATS} fresh seeds each, and the best mean counts."
        ),
        "Photographs have the scene's camera effects; leaves are still and poses exact, claimed good to 10 mm.",
    )


def _destinations(scene: str, options: PlannerOptions) -> list[str]:
    """Scenes that a scene's plans are carried to; plots of its kind are written beside the runs."""
    found: list[str] = []
    for name in options.onto:
        if not name.startswith(_LIKE):
            found.append(name)
            continue
        count = name.removeprefix(_LIKE)
        if not (count.isdecimal() and int(count)):
            raise UsageError(f"{name}: how many plots?", remedy="Give a whole number, as in like:2.")
        description = read_scene(find_scene(scene))
        options.runs.mkdir(parents=True, exist_ok=True)
        for number, made in enumerate(plots_of_kind(description, int(count), _LIKE_SEED)):
            file = options.runs / f"{Path(scene).stem}-like-{number}.toml"
            if not file.is_file():
                write_scene(file, made)
            found.append(str(file))
    return found


def _transfer(options: PlannerOptions, progress: Progress) -> StudyResult:
    tables, figures = [], {}
    # All of them first, so that a wrong name fails before hours of planning.
    targets = {scene: [(name, Place.scene(name)) for name in _destinations(scene, options)] for scene in options.scenes}
    for scene, places in targets.items():
        origin, plans = Place.scene(scene).name, _on_scene(scene, _CARRIED, options, progress)
        for name, place in places:
            carried = carry(
                plans,
                origin,
                place,
                options.runs,
                cameras=options.cameras,
                mapping=options.mapping,
                fidelity=options.fidelity,
                repeats=_REPEATS,
                workers=options.workers,
                cache=options.cache,
                progress=progress,
            )
            optimised = _on_scene(name, _OPTIMISED, options, progress)
            tables.append(transfer_table(origin, place.name, carried, optimised))
            figures[f"{name} from {scene}"] = {
                "carried": [
                    {"method": c.ran.method, "seed": c.ran.seed, "value_m": c.value_m, "moved_m": c.moved_m}
                    for c in carried
                ],
                "optimised": [{"method": r.method, "seed": r.seed, "value_m": r.value_m} for r in optimised],
            }
    return StudyResult(
        name="transfer",
        title="Plans of one plot on others, without optimising",
        tables=tuple(tables),
        notes=(*_scene_notes(options), "Carried plans are evaluated at fine and fresh seeds, too."),
        figures=figures,
    )


def _recorded(options: PlannerOptions, progress: Progress) -> StudyResult:
    title = "Planners on recorded sets"
    if options.data is None:
        return StudyResult("chosen", title, skipped=NO_DATA)
    found: dict[str, list[Ran]] = {}
    pictures: dict[str, bytes] = {}
    rests: list[ResultTable] = []
    for rig in [name for name in RIGS if name in options.scenes] or RIGS:
        place = _rig_place(options.data, rig, options, progress)
        for count in RIGS[rig]:
            contenders = [
                Contender("random", _SUBSETS) if each.method == "random" else each
                for each in _contenders(_RECORDED, options)
            ]
            runs = run_all(
                place,
                contenders,
                options.runs,
                cameras=count,
                mapping=options.mapping,
                fidelity=RECORDED_FIDELITY,
                confirm_fidelity="fine",
                repeats=1,
                workers=options.workers,
                cache=options.cache,
                progress=progress,
            )
            found[f"{rig}, {count} views"] = runs
            rows: list[tuple[Cell, ...]] = []
            for method in dict.fromkeys(run.method for run in runs):
                best = min((run for run in runs if run.method == method), key=lambda run: run.value_m)
                folder = options.runs / run_name(place, count, options.mapping, RECORDED_FIDELITY, method, best.seed)
                value = value_against_rest(
                    folder, place, best.views, workers=options.workers, cache=options.cache, progress=progress
                )
                rows.append((method, f"{1000 * best.value_m:.2f}", f"{1000 * value:.2f}"))
                pictures[f"chosen-{rig}-{count}-{method}.png"] = png(
                    draw_plan(f"{rig}, {count} views: {method}", best.plan)
                )
            columns = ("method", "against all views, mm>", "against the others, mm>")
            rests.append(ResultTable(f"{rig}, {count} views: each method's best plan", columns, tuple(rows)))
    notes = (
        (
            f"{options.evaluations} evaluations at {RECORDED_FIDELITY} among all views of the rig, with its commanded "
            f"poses, against the reference of all of them ({_SUBSETS} for random); the finalists were evaluated again "
            "at fine."
        ),
    )
    study = _study("chosen", title, found, notes)
    return replace(study, tables=(*study.tables, *rests), pictures={**study.pictures, **pictures})


def _rig_place(data: Path, name: str, options: PlannerOptions, progress: Progress) -> Place:
    """A rig's photographs with complete commanded poses, and their reference, kept beside the runs."""
    images, reference = options.runs / name, options.runs / f"{name}-reference"
    if not images.is_dir():
        rig = load_rig(data, name, cache=options.cache, progress=progress, workers=options.workers)
        part = images.with_name(f"{name}.part")
        shutil.rmtree(part, ignore_errors=True)
        rig_capture(part, rig, rig.names, rig.nominal, rig.accuracy_m)
        part.rename(images)  # so that an interrupted copy is not taken for a complete one
    if not reference.is_dir():
        build_reference(
            data / name / "images",
            reference,
            context=Context(options.cache, progress, options.workers),
            scene=False,
        )
    plot = GivenPlot(
        source=PlanSource(kind="captures", name=name),
        path=str(images.resolve()),
        reference_path=str(reference.resolve()),
    )
    return Place(name, plot)


def _contenders(names: Sequence[str], options: PlannerOptions) -> list[Contender]:
    chosen = [name for name in names if not options.methods or name in options.methods]
    seeds = tuple(range(options.seeds))
    return [
        Contender(
            _KIND.get(name, name),
            options.evaluations,
            seeds if name in (*_SEVERAL, *_KIND) else (0,),
            KIND_PLOTS if name in _KIND else 1,
        )
        for name in chosen
    ]


def _study(name: str, title: str, found: Mapping[str, Sequence[Ran]], notes: tuple[str, ...]) -> StudyResult:
    return StudyResult(
        name=name,
        title=title,
        tables=tuple(compare_table(place, runs) for place, runs in found.items()),
        notes=notes,
        figures={
            place: [{"method": r.method, "seed": r.seed, "best_m": r.best_m, **r.outcome.model_dump()} for r in runs]
            for place, runs in found.items()
        },
        pictures={f"{name}-regret.png": png(draw_regret({p: _curves(runs) for p, runs in found.items()}))},
    )


def compare_table(place: str, runs: Sequence[Ran]) -> ResultTable:
    """A row per method: confirmed values of its plans, and their ratio to the best baseline's."""
    methods = list(dict.fromkeys(run.method for run in runs))
    baselines = [_mean_value(runs, method) for method in methods if method not in _OURS]
    best = min(baselines, default=float("nan"))
    final = _final_search_value(runs, "bosfm")
    rows: list[tuple[Cell, ...]] = []
    for method in methods:
        own = [run for run in runs if run.method == method]
        reached = [_evaluations_to(run, final) for run in own] if final is not None else []
        rows.append(
            (
                method,
                len(own),
                f"{np.mean([r.outcome.evaluations for r in own]):.0f}",
                f"{np.mean([r.outcome.failed_evaluations for r in own]):.0f}",
                spread([1000 * (r.found_m or np.nan) for r in own], 2),
                *figures(own, best),
                " ".join("–" if k is None else str(k) for k in reached) or None,
                f"{np.mean([_overhead(r) for r in own]):.1%}",
                f"{np.mean([_cpu_s(r) for r in own]) / 60:.0f}",
            )
        )
    columns = (
        "method",
        "runs>",
        "evaluations>",
        "without a cloud>",
        "search, mm>",
        "plan, mm>",
        "÷ best baseline>",
        "accuracy, mm>",
        "completeness, mm>",
        "right>",
        "reaches bosfm's end at>",
        "overhead>",
        "CPU minutes>",
    )
    return ResultTable(place, columns, tuple(rows))


def _mean_value(runs: Sequence[Ran], method: str) -> float:
    return float(np.mean([run.value_m for run in runs if run.method == method]))


def _final_search_value(runs: Sequence[Ran], method: str) -> float | None:
    values = [run.found_m for run in runs if run.method == method and run.found_m is not None]
    return float(np.mean(values)) if values else None


def _evaluations_to(run: Ran, value_m: float) -> int | None:
    return next((k + 1 for k, best in enumerate(run.best_m) if best is not None and best <= value_m), None)


def _overhead(run: Ran) -> float:
    """Share of the CPU time outside evaluations."""
    spent = _cpu_s(run)
    return run.outcome.proposal_cpu_s / spent if spent > 0 else 0.0


def _cpu_s(run: Ran) -> float:
    return run.outcome.evaluation_cpu_s + run.outcome.proposal_cpu_s


def _curves(runs: Sequence[Ran]) -> dict[str, list[tuple[float | None, ...]]]:
    curves: dict[str, list[tuple[float | None, ...]]] = {}
    for run in runs:
        if run.best_m:
            curves.setdefault(run.method, []).append(run.best_m)
    return curves


STUDIES: dict[str, Callable[[PlannerOptions, Progress], StudyResult]] = {
    "simulated": _simulated,
    "transfer": _transfer,
    "chosen": _recorded,
}


def run_planner(
    output: Path, names: Sequence[str], options: PlannerOptions, *, progress: Progress, overwrite: bool = False
) -> list[StudyResult]:
    """Run studies one after the other and write results.json, results.md and their pictures.

    Args:
        output: folder of the result.
        names: of `STUDIES`; empty takes ``simulated``.
        options: for all of them.
        overwrite: replace an earlier result in ``output``.
    """
    return run_studies(output, names, STUDIES, ["simulated"], options, progress=progress, overwrite=overwrite)
