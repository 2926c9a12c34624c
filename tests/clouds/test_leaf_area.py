"""Area of leaves whose size is known."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fieldkit.arrays import FloatArray
from fieldkit.clouds import Cloud
from fieldkit.clouds.canopy import canopy
from fieldkit.clouds.leaf_area import leaf_area_m2, shown_share

PIXEL_M = 0.003


def layers(lai: float, width: float = 0.07, scatter_m: float = 0.003) -> FloatArray:
    """Points of leaves 50 cm long over a square metre, at all heights, up to 60° from level, in any direction."""
    rng = np.random.default_rng(1)
    leaves = []
    for _ in range(round(lai / (0.5 * width))):
        points = rng.uniform(-0.5, 0.5, (round(0.5 * width / PIXEL_M**2), 3)) * (0.5, width, 0.0)
        points += rng.normal(0.0, scatter_m, points.shape)
        turn = Rotation.from_euler("yz", (rng.uniform(-60, 60), rng.uniform(0, 360)), degrees=True)
        leaves.append(turn.apply(points) + rng.uniform((0, 0, 0.5), (1, 1, 2.0)))
    return np.concatenate(leaves)


def area_m2(points: FloatArray) -> float:
    return leaf_area_m2(Cloud(points), canopy(points, points[:, 2], PIXEL_M), PIXEL_M)


@pytest.mark.parametrize("lai", [0.5, 2.0, 4.0])
@pytest.mark.parametrize("scatter_m", [0.001, 0.003])
def test_layers_of_leaves_with_a_known_index(lai: float, scatter_m: float) -> None:
    assert area_m2(layers(lai, scatter_m=scatter_m)) == pytest.approx(lai, rel=0.2)


def test_narrow_leaves() -> None:
    assert area_m2(layers(1.0, width=0.045)) == pytest.approx(1.0, rel=0.2)


def test_a_seam_of_few_points_adds_little() -> None:
    """Where leaves sway, each view shows their edges elsewhere."""
    leaves, rng = layers(1.0), np.random.default_rng(2)
    seam = leaves[::8] + rng.normal(0.0, 0.01, leaves[::8].shape)
    alone, with_seam = (area_m2(points) for points in (leaves, np.concatenate([leaves, seam])))
    assert with_seam == pytest.approx(alone, rel=0.15)


@pytest.mark.parametrize(("lai", "photographs", "share"), [(1.98, 12, 0.88), (3.48, 12, 0.57), (3.95, 64, 0.91)])
def test_hidden_leaves_as_rendered_depths_show_them(lai: float, photographs: int, share: float) -> None:
    """Of simulated blocks at V10 and R1: leaf area that three of so many photographs show."""
    assert shown_share(lai, photographs) == pytest.approx(share, abs=0.06)
    assert shown_share(0.0, photographs) == 1.0
