from pathlib import Path

import numpy as np
import pytest

from fieldkit.clouds import Cloud, ReferenceIndex, alignment, icp, read_ply
from fieldkit.clouds.alignment import icp_onto_reference
from fieldkit.geometry import Similarity
from fieldkit.geometry.pose import rotation_from_vector
from tests.clouds.examples import leaves


def displaced(center: np.ndarray, rng: np.random.Generator, *, shift_m: float, angle_deg: float, scale: float = 1.0):
    """A motion that turns about ``center`` and then shifts, in random directions."""
    axis, direction = (v / np.linalg.norm(v) for v in rng.normal(size=(2, 3)))
    rotation = rotation_from_vector(axis * np.radians(angle_deg))
    return Similarity(scale, rotation, center + shift_m * direction - scale * rotation @ center)


def partial_pair(points: np.ndarray, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Two different samples of a cloud, each without another end of it, the first with 0.5 mm noise."""
    along = np.argsort(points @ rng.normal(size=3))
    source, target = points[along[len(points) // 4 :]], points[along[: int(0.8 * len(points))]]
    source, target = source[rng.random(len(source)) < 0.6], target[rng.random(len(target)) < 0.6]
    return source + rng.normal(0, 0.0005, source.shape), target


def error_mm(found: Similarity, motion: Similarity, points: np.ndarray) -> float:
    return 1000 * float(np.linalg.norm(found.apply(motion.apply(points)) - points, axis=1).mean())


@pytest.mark.parametrize("seed", range(4))
def test_a_real_plant_moved_by_5_mm_and_2_degrees(data_folder: Path, seed: int) -> None:
    points = read_ply(data_folder / "basil_rig" / "reference_cloud.ply").points / 1000.0
    rng = np.random.default_rng(seed)
    source, target = partial_pair(points, rng)
    motion = displaced(points.mean(axis=0), rng, shift_m=0.005, angle_deg=2.0)
    found, stats = icp(Cloud(motion.apply(source)), Cloud(target))
    assert error_mm(found, motion, points) < 0.6
    assert found.scale == pytest.approx(1.0, abs=1e-9)
    assert 0.7 < stats.overlap < 0.85
    assert stats.rms_m < 0.0015
    assert stats.shift_m == pytest.approx(0.005, abs=0.001)
    assert stats.rotation_deg == pytest.approx(2.0, abs=0.5)


def test_a_scale_error_of_one_percent(data_folder: Path) -> None:
    points = read_ply(data_folder / "basil_rig" / "reference_cloud.ply").points / 1000.0
    rng = np.random.default_rng(1)
    source, target = partial_pair(points, rng)
    motion = displaced(points.mean(axis=0), rng, shift_m=0.003, angle_deg=1.0, scale=1.01)
    found, stats = icp(Cloud(motion.apply(source)), Cloud(target), with_scale=True)
    assert stats.scale == pytest.approx(1 / 1.01, abs=0.006)
    assert error_mm(found, motion, points) < 0.8


@pytest.mark.parametrize("with_scale", [False, True])
def test_clouds_out_of_reach_stay_where_they_are_and_say_so(with_scale: bool) -> None:
    far = Cloud(leaves(500) + 100.0)
    found, stats = icp(Cloud(leaves(500)), far, with_scale=with_scale)
    np.testing.assert_allclose(found.matrix(), np.eye(4), atol=1e-9)
    assert not stats.fits
    assert stats.overlap == 0.0
    assert stats.before_m == stats.after_m == 0.02
    assert np.isnan(stats.rms_m)


def test_what_lies_beside_the_reference_is_cropped_and_where_nothing_fits_nothing_moves() -> None:
    rng, target = np.random.default_rng(7), leaves(12_000, seed=1)
    source = leaves(9_000, seed=2)
    motion = displaced(source.mean(axis=0), rng, shift_m=0.02, angle_deg=1.0)
    beside = source + np.array([2.0, 0.0, 0.0])
    cloud = Cloud(motion.apply(np.concatenate([source, beside, beside + 3.0])))
    found, stats = icp_onto_reference(cloud, Cloud(target))
    assert stats.fits
    assert stats.overlap > 0.9
    assert error_mm(found, motion, target) < 1.0
    found, stats = icp_onto_reference(Cloud(beside), Cloud(target))
    assert not stats.fits
    np.testing.assert_array_equal(found.matrix(), np.eye(4))


def test_a_real_plant_whose_points_wander_is_moved_nevertheless(data_folder: Path) -> None:
    """Noise of 2 mm keeps the iterations from settling; the motion is good all the same."""
    points = read_ply(data_folder / "basil_rig" / "reference_cloud.ply").points / 1000.0
    rng = np.random.default_rng(2)
    motion = displaced(points.mean(axis=0), rng, shift_m=0.015, angle_deg=3.0)
    noisy = motion.apply(points + rng.normal(0, 0.002, points.shape))
    for with_scale in (False, True):
        found, stats = icp_onto_reference(Cloud(noisy), Cloud(points), with_scale=with_scale)
        assert stats.fits
        assert stats.scale == 1.0  # which did not settle, so there is none
        assert error_mm(found, motion, points) < 0.8


def test_large_clouds_are_thinned_further(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(3)
    points = leaves(20_000)
    motion = displaced(points.mean(axis=0), rng, shift_m=0.004, angle_deg=0.5)
    monkeypatch.setattr(alignment, "_MOST_POINTS", 3_000)
    sizes = []
    thin = alignment.voxel_thin
    monkeypatch.setattr(alignment, "voxel_thin", lambda *a, **k: sizes.append(len(r := thin(*a, **k))) or r)
    found, stats = icp(Cloud(motion.apply(points)), ReferenceIndex(Cloud(leaves(20_000, seed=1))))
    assert sizes[-1] <= 3_200
    assert max(sizes) > 3_000
    assert stats.overlap > 0.8
    assert error_mm(found, motion, points) < 1.5
