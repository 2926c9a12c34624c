"""Mapping with priors, step by step, on simulated features: what is believed at first is never changed."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import cv2
import numpy as np
import pytest

from fieldkit.cache import StageCache
from fieldkit.captures import Photo
from fieldkit.errors import FieldkitError
from fieldkit.geometry.pose import rotation_angle_deg
from fieldkit.geometry.priors import PosePrior, Priors
from fieldkit.reconstruction.cameras import CameraSet
from fieldkit.reconstruction.colmap_model import model_poses
from fieldkit.reconstruction.mapping import steps
from fieldkit.reconstruction.mapping.state import Belief, Inputs, Mapped
from fieldkit.reconstruction.mapping.steps import doubt_odd_orientations, map_by_priors, orient
from fieldkit.reconstruction.settings import ReconstructionSettings
from fieldkit.reconstruction.stages import KeyedFeatures
from fieldkit.runtime.context import Context
from tests.reconstruction.synthetic import FeatureScene, feature_scene, perturbed, ring

COUNT = 8
TURNED = np.diag([-1.0, -1.0, 1.0])


@pytest.fixture(scope="module")
def scene() -> FeatureScene:
    return feature_scene(ring(COUNT), points=200, clutter=50)


@pytest.fixture(autouse=True)
def blank_photographs(scene: FeatureScene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where the features of the ground are looked for, there are none."""
    monkeypatch.chdir(tmp_path)
    for name in scene.names:
        cv2.imwrite(name, np.zeros((scene.camera.height, scene.camera.width), np.uint8))


def given(scene: FeatureScene, priors: dict[str, PosePrior]) -> tuple[Inputs, Belief]:
    size = (scene.camera.width, scene.camera.height)
    photos = tuple(Photo(Path(name), name, *size, "JPEG", name) for name in scene.names)
    capture = SimpleNamespace(folder=Path("plot"), names=tuple(scene.names), photos=photos, priors=priors)
    keyed = [KeyedFeatures(f"{k:016x}", features, cached=False) for k, features in enumerate(scene.features)]
    cameras = CameraSet(("camera",), (scene.camera,), ("camera.toml",), (True,), (0,) * COUNT)
    inputs = Inputs(cast("Any", capture), ReconstructionSettings(), keyed, Context(StageCache(Path.cwd() / "cache")))
    return inputs, Belief(cameras, Priors(None, priors))


def recorded(scene: FeatureScene) -> dict[str, PosePrior]:
    noisy = perturbed(scene.poses, 0.0, 1.0, seed=3)
    return {name: PosePrior.of(pose, 0.005, 2.0) for name, pose in zip(scene.names, noisy, strict=True)}


def worst_deg(mapped: Mapped, scene: FeatureScene) -> float:
    found = model_poses(mapped.model)
    return max(rotation_angle_deg(found[n].rotation, p.rotation) for n, p in zip(scene.names, scene.poses, strict=True))


def test_poses_on_record_are_mapped_about(scene: FeatureScene) -> None:
    mapped = map_by_priors(*given(scene, recorded(scene)))
    assert (mapped.method, mapped.metric, mapped.right, mapped.notes) == ("prior", True, COUNT, ())
    assert mapped.model_sizes == (COUNT,)
    assert worst_deg(mapped, scene) < 0.5


def test_of_many_photographs_the_ground_is_looked_at_where_one_is_not_right(
    scene: FeatureScene, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(steps, "_MANY", COUNT)
    for name in scene.names:
        Path(name).unlink()  # so that whoever looks at the ground fails
    priors = recorded(scene)
    assert map_by_priors(*given(scene, priors)).right == COUNT
    known = priors[scene.names[0]]
    priors[scene.names[0]] = replace(known, position=known.pose.center + np.array([0.5, 0.0, 0.0]))
    with pytest.raises(FieldkitError, match=r"cannot be read|does not exist|no longer"):
        map_by_priors(*given(scene, priors))


@pytest.mark.slow
def test_positions_alone_are_oriented_by_matches(scene: FeatureScene) -> None:
    priors = {name: replace(prior, rotation=None) for name, prior in recorded(scene).items()}
    mapped = map_by_priors(*given(scene, priors))
    assert mapped.right == COUNT
    assert all(image.angle_residual_deg is None for image in mapped.images)
    assert worst_deg(mapped, scene) < 0.5


def test_an_orientation_that_matches_contradict_is_put_right(scene: FeatureScene) -> None:
    priors = recorded(scene)
    wrong = scene.names[2]
    rotation = priors[wrong].rotation
    priors[wrong] = replace(priors[wrong], rotation=TURNED @ rotation)
    inputs, belief = given(scene, priors)
    mapped = map_by_priors(inputs, belief)
    assert mapped.right == COUNT
    assert worst_deg(mapped, scene) < 0.5
    assert len(mapped.notes) == 1
    assert f"orientations of {wrong} contradict the photographs" in mapped.notes[0]
    assert (belief.notes, belief.rough, belief.mapped) == ((), {}, None)
    assert belief.priors.by_name[wrong].rotation is not None


@pytest.mark.parametrize("reached", [3, COUNT])
def test_level_views_are_doubted_only_where_pairs_reach_half(
    scene: FeatureScene, monkeypatch: pytest.MonkeyPatch, reached: int
) -> None:
    """Leaves that sway make wrong pairs; a chain of three always fits its positions somehow."""
    level = {
        n: replace(p, rotation=np.array([[1.0, 0, 0], [0, 0, -1.0], [0, 1.0, 0]])) for n, p in recorded(scene).items()
    }
    inputs, belief = given(scene, level)
    wrong = {n: replace(level[n], rotation=TURNED @ level[n].rotation) for n in scene.names[:reached]}
    monkeypatch.setattr(steps, "_pair_poses", lambda *_: wrong)
    found = doubt_odd_orientations(inputs, orient(inputs, belief))
    assert found.contradicted == (set(scene.names) if reached == COUNT else set())
