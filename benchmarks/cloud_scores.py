"""Scoring two clouds: fieldkit against SciPy and, if installed, point-cloud-utils."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass

import numpy as np

from benchmarks.result import ResultTable, StudyResult
from fieldkit.arrays import FloatArray
from fieldkit.clouds import Cloud, ReferenceIndex, score
from fieldkit.runtime.progress import Progress

SIZES = (100_000, 500_000, 1_000_000)
_STRIPS = 120
_NOISE_M = 0.002


@dataclass(frozen=True)
class CloudRun:
    """A method at one size: CPU seconds and the resulting chamfer distance, metres."""

    points: int
    method: str
    cpu_s: float
    chamfer_m: float


def run_clouds(sizes: Sequence[int] = SIZES, *, progress: Progress) -> StudyResult:
    """Chamfer distances of leaf-like clouds of several sizes."""
    wall, cpu = time.perf_counter(), time.process_time()
    score(Cloud(leaves(1000, 0)), Cloud(leaves(1000, 1)))  # imports
    runs: list[CloudRun] = []
    with progress.stage("Clouds", len(sizes)) as advance:
        for size in sizes:
            runs += measure(size)
            advance(1)
    return StudyResult(
        name="clouds",
        title="Scoring clouds",
        tables=(cloud_table(runs),),
        notes=(
            f"Points on {_STRIPS} curved strips in random order, the estimate with {1000 * _NOISE_M:g} mm of noise.",
            "Both directions, one thread; the kernels were compiled before.",
            "score gives chamfer distance, both directed terms and F-scores at four distances in one pass.",
        ),
        figures={"runs": [asdict(run) for run in runs]},
        wall_s=time.perf_counter() - wall,
        cpu_s=time.process_time() - cpu,
    )


def measure(size: int) -> list[CloudRun]:
    """Run every method on the same two clouds, and check that their results agree."""
    reference, estimate = leaves(size, 0), leaves(size, 1)
    index = ReferenceIndex(Cloud(reference))
    index.index.distances_from(index.index)  # builds the index
    methods: dict[str, Callable[[], float]] = {
        "fieldkit score": lambda: score(Cloud(reference), Cloud(estimate)).chamfer.chamfer_m,
        "fieldkit score, reference kept": lambda: score(index, Cloud(estimate)).chamfer.chamfer_m,
        "scipy cKDTree": lambda: _scipy(reference, estimate),
    }
    try:
        import point_cloud_utils

        methods["point-cloud-utils"] = lambda: float(point_cloud_utils.chamfer_distance(reference, estimate))
    except ImportError:
        pass
    runs = []
    for name, method in methods.items():
        start = time.process_time()
        value = method()
        runs.append(CloudRun(size, name, time.process_time() - start, value))
    values = [run.chamfer_m for run in runs]
    if not np.allclose(values, values[0], rtol=1e-6):
        raise AssertionError(f"the methods disagree: {values}")
    return runs


def leaves(count: int, seed: int) -> FloatArray:
    """Points (count, 3) on curved strips, the same strips for every seed; noisy except for seed 0."""
    fixed = np.random.default_rng(0)
    base = fixed.uniform(-0.5, 0.5, (_STRIPS, 3)) * (1.0, 1.0, 0.6)
    azimuth = fixed.uniform(0, 2 * np.pi, _STRIPS)
    rng = np.random.default_rng([seed, count])
    strip = rng.integers(0, _STRIPS, count)
    along, across = rng.uniform(0, 0.5, count), rng.uniform(-0.03, 0.03, count)
    a = azimuth[strip]
    x = np.cos(a) * along - np.sin(a) * across
    y = np.sin(a) * along + np.cos(a) * across
    z = along - 2.2 * along**2 + 3.0 * across**2
    points = base[strip] + np.stack([x, y, z], axis=1)
    if seed:
        points += rng.normal(0.0, _NOISE_M, points.shape)
    return points


def cloud_table(runs: Sequence[CloudRun]) -> ResultTable:
    """A row per method, a column per size."""
    sizes = list(dict.fromkeys(run.points for run in runs))
    by = {(run.method, run.points): run.cpu_s for run in runs}
    rows = tuple(
        (method, *(f"{by[method, size]:.2f}" for size in sizes)) for method in dict.fromkeys(run.method for run in runs)
    )
    return ResultTable("CPU seconds, points per cloud", ("method", *(f"{size:,}>" for size in sizes)), rows)


def _scipy(reference: FloatArray, estimate: FloatArray) -> float:
    from scipy.spatial import cKDTree

    to_reference, _ = cKDTree(reference).query(estimate)
    to_estimate, _ = cKDTree(estimate).query(reference)
    return float(np.mean(to_reference) + np.mean(to_estimate))
