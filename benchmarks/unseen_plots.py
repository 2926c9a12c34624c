"""`new-plots` and `new-traits`: plans for a kind over plots that nobody planned on."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.planner_runs import Place
from benchmarks.plant_figures import error_table
from benchmarks.result import Cell, ResultTable, StudyResult
from benchmarks.scored_captures import scene_outline, settle_in_scene
from fieldkit.cache import StageCache, digest
from fieldkit.captures import read_capture
from fieldkit.captures.bursts import by_station
from fieldkit.errors import ReconstructionError
from fieldkit.evaluation.conversion import failed_plot, plot_evaluation
from fieldkit.files import write_atomic
from fieldkit.geometry import Similarity
from fieldkit.geometry.priors import SourceFrame
from fieldkit.planning.objective.objective import FIDELITIES
from fieldkit.planning.objective.simulated import Proxy
from fieldkit.planning.plan_settings import EnvelopeSettings, NoiseSettings, PlanSettings
from fieldkit.planning.problem import PlanningProblem
from fieldkit.planning.run.flyable import OUTDOORS_ENVELOPE, flight_noise
from fieldkit.planning.run.loop import Job, evaluating
from fieldkit.planning.run.plan import plan
from fieldkit.planning.run.run_setup import set_up_run
from fieldkit.planning.space.cameras import Cameras
from fieldkit.planning.space.families import Circle
from fieldkit.reconstruction.pipeline import KnownPlot, reconstruct
from fieldkit.reconstruction.settings import ReconstructionSettings
from fieldkit.reconstruction.silhouettes import outlines
from fieldkit.reconstruction.steady import steady_capture
from fieldkit.results.evaluation import PlotEvaluation
from fieldkit.results.plan import Plan
from fieldkit.results.plan_file import PLAN_FILE, load_plan
from fieldkit.results.traits import TraitsEntry
from fieldkit.runtime.context import Context
from fieldkit.runtime.machine import Spent
from fieldkit.runtime.progress import Progress
from fieldkit.scenes.renderer import Renderer
from fieldkit.scenes.scene_file import read_scene, write_scene
from fieldkit.scenes.simulate import CaptureNoise, Outdoors, Sidecars, simulate_capture
from fieldkit.sites.fitted import fitted_to_height
from fieldkit.vehicles.vehicle_file import find_vehicle, load_vehicle
from fieldkit.vocabulary import Preset
from fieldkit_sim.generator import new_scene
from fieldkit_sim.truth import true_traits

_PLANNED, _PLANTS, _CAMERAS = range(8101, 8111), 3, 10
"""Seeds of the plots that plans are made on, number of plants on each, and of photographs."""
FLOWN = {3: range(8201, 8211), 6: range(8301, 8311)}
"""Seeds of the plots that they are flown over, by number of plants: few, and many that hide each other."""
_VEHICLE, _HEIGHT_ERROR = "dji-mavic-3-enterprise", 0.2
"""Outdoors: whose wash moves leaves, and by which share plants' heights are stated wrong at most."""
_GRID, _REPEATS = 3, 2
_BURST = 5


@dataclass(frozen=True)
class UnseenOptions:
    """Options of both studies."""

    cache: StageCache
    """The stage cache."""
    runs: Path
    """Folder that keeps plans, scenes and values; what is there is not repeated."""
    workers: int = 1
    """Number of processes."""
    count: int = 10
    """Plots of each number of plants, ten at most."""
    presets: tuple[Preset, ...] = ("outdoors", "paper")
    """Conditions: a flight in a breeze, and the paper's exact poses in still air."""

    @property
    def plots(self) -> list[tuple[int, int]]:
        """Number of plants and seed of each plot."""
        return [(plants, seed) for plants, seeds in FLOWN.items() for seed in seeds[: self.count]]


def _noise(preset: Preset) -> NoiseSettings:
    kg = load_vehicle(find_vehicle(_VEHICLE)).mass_kg
    return NoiseSettings() if preset == "paper" else flight_noise(None).model_copy(update={"vehicle_kg": kg})


