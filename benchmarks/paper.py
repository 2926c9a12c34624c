"""`python -m benchmarks paper`: the paper's tables and noise figures on our cases, and plans on new plots."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from benchmarks.curves import draw_bands
from benchmarks.depth_images import DepthError, depth_error
from benchmarks.planner_runs import OF_A_KIND, Confirmed, Contender, Place, Ran, run_all
from benchmarks.planner_transfer import Carried, carry
from benchmarks.result import Cell, ResultTable, StudyResult, spread
from benchmarks.suite import run_studies
from benchmarks.unseen_plots import UnseenOptions, run_new_plots, run_new_traits
from fieldkit.cache import StageCache, digest
from fieldkit.files import write_atomic
from fieldkit.pictures.panels import png
from fieldkit.planning.objective.evaluation import Evaluation
from fieldkit.planning.objective.objective import Objective, ObjectiveSettings
from fieldkit.planning.objective.simulated import SimulatedSource
from fieldkit.planning.run.loop import Job, evaluating
from fieldkit.planning.run.request import KIND_PLOTS
from fieldkit.runtime.context import Context
from fieldkit.runtime.progress import Progress
from fieldkit.scenes.library import find_scene
from fieldkit.scenes.scene_file import read_scene
from fieldkit.scenes.simulate import CaptureNoise
from fieldkit.vocabulary import MappingName, SearchFidelity

CASES = ("case-1", "case-2", "case-3")
TESTS: Mapping[str, str] = {
    "test-case-1": "case-1",
    "test-case-2": "case-2",
    "test-case-3": "case-3",
    "test-case-4": "case-1",
    "test-case-5": "case-3",
}
"""The case whose plans are carried to each test case."""
PAPER: Mapping[str, float] = {
    "case-1": 0.836,
    "case-2": 0.797,
    "case-3": 0.754,
    "test-case-1": 0.872,
    "test-case-2": 0.973,
    "test-case-3": 0.895,
    "test-case-4": 0.783,
    "test-case-5": 0.930,
}
"""CD of the paper's BOSfM ÷ its best baseline."""
BASELINES = ("circle", "circle-aim", "two-rings", "mcp", "smith", "geometric")
_SEEDLESS = ("mcp", "geometric", "smith")
"""Methods that hardly depend on the seed; they run with one."""
_KIND = f"score{OF_A_KIND}"
"""The default of `fieldkit plan`."""
_CARRIED = ("circle", "bosfm", "field", f"field{OF_A_KIND}", _KIND)
_QUICK = ("circle", "field", _KIND)
_REPEATS = 2
_CAMERAS = 10
_MAPPING: MappingName = "prior"
_FIDELITY: SearchFidelity = "standard"
NEW_PLANTS, _FLOWN, _PLANNED = 3, range(8001, 8011), range(8101, 8111)
"""Number of plants, and seeds of the plots that plans are flown over and made on."""
POSITIONS_M = (0.0, 0.005, 0.01, 0.02, 0.05)
_DEG_PER_M = 50.0
"""Noise of angles per noise of positions: 1° at 2 cm."""
FLIGHT_M, _FLIGHTS = 0.02, 10
GREY_LEVELS = (0.0, 5.0, 10.0, 20.0, 40.0)


