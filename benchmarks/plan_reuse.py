"""`plan-reuse`: one plan on plots with other plants, row spacing, heading and slope."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace

import numpy as np
from numpy.typing import NDArray

from benchmarks.result import Cell, ResultTable, StudyResult, spread
from benchmarks.sloped_plots import SlopedSource, sheared, shifted, sloped_proxy, turned
from fieldkit.clouds import Cloud
from fieldkit.clouds.metrics import ReferenceIndex, nearest_distances, score_distances
from fieldkit.clouds.neighbors import PointIndex
from fieldkit.errors import UsageError
from fieldkit.planning.objective.evaluation import Evaluation, value_m
from fieldkit.planning.objective.objective import Objective, ObjectiveSettings
from fieldkit.planning.objective.simulated import Proxy
from fieldkit.planning.problem import PlanningProblem
from fieldkit.planning.score.geometric import GeometricScore
from fieldkit.planning.space.cameras import Cameras
from fieldkit.planning.space.envelope import Envelope
from fieldkit.results.plan import Plan
from fieldkit.runtime.progress import Progress
from fieldkit.scenes.description import SceneDescription, build
from fieldkit.scenes.library import find_scene
from fieldkit.scenes.sampling import neighbour_points
from fieldkit.scenes.scene_file import read_scene
from fieldkit.sites.terrain import LEVEL, Gradient
from fieldkit.vocabulary import DISTANCES_M, SearchFidelity
from fieldkit_sim.simulation import ring

VIEWS, RADIUS_M, HEIGHT_M, TARGET_M = 13, 1.3, 1.6, (0.0, 0.0, 0.3)
"""The ring flown if no plan is given."""
PLANNED, ROWS_M = "the plan's plot", 0.75
SLOPES_PERCENT = (5.0, 10.0, 20.0)
DIRECTIONS = {"along the rows": 0.0, "across": 90.0}
"""Directions of the ascent, anticlockwise from x."""
_F_M = 0.010
_OTHER_PLANTS_DEG = 137.0

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Variant:
    """A plot that a plan is carried to."""

    name: str
    """For people."""
    change: Callable[[SceneDescription], SceneDescription]
    """Of the plan's own scene."""
    slope: Gradient = LEVEL
    """Rise along x and y; the plan is sheared with it as by `export-mission`."""


def variants() -> dict[str, Variant]:
    """The plots of the study, by name; the plan's own is the first."""
    found = [
        Variant(PLANNED, lambda scene: scene),
        Variant("other plants", _other_plants),
        Variant("rows 0.50 m apart", lambda scene: _with_rows(scene, 0.50)),
        Variant("rows 1.00 m apart", lambda scene: _with_rows(scene, 1.00)),
        Variant("rows turned by 90°", lambda scene: _turned(scene, 90.0)),
        Variant("rows turned by 180°", lambda scene: _turned(scene, 180.0)),
        Variant("10 % uphill along the rows", lambda scene: scene, (0.10, 0.0)),
        Variant("10 % uphill across the rows", lambda scene: scene, (0.0, 0.10)),
    ]
    return {variant.name: variant for variant in found}


