"""The geometric score against a slow one, visibility against a wall, and how its terms behave."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fieldkit.clouds import Cloud
from fieldkit.clouds.canopy import with_room_m
from fieldkit.planning.plan_settings import NoiseSettings
from fieldkit.planning.score.geometric import GeometricScore, camera_sigmas_m, expected_matches, room_above
from fieldkit.planning.score.visibility import Surface, in_picture, look
from fieldkit.planning.space.cameras import Cameras
from fieldkit.planning.space.plots import Plot
from fieldkit.reconstruction.evidence import FINEST_M
from fieldkit.vocabulary import CAP_M
from tests.planning.leafy import CAMERA, around, problem

PROBLEM = problem()
SCORE = GeometricScore(PROBLEM, points=400)


def slow_distance(score: GeometricScore, cameras: Cameras) -> tuple[float, float]:
    """`GeometricScore`'s first term as its docstring has it, gap and noise, by loops and enumeration."""
    surface = score.surface
    sights = look(surface, cameras, CAMERA)
    p, noise = np.zeros(len(surface)), np.zeros(len(surface))
    for k in range(len(surface)):
        foot = [max(s.distance_m[k] / CAMERA.fx, FINEST_M) for s in sights]
        steep = [min(1.0, max(0.0, (s.facing[k] - 0.1) / 0.4)) for s in sights]
        u = [s.seen[k] * i / (1 + (f / 0.008) ** 2) for s, i, f in zip(sights, steep, foot, strict=True)]
        q, information = [], 1 / CAP_M**2
        for i in range(len(cameras)):
            fails = 1.0
            for j in range(len(cameras)):
                if i != j:
                    angle = np.arccos(np.clip(sights[i].rays[k] @ sights[j].rays[k], -1, 1))
                    ratio = np.degrees(angle) / 12
                    success = (ratio * np.exp(1 - ratio)) ** 0.6 * min(u[i], u[j])
                    fails *= 1 - success
                    information += 0.5 * success * np.sin(angle) ** 2 / (0.5**2 * foot[i] * foot[j])
            q.append(1 - fails)
        for right in itertools.product([0, 1], repeat=len(cameras)):
            if sum(right) >= 2:
                p[k] += np.prod([x if r else 1 - x for x, r in zip(q, right, strict=True)])
        used = [f for f, x in zip(foot, u, strict=True) if x > 0]
        if len(used) >= 2:
            noise[k] = np.sqrt(1 / information + np.mean(np.square(used)))
    expected = []
    for point in surface.points:
        away = np.linalg.norm(surface.points - point, axis=1)
        nearest = np.argsort(away, kind="stable")[:24]
        distances = np.append(np.minimum(away[nearest], CAP_M), CAP_M)
        missing = np.cumprod(1 - p[nearest])
        expected.append((missing * np.diff(distances)).sum())
    return float(np.mean(expected)), float((p * noise).sum() / p.sum())


@pytest.mark.parametrize("normals", [True, False])
def test_distance_is_what_enumeration_finds(normals: bool) -> None:
    plot = problem(normals=normals)
    score = GeometricScore(plot, points=120)
    for seed in range(3):
        cameras = plot.sample(seed)
        found, (gap, noise) = score.score(cameras), slow_distance(score, cameras)
        assert found.gap_m == pytest.approx(gap, rel=1e-4)
        assert found.noise_m == pytest.approx(noise, rel=1e-4)


def test_room_above_the_plants_is_lost_where_pictures_end_below_it() -> None:
    room = room_above(PROBLEM.plots[0].reference.points)
    assert (room[:, 2] >= with_room_m(PROBLEM.plots[0].height_m)).all()
    ring = around(15.0 * np.arange(24))
    seen = in_picture(room, ring, CAMERA).mean()
    low = ring.__class__(ring.positions, ring.yaw_deg, np.full(len(ring), -80.0))
    assert not in_picture(room, low, CAMERA).any()
    assert SCORE.score(low).lost_room == pytest.approx(1.0, abs=1e-6)
    assert seen > 0.5
    assert SCORE.score(ring).lost_room < 0.2