@dataclass(frozen=True)
class PaperOptions:
    """Options of the studies."""

    cache: StageCache
    """The stage cache."""
    runs: Path
    """Folder that keeps every run and evaluation; finished ones are not repeated."""
    evaluations: int = 100
    """Of each search, at most."""
    seeds: int = 3
    """Number of seeds of methods that use one, and of draws of the noise."""
    workers: int = 1
    """Number of processes."""
    scenes: tuple[str, ...] = ()
    """Test cases; empty takes all."""
    count: int = 10
    """New plots, ten at most."""
    quick: bool = False
    """Case-1 with its two test cases, circles and fieldkit's own methods, one seed, two new plots, few evaluations."""

    @property
    def tests(self) -> dict[str, str]:
        """The test cases with their cases."""
        wanted = self.scenes or (("test-case-1", "test-case-4") if self.quick else tuple(TESTS))
        return {name: TESTS[name] for name in wanted if name in TESTS}

    @property
    def flown(self) -> Sequence[int]:
        """Seeds of the new plots."""
        return _FLOWN[: min(self.count, 2 if self.quick else len(_FLOWN))]

    @property
    def cases(self) -> list[str]:
        """The cases, in their order."""
        return [case for case in CASES if case in self.tests.values()]

    def contenders(self, methods: Sequence[str]) -> list[Contender]:
        """The methods with their budgets."""
        seeds = tuple(range(1 if self.quick else self.seeds))
        return [
            Contender(
                method.removesuffix(OF_A_KIND),
                min(self.evaluations, 8) if self.quick else self.evaluations,
                seeds[:1] if method in _SEEDLESS else seeds,
                KIND_PLOTS if method.endswith(OF_A_KIND) else 1,
            )
            for method in methods
        ]


def _tables(options: PaperOptions, progress: Progress) -> StudyResult:
    home = tuple(m for m in (*BASELINES, *_CARRIED[1:]) if not options.quick or m in _QUICK)
    baselines = tuple(m for m in BASELINES if not options.quick or m in _QUICK)
    planned = {case: _run(Place.scene(case), home, options, progress) for case in options.cases}
    carried = {
        test: _carry(planned[case], case, Place.scene(test), options, progress) for test, case in options.tests.items()
    }
    optimised = {test: _run(Place.scene(test), baselines, options, progress) for test in options.tests}
    rows_home = {case: _at_home(runs, case, options, progress) for case, runs in planned.items()}
    rows_test = {
        test: {f"{name}, carried": plans for name, plans in _by_method(carried[test]).items()}
        | {f"{name}, optimised there": plans for name, plans in _by_method(optimised[test]).items()}
        for test in options.tests
    }
    depths_home = _depths(rows_home, options, progress)
    depths_test = _depths(rows_test, options, progress)
    notes = (
        f"{_CAMERAS} cameras, commanded poses, confirmed at fine, {_REPEATS} fresh seeds; means (ranges).",
        "CD is the sum of both directed means in metres, × 100: a tenth of the millimetres.",
        "÷: a method's mean over the best baseline's mean on the same plot. Carried plans had no evaluation there.",
        "Depth: first seed, whole counting (a missing depth counts as 0) / pixels that both images have, metres.",
    )
    return StudyResult(
        name="tables",
        title="The paper's tables",
        tables=(
            distance_table("Table 1: CD × 100 at home", rows_home),
            depth_table("Table 1: depth MAE at home", depths_home),
            distance_table("Table 2: CD × 100 on the test cases", rows_test),
            depth_table("Table 3: depth MAE on the test cases", depths_test),
        ),
        notes=notes,
        figures={
            place: {name: [plan.value_m for plan in plans] for name, plans in by.items()}
            for place, by in (rows_home | rows_test).items()
        },
    )


Plans = Mapping[str, Sequence["Ran | Carried"]]


def distance_table(title: str, found: Mapping[str, Plans]) -> ResultTable:
    """A row per method: CD × 100 and the ratio to the best baseline, by plot; the last row has the paper's ratio."""
    rows: list[tuple[Cell, ...]] = []
    best = {place: _best_baseline(plans) for place, plans in found.items()}
    for name in dict.fromkeys(name for plans in found.values() for name in plans):
        cells: list[Cell] = [name]
        for place, plans in found.items():
            own: Sequence[Confirmed] = plans.get(name, ())
            if not own:
                cells += [None, None]
                continue
            mean = float(np.mean([plan.value_m for plan in own]))
            cells += [spread([100 * plan.value_m for plan in own], 3), f"{mean / best[place]:.2f}"]
        rows.append(tuple(cells))
    paper: list[Cell] = ["the paper's BOSfM"]
    for place in found:
        paper += [None, f"{PAPER[place]:.2f}" if place in PAPER else None]
    columns = ("method", *(column for place in found for column in (f"{place}>", "÷>")))
    return ResultTable(title, columns, (*rows, tuple(paper)))