def run_plan_reuse(
    plan: Plan | None = None,
    *,
    scene: str = "tuning-1",
    names: Sequence[str] = (),
    fidelity: SearchFidelity = "standard",
    repeats: int = 1,
    evaluate: bool = True,
    progress: Progress,
) -> StudyResult:
    """Evaluate a plan unchanged on its own plot and on others, and compare ways of putting it on a slope.

    Args:
        plan: in the scene's plot frame; None takes a ring of 13.
        scene: name or file; a row 0.75 m away on each side is added to it.
        names: of `variants`; empty takes all.
        fidelity: of the evaluations.
        repeats: number of evaluations of each plot, each with its own noise.
        evaluate: render and reconstruct; else only score slopes by geometry.
    """
    wall, cpu = time.perf_counter(), time.process_time()
    known = variants()
    for name in names:
        if name not in known:
            raise UsageError(f"there is no plot {name!r}", remedy=f"Choose one of {', '.join(known)}.")
    description = _with_rows(read_scene(find_scene(scene)), ROWS_M)
    cameras = ring_plan() if plan is None else Cameras.from_poses(station.pose for station in plan.stations)
    with progress.stage("Ways of putting a plan on a slope"):
        ways = slope_ways(description, cameras)
    scored: dict[str, list[Evaluation]] = {}
    for name in (names or known) if evaluate else ():
        scored[name] = carried(description, known[name], cameras, fidelity, repeats, progress)
        progress.note(f"{name}: {1000 * scored[name][0].value_m:.2f} mm")
    tables = [ways_table(ways)]
    if scored:
        tables.insert(0, reuse_table(scored))
    return StudyResult(
        name="plan-reuse",
        title="One plan on other plots",
        tables=tuple(tables),
        notes=(
            f"Plan: {len(cameras)} views of {scene} with a row {ROWS_M:g} m away on each side; nothing is optimised.",
            "Points nearer to plants of the other rows than to the plot's own are left out of the scores.",
            "Rows turned: the sun stands elsewhere, the plan turns with the rows.",
            "Slopes: plants upright, their feet on the slope; light as on the level plot.",
            (
                "Ways: as flown on the level; only shifted to the height above the local ground; shifted, with the "
                "pitch sheared (export-mission); turned about the origin with the ground, without the roll of that."
            ),
            "Ways are compared by the geometric score (docs/planning.md): no photograph is taken.",
        ),
        figures={
            "evaluations": {name: [asdict(each) for each in found] for name, found in scored.items()},
            "ways": ways,
        },
        wall_s=time.perf_counter() - wall,
        cpu_s=time.process_time() - cpu,
    )


def ring_plan() -> Cameras:
    """The ring flown if no plan is given."""
    return Cameras.from_poses(ring(VIEWS, RADIUS_M, HEIGHT_M, TARGET_M))


def carried(
    description: SceneDescription, variant: Variant, cameras: Cameras, fidelity: SearchFidelity, repeats: int,
    progress: Progress,
) -> list[Evaluation]:  # fmt: skip
    """A plan evaluated on another plot, without optimisation."""
    changed = variant.change(description)
    with progress.stage(f"Building {variant.name}"):
        proxy = sloped_proxy(changed, variant.slope)
    source = SlopedSource(proxy, changed, variant.slope)
    objective = Objective(source, ObjectiveSettings(fidelity))
    try:
        with progress.stage(f"Evaluating {variant.name}", repeats) as advance:
            found = []
            for seed in range(repeats):
                evaluation, cloud = objective.evaluate_cloud(sheared(cameras, variant.slope), seed=seed)
                found.append(rescored(evaluation, cloud, proxy))
                advance(1)
    finally:
        objective.close()
    return found


def rescored(evaluation: Evaluation, cloud: Cloud, proxy: Proxy) -> Evaluation:
    """The evaluation with only the cloud's points that are nearer to the plot's plants than to other rows.

    Leaves of near rows reach into the volume of interest; the truth lacks them.
    """
    others = neighbour_points(proxy.scene)
    if not len(cloud) or not len(others):
        return evaluation
    own, _ = PointIndex(proxy.reference.points).nearest(cloud.points)
    foreign, _ = PointIndex(others).nearest(cloud.points)
    kept = cloud.select(own <= foreign)
    if not len(kept):
        return evaluation
    to_reference, to_cloud = nearest_distances(ReferenceIndex(proxy.reference), kept)
    score = score_distances(to_reference, to_cloud, DISTANCES_M)
    return replace(
        evaluation, value_m=value_m(to_cloud, to_reference), chamfer_m=score.chamfer.chamfer_m,
        accuracy_m=score.chamfer.accuracy_m, completeness_m=score.chamfer.completeness_m, points=len(kept),
        f_scores={d: score.f_scores[d].f_score for d in DISTANCES_M},
    )  # fmt: skip


WAYS: Mapping[str, Callable[[Cameras, Gradient], Cameras]] = {
    "as on the level": lambda cameras, _: cameras,
    "shifted": shifted,
    "shifted, pitch sheared": sheared,
    "turned with the ground": turned,
}