def test_a_wall_hides_what_is_behind_it_and_nothing_else() -> None:
    grid = np.stack(np.meshgrid(np.linspace(-0.2, 0.2, 9), np.linspace(0.1, 0.5, 9)), axis=-1).reshape(-1, 2)
    behind = np.column_stack([grid[:, 0], np.full(len(grid), 0.3), grid[:, 1]])
    y = np.arange(-0.3, 0.0, 0.008)
    wall = np.stack(np.meshgrid(y, np.arange(0, 0.8, 0.008)), axis=-1).reshape(-1, 2)
    wall = np.column_stack([wall[:, 0], np.zeros(len(wall)), wall[:, 1]])  # x from −0.3 to 0
    surface = Surface.of(Plot(Cloud(behind), wall))
    front, back = look(surface, Cameras.aimed([(0, -1.5, 0.3), (0, 2.0, 0.3)], (0.0, 0.3, 0.3)), CAMERA)
    assert back.seen.all()
    # The shadow of the wall's edge at x = 0, as seen from x = 0, is at x = 0.
    assert not front.seen[surface.points[:, 0] < -0.02].any()
    assert front.seen[surface.points[:, 0] > 0.02].all()
    np.testing.assert_allclose(front.distance_m, np.linalg.norm(surface.points - (0, -1.5, 0.3), axis=1))
    away = look(surface, Cameras.aimed([(0, -1.5, 0.3)], (0.0, -3.0, 0.3)), CAMERA)[0]
    assert not away.seen.any()


def test_a_further_view_never_makes_the_gap_worse() -> None:
    for seed in range(5):
        cameras = PROBLEM.envelope.sample(9, seed)
        values = [SCORE.score(cameras.select(range(n))).gap_m for n in range(1, 10)]
        assert all(b <= a + 1e-12 for a, b in itertools.pairwise(values))
        assert values[0] == pytest.approx(0.10)  # one depth map agrees with none


def test_limits_of_the_distance() -> None:
    away = Cameras.aimed(around(np.arange(0, 60, 10.0)).positions, (0.0, 0.0, 9.0))
    assert SCORE.score(away).gap_m == pytest.approx(0.10)
    assert SCORE.score(away).noise_m == pytest.approx(0.10)
    many = around(np.arange(0, 360, 9.0))
    assert SCORE.score(many).gap_m < 0.0005
    assert SCORE.score(many).noise_m < 0.003
    sparse, dense = SCORE.score(around(np.arange(6) * 60.0)), SCORE.score(around(np.arange(6) * 15.0))
    assert dense.gap_m + dense.noise_m < sparse.gap_m + sparse.noise_m
    narrow = SCORE.score(around(np.arange(6) * 2.0))
    assert narrow.noise_m > 2 * dense.noise_m  # small angles triangulate badly


def test_closer_views_hang_together_more_firmly() -> None:
    ties = [SCORE.score(around(np.arange(6) * step)).tie_m for step in (5.0, 10.0, 20.0, 36.0, 60.0)]
    assert all(a < b for a, b in itertools.pairwise(ties))
    assert ties[0] < 0.002
    assert ties[-1] > 0.003


def test_soil_seen_from_above_holds_cameras() -> None:
    low, high = (around(np.arange(10) * 36.0, height_m=height) for height in (0.15, 1.5))
    assert SCORE.score(low).tie_m > 3 * SCORE.score(high).tie_m


def test_neither_kept_views_nor_the_order_of_cameras_matter() -> None:
    kept = GeometricScore(PROBLEM, points=400)
    cameras = PROBLEM.sample(1)
    first = kept.score(cameras)
    z = cameras.vector().copy()
    z[7] += 0.05
    moved = Cameras.from_vector(z)
    assert kept.score(moved) == GeometricScore(PROBLEM, points=400).score(moved)
    assert kept.score(cameras) == first
    assert kept.score(cameras.select([3, 1, 5, 0, 2, 4])) == pytest.approx(first, rel=1e-9)


def test_sets_are_looser_where_more_noise_of_poses_is_expected() -> None:
    cameras = around(np.r_[np.arange(3) * 6.0, 150 + np.arange(3) * 6.0])
    usual = GeometricScore(PROBLEM, points=400).score(cameras)
    same = GeometricScore(replace(PROBLEM, noise=NoiseSettings(pose_m=0.010)), points=400).score(cameras)
    noisy = GeometricScore(replace(PROBLEM, noise=NoiseSettings(pose_m=0.05)), points=400).score(cameras)
    assert same == usual
    assert noisy.tie_m > 1.1 * usual.tie_m
    assert noisy[:2] == usual[:2]