def depth_table(title: str, found: Mapping[str, Mapping[str, DepthError]]) -> ResultTable:
    """A row per method: both kinds of the depth error, by plot."""
    names = dict.fromkeys(name for by in found.values() for name in by)
    rows: list[tuple[Cell, ...]] = [
        (
            name,
            *(
                f"{by[name].mae_whole_m:.3f} / {by[name].mae_common_m:.3f}" if name in by else None
                for by in found.values()
            ),
        )
        for name in names
    ]
    return ResultTable(title, ("method", *(f"{place}, m>" for place in found)), tuple(rows))


def _best_baseline(plans: Plans) -> float:
    means = [
        float(np.mean([plan.value_m for plan in own]))
        for name, own in plans.items()
        if name.removesuffix(", optimised there") in BASELINES
    ]
    return min(means, default=float("nan"))


def _run(place: Place, methods: Sequence[str], options: PaperOptions, progress: Progress) -> list[Ran]:
    return _run_contenders(place, options.contenders(methods), options, progress)


def _run_contenders(
    place: Place, contenders: Sequence[Contender], options: PaperOptions, progress: Progress
) -> list[Ran]:
    return run_all(
        place,
        contenders,
        options.runs,
        cameras=_CAMERAS,
        mapping=_MAPPING,
        fidelity=_FIDELITY,
        confirm_fidelity="fine",
        repeats=_REPEATS,
        workers=options.workers,
        cache=options.cache,
        progress=progress,
    )


def _carry(plans: Sequence[Ran], origin: str, place: Place, options: PaperOptions, progress: Progress) -> list[Carried]:
    return carry(
        [plan for plan in plans if plan.method in _CARRIED],
        origin,
        place,
        options.runs,
        cameras=_CAMERAS,
        mapping=_MAPPING,
        fidelity=_FIDELITY,
        repeats=_REPEATS,
        workers=options.workers,
        cache=options.cache,
        progress=progress,
    )


def _at_home(
    plans: Sequence[Ran], case: str, options: PaperOptions, progress: Progress
) -> dict[str, list[Ran | Carried]]:
    """Plans by method; plans for a kind, confirmed on other plots under noise, are evaluated at home too."""
    for_kind = _carry([p for p in plans if p.method.endswith(OF_A_KIND)], case, Place.scene(case), options, progress)
    return _by_method(plans) | _by_method(for_kind)


def _by_method(plans: Sequence[Ran] | Sequence[Carried]) -> dict[str, list[Ran | Carried]]:
    found: dict[str, list[Ran | Carried]] = {}
    for plan in plans:
        found.setdefault((plan.ran if isinstance(plan, Carried) else plan).method, []).append(plan)
    return found


def _depths(found: Mapping[str, Plans], options: PaperOptions, progress: Progress) -> dict[str, dict[str, DepthError]]:
    """Depth errors of each method's first plan, kept beside the runs."""
    kept_file = options.runs / "depths.json"
    kept = json.loads(kept_file.read_text("utf-8")) if kept_file.is_file() else {}
    errors: dict[str, dict[str, DepthError]] = {}
    for place, by in found.items():
        source: SimulatedSource | None = None
        errors[place] = {}
        with progress.stage(f"{place}: depth images", len(by)) as advance:
            for name, plans in by.items():
                cameras = plans[0].cameras
                key = f"{place} {digest(cameras.vector())}"
                if key not in kept:
                    source = source or SimulatedSource.from_description(
                        read_scene(find_scene(Path(place))), CaptureNoise()
                    )
                    kept[key] = asdict(depth_error(source, cameras, seed=0))
                    write_atomic(kept_file, json.dumps(kept, indent=1) + "\n")
                errors[place][name] = DepthError(**kept[key])
                advance(1)
        if source is not None:
            source.close()
    return errors


def _pose_noise(options: PaperOptions, progress: Progress) -> StudyResult:
    levels = {1000.0 * sigma: CaptureNoise(position_m=sigma, angle_deg=_DEG_PER_M * sigma) for sigma in POSITIONS_M}
    return _noise("pose-noise", "Carried plans against noise of poses", "σ of positions, mm", levels, options, progress)


