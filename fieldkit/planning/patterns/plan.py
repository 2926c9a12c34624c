"""A pattern for a trial: the front of minutes and errors over its field, and the pattern that is asked for."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal, get_args

import numpy as np
import shapely

from fieldkit.arrays import FloatArray
from fieldkit.documents.csv_text import csv_text
from fieldkit.documents.json_file import read_model
from fieldkit.errors import MetadataError, UsageError
from fieldkit.figures.style import format_length
from fieldkit.files import atomic_folder, write_atomic
from fieldkit.geometry import Similarity
from fieldkit.geometry.geodesy import LocalFrame
from fieldkit.geometry.priors import SourceFrame
from fieldkit.planning.methods.registry import method_entry
from fieldkit.planning.patterns.block import LAYOUT, Block
from fieldkit.planning.patterns.front import FrontPattern, PatternWorth, front_of, over
from fieldkit.planning.patterns.objective import evaluate
from fieldkit.planning.patterns.score import PatternScore
from fieldkit.planning.patterns.space import PatternSpace
from fieldkit.planning.plan_settings import TrialSettings
from fieldkit.planning.run.flyable import flight_noise
from fieldkit.results.fields import Length, Strict
from fieldkit.results.pattern import Pattern
from fieldkit.results.plan import Plan, PlanMethod
from fieldkit.results.plan_file import PLAN_FILE, save_plan
from fieldkit.runtime.context import Context
from fieldkit.runtime.shipped import shipped_folder
from fieldkit.scenes.renderer import Renderer
from fieldkit.sites.plots_file import drawn_outline, read_plots
from fieldkit.vehicles.vehicle import Vehicle
from fieldkit.vehicles.vehicle_file import load_vehicle
from fieldkit.version import __version__
from fieldkit.vocabulary import Stage
from fieldkit.wording import count

FRONT_FILE = "front.csv"
_MAX_BYTES = 1 << 20
"""Largest file of patterns, bytes."""
_FOCAL_PX = 3871.0
"""Focal length of the camera that shipped patterns were measured with, pixels."""
_MOST = 12
"""Patterns of a front."""
_ALIKE = 1.13
"""Factor of the least errors up to which measurements hardly tell patterns apart: standard deviation of the difference
between two evaluations."""
_BLOCKS = 2
"""Number of blocks that evaluations are on in turn."""
_BLOCK_SEED = 5000
"""Seed of the first one."""


class StagePatterns(Strict):
    """Patterns for a growth stage."""

    stage: Stage
    plants_m: Length
    """Height of the plants."""
    patterns: tuple[PatternWorth, ...]


class ShippedPatterns(Strict):
    """The file of patterns that comes with fieldkit."""

    kind: Literal["patterns"] = "patterns"
    version: Literal[1] = 1
    kinds: tuple[StagePatterns, ...]


@dataclass(frozen=True)
class TrialPlan:
    """What was found for a trial."""

    front: Sequence[FrontPattern]
    """The fastest first; each is expected to be nearer to the plants than those before."""
    chosen: FrontPattern
    stage: Stage
    plots: int


def plan_trial(
    output: Path,
    asked: TrialSettings,
    vehicle: str | Path,
    context: Context | None = None,
    *,
    method: str = "field",
    evaluations: int = 0,
    overwrite: bool = False,
) -> TrialPlan:
    """Choose a pattern for a trial, and write plan.json and front.csv.

    Args:
        output: the plan's folder.
        vehicle: a profile's name or file.
        method: of a search, `field` or `bosfm`.
        evaluations: of rendered plots that it makes; none chooses among the patterns that come with fieldkit.

    Raises:
        UsageError: the stage is not known, or no pattern keeps what is asked.
        InputError: the plots or the vehicle cannot be used.
    """
    assert asked.trial is not None
    flyer = load_vehicle(vehicle)
    drawn = read_plots(asked.trial)
    first = drawn.plots[0]
    frame = SourceFrame("", LocalFrame(first.latitude_deg, first.longitude_deg), Similarity.identity())
    outlines = [drawn_outline(plot, shape, frame) for plot, shape in zip(drawn.plots, drawn.shapes, strict=True)]
    corners = [corner for outline in outlines if outline is not None for corner in outline]
    if not corners:
        raise MetadataError("the plots are points", path=asked.trial, remedy="Draw polygons, or give their sides.")
    plants_m = max((plot.plant_height_m or 0.0 for plot in drawn.plots), default=0.0)
    context = context or Context()
    kind = shipped_patterns(asked.stage, plants_m, flyer)
    field = shapely.MultiPoint(corners).convex_hull
    space = PatternSpace(flyer, kind.plants_m)
    worths, stage = kind.patterns, kind.stage
    if evaluations:
        method_entry(method)
        minutes = _minutes(asked, flyer)

        def allowed(pattern: Pattern) -> bool:
            in_time = space.seconds(pattern, field, first.row_heading_deg)[0] <= 60.0 * minutes
            return in_time and space.matches(pattern)

        stage = asked.stage or stage
        worths = tuple(_searched(space, allowed, stage, method, evaluations, context))
    flown = [over(w, space, field, first.row_heading_deg) for w in worths if space.allows(w.pattern)]
    if not flown:
        raise UsageError("the vehicle can fly none of the patterns", remedy="Plan with another vehicle or mount.")
    front = front_of(flown)
    front = [front[k] for k in np.unique(np.linspace(0, len(front) - 1, min(len(front), _MOST)).round().astype(int))]
    chosen = choose(front, asked, flyer)
    with atomic_folder(output, overwrite=overwrite, marker=PLAN_FILE) as folder:
        by = PlanMethod(name="patterns", evaluations=chosen.worth.evaluations, expected_m=chosen.worth.value_m)
        plan = Plan(
            fieldkit=__version__,
            pattern=chosen.worth.pattern,
            camera=flyer.camera,
            plant_height_m=space.plants_m,
            method=by,
        )
        save_plan(folder / PLAN_FILE, plan)
        rows = [each.row for each in front]
        write_atomic(folder / FRONT_FILE, csv_text(list(rows[0]), [row.values() for row in rows]))
    return TrialPlan(front, chosen, stage, len(drawn.plots))


def _searched(
    space: PatternSpace,
    allowed: Callable[[Pattern], bool],
    stage: Stage,
    method: str,
    evaluations: int,
    context: Context,
) -> list[PatternWorth]:
    """What was evaluated on blocks in turn, and is worth on both by all evaluations."""
    noise, camera = flight_noise(space.vehicle), space.vehicle.camera.without_distortion()
    with context.progress.stage("Growing blocks", _BLOCKS):
        blocks = [
            Block.of(replace(LAYOUT, stage=stage, seed=_BLOCK_SEED + context.seed + number))
            for number in range(_BLOCKS)
        ]
        scores = [PatternScore.of(block) for block in blocks]

    def terms(pattern: Pattern) -> FloatArray:
        return np.asarray(np.mean([score.expect(pattern, camera, noise) for score in scores], axis=0))

    from fieldkit.planning.patterns.search import PatternSearch  # brings PyTorch along

    search = PatternSearch(space, allowed, terms, context.seed)
    with context.progress.stage("Evaluating patterns", evaluations) as advance, ExitStack() as opened:
        renderers = [opened.enter_context(Renderer(block.scene)) for block in blocks]
        for number in range(evaluations):
            code, of = search.propose(method), number % len(blocks)
            pattern = space.decode(code)
            made = evaluate(pattern, blocks[of], renderers[of], camera, noise, context.seed + number)
            search.tell(code, of, made.value_m)
            known = count(made.right, "photograph counts", "photographs count", of=made.photographs)
            context.progress.note(f"{format_length(made.value_m)}: {known}, {count(len(pattern.looks), 'way')} to look")
            advance(1)
    values_m = search.expected_m(search.codes).tolist()
    return [
        PatternWorth(pattern=space.decode(code), value_m=value_m, evaluations=1)
        for code, value_m in zip(search.codes, values_m, strict=True)
    ]


def shipped_patterns(stage: Stage | None, plants_m: float, vehicle: Vehicle) -> StagePatterns:
    """Those that come with fieldkit for a stage, or the nearest one, over plants of a height (0: the stage's).

    Heights above the plants and spacings are such that angles between photographs and pixels on the plants are those
    that were measured. Raises UsageError: neither stage nor height is known.
    """
    file = shipped_folder("missions/patterns") / "maize.json"
    if stage is None and not plants_m:
        raise UsageError("how high are the plants?", remedy="Give --stage, or the plots' plant_height_m.")
    stages = get_args(Stage)

    def away(kind: StagePatterns) -> float:
        return abs(kind.plants_m - plants_m) if stage is None else abs(stages.index(kind.stage) - stages.index(stage))

    kind = min(read_model(ShippedPatterns, "patterns", file, "", max_bytes=_MAX_BYTES).kinds, key=away)
    there_m, scale = plants_m or kind.plants_m, vehicle.camera.fx / _FOCAL_PX

    def fitted(worth: PatternWorth) -> PatternWorth:
        pattern = worth.pattern
        moved = replace(
            pattern,
            height_m=round(there_m + scale * (pattern.height_m - kind.plants_m), 1),
            along_m=round(scale * pattern.along_m, 2),
            between_m=round(scale * pattern.between_m, 2),
        )
        return worth.model_copy(update={"pattern": moved})

    return kind.model_copy(update={"plants_m": there_m, "patterns": tuple(map(fitted, kind.patterns))})


def _minutes(asked: TrialSettings, vehicle: Vehicle) -> float:
    """That a flight may take: a battery's, where nothing is asked."""
    return asked.minutes or vehicle.battery.usable_s / 60.0


def choose(front: Sequence[FrontPattern], asked: TrialSettings, vehicle: Vehicle) -> FrontPattern:
    """The pattern of a front that is asked for: the fastest one with such errors, or with hardly larger ones than the
    best one in the time has.

    Raises:
        UsageError: none keeps it.
    """
    if asked.height_error_m is not None:
        kept = [each for each in front if each.height_m <= asked.height_error_m]
        if kept:
            return kept[0]
        best = min(front, key=lambda each: each.height_m)
        raise UsageError(
            f"no pattern is expected to measure heights to {100 * asked.height_error_m:g} cm; the best has "
            f"{100 * best.height_m:.1f} cm in {best.minutes:.1f} min",
            remedy="Ask for less.",
        )
    minutes = _minutes(asked, vehicle)
    kept = [each for each in front if each.minutes <= minutes]
    if not kept:
        raise UsageError(
            f"no pattern covers the field in {minutes:.1f} min; the fastest takes {front[0].minutes:.1f}",
            remedy="Give more --minutes, or plan parts of the field.",
        )
    return next(each for each in kept if each.errors_m <= _ALIKE * kept[-1].errors_m)