def test_sigmas_are_those_of_all_rays_distances() -> None:
    """The same by numerical derivatives of every distance between two rays through a point."""
    rng, prior = np.random.default_rng(3), 0.02
    positions, points = rng.normal((0.0, 0.0, 2.0), 1.0, (4, 3)), rng.normal(0.0, 0.2, (5, 3))
    seen, variance = rng.uniform(0.0, 1.0, (4, 5)), rng.uniform(0.5, 2.0, (4, 5)) * 1e-6
    matches = np.zeros((4, 4))
    for (i, j), count in {(0, 1): 90.0, (1, 2): 40.0, (2, 3): 150.0, (0, 3): 60.0, (0, 2): 5.0}.items():
        matches[i, j] = matches[j, i] = count

    def distances(x: np.ndarray) -> np.ndarray:
        turned, centers = x[:12].reshape(4, 3), positions + x[12:].reshape(4, 3)
        found = []
        for i, j, k in itertools.product(range(4), range(4), range(5)):
            if i < j:
                rays = [Rotation.from_rotvec(turned[c]).apply(points[k] - positions[c]) for c in (i, j)]
                across = np.cross(*rays) / np.linalg.norm(np.cross(*rays))
                share = seen[i, k] * seen[j, k] / (seen[i] @ seen[j])
                weight = np.sqrt(max(matches[i, j] - 12.0, 0.0) * share / (variance[i, k] + variance[j, k]))
                found.append(weight * (across @ (centers[i] - centers[j])))
        return np.array(found)

    step = 1e-6 * np.eye(24)
    by = np.stack([(distances(row) - distances(-row)) / 2e-6 for row in step], axis=1)
    covariance = np.linalg.inv(by.T @ by + np.diag([1.0] * 12 + [prior**-2] * 12))[12:, 12:]
    centered = positions - positions.mean(axis=0)
    common = [np.tile(axis, 4) for axis in np.eye(3)] + [np.cross(axis, centered).ravel() for axis in np.eye(3)]
    basis = np.linalg.qr(np.stack([*common, centered.ravel()], axis=1))[0]
    own = np.eye(12) - basis @ basis.T
    expected = np.sqrt(np.diag(own @ covariance @ own).reshape(4, 3).sum(axis=1))
    np.testing.assert_allclose(camera_sigmas_m(positions, points, seen, variance, matches, prior), expected, rtol=1e-4)
    unmatched = camera_sigmas_m(positions, points, seen, variance, np.zeros((4, 4)), prior)
    assert (unmatched**2).sum() == pytest.approx((12 - 7) * prior**2)  # all but the common similarity
    firmer = camera_sigmas_m(positions, points, seen, variance, 4.0 * matches, prior)
    assert (firmer < camera_sigmas_m(positions, points, seen, variance, matches, prior)).all()


def test_matches_fall_with_angle_overlap_and_scale() -> None:
    center, positions = PROBLEM.center, around(np.array([0.0, 10.0, 30.0])).positions
    whole = np.ones((3, 3))
    found = expected_matches(positions, center, whole)
    assert 1600.0 > found[0, 1] > found[1, 2] > found[0, 2] > 0
    np.testing.assert_array_equal(found, found.T)
    np.testing.assert_allclose(expected_matches(positions, center, 0.5 * whole), 0.5 * found)
    far = np.array(positions)
    far[1] = center + 2 * (far[1] - center)
    assert expected_matches(far, center, whole)[0, 1] < 0.2 * found[0, 1]


def test_sets_are_looser_in_a_tall_closed_canopy() -> None:
    """Neighbours all round hide the soil that ties views about plants that stand alone."""
    places = np.stack(np.meshgrid(np.arange(-1.5, 1.5, 0.05), np.arange(-1.5, 1.5, 0.05)), axis=-1).reshape(-1, 2)
    alone = PROBLEM.plots[0]
    tall = replace(alone, reference=Cloud(alone.reference.points * (1.0, 1.0, 6.0), None, alone.reference.normals))
    amid = replace(tall, obstacles=np.column_stack([places, np.full(len(places), 0.5)]))
    cameras = around(np.arange(6) * 20.0, 3.0, 6.0)
    loose, firm = (GeometricScore(PROBLEM, plot=plot, points=400).score(cameras).tie_m for plot in (amid, tall))
    assert loose > 1.05 * firm
