"""Leaves in motion: how far, how fast, what photographs share, and what a vehicle's wash adds."""

import numpy as np
import pytest

from fieldkit.scenes.scene import Mesh, Scene
from fieldkit.scenes.simulate import Outdoors
from fieldkit.scenes.sway import GUST_SHARE, Motion

LEAVES = 120


def leaves(name: str, x_m: float, seed: int) -> Mesh:
    """Flat leaves half a metre long about x, each of four vertices and fixed at its first."""
    rng = np.random.default_rng(seed)
    feet = rng.uniform(-0.1, 0.1, (LEAVES, 3)) + np.array([x_m, 0.0, 1.0])
    leaf = np.array([[0.0, 0.0, 0.0], [0.25, 0.0, 0.0], [0.5, 0.0, 0.01], [0.5, 0.0, -0.01]])
    faces = (4 * np.arange(LEAVES)[:, None, None] + [[0, 1, 2], [1, 2, 3]]).reshape(-1, 3).astype(np.int32)
    flex = np.tile(np.array([0.0, 0.25, 0.5, 0.5], np.float32), LEAVES)
    vertices = (feet[:, None] + leaf).reshape(-1, 3).astype(np.float32)
    return Mesh(name, vertices, faces, plant=True, flex_m=flex)


SCENE = Scene((leaves("one", 0.0, 1), leaves("other", 0.75, 2)))


def tips(times: np.ndarray, seed: int = 1, name: str = "one", wash: tuple = (), wind_m: float = 0.01):
    """Sideways motion (times, leaves, 2) of a plant's tips."""
    mesh = next(m for m in SCENE.meshes if m.name == name)
    motion = Motion(SCENE, seed)
    return np.array([(motion.at(t, wind_m, *wash)[name] - mesh.vertices)[2::4, :2] for t in times])


def test_tips_move_by_the_strength_and_collars_stand() -> None:
    moved = np.concatenate([tips(np.arange(0, 120, 1.7), seed) for seed in range(4)])
    np.testing.assert_allclose(np.sqrt((moved**2).mean(axis=(0, 1))), 0.01, rtol=0.1)
    at = Motion(SCENE, 1).at(3.0, 0.01)["one"]
    np.testing.assert_array_equal(at[0::4], SCENE.meshes[0].vertices[0::4])
    # Half as far out, less than half as far.
    assert np.sqrt(((at - SCENE.meshes[0].vertices)[1::4, :2] ** 2).mean()) < 0.005


def test_leaves_swing_at_one_to_three_hertz_about_slow_gusts() -> None:
    step, n = 0.1, 2048
    moved = tips(step * np.arange(n))
    window = np.hanning(n)[:, None, None]
    power = (np.abs(np.fft.rfft(moved * window, axis=0)) ** 2).sum(axis=2)
    hertz = np.fft.rfftfreq(n, step)
    swing, gust = power[(hertz > 0.97) & (hertz < 3.03)].sum(axis=0), power[hertz < 0.5].sum(axis=0)
    assert ((swing + gust) / power.sum(axis=0)).min() > 0.999
    assert (gust / power.sum(axis=0)).mean() == pytest.approx(GUST_SHARE, abs=0.1)
    fastest = hertz[np.where(hertz[:, None] > 0.5, power, 0).argmax(axis=0)]
    assert np.ptp(fastest) > 1.2  # every leaf at its own


def test_a_burst_shares_the_gust_and_neighbours_do_and_stations_do_not() -> None:
    def agreement(lag_s: float, name: str = "one") -> float:
        pairs = []
        for seed in range(12):
            times = 20.0 * np.arange(4)
            pairs.append((tips(times, seed).mean(axis=1), tips(times + lag_s, seed, name).mean(axis=1)))
        a, b = (np.concatenate(side).ravel() for side in zip(*pairs, strict=True))
        return float(np.corrcoef(a, b)[0, 1])

    # The mean over many leaves is the gust: their swings cancel.
    assert agreement(0.7) > 0.8
    assert agreement(0.0, "other") > 0.8
    assert abs(agreement(8.0)) < 0.3
    # A leaf itself is elsewhere in its swing at the next photograph.
    moved = np.concatenate([tips(np.array([0.0, 0.7]), seed) for seed in range(12)])
    assert np.corrcoef(moved[0::2].ravel(), moved[1::2].ravel())[0, 1] < 0.6


def test_wash_adds_by_the_distance_of_each_leaf() -> None:
    times = np.arange(0, 60, 1.7)

    def strength(x_m: float, z_m: float = 1.0, wind_m: float = 0.0) -> float:
        wash = (1.0, (x_m, 0.0, z_m))
        return float(np.sqrt((tips(times, wash=wash, wind_m=wind_m) ** 2).mean()))

    # From the leaves' tips, at 0.5 m: 3.6, 2.4, 1.8 m/s.
    assert [1e3 * strength(x) for x in (1.5, 2.0, 2.5)] == pytest.approx([13.0, 4.7, 2.3], rel=0.15)
    assert strength(2.0, wind_m=0.01) == pytest.approx(np.hypot(0.0047, 0.01), rel=0.15)
    assert strength(0.5, 2.5) > 5 * strength(2.0)  # downwash
    near = np.sqrt((tips(times, wash=(1.0, (-0.3, 0.0, 1.0)), wind_m=0.0) ** 2).mean(axis=(0, 2)))
    assert near.max() > 1.5 * near.min()  # leaf by leaf


def test_a_moment_is_the_same_whatever_else_is_in_the_scene() -> None:
    whole, part = Motion(SCENE, 3), Motion(Scene(SCENE.meshes[1:]), 3)
    np.testing.assert_array_equal(whole.at(2.5, 0.01)["other"], part.at(2.5, 0.01)["other"])
    assert whole.at(2.5, 0.0) == {}


def test_photographs_of_a_burst_are_near_in_time() -> None:
    single, five = Outdoors(), Outdoors(burst=5)
    assert [single.time_s(i) for i in range(3)] == [0.0, 4.0, 8.0]
    assert [five.time_s(i) for i in (0, 1, 4, 5)] == pytest.approx([0.0, 0.7, 2.8, 7.8])