def slope_ways(
    description: SceneDescription, cameras: Cameras, percents: Sequence[float] = SLOPES_PERCENT
) -> list[dict[str, float | str]]:
    """The geometric score of each way on each slope, and on the level plot.

    Returns:
        Rows with slope_percent, direction, way, gap_m, noise_m, distance_m, covered and least_height_m, the lowest
        camera above the ground below it.
    """
    rows: list[dict[str, float | str]] = []
    slopes = [("", 0.0, LEVEL)] + [
        (name, percent, (0.01 * percent * float(np.cos(a)), 0.01 * percent * float(np.sin(a))))
        for percent in percents for name, a in ((n, np.radians(d)) for n, d in DIRECTIONS.items())
    ]  # fmt: skip
    level = build(description)
    for direction, percent, slope in slopes:
        proxy = sloped_proxy(description, slope, level)
        score = GeometricScore(_problem(proxy, len(cameras), slope))
        for way, put in WAYS.items() if percent else [("level plot", sheared)]:
            there = put(cameras, slope)
            found = score.score(there)
            above = there.positions[:, 2] - there.positions[:, :2] @ np.array(slope)
            rows.append({
                "slope_percent": percent, "direction": direction, "way": way, "gap_m": found.gap_m,
                "noise_m": found.noise_m, "distance_m": found.distance_m, "covered": found.covered,
                "least_height_m": float(above.min()),
            })  # fmt: skip
    return rows


def _problem(proxy: Proxy, count: int, slope: Gradient) -> PlanningProblem:
    envelope = Envelope.around(Cloud(proxy.plot.points), proxy.volume, ground=(*slope, 0.0))
    return PlanningProblem(count, envelope, proxy.camera, (proxy.plot,))


def reuse_table(scored: Mapping[str, Sequence[Evaluation]]) -> ResultTable:
    """A row per plot."""
    first = np.mean([e.value_m for e in next(iter(scored.values()))])
    rows: list[tuple[Cell, ...]] = []
    for name, found in scored.items():
        values = [e.value_m for e in found]
        rows.append(
            (
                name, f"{np.mean([e.right for e in found]):.1f} of {found[0].images}",
                spread([1000 * v for v in values], 2), f"{np.mean(values) / first:.2f}",
                spread(_millimetres([e.accuracy_m for e in found]), 2),
                spread(_millimetres([e.completeness_m for e in found]), 2),
                f"{np.mean([e.f_scores[_F_M] for e in found]):.3f}",
            )
        )  # fmt: skip
    columns = ("plot", "right>", "value, mm>", "÷ first>", "accuracy, mm>", "completeness, mm>", "F at 10 mm>")
    return ResultTable("One plan on other plots, nothing optimised there", columns, tuple(rows))


def ways_table(ways: Sequence[Mapping[str, float | str]]) -> ResultTable:
    """A row per way and slope."""
    rows: list[tuple[Cell, ...]] = []
    for row in ways:
        place = f"{row['slope_percent']:g} % {row['direction']}" if row["direction"] else "level"
        rows.append(
            (
                place, row["way"], f"{1000 * float(row['distance_m']):.2f}", f"{1000 * float(row['gap_m']):.2f}",
                f"{1000 * float(row['noise_m']):.2f}", f"{float(row['covered']):.0%}",
                f"{float(row['least_height_m']):.2f}",
            )
        )  # fmt: skip
    columns = ("slope", "way", "score, mm>", "gap, mm>", "noise, mm>", "covered>", "lowest camera above ground, m>")
    return ResultTable("Ways of putting a plan on a slope, by geometry", columns, tuple(rows))


def _millimetres(values: Sequence[float | None]) -> list[float | None]:
    return [None if value is None else 1000 * value for value in values]


def _with_rows(description: SceneDescription, spacing_m: float) -> SceneDescription:
    """The plot with one row on each side of its plants."""
    neighbours = replace(description.plot.neighbours, rows=1, row_spacing_m=spacing_m)
    return replace(description, plot=replace(description.plot, neighbours=neighbours))


def _other_plants(description: SceneDescription) -> SceneDescription:
    """The plot with other individuals at the same places and stages."""
    plants = tuple(
        replace(plant, seed=plant.seed + 1, yaw_deg=(plant.yaw_deg + _OTHER_PLANTS_DEG) % 360.0)
        for plant in description.plot.plants
    )
    neighbours = replace(description.plot.neighbours, seed=description.plot.neighbours.seed + 1)
    return replace(description, plot=replace(description.plot, plants=plants, neighbours=neighbours))


def _turned(description: SceneDescription, degrees: float) -> SceneDescription:
    """The sun relative to rows turned clockwise by an angle, at the same hour."""
    light, angle = description.plot.light, np.radians(degrees)
    x, y, z = light.sun
    c, s = float(np.cos(angle)), float(np.sin(angle))
    sun = (c * x - s * y, s * x + c * y, z)
    return replace(description, plot=replace(description.plot, light=replace(light, sun=sun)))
