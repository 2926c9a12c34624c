"""`known-poses`: whether photographs are as far off as mapping says they may be, on the recorded rigs."""

from __future__ import annotations

import itertools
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.few_views import RIG_ANGLE_SIGMA_DEG, Noise
from benchmarks.result import ResultTable, StudyResult
from benchmarks.rigs import RigSet, load_rig, perturb, uniform_subset
from fieldkit.cache import StageCache
from fieldkit.errors import ReconstructionError
from fieldkit.geometry import Similarity
from fieldkit.geometry.priors import PosePrior, Priors, SourceFrame
from fieldkit.geometry.similarity import fit_similarity
from fieldkit.reconstruction.cameras import cameras_of
from fieldkit.reconstruction.colmap_model import model_poses
from fieldkit.reconstruction.learned import ties_name
from fieldkit.reconstruction.mapping.choose import map_capture
from fieldkit.reconstruction.settings import ReconstructionSettings
from fieldkit.results.evaluation import ImageReport
from fieldkit.runtime.context import Context
from fieldkit.runtime.progress import Progress
from fieldkit.vocabulary import TiesName

SETS: Mapping[str, Sequence[int]] = {"basil_rig": (10, 13), "arabidopsis_rig": (13, 20)}
NOISES = (*(Noise(m, deg) for deg in (1.0, 2.0, np.inf) for m in (0.01, 0.02, 0.05)), Noise(0.0, np.inf))
"""Without angles nothing is known of the lens either."""
LEARNED_SETS: Mapping[str, Sequence[int]] = {"basil_rig": (10,), "arabidopsis_rig": (13,)}
LEARNED_NOISES = (Noise(0.01, 2.0), Noise(0.05, 2.0), Noise(0.01, np.inf), Noise(0.05, np.inf))
_OFF_M = 0.010


def run_known_poses(
    data: Path, *, phases: int, cache: StageCache, progress: Progress, learned: bool = False
) -> StudyResult:
    """Map even subsets about noisy poses, and compare errors with what is said of them; with learned matches, too."""
    rows: list[tuple[int | float | str, ...]] = []
    ties: Sequence[TiesName] = ("sift", ties_name("learned")) if learned else ("sift",)
    sets, noises = (LEARNED_SETS, LEARNED_NOISES) if learned else (SETS, NOISES)
    for name, sizes in sets.items():
        rig = load_rig(data, name, cache=cache, progress=progress)
        cases = list(itertools.product(sizes, noises, ties))
        with progress.stage(name, len(cases) * phases) as advance:
            for size, noise, tie in cases:
                found, start = [], time.process_time()
                for phase in range(phases):
                    found += _mapped(rig, uniform_subset(rig.names, size, phase), noise, phase, tie)
                    advance(1)
                said = str(noise) if np.isfinite(noise.angle_deg) else f"{1000 * noise.position_m:.0f} mm, no angles"
                rows.append((name, size, said, tie, *_cells(found), (time.process_time() - start) / phases))
    columns = (
        "set",
        "views>",
        "priors",
        "ties",
        "right>",
        "loose>",
        "wrong>",
        "not registered>",
        "largest error, mm>",
        "above 10 mm told>",
        "loose within 10 mm>",
        "within 2 σ, %>",
        "CPU s>",
    )
    return StudyResult(
        name="learned-ties" if learned else "known-poses",
        title="How well poses are known",
        tables=(ResultTable(f"Even subsets, {phases} each", columns, tuple(rows)),),
        notes=(
            "Errors: centres of photographs not called wrong, against the model of all after the best fit.",
            "CPU s with features.",
        ),
    )


def _mapped(
    rig: RigSet, names: Sequence[str], noise: Noise, draw: int, ties: TiesName
) -> list[tuple[ImageReport, float]]:
    """Reports of photographs with the errors of their centres, metres; NaN where there is none."""
    capture, oriented = rig.capture, bool(np.isfinite(noise.angle_deg))
    capture = replace(
        capture,
        photos=tuple(photo for photo in capture.photos if photo.name in names),
        findings=(),
        groups=(replace(capture.groups[0], photos=tuple(n for n in capture.names if n in names)),),
    )
    sigma = float(np.hypot(noise.position_m, rig.accuracy_m))
    noisy = perturb(rig.nominal, noise.position_m, noise.angle_deg if oriented else 0.0, draw)
    priors = {
        name: PosePrior.of(noisy[name], sigma, float(np.hypot(noise.angle_deg, RIG_ANGLE_SIGMA_DEG)))
        if oriented
        else PosePrior(noisy[name].center, sigma)
        for name in capture.names
    }
    cameras = cameras_of(capture)
    if oriented:
        cameras = replace(cameras, cameras=(rig.intrinsics,), sources=("camera.toml",), fixed=(True,))
    known = Priors(SourceFrame("poses.csv", None, Similarity.identity()), priors)
    try:
        mapped = map_capture(capture, cameras, known, ReconstructionSettings(ties=ties), Context())
    except ReconstructionError:
        return [(ImageReport(name=name, features=0, registered=False), np.nan) for name in names]
    poses = model_poses(mapped.model)
    errors = {}
    if len(poses) > 3:
        found = np.array([pose.center for pose in poses.values()])
        dense = np.array([rig.dense[name].center for name in poses])
        errors = dict(
            zip(poses, np.linalg.norm(fit_similarity(found, dense).apply(found) - dense, axis=1), strict=True)
        )
    return [(image, errors.get(image.name, np.nan)) for image in mapped.images]


def _cells(found: Sequence[tuple[ImageReport, float]]) -> tuple[int | float | str, ...]:
    counted = [(image, error) for image, error in found if image.counts and np.isfinite(error)]
    off = [image for image, error in counted if error > _OFF_M]
    loose = [image for image, _ in found if image.counts and image.right is None]
    inside = [error <= 2.0 * image.sigma_m for image, error in counted if image.sigma_m is not None]
    return (
        sum(image.right is True for image, _ in found),
        len(loose),
        sum(image.right is False for image, _ in found),
        sum(not image.registered for image, _ in found),
        1000.0 * max((error for _, error in counted), default=float("nan")),
        f"{sum(image.right is None for image in off)} of {len(off)}",
        sum(image.right is None and error <= _OFF_M for image, error in counted),
        100.0 * float(np.mean(inside)) if inside else float("nan"),
    )
