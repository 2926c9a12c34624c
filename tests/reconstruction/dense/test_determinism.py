"""The same bytes in every process, with the cache cold and warm, and only what changed computed again."""

import hashlib
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from fieldkit.cache import StageCache
from fieldkit.clouds import Volume
from fieldkit.reconstruction.dense import View, compute_depth_maps, fuse
from fieldkit.reconstruction.dense import depth_maps as module
from fieldkit.runtime.context import Context
from fieldkit.runtime.memory import MEMORY, MemoryBudget
from tests.reconstruction.dense.planes import VOLUME, Plane, ring, scene_views

ROOT = Path(__file__).parents[3]
PROGRAM = "from tests.reconstruction.dense.test_determinism import run; print(run())"


def views(count: int = 4) -> list[View]:
    found, _ = scene_views([Plane(slope_x=0.2), Plane(height=0.2, half=0.15, seed=1)], ring(count))
    return found


def run(
    seed: int = 0, cache: StageCache | None = None, given: list[View] | None = None, memory: MemoryBudget = MEMORY
) -> str:
    """Digest of depths, normals, costs and the fused cloud."""
    state = hashlib.sha256()
    scene = views() if given is None else given
    found = compute_depth_maps(
        scene, VOLUME, seed=seed, context=Context(cache=cache or StageCache(None)), memory=memory
    )
    cloud, _ = fuse(scene, found, VOLUME, memory=memory)
    for depth_map in found:
        for array in (depth_map.depth, depth_map.normal, depth_map.cost):
            state.update(array.tobytes())
    state.update(cloud.points.tobytes())
    state.update(cloud.colors.tobytes() + cloud.normals.tobytes())
    return state.hexdigest()


def in_a_new_process(**environment: str) -> str:
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM],
        cwd=ROOT,
        env=os.environ | environment,
        capture_output=True,
        text=True,
        check=True,
    )
    return done.stdout.strip()


@pytest.mark.slow
def test_two_processes_give_the_same_bytes():
    assert in_a_new_process() == run()


def test_files_instead_of_memory_give_the_same_bytes(tmp_path):
    assert run(memory=MemoryBudget(tmp_path)) == run()
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_freshly_compiled_kernels_give_the_same_bytes(tmp_path):
    cold = in_a_new_process(NUMBA_CACHE_DIR=str(tmp_path / "kernels"))
    warm = in_a_new_process(NUMBA_CACHE_DIR=str(tmp_path / "kernels"))
    assert cold == warm == run()


def test_the_cache_does_not_change_the_result_and_is_used(tmp_path, monkeypatch):
    cache = StageCache(tmp_path)
    cold = run(cache=cache)
    assert cold == run()
    monkeypatch.setattr(module.Problem, "build", _never)
    assert run(cache=cache) == cold
    # A renamed view is the same view.
    renamed = [View(f"x{v.name}", v.image, v.intrinsics, v.pose, v.mask) for v in views()]
    assert run(cache=cache, given=renamed) == cold


def test_whatever_matters_is_part_of_the_key(tmp_path):
    cache = StageCache(tmp_path)
    scene = views(3)
    first = scene[0]
    image, pose = first.image.copy(), first.pose
    image[90, 120] ^= 1
    pose = type(pose)(pose.rotation, pose.center + 1e-12)
    whole = np.ones(image.shape[:2], dtype=bool)

    def computed(view: View = first, seed: int = 0, volume: Volume = VOLUME) -> int:
        before = cache.sizes().get("depth")
        compute_depth_maps([view, *scene[1:]], volume, seed=seed, context=Context(cache))
        return cache.sizes()["depth"].entries - (before.entries if before else 0)

    count = computed()
    assert computed(View(first.name, image, first.intrinsics, first.pose, first.mask)) == count
    assert computed(View(first.name, first.image, first.intrinsics, pose, first.mask)) == count
    assert computed(View(first.name, first.image, first.intrinsics, first.pose, whole)) == count
    assert computed(seed=7) == count
    assert computed(volume=VOLUME.grown(0.001)) == count


def _never(*arguments: object) -> None:
    raise AssertionError("computed again")
