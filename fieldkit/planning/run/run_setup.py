"""From a source (a scene, a reference, a recorded set) to the problem and its objective."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.stats import qmc

from fieldkit.captures import read_capture
from fieldkit.captures.bursts import by_station
from fieldkit.clouds.cloud import Cloud
from fieldkit.clouds.volume import Volume
from fieldkit.errors import SceneError, UsageError
from fieldkit.evaluation.proxy import make_proxy
from fieldkit.evaluation.reference import Reference, build_reference
from fieldkit.geometry import Intrinsics
from fieldkit.planning.objective.objective import ObjectiveSettings, PlotsObjective
from fieldkit.planning.objective.recorded import RecordedKind, RecordedSource, match_graph
from fieldkit.planning.objective.simulated import Kind
from fieldkit.planning.plan_settings import EnvelopeSettings
from fieldkit.planning.problem import PlanningProblem
from fieldkit.planning.settings import GivenPlot, SearchSettings, unchanging
from fieldkit.planning.space.cameras import Cameras
from fieldkit.planning.space.envelope import Envelope
from fieldkit.planning.space.plots import Plot
from fieldkit.reconstruction.settings import FeatureSettings
from fieldkit.results.finding import DOUBTFUL, PLANTS_APART
from fieldkit.results.report_files import REFERENCE_FILE, file_sha256, load_reference_report
from fieldkit.runtime.context import Context
from fieldkit.runtime.progress import Progress
from fieldkit.scenes.library import find_scene
from fieldkit.scenes.scene_file import read_scene
from fieldkit.scenes.simulate import CaptureNoise
from fieldkit.sites.fitted import Stretch

PROXY_FOLDER, BUILT_REFERENCE = "proxy", "reference"
_HEIGHT_ERROR = 0.25
"""Largest error of a plot's height as people state it: plants grow, and nobody measures each plot before a flight."""
_GOOD_POSES_M = 0.010
"""Median accuracy of recorded positions with which two rounds of matching do, metres."""
_TWO_ROUNDS_PX = (10.0, 3.0)
"""Bands of these two rounds, pixels."""


@dataclass(frozen=True, eq=False)
class RunSetup:
    """The problem and the objective of a run."""

    problem: PlanningProblem
    objective: PlotsObjective
    """Of all plots, for the executor."""
    photographs: tuple[str, ...] = ()
    """Names of recorded photographs, in the order of the problem's views; empty if they are rendered."""
    plant_height_m: float | None = None
    """Of the first given plot, for which cameras are stated if they are fitted to each plot; else None."""


def set_up_run(settings: SearchSettings, folder: Path, context: Context, *, count_matches: bool = False) -> RunSetup:
    """The problem and the objective of a run.

    ``folder``, the run's, keeps what is made from the source: a reference's proxy, a recorded set's reference.
    """
    for plot in settings.given:
        _check_unchanged(plot)
        for doubt in source_doubts(plot):
            context.progress.note(doubt)
    if settings.source.kind == "captures":
        return _on_captures(settings, folder, context, count_matches)
    return _on_scenes(settings, folder, context.progress)


def _check_unchanged(plot: GivenPlot) -> None:
    """Raise a UsageError if a plot is gone, or is not what it was when the run began."""
    if plot.source.sha256 is None:
        return
    file = path = Path(plot.path)
    if plot.source.kind == "reference":
        file = path / REFERENCE_FILE
    else:
        with suppress(SceneError):  # gone
            file = find_scene(path)
    if not file.is_file():
        raise UsageError("the source of this run is gone", path=file, remedy="Put it back there, or start a new run.")
    if file_sha256(file) != plot.source.sha256:
        raise UsageError("has changed since this run began", path=file, remedy="Start a new run in another folder.")


def source_doubts(plot: GivenPlot) -> list[str]:
    """What a reference's own findings say against a plan for it: plants that are not the plot's, above all."""
    if plot.source.kind != "reference":
        return []
    findings = load_reference_report(Path(plot.path)).findings
    return [f"{plot.source.name}: {f.message}" for f in findings if f.code in DOUBTFUL | {PLANTS_APART}]


def _problem(
    settings: SearchSettings,
    envelope: Envelope,
    camera: Intrinsics,
    plots: Sequence[Plot],
    views: Cameras | None = None,
) -> PlanningProblem:
    """The problem on the first plots; the others are unseen."""
    seen = settings.plots
    return PlanningProblem(
        settings.cameras,
        envelope,
        camera,
        tuple(plots[:seen]),
        views,
        exact=seen == 1 and unchanging(settings.source, settings.noise),
        unseen=tuple(plots[seen:]),
        noise=settings.noise,
    )


def _on_scenes(settings: SearchSettings, folder: Path, progress: Progress) -> RunSetup:
    """Any cameras of the envelope about simulated plots, or about proxies of references; photographs are rendered."""
    files = [_scene_of(plot, folder, number, progress) for number, plot in enumerate(settings.given)]
    with progress.stage("Reading the scene"):
        descriptions = tuple(read_scene(file) for file in files)
        first, asked = descriptions[0], settings.noise
        camera = first.camera if settings.camera is None else _rendered(settings.camera, first.camera)
        noise = CaptureNoise(asked.pose_m, asked.pose_deg, image_sigma=asked.image_grey or first.noise.image_sigma)
        kind = Kind(descriptions, settings.seed, noise, asked.outdoors, camera)
        found = [kind.plot(number) for number in range(settings.all_plots)]
    plots = [plot for plot, _ in found]
    height_m = plots[0].height_m
    envelope = _envelope(found[: settings.plots], height_m, settings.envelope)
    if settings.plots > 1:
        stated = zip(plots, _height_errors(len(plots)), strict=True)
        plots = [replace(plot, stretch=_stretch(plot, height_m, envelope, error)) for plot, error in stated]
    objective = PlotsObjective(
        kind,
        ObjectiveSettings(settings.fidelity, settings.mapping, refine=settings.refine),
        seed=settings.seed,
        stretches={number: plot.stretch for number, plot in enumerate(plots) if plot.stretch is not None},
    )
    problem = _problem(settings, envelope, camera, plots)
    return RunSetup(problem, objective, plant_height_m=height_m if settings.plots > 1 else None)