def _image_noise(options: PaperOptions, progress: Progress) -> StudyResult:
    levels = {sigma: CaptureNoise(image_sigma=sigma) for sigma in GREY_LEVELS}
    return _noise("image-noise", "Carried plans against noise of images", "σ, grey levels", levels, options, progress)


def _noise(
    name: str, title: str, axis: str, levels: Mapping[float, CaptureNoise], options: PaperOptions, progress: Progress
) -> StudyResult:
    """Values of carried plans by noise; clouds are aligned and scaled to the plants, so only their shape counts."""
    methods = tuple(m for m in _CARRIED if not options.quick or m in _QUICK)
    levels = dict(list(levels.items())[:: 4 if options.quick else 1])
    draws = 2 if options.quick else max(2, options.seeds)
    rows: list[tuple[Cell, ...]] = []
    pictures: dict[str, bytes] = {}
    for test, case in options.tests.items():
        place = Place.scene(test)
        carried = _by_method(
            _carry(_run(Place.scene(case), methods, options, progress), case, place, options, progress)
        )
        description = read_scene(find_scene(Path(test)))
        source = SimulatedSource.from_description(description)
        curves: dict[str, dict[float, list[float]]] = {}
        with progress.stage(f"{test}: {name}", len(carried) * len(levels) * draws) as advance:
            for sigma, noise in levels.items():
                objective = Objective(
                    SimulatedSource(source.proxy, noise, effects=source.effects),
                    ObjectiveSettings(_FIDELITY, _MAPPING, refine=True),
                )
                with evaluating(objective, Context(workers=options.workers)) as evaluations:
                    for method, plans in carried.items():
                        found: list[Evaluation] = []
                        for evaluation in evaluations.each(Job(plans[0].cameras, seed) for seed in range(draws)):
                            found.append(evaluation)
                            advance(1)
                        curves.setdefault(method, {})[sigma] = [each.value_m for each in found]
                        rows.append(
                            (
                                test,
                                method,
                                f"{sigma:g}",
                                spread([1000 * e.value_m for e in found], 2),
                                f"{np.mean([e.right for e in found]):.1f}",
                                f"{sum(e.right == _CAMERAS for e in found)} of {len(found)}",
                            )
                        )
        pictures[f"{name}-{test}.png"] = png(draw_bands({f"{m}: {axis}": c for m, c in curves.items()}, "value"))
    columns = ("plot", "carried plan", f"{axis}>", "value, mm>", "right>", "all ten right>")
    return StudyResult(
        name=name,
        title=title,
        tables=(ResultTable(title, columns, tuple(rows)),),
        notes=(
            f"Standard, {draws} draws, first planner seed. Bands: mean ± one standard deviation.",
            "Clouds are moved and scaled onto the plants before they are scored. Angles go with positions, 1° at 2 cm.",
        ),
        pictures=pictures,
    )


def _unseen(options: PaperOptions) -> UnseenOptions:
    return UnseenOptions(options.cache, options.runs, options.workers, min(options.count, 1 if options.quick else 10))


STUDIES: dict[str, Callable[[PaperOptions, Progress], StudyResult]] = {
    "tables": _tables,
    "pose-noise": _pose_noise,
    "image-noise": _image_noise,
    "new-plots": lambda options, progress: run_new_plots(_unseen(options), progress),
    "new-traits": lambda options, progress: run_new_traits(_unseen(options), progress),
}


def run_paper(
    output: Path, names: Sequence[str], options: PaperOptions, *, progress: Progress, overwrite: bool = False
) -> list[StudyResult]:
    """Run studies one after the other and write results.json, results.md and their pictures.

    Args:
        output: folder of the result.
        names: of `STUDIES`; empty takes all.
        options: for all of them.
        overwrite: replace an earlier result in ``output``.
    """
    return run_studies(output, names, STUDIES, list(STUDIES), options, progress=progress, overwrite=overwrite)
