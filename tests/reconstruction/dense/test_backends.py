"""Choice of the backend, COLMAP's workspace, and the baseline. No GPU is needed."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pycolmap
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from benchmarks.sgbm import rectify, sgbm_depth_maps
from fieldkit.cache import StageCache
from fieldkit.errors import ReconstructionError, UsageError
from fieldkit.reconstruction.dense import DepthMap, Settings, compute_depth_maps, cuda, fuse, select_backend
from fieldkit.runtime.progress import Silent
from tests.reconstruction.dense.planes import VOLUME, Plane, ring, scene_views

no_gpu = pytest.mark.skipif(cuda.cuda_devices() > 0, reason="this machine has a CUDA device")


@pytest.fixture(scope="module")
def scene():
    views, truth = scene_views([Plane(slope_x=0.2)], ring(5))
    found = compute_depth_maps(views, VOLUME, Settings(), seed=0, progress=Silent(), cache=StageCache(None))
    return views, truth, found


@no_gpu
def test_without_a_device_auto_is_the_cpu():
    assert select_backend().name == "cpu"
    assert select_backend("cpu").name == "cpu"


@no_gpu
def test_asking_for_cuda_without_a_device_is_an_error_with_a_remedy():
    with pytest.raises(UsageError, match="NVIDIA") as raised:
        select_backend("cuda")
    assert "--backend cpu" in raised.value.remedy


@no_gpu
def test_cuda_depth_maps_without_a_device_do_not_reach_colmap(scene, monkeypatch):
    monkeypatch.setattr(pycolmap, "patch_match_stereo", None)
    with pytest.raises(UsageError, match="no CUDA device"):
        cuda.Cuda().compute_depth_maps(scene[0], VOLUME, Settings(), seed=0, progress=Silent(), cache=StageCache(None))


def test_a_build_that_says_it_has_cuda_but_finds_no_device_counts_as_none(monkeypatch):
    monkeypatch.setattr(pycolmap, "has_cuda", True)
    monkeypatch.setattr(pycolmap, "get_num_cuda_devices", lambda: 0, raising=False)
    assert cuda.cuda_devices() == 0


def test_with_a_device_auto_is_cuda(monkeypatch):
    monkeypatch.setattr(pycolmap, "has_cuda", True)
    monkeypatch.setattr(pycolmap, "get_num_cuda_devices", lambda: 1, raising=False)
    assert select_backend("auto").name == "cuda"
    assert select_backend("cuda").name == "cuda"


def test_an_unknown_backend_is_refused():
    with pytest.raises(UsageError, match="no dense stereo backend 'tpu'"):
        select_backend("tpu")


def test_the_cpu_backend_is_the_packages_own_functions(scene):
    views, _, found = scene
    backend = select_backend("cpu")
    again = backend.compute_depth_maps(views, VOLUME, Settings(), seed=0, progress=Silent(), cache=StageCache(None))
    assert all(np.array_equal(a.depth, b.depth) for a, b in zip(again, found, strict=True))
    assert len(backend.fuse(views, found, VOLUME, Settings())) == len(fuse(views, found, VOLUME, Settings()))


def test_the_workspace_is_what_colmap_reads(scene, tmp_path):
    views = scene[0]
    cuda.write_workspace(tmp_path, views, VOLUME, Settings())
    model = pycolmap.Reconstruction(str(tmp_path / "sparse"))
    assert model.num_reg_images() == 5
    for image in model.images.values():
        view = views[image.image_id - 1]
        assert image.projection_center() == pytest.approx(view.pose.center)
        assert image.cam_from_world().rotation.matrix() == pytest.approx(view.pose.rotation)
        camera = model.cameras[image.camera_id]
        assert (camera.width, camera.height) == (240, 180)
        assert (tmp_path / "images" / image.name).exists()
    for point in list(model.points3D.values())[:20]:
        for element in point.track.elements:
            image = model.images[element.image_id]
            expected = image.points2D[element.point2D_idx].xy
            assert image.project_point(point.xyz) == pytest.approx(expected, abs=1e-6)
    lines = (tmp_path / "stereo" / "patch-match.cfg").read_text().splitlines()
    assert lines[0] == "0000.png"
    assert set(lines[1].split(", ")) <= {f"{i:04d}.png" for i in range(1, 5)}
    assert (tmp_path / "stereo" / "fusion.cfg").read_text().splitlines() == [f"{i:04d}.png" for i in range(5)]


def test_options_carry_the_volume_and_the_rule(scene, tmp_path):
    views = scene[0]
    matching = cuda.patch_match_options(views, VOLUME)
    depths = np.concatenate([v.pose.to_camera(VOLUME.corners())[:, 2] for v in views])
    assert matching.depth_min == pytest.approx(depths.min(), rel=1e-5)
    assert matching.depth_max == pytest.approx(depths.max(), rel=1e-5)
    rule = cuda.fusion_options(tmp_path, views, VOLUME, Settings(min_agreeing=1, max_reprojection_px=2.5))
    assert rule.min_num_pixels == 2
    assert rule.max_reproj_error == pytest.approx(2.5)
    assert np.allclose(rule.bounding_box[0], VOLUME.lower)


def test_colmaps_fusion_of_our_maps_lies_on_the_plane(scene):
    views, _, found = scene
    cloud = cuda.Cuda().fuse(views, found, VOLUME, Settings())
    assert len(cloud) > 3000
    assert np.abs(cloud.points[:, 2] - 0.2 * cloud.points[:, 0]).mean() < 0.003
    assert cloud.normals is not None
    expected = np.array([-0.2, 0.0, 1.0]) / np.hypot(0.2, 1.0)
    assert np.median(cloud.normals @ expected) > 0.98
    assert cloud.colors is not None


def test_maps_come_back_from_the_workspace_as_they_went(scene, tmp_path):
    views, _, found = scene
    cuda.write_workspace(tmp_path, views, VOLUME, Settings())
    cuda.write_maps(tmp_path, views, found, Settings())
    for view, given_map, name in zip(views, found, cuda._file_names(views), strict=True):
        back: DepthMap = cuda._read_maps(tmp_path, view, name)
        kept = (given_map.depth > 0) & (given_map.cost < 0.6)
        assert np.array_equal(back.depth > 0, kept)
        assert np.array_equal(back.depth[kept], given_map.depth[kept])
        assert np.allclose(back.normal[kept], given_map.normal[kept], atol=1e-6)


@given(arrays.arrays(np.float32, st.tuples(*[st.integers(1, 5)] * 2), elements=st.floats(0, 9, width=32)))
def test_depth_files_are_the_ones_pycolmap_writes(tmp_path_factory, depth):
    folder: Path = tmp_path_factory.mktemp("maps")
    cuda.write_array(folder / "ours.bin", depth)
    pycolmap.DepthMap.from_array(depth, 0.0, 9.0).write(str(folder / "theirs.bin"))
    assert (folder / "ours.bin").read_bytes() == (folder / "theirs.bin").read_bytes()
    assert np.array_equal(cuda.read_array(folder / "theirs.bin"), depth)


def test_normal_files_hold_one_channel_after_the_other(tmp_path):
    normal = np.arange(2 * 3 * 3, dtype=np.float32).reshape(2, 3, 3)
    cuda.write_array(tmp_path / "n.bin", normal)
    data = (tmp_path / "n.bin").read_bytes()
    assert data.startswith(b"3&2&3&")
    assert np.frombuffer(data[6:], "<f4")[:6].tolist() == normal[..., 0].ravel().tolist()
    assert np.array_equal(cuda.read_array(tmp_path / "n.bin"), normal)


@pytest.mark.parametrize("content", [b"", b"3&2&", b"a&b&c&", b"3&2&1&1234"])
def test_a_damaged_map_is_an_error_with_its_path(tmp_path, content):
    (tmp_path / "bad.bin").write_bytes(content)
    with pytest.raises(ReconstructionError, match="not a COLMAP"):
        cuda.read_array(tmp_path / "bad.bin")


def test_the_baseline_finds_the_plane(scene):
    views, truth, _ = scene
    for found, depth in zip(sgbm_depth_maps(views, VOLUME, Settings()), truth, strict=True):
        inner = (slice(40, -40), slice(40, -40))
        error = np.abs(found.depth - depth)[inner] / depth[inner]
        assert np.mean(error < 0.01) > 0.8


def test_a_rectified_pair_shares_its_rows(scene):
    views = scene[0]
    pair = rectify(views[0], views[1], VOLUME)
    assert pair is not None
    point = np.array([0.05, -0.1, 0.01])
    rays = [pair.rotation @ views[0].pose.rotation @ (point - views[i].pose.center) for i in (0, 1)]
    rows = [pair.focal * r[1] / r[2] + c[1] for r, c in zip(rays, (pair.left_center, pair.right_center), strict=True)]
    assert rows[0] == pytest.approx(rows[1])
    assert rays[0][2] == pytest.approx(rays[1][2])
    assert (rays[0] - rays[1])[0] == pytest.approx(pair.baseline)