def run_new_plots(options: UnseenOptions, progress: Progress) -> StudyResult:
    """Distances of a carried plan, of a carried ring, and of the best ring that evaluations find on the very plot."""
    tables, figures = [], dict[str, Any]()
    for preset in options.presets:
        plan = _plan(preset, options, progress)
        with _Plot(_PLANTS, _PLANNED[0], preset, options, progress) as home:
            ring = home.best_ring()
        rows: list[tuple[Cell, ...]] = []
        ratios: list[tuple[float, float]] = []
        for plants, seed in options.plots:
            with _Plot(plants, seed, preset, options, progress) as plot:
                there = plot.best_ring()
                sets = plot.flown(plan), *(circle.cameras(plot.problem) for circle in (ring, there))
                values = plot.confirmed([sets[0], *map(plot.problem.nearest, sets[1:])])
            ratios.append((values[0] / values[2], values[0] / values[1]))
            rows.append(
                (
                    f"{plants} plants, {seed}",
                    *(f"{1000 * value:.2f}" for value in values),
                    str(there),
                    *(f"{ratio:.2f}" for ratio in ratios[-1]),
                )
            )
        over, carried = (np.array(column) for column in zip(*ratios, strict=True))
        means = f"{over.mean():.2f} (at most {over.max():.2f})", f"{carried.mean():.2f}"
        rows.append(("mean", None, None, None, None, *means))
        columns = (
            "plot",
            "plan, mm>",
            "ring of 8101, mm>",
            "best ring there, mm>",
            "which",
            "plan ÷ best ring>",
            "÷ carried ring>",
        )
        tables.append(ResultTable(_title(preset), columns, tuple(rows)))
        figures[preset] = {"best_ring": over.tolist(), "carried_ring": carried.tolist(), "ring": str(ring)}
    return StudyResult(
        name="new-plots",
        title="New plots of other plants",
        tables=tuple(tables),
        notes=(
            f"`fieldkit plan` on {len(_PLANNED)} plots of {_PLANTS} plants; {_CAMERAS} photographs, standard.",
            f"Rings: {_GRID} radii × {_GRID} heights, then half a step in radius, height and aim; one evaluation each.",
            f"The plan, the carried ring (found on plot {_PLANNED[0]}) and the best ring: {_REPEATS} fresh seeds.",
        ),
        figures=figures,
    )


def run_new_traits(options: UnseenOptions, progress: Progress) -> StudyResult:
    """Traits of the plots outdoors by the carried plan, with single photographs and with bursts, against the meshes."""
    plan = _plan("outdoors", options, progress)
    tables, figures = [], dict[str, Any]()
    for burst in (1, _BURST):
        rows = [_traits(plants, seed, plan, burst, options, progress) for plants, seed in options.plots]
        title = "One photograph a station" if burst == 1 else f"Bursts of {burst}"
        tables.append(replace(error_table(rows), title=title))
        figures[str(burst)] = rows
    return StudyResult(
        name="new-traits",
        title="Traits of new plots outdoors",
        tables=tuple(tables),
        notes=("Refused: traits that are not to be had, as fieldkit says. In ±: within the stated error.",),
        figures=figures,
    )


def _title(preset: Preset) -> str:
    noise = _noise(preset)
    if preset == "paper":
        return "Still: exact poses, true heights"
    return (
        f"Outdoors: {1000 * noise.pose_m:g} mm, {noise.pose_deg:g}°, {1000 * noise.wind_m:g} mm of wind, wash of "
        f"{noise.vehicle_kg:g} kg, heights ± {100 * _HEIGHT_ERROR:g} %"
    )


def _scene(plants: int, seed: int, runs: Path) -> Path:
    runs.mkdir(parents=True, exist_ok=True)
    file = runs / f"new-{plants}-{seed}.toml"
    if not file.is_file():
        write_scene(file, new_scene(plants, seed))
    return file


def _plan(preset: Preset, options: UnseenOptions, progress: Progress) -> Plan:
    """The default plan for the kind, made once."""
    output = options.runs / f"plan-{preset}"
    if not (output / PLAN_FILE).is_file():
        scenes = [_scene(_PLANTS, seed, options.runs) for seed in _PLANNED]
        kg = _noise(preset).vehicle_kg
        settings = PlanSettings(scene=scenes, preset=preset, noise={"vehicle_kg": kg}, cameras=_CAMERAS)
        plan(output, settings, Context(options.cache, progress, options.workers), overwrite=True)
    return load_plan(output / PLAN_FILE)


def _flown(plan: Plan, height_m: float, plants: int, seed: int, preset: Preset) -> Cameras:
    """The plan over a plot, fitted to its height as somebody states it."""
    wrong = np.random.default_rng([plants, seed]).uniform(-_HEIGHT_ERROR, _HEIGHT_ERROR) if preset == "outdoors" else 0
    stations = fitted_to_height(plan, height_m * (1.0 + wrong)).stations
    return Cameras.from_poses(station.pose for station in stations)


