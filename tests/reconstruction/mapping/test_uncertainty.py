"""How well cameras are known, against errors of models that are made again and again."""

from dataclasses import replace

import numpy as np
import pycolmap
import pytest

from fieldkit.geometry.priors import PosePrior
from fieldkit.geometry.similarity import fit_similarity
from fieldkit.reconstruction.colmap_model import new_model, triangulate_tracks
from fieldkit.reconstruction.mapping.bundle import adjust
from fieldkit.reconstruction.mapping.uncertainty import Uncertainty, pair_information, pose_uncertainty
from tests.reconstruction.synthetic import FeatureScene, feature_scene, ring
from tests.reconstruction.test_colmap_model import true_tracks

SIGMA_M = 0.02
FIRM = 1e4
COUNT = 8


@pytest.fixture(scope="module")
def scene() -> FeatureScene:
    return feature_scene(ring(COUNT), points=60, clutter=0, seed=3)


def priors_of(scene: FeatureScene, sigma_m: float = SIGMA_M, draw: int = 0) -> dict[str, PosePrior]:
    rng = np.random.default_rng(draw)
    return {
        name: PosePrior(pose.center + rng.normal(0.0, sigma_m, 3), sigma_m)
        for name, pose in zip(scene.names, scene.poses, strict=True)
    }


def ties(*, without: set[int] = frozenset()) -> dict[tuple[int, int], float]:  # type: ignore[assignment]
    """All pairs of a ring, but those that join some of its photographs to the others."""
    every = [(i, j) for j in range(COUNT) for i in range(j)]
    return {(i, j): FIRM for i, j in every if (i in without) == (j in without)}


def modelled(scene: FeatureScene, noise_px: float, draw: int) -> pycolmap.Reconstruction:
    rng = np.random.default_rng(draw)
    features = [
        replace(each, keypoints=each.keypoints + np.pad(rng.normal(0.0, noise_px, (len(each), 2)), ((0, 0), (0, 2))))
        for each in scene.features
    ]
    model = new_model(scene.names, [scene.camera], [0] * COUNT, scene.poses, features)
    tracks = true_tracks(scene)[0]
    triangulate_tracks(model, features, tracks, max_error_px=8.0, min_angle_deg=1.0, seed=0)
    priors = {k + 1: prior for k, prior in enumerate(priors_of(scene, draw=draw).values())}
    adjust(model, priors, loss_px=2.0, refine_intrinsics=False, seed=0)
    return model


def known(scene: FeatureScene, model: pycolmap.Reconstruction, pairs, sigma_m: float = SIGMA_M) -> Uncertainty:
    return pose_uncertainty(model, priors_of(scene, sigma_m), pairs, scene.names, loss_px=2.0, refined=False)


def test_errors_are_as_large_as_it_says(scene: FeatureScene) -> None:
    truth = np.array([pose.center for pose in scene.poses])
    squares, said = [], []
    for draw in range(6):
        model = modelled(scene, 1.0, draw)
        found = np.array([model.image(k + 1).projection_center() for k in range(COUNT)])
        squares.append(((fit_similarity(found, truth).apply(found) - truth) ** 2).sum(axis=1))
        said.append(np.diag(known(scene, model, ties()).covariance).reshape(-1, 3).sum(axis=1))
    # The inflation is for what real photographs have beside noise.
    assert np.sqrt(np.mean(said) / np.mean(squares)) == pytest.approx(1.5, rel=0.35)


def test_a_group_without_a_pair_across_is_known_by_its_positions(scene: FeatureScene) -> None:
    model = modelled(scene, 0.5, 0)
    apart = {5, 6, 7}
    whole, two = known(scene, model, ties()), known(scene, model, ties(without=apart))
    assert two.sigma.min() > 3 * whole.sigma.max()
    names, sigma, moves = two.weakest()
    assert names == [scene.names[k] for k in sorted(apart)]
    assert np.sqrt((moves**2).sum(axis=1).mean()) == pytest.approx(sigma)
    assert SIGMA_M / 2 < sigma < 4 * SIGMA_M
    # As much as the positions leave open.
    assert known(scene, model, ties(without=apart), 10 * SIGMA_M).weakest()[1] == pytest.approx(10 * sigma, rel=0.2)


def test_a_free_lens_makes_nothing_surer(scene: FeatureScene) -> None:
    model = modelled(scene, 0.5, 3)
    held, free = (
        pose_uncertainty(model, priors_of(scene), ties(), scene.names, loss_px=2.0, refined=refined)
        for refined in (False, True)
    )
    assert (free.sigma >= held.sigma - 1e-9).all()
    np.testing.assert_array_equal(free.reprojection_px, held.reprojection_px)


@pytest.mark.parametrize(("right", "chance", "least", "most"), [(0, 40, 0, 0), (10, 20, 0, 0), (100, 30, 200, 1000)])
def test_only_matches_above_chance_say_something_of_a_pair(right, chance, least, most) -> None:
    rng = np.random.default_rng(0)
    distances = np.abs(np.concatenate([rng.normal(0.0, 0.35, right), rng.uniform(-6.0, 6.0, chance)]))
    assert least <= pair_information(distances) <= most
    assert pair_information(np.zeros(0)) == 0.0
