"""Mapping without priors, by COLMAP: incremental (the paper's way) or global (GLOMAP)."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from fieldkit.geometry import Intrinsics
from fieldkit.reconstruction.colmap import pycolmap
from fieldkit.reconstruction.colmap_model import to_colmap_camera
from fieldkit.reconstruction.features import Features
from fieldkit.reconstruction.verification import TwoView

METHODS = ("incremental", "global")
"""In the order in which they are tried where neither is asked for."""


@dataclass(frozen=True, eq=False)
class BlindMapping:
    """All models a mapper made, largest first (most registered images, then most points)."""

    models: tuple[pycolmap.Reconstruction, ...]


def map_blindly(
    method: str,
    names: Sequence[str],
    features: Sequence[Features],
    cameras: Sequence[Intrinsics],
    camera_of: Sequence[int],
    pairs: Mapping[tuple[int, int], TwoView],
    *,
    fixed_intrinsics: bool,
    seed: int = 0,
) -> BlindMapping:
    """Run COLMAP's incremental or global mapper on verified pairs, on one thread.

    Args:
        method: ``"incremental"`` or ``"global"``.
        names: of n images; image i has COLMAP id i + 1.
        features: of each.
        cameras: of each camera group.
        camera_of: each image's index into ``cameras``.
        pairs: verified pairs by image indices.
        fixed_intrinsics: hold the cameras as given, else focal length and distortion are refined.
        seed: of the mapper.

    Returns:
        The models in COLMAP's arbitrary frame and scale; none when nothing could be mapped.
    """
    with tempfile.TemporaryDirectory(prefix="fieldkit-") as folder:
        database = Path(folder) / "database.db"
        _write_database(database, names, features, cameras, camera_of, pairs, fixed_intrinsics)
        run = _incremental if method == "incremental" else _global
        models = run(database, Path(folder), len(cameras), fixed_intrinsics, seed)
    found = [m for m in models.values() if m.num_reg_images() >= 2]
    found.sort(key=lambda m: (-m.num_reg_images(), -m.num_points3D()))
    return BlindMapping(tuple(found))


def _incremental(
    database: Path, folder: Path, camera_count: int, fixed: bool, seed: int
) -> dict[int, pycolmap.Reconstruction]:
    options = pycolmap.IncrementalPipelineOptions()
    options.num_threads = 1
    options.random_seed = seed
    options.mapper.num_threads = 1
    options.mapper.random_seed = seed
    options.triangulation.random_seed = seed
    options.extract_colors = False
    options.multiple_models = True
    options.min_model_size = 3
    options.ba_refine_focal_length = not fixed
    options.ba_refine_extra_params = not fixed
    options.mapper.abs_pose_refine_focal_length = False
    options.mapper.abs_pose_refine_extra_params = False
    if fixed:
        options.constant_cameras = {k + 1 for k in range(camera_count)}
    return pycolmap.incremental_mapping(database, folder, folder / "incremental", options)


def _global(
    database: Path, folder: Path, camera_count: int, fixed: bool, seed: int
) -> dict[int, pycolmap.Reconstruction]:
    del camera_count
    options = pycolmap.GlobalPipelineOptions()
    options.num_threads = 1
    options.random_seed = seed
    options.min_model_size = 3
    options.mapper.num_threads = 1
    options.mapper.random_seed = seed
    options.mapper.bundle_adjustment.refine_focal_length = not fixed
    options.mapper.bundle_adjustment.refine_extra_params = not fixed
    options.mapper.bundle_adjustment.ceres.solver_options.num_threads = 1
    return pycolmap.global_mapping(database, folder, folder / "global", options)


def _write_database(
    path: Path,
    names: Sequence[str],
    features: Sequence[Features],
    cameras: Sequence[Intrinsics],
    camera_of: Sequence[int],
    pairs: Mapping[tuple[int, int], TwoView],
    fixed_intrinsics: bool,
) -> None:
    database = pycolmap.Database.open(path)
    try:
        for index, intrinsics in enumerate(cameras):
            camera = to_colmap_camera(intrinsics, index + 1)
            camera.has_prior_focal_length = fixed_intrinsics
            database.write_camera(camera, True)
            rig = pycolmap.Rig()
            rig.rig_id = index + 1
            rig.add_ref_sensor(pycolmap.sensor_t(pycolmap.SensorType.CAMERA, index + 1))
            database.write_rig(rig, True)
        for index, name in enumerate(names):
            image = pycolmap.Image(name=name, camera_id=camera_of[index] + 1, image_id=index + 1)
            database.write_image(image, True)
            frame = pycolmap.Frame()
            frame.frame_id = index + 1
            frame.rig_id = camera_of[index] + 1
            frame.add_data_id(image.data_id)
            database.write_frame(frame, True)
            database.write_keypoints(index + 1, features[index].keypoints[:, :2])
        for (i, j), pair in sorted(pairs.items()):
            if len(pair.inliers) == 0:
                continue
            database.write_matches(i + 1, j + 1, pair.inliers)
            database.write_two_view_geometry(i + 1, j + 1, _two_view_geometry(pair))
    finally:
        database.close()


def _two_view_geometry(pair: TwoView) -> pycolmap.TwoViewGeometry:
    geometry = pycolmap.TwoViewGeometry()
    geometry.config = pycolmap.TwoViewGeometryConfiguration(pair.config)
    geometry.F, geometry.E, geometry.H = pair.fundamental, pair.essential, pair.homography
    geometry.inlier_matches = pair.inliers
    return geometry
