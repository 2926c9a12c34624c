"""Few views of the recorded rigs: registered and right poses, with and without priors."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from itertools import groupby
from pathlib import Path

import numpy as np

from benchmarks.result import ResultTable, StudyResult, spread
from benchmarks.rigs import RigSet, load_rig, perturb, root_mean_square, uniform_subset
from fieldkit.cache import StageCache
from fieldkit.geometry import Pose
from fieldkit.geometry.pose import rotation_angle_deg
from fieldkit.geometry.priors import PosePrior
from fieldkit.geometry.similarity import fit_similarity
from fieldkit.reconstruction.agreement import align_to_positions, judge
from fieldkit.reconstruction.colmap_model import model_poses
from fieldkit.reconstruction.features import Features
from fieldkit.reconstruction.mapping.blind import map_blindly
from fieldkit.reconstruction.mapping.prior import PriorProblem, map_with_priors
from fieldkit.reconstruction.settings import BLIND_METHODS, ReconstructionSettings
from fieldkit.reconstruction.stages import KeyedFeatures, exhaustive_pairs, load_features, load_pairs
from fieldkit.runtime.context import Context
from fieldkit.runtime.progress import Progress

RIG_ANGLE_SIGMA_DEG = 0.7
"""Accuracy of the rigs' commanded orientations, standard deviation per axis."""


@dataclass(frozen=True)
class Noise:
    """Noise of the priors: standard deviations per axis."""

    position_m: float
    angle_deg: float

    def __str__(self) -> str:
        return f"{1000 * self.position_m:.0f} mm, {self.angle_deg:g}°"


GRID = tuple(Noise(m, d) for m in (0.0, 0.010, 0.020, 0.050) for d in (0.0, 1.0, 2.0))
MAIN = (Noise(0.0, 0.0), Noise(0.010, 1.0), Noise(0.020, 2.0), Noise(0.050, 2.0))
GOAL = Noise(0.010, 1.0)


@dataclass(frozen=True)
class Plan:
    """The trials to run."""

    subsets: Mapping[str, tuple[int, ...]]
    """Sizes by rig."""
    goals: Mapping[str, tuple[int, ...]]
    """Sizes with a goal: every noise of `GRID` at phase 0, `MAIN` at phase 1, whose photographs were not used for
    tuning. The others get `MAIN`, and at phase 1 `GOAL`."""
    draws: int = 5
    """Number of draws of every noise, and of seeds of the blind mappers."""
    whole_grid: bool = False
    """Every noise on every subset and phase."""

    def noises(self, rig: str, size: int, phase: int) -> tuple[Noise, ...]:
        """The noises tried on a subset."""
        steps = ((GOAL,), MAIN, GRID)
        return GRID if self.whole_grid else steps[1 + (size in self.goals.get(rig, ())) - phase]


SUBSETS = {"basil_rig": (10, 13, 16, 20), "arabidopsis_rig": (13, 20)}
GOALS = {"basil_rig": (10, 13), "arabidopsis_rig": (20,)}


@dataclass(frozen=True)
class Outcome:
    """The poses of a subset compared with the rig and with the model of all photographs."""

    registered: int
    """With a pose."""
    right: int
    """Of those, within the rig's bound after a robust similarity onto the commanded centres."""
    rig_rms_m: float | None
    rig_max_m: float | None
    """Centres against the commanded ones, after the least-squares similarity of all registered."""
    dense_rms_m: float | None
    dense_max_m: float | None
    """The same against the dense model's centres."""
    angle_max_deg: float | None
    """Largest rotation against the dense model, after that similarity."""

    @property
    def wrong(self) -> int:
        return self.registered - self.right


@dataclass(frozen=True)
class Trial:
    """A mapping of a subset."""

    rig: str
    phase: int
    images: int
    method: str
    noise: str
    draw: int
    cpu_s: float
    outcome: Outcome


