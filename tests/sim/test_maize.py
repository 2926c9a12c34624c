"""Plants by growth stage."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fieldkit.scenes.plot_description import GROWTH_STAGES, MaizeDescription, Stage
from fieldkit_sim.maize.architecture import grow
from fieldkit_sim.maize.plant import build_maize


@pytest.mark.parametrize(
    ("stage", "low", "high", "triangles"),
    [("V4", 0.2, 0.65, 30_000), ("V8", 0.5, 1.25, 30_000), ("R1", 1.9, 3.2, 60_000)],
)
def test_a_stage_has_its_height_and_detail(stage: Stage, low: float, high: float, triangles: int) -> None:
    mesh = build_maize(MaizeDescription(seed=1, stage=stage))
    assert low < float(mesh.vertices[:, 2].max()) < high
    assert triangles < len(mesh.faces) < 200_000
    assert 0.0 <= float(mesh.uv.min()) <= float(mesh.uv.max()) <= 1.0
    assert max(mesh.texture.shape) <= 4096


def test_the_same_seed_is_the_same_plant_and_no_two_leaves_are_alike() -> None:
    one, again, other = (build_maize(MaizeDescription(seed=s, leaves=6)) for s in (1, 1, 2))
    assert np.array_equal(one.vertices, again.vertices)
    assert np.array_equal(one.texture, again.texture)
    assert one.vertices.shape != other.vertices.shape or not np.allclose(one.vertices, other.vertices, atol=0.005)
    leaves = grow("V10", np.random.default_rng(3)).leaves
    assert len({leaf.seed for leaf in leaves}) == len(leaves)
    assert len({round(leaf.length, 4) for leaf in leaves}) == len(leaves)


@given(st.sampled_from(GROWTH_STAGES), st.integers(0, 10_000))
def test_architecture_at_every_stage(stage: Stage, seed: int) -> None:
    plant = grow(stage, np.random.default_rng(seed))
    heights = [leaf.collar[2] for leaf in plant.leaves]
    assert heights == sorted(heights)
    assert all(0.03 < leaf.length < 1.3 for leaf in plant.leaves)
    assert all(0.004 < leaf.width < 0.14 for leaf in plant.leaves)
    assert (plant.radii > 0).all()
    assert (plant.tassel_m > 0) == (stage in ("VT", "R1"))
    assert plant.ear == (stage == "R1")


def test_a_coarse_plant_is_the_same_plant_with_less_detail() -> None:
    fine = build_maize(MaizeDescription(seed=4))
    coarse = build_maize(MaizeDescription(seed=4), coarse=True)
    assert len(coarse.faces) < 0.15 * len(fine.faces)
    np.testing.assert_allclose(fine.vertices.max(0), coarse.vertices.max(0), atol=0.03)
    np.testing.assert_allclose(fine.vertices.min(0), coarse.vertices.min(0), atol=0.03)