class _Plot:
    """Values of sets of cameras on a plot, kept beside the plans."""

    def __init__(self, plants: int, seed: int, preset: Preset, options: UnseenOptions, progress: Progress) -> None:
        self._key, self._preset = (plants, seed), preset
        self._kept = options.runs / f"values-{preset}-{plants}-{seed}.json"
        self._values: dict[str, float] = json.loads(self._kept.read_text("utf-8")) if self._kept.is_file() else {}
        noise = _noise(preset)
        settings = Place.scene(str(_scene(plants, seed, options.runs))).settings(
            cameras=_CAMERAS,
            method="given",
            plots=1,
            noise=noise,
            refine=noise.any,
            envelope=OUTDOORS_ENVELOPE if preset == "outdoors" else EnvelopeSettings(),
        )
        self._context, self._progress = Context(options.cache, progress, options.workers), progress
        self._setup = set_up_run(settings, options.runs / "proxies", self._context)

    def __enter__(self) -> _Plot:
        return self

    def __exit__(self, *_: object) -> None:
        self._setup.objective.close()

    @property
    def problem(self) -> PlanningProblem:
        return self._setup.problem

    def flown(self, plan: Plan) -> Cameras:
        """A plan's cameras over this plot; not moved where plants are higher than stated."""
        return _flown(plan, self.problem.plots[0].height_m, *self._key, self._preset)

    def best_ring(self) -> Circle:
        """The best of a grid, then of half a step about it."""
        radii, altitudes, aims = self.problem.ranges
        steps = [0.5 * (high - low) / _GRID for low, high in (radii, altitudes, aims)]
        spread = [[low + (k + 0.5) * (high - low) / _GRID for k in range(_GRID)] for low, high in (radii, altitudes)]
        first = [Circle(r, h, sum(aims) / 2.0) for h in spread[1] for r in spread[0]]
        best = self._best(first)
        around = [
            replace(best, **{name: getattr(best, name) + sign * step})
            for name, step in zip(("radius_m", "altitude_m", "aim_m"), steps, strict=True)
            for sign in (-1.0, 1.0)
        ]
        return self._best([best, *around])

    def confirmed(self, sets: Sequence[Cameras]) -> list[float]:
        """Mean values (m) at fresh seeds, the same for all sets."""
        found = self._evaluated([(cameras, seed) for cameras in sets for seed in range(1, 1 + _REPEATS)])
        return [float(np.mean(found[k : k + _REPEATS])) for k in range(0, len(found), _REPEATS)]

    def _best(self, rings: Sequence[Circle]) -> Circle:
        values = self._evaluated([(self.problem.nearest(ring.cameras(self.problem)), 0) for ring in rings])
        return rings[int(np.argmin(values))]

    def _evaluated(self, wanted: Sequence[tuple[Cameras, int]]) -> list[float]:
        keys = [f"{digest(cameras.vector())} {seed}" for cameras, seed in wanted]
        missing = {key: Job(*one) for key, one in zip(keys, wanted, strict=True) if key not in self._values}
        if missing:
            with (
                self._progress.stage(self._kept.stem, len(missing)) as advance,
                evaluating(self._setup.objective, self._context) as evaluations,
            ):
                for key, found in zip(missing, evaluations.each(missing.values()), strict=True):
                    self._values[key] = found.value_m
                    advance(1)
            write_atomic(self._kept, json.dumps(self._values, indent=1) + "\n")
        return [self._values[key] for key in keys]


def _traits(
    plants: int, seed: int, plan: Plan, burst: int, options: UnseenOptions, progress: Progress
) -> dict[str, Any]:
    """Traits found and true, as `plant_figures.compare` has them."""
    kept = options.runs / f"traits-{plants}-{seed}-{burst}.json"
    if not kept.is_file():
        file, noise = _scene(plants, seed, options.runs), _noise("outdoors")
        description = read_scene(file)
        proxy = Proxy.from_description(description)
        cameras = _flown(plan, proxy.plot.height_m, plants, seed, "outdoors")
        camera = FIDELITIES["fine"].camera(proxy.camera, cameras, proxy.volume)
        with tempfile.TemporaryDirectory(prefix="fieldkit-") as temporary:
            renderer = Renderer(proxy.scene)
            simulate_capture(
                Path(temporary) / "capture",
                renderer,
                cameras.poses(),
                camera,
                seed=seed,
                economy=True,
                noise=CaptureNoise(noise.pose_m, noise.pose_deg, image_sigma=description.noise.image_sigma),
                effects=description.camera_effects,
                outdoors=Outdoors(noise.wind_m, noise.vehicle_kg, burst),
                sidecars=Sidecars(poses=True, accuracy_m=noise.pose_m, camera=True),
            )
            renderer.close()
            plot = _evaluated(file.stem, Path(temporary) / "capture", proxy, Context(StageCache(None), progress))
        truth = true_traits(proxy.scene.meshes, proxy.volume)
        found = {
            "scene": file.stem,
            "sway_m": plot.sway_m,
            "error": plot.error,
            "found": (plot.traits or TraitsEntry()).model_dump(mode="json"),
            "truth": asdict(truth) | {"cover_percent": truth.cover_percent},
        }
        write_atomic(kept, json.dumps(found, indent=1) + "\n")
    record: dict[str, Any] = json.loads(kept.read_text("utf-8"))
    return record


def _evaluated(name: str, folder: Path, proxy: Proxy, context: Context) -> PlotEvaluation:
    """A capture's figures within the scene's own volume, in the scene's frame."""
    there = KnownPlot(SourceFrame("poses.csv", None, Similarity.identity()), proxy.volume, None, settle=settle_in_scene)
    settings, capture, begun = ReconstructionSettings(), by_station(read_capture(folder)), Spent.now()
    try:
        with steady_capture(capture, context) as steady:
            found = reconstruct(steady, settings, known_plot=there, context=context)
            shown = outlines(found.sparse, settings.mask)
    except ReconstructionError as error:
        return failed_plot(name, error, photographs=len(capture.photos), spent=begun)
    outline = scene_outline(found, proxy)
    return plot_evaluation(name, found, settings, score=None, spent=begun, outline=outline, shown=shown)