def run_few_views(data: Path, plan: Plan, *, cache: StageCache, progress: Progress) -> StudyResult:
    """Map uniform subsets of the rigs blindly and with perturbed priors."""
    trials: list[Trial] = []
    notes = []
    for name, sizes in plan.subsets.items():
        rig = load_rig(data, name, cache=cache, progress=progress)
        notes.append(
            f"{name}: dense model of {len(rig.names)} photographs, centres {1000 * rig.rms_m:.1f} mm RMS and rotations "
            f"{rig.angle_rms_deg:.2f}° RMS from the completed commanded poses; accuracy "
            f"{1000 * rig.accuracy_m:.0f} mm, so right is within {4030 * rig.accuracy_m:.1f} mm."
        )
        for phase in (0, 1):
            for size in sizes:
                trials += run_subset(rig, size, phase, plan.noises(name, size, phase), plan.draws, cache, progress)
    notes += _notes(plan.draws)
    return StudyResult(
        name="few-views",
        title="Few views",
        tables=tuple(trial_tables(trials, plan.draws)),
        notes=tuple(notes),
        figures={"trials": [asdict(trial) for trial in trials]},
    )


def _notes(draws: int) -> list[str]:
    return [
        "All methods get the same features and the dense model's calibration, held fixed.",
        "CPU s: matching, verification and mapping on one thread, without the features (the same for all).",
        "Phase 0 starts at the first photograph (constants were chosen while looking at it), phase 1 at the second.",
        "Fewer than three registered photographs cannot be checked and count as wrong.",
        f"Blind rows: {draws} seeds of the mapper on the same matches. Prior rows: {draws} draws of the noise.",
        "The noise comes on top of the rig's own error, which 0 mm, 0° still has.",
        "Medians, with the least and the most in brackets.",
    ]


def run_subset(
    rig: RigSet, size: int, phase: int, noises: Sequence[Noise], draws: int, cache: StageCache, progress: Progress
) -> list[Trial]:
    """Run all methods and noises on a subset."""
    names = uniform_subset(rig.names, size, phase)
    settings = ReconstructionSettings()
    photos = [rig.capture.photo(name) for name in names]
    keyed = load_features(photos, settings.features, context=Context(cache))
    total = draws * (len(BLIND_METHODS) + len(noises))
    with progress.stage(f"{rig.name}, {size} views, phase {phase}", total) as advance:
        found = [(method, "", draw, poses, cpu) for method, draw, poses, cpu in _blind(rig, names, keyed, draws)]
        advance(draws * len(BLIND_METHODS))
        features = [k.features for k in keyed]
        map_with_noise(rig, names[:4], features[:4], noises[0], 0, settings)  # compiles the kernels
        for noise in noises:
            for draw in range(draws):
                found.append(("prior", str(noise), draw, *map_with_noise(rig, names, features, noise, draw, settings)))
                advance(1)
    trials = [
        Trial(rig.name, phase, size, method, noise, draw, cpu, assess(poses, rig))
        for method, noise, draw, poses, cpu in found
    ]
    for (method, noise), group in groupby(trials, key=lambda t: (t.method, t.noise)):
        outcomes = [trial.outcome for trial in group]
        rms = spread([None if o.rig_rms_m is None else 1000 * o.rig_rms_m for o in outcomes])
        progress.note(
            f"{rig.name}, {size} views, phase {phase}, {method} {noise}: {spread([o.right for o in outcomes], 0)} "
            f"right, {spread([o.wrong for o in outcomes], 0)} wrong, {rms} mm RMS"
        )
    return trials


def assess(poses: Mapping[str, Pose], rig: RigSet) -> Outcome:
    """Compare at least three poses, in any frame and scale, with the rig and its dense model."""
    names = [name for name in rig.names if name in poses]
    if len(names) < 3:
        return Outcome(len(names), 0, None, None, None, None, None)
    known = {n: PosePrior(rig.nominal[n].center, rig.accuracy_m) for n in names}
    aligned = align_to_positions({n: poses[n] for n in names}, known, seed=0)
    right = 0
    if aligned is not None:
        right = sum(judge(aligned.apply_pose(poses[n]), known[n]).right is True for n in names)
    centers = np.array([poses[n].center for n in names])
    rig_error = _residuals(centers, np.array([rig.nominal[n].center for n in names]))
    dense_centers = np.array([rig.dense[n].center for n in names])
    dense_error = _residuals(centers, dense_centers)
    angle = None
    if dense_error is not None:
        to_dense = fit_similarity(centers, dense_centers)
        angle = max(rotation_angle_deg(to_dense.apply_pose(poses[n]).rotation, rig.dense[n].rotation) for n in names)
    return Outcome(
        len(names),
        right,
        None if rig_error is None else root_mean_square(rig_error),
        None if rig_error is None else float(rig_error.max()),
        None if dense_error is None else root_mean_square(dense_error),
        None if dense_error is None else float(dense_error.max()),
        angle,
    )