def _envelope(found: Sequence[tuple[Plot, Volume]], height_m: float, limits: EnvelopeSettings) -> Envelope:
    """An envelope about plots of plants and their volumes of interest, all stretched to one height."""
    scales = [np.array([1.0, 1.0, height_m / plot.height_m]) for plot, _ in found]
    points = [plot.points * scale for (plot, _), scale in zip(found, scales, strict=True)]
    corners = [
        np.array(corner) * scale
        for (_, volume), scale in zip(found, scales, strict=True)
        for corner in (volume.lower, volume.upper)
    ]
    return Envelope.around(Cloud(np.concatenate(points)), Volume.around(corners), **limits.model_dump())


def _height_errors(count: int) -> list[float]:
    """By which share each plot's height is stated wrong: evenly spread however many they are, 0 for the given one.

    So a plan shows the tips of higher plants, too.
    """
    spread = 2.0 * qmc.Halton(1, scramble=False).random(count)[:, 0] - 1.0  # −1, 0, −½, ½, …
    return [0.0, *(_HEIGHT_ERROR * spread[1:]).tolist()]


def _stretch(plot: Plot, height_m: float, envelope: Envelope, error: float) -> Stretch:
    """How cameras stated for plants of a height are flown over a plot, whose own height is stated with an error (a
    share); as `fitted` does with the plan.
    """
    stated_m = plot.height_m * (1.0 + error)
    points = np.array(envelope.plan_plants(envelope.plants).points_m)
    return Stretch(
        np.append(points[:, :2].min(axis=0), 0.0),
        np.append(points[:, :2].max(axis=0), height_m),
        np.array([1.0, 1.0, stated_m / height_m]),
        envelope.clearance_m,
        envelope.height_m[0],
        envelope.pitch_deg,
    )


def _scene_of(plot: GivenPlot, folder: Path, number: int, progress: Progress) -> Path:
    """A given plot's scene file; for a reference it is made in the run's folder."""
    if plot.source.kind != "reference":
        return find_scene(Path(plot.path))
    scene = folder / (PROXY_FOLDER if not number else f"{PROXY_FOLDER}-{number + 1}")
    if not scene.is_dir():
        images = None if plot.images_path is None else Path(plot.images_path)
        make_proxy(Path(plot.path), scene, images=images, progress=progress)
    return find_scene(scene)


def _on_captures(settings: SearchSettings, folder: Path, context: Context, count_matches: bool) -> RunSetup:
    """A choice among recorded views; photographs are looked up."""
    progress = context.progress
    images, given = Path(settings.given[0].path), settings.given[0].reference_path
    place = folder / BUILT_REFERENCE if given is None else Path(given)
    if given is None and not place.is_dir():
        progress.note("no --reference is given: one is built of all photographs first")
        build_reference(images, place, context=replace(context, scheduler=""), scene=False)
    reference = Reference(place)
    plot, asked = reference.known_plot(), settings.noise
    source = RecordedSource(
        by_station(read_capture(images)),
        plot,
        reference.cloud,
        cache=context.cache,
        noise=CaptureNoise(asked.pose_m, asked.pose_deg, image_sigma=0.0),
        reconstructed=reference.report.poses,
    )
    views = source.cameras()
    # If positions are good to millimetres, two rounds of matching do as well as three, at half the cost.
    good = float(np.median([view.position_sigma_m for view in source.views])) <= _GOOD_POSES_M
    wanted = ObjectiveSettings(
        settings.fidelity,
        settings.mapping,
        bands_px=_TWO_ROUNDS_PX if good and not asked.any else None,
        refine=settings.refine,
    )
    ends = [(float(axis.min()), float(axis.max())) for axis in (*views.positions.T, views.pitch_deg)]
    envelope = Envelope(
        ends[0],
        ends[1],
        ends[2],
        plot.volume,
        clearance_m=0.0,
        pitch_deg=ends[3],
        separation_m=0.0,
    )
    matches = match_graph(source, FeatureSettings(), context) if count_matches else None
    kind = RecordedKind(source, settings.seed)
    plots = [kind.plot(number, matches) for number in range(settings.all_plots)]
    camera = max(reference.report.cameras, key=lambda c: c.photos)
    full = Intrinsics(camera.model, camera.width, camera.height, camera.params)
    problem = _problem(settings, envelope, full.without_distortion(), plots, views)
    objective = PlotsObjective(kind, wanted, seed=settings.seed)
    return RunSetup(problem, objective, tuple(view.name for view in source.views))


def _rendered(camera: Intrinsics, scene: Intrinsics) -> Intrinsics:
    """A camera without its distortion, whose longer side is at most that of the scene's camera.

    Reconstruction uses about 1,600 pixels at most, and a scene's defocus and grain are stated in its pixels.
    """
    ideal = camera.without_distortion()
    scale = max(scene.width, scene.height) / max(ideal.width, ideal.height)
    return ideal if scale >= 1.0 else ideal.scaled(round(ideal.width * scale), round(ideal.height * scale))