def trial_tables(trials: Sequence[Trial], draws: int) -> list[ResultTable]:
    """One table per rig and phase, a row per subset, method and noise."""
    columns = (
        "views>",
        "mapping",
        "prior noise",
        "all right>",
        "registered>",
        "right>",
        "wrong>",
        "rig RMS, mm>",
        "rig max, mm>",
        "dense RMS, mm>",
        "dense max, mm>",
        "CPU s>",
    )
    tables = []
    for (rig, phase), of_rig in groupby(trials, key=lambda t: (t.rig, t.phase)):
        rows = []
        for (images, method, noise), group in groupby(of_rig, key=lambda t: (t.images, t.method, t.noise)):
            runs = list(group)
            found = [t.outcome for t in runs]
            rows.append(
                (
                    images,
                    method,
                    noise or "–",
                    f"{sum(o.right == images for o in found)} of {draws}",
                    spread([o.registered for o in found], 0),
                    spread([o.right for o in found], 0),
                    spread([o.wrong for o in found], 0),
                    *(
                        spread([None if v is None else 1000 * v for v in values])
                        for values in (
                            [o.rig_rms_m for o in found],
                            [o.rig_max_m for o in found],
                            [o.dense_rms_m for o in found],
                            [o.dense_max_m for o in found],
                        )
                    ),
                    spread([t.cpu_s for t in runs]),
                )
            )
        tables.append(ResultTable(f"{rig}, phase {phase}{' (held out)' if phase else ''}", columns, tuple(rows)))
    return tables


def _residuals(source: np.ndarray, target: np.ndarray) -> np.ndarray | None:
    try:
        moved = fit_similarity(source, target).apply(source)
    except ValueError:  # coincident centres
        return None
    errors: np.ndarray = np.linalg.norm(moved - target, axis=1)
    return errors


def _blind(
    rig: RigSet, names: Sequence[str], keyed: Sequence[KeyedFeatures], draws: int
) -> list[tuple[str, int, dict[str, Pose], float]]:
    settings = ReconstructionSettings()
    camera_of = [0] * len(names)
    start = time.process_time()
    wanted = exhaustive_pairs(len(names), [None] * len(names), len(names))
    pairs = load_pairs(
        keyed, [rig.intrinsics], camera_of, wanted, settings.verification, Context(), calibrated=True, seed=0
    )
    matching = time.process_time() - start
    found = []
    for method in BLIND_METHODS:
        for draw in range(draws):
            start = time.process_time()
            models = map_blindly(
                method,
                names,
                [k.features for k in keyed],
                [rig.intrinsics],
                camera_of,
                pairs,
                fixed_intrinsics=True,
                seed=draw,
            )
            poses = model_poses(models[0]) if models else {}
            found.append((method, draw, poses, matching + time.process_time() - start))
    return found


def map_with_noise(
    rig: RigSet,
    names: Sequence[str],
    features: Sequence[Features],
    noise: Noise,
    draw: int,
    settings: ReconstructionSettings,
) -> tuple[dict[str, Pose], float]:
    """Poses of prior mapping from noisy commanded ones, and its CPU seconds."""
    noisy = perturb(rig.nominal, noise.position_m, noise.angle_deg, draw)
    position_sigma = float(np.hypot(noise.position_m, rig.accuracy_m))
    angle_sigma = float(np.hypot(noise.angle_deg, RIG_ANGLE_SIGMA_DEG))
    start = time.process_time()
    result = map_with_priors(
        PriorProblem(
            names,
            features,
            [rig.intrinsics],
            [0] * len(names),
            [PosePrior.of(noisy[name], position_sigma, angle_sigma) for name in names],
            settings.prior,
            fixed_intrinsics=True,
            seed=draw,
        )
    )
    return model_poses(result.model), time.process_time() - start
