"""The baseline: pycolmap with its defaults, then OpenCV's semi-global matching.

It differs from the defaults by one thread, fixed seeds and the calibrated camera instead of self-calibration; this
favours it or makes the comparison possible.
"""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from pathlib import Path

import pycolmap

from benchmarks.sgbm import sgbm_depth_maps
from fieldkit.captures import read_image
from fieldkit.captures.model import Capture
from fieldkit.clouds import Cloud
from fieldkit.geometry import Intrinsics, Pose
from fieldkit.reconstruction.agreement import align_to_positions, judge
from fieldkit.reconstruction.colmap_model import model_poses
from fieldkit.reconstruction.dense import fuse, prepare_view, resolution
from fieldkit.reconstruction.known_poses import known_poses
from fieldkit.reconstruction.pipeline import KnownPlot
from fieldkit.reconstruction.stages import StageTimer
from fieldkit.runtime.progress import Progress

LEAST_POSES = 3
"""Fewer poses give no dense cloud: a depth counts if two other views agree."""


class Baseline:
    """A run of the baseline; ``stages`` then holds the CPU seconds by stage.

    Args:
        capture: with a calibrated camera and known positions.
        intrinsics: that camera.
        plot: frame, volume and ground.
    """

    def __init__(self, capture: Capture, intrinsics: Intrinsics, plot: KnownPlot, progress: Progress) -> None:
        self._capture, self._intrinsics, self._plot = capture, intrinsics, plot
        self._timer = StageTimer(progress)
        self.registered = 0
        self.right = 0

    @property
    def stages(self) -> dict[str, float]:
        """CPU seconds."""
        return {time.name: time.cpu_s for time in self._timer.times({})}

    def poses(self) -> dict[str, Pose]:
        """Poses, in the plot frame, of the photographs that agree with the known positions."""
        with tempfile.TemporaryDirectory(prefix="fieldkit-") as folder:
            model = self._map(Path(folder))
        if model is None:
            return {}
        found = model_poses(model)
        self.registered = len(found)
        known = known_poses(self._capture, self._plot.source).by_name
        similarity = align_to_positions(found, known, seed=0)
        if similarity is None:
            return {}
        aligned = {name: similarity.apply_pose(pose) for name, pose in found.items()}
        right = {name: pose for name, pose in aligned.items() if judge(pose, known.get(name)).right is not False}
        self.right = len(right)
        return right

    def cloud(self, poses: Mapping[str, Pose]) -> Cloud:
        """The cloud of SGBM's depth maps at the size of `standard`, masked and fused like ours."""
        volume = self._plot.volume
        with self._timer.stage("Undistortion"):
            views = [
                prepare_view(
                    photo.name,
                    read_image(photo),
                    self._intrinsics,
                    poses[photo.name],
                    resolution(
                        (photo.width, photo.height), self._intrinsics, poses[photo.name], volume, "standard"
                    ).size,
                )
                for photo in self._capture.photos
                if photo.name in poses
            ]
        with self._timer.stage("Dense stereo"):
            maps = sgbm_depth_maps(views, volume)
        with self._timer.stage("Fusion"):
            return fuse(views, maps, volume)[0]

    def _map(self, folder: Path) -> pycolmap.Reconstruction | None:
        database, images = folder / "database.db", self._capture.image_folder
        names = list(self._capture.names)
        reader = pycolmap.ImageReaderOptions()
        reader.camera_model = self._intrinsics.model
        reader.camera_params = ",".join(repr(float(p)) for p in self._intrinsics.params)
        extraction, matching = pycolmap.FeatureExtractionOptions(), pycolmap.FeatureMatchingOptions()
        extraction.num_threads = matching.num_threads = 1
        extraction.use_gpu = matching.use_gpu = False
        verification = pycolmap.TwoViewGeometryOptions()
        verification.ransac.random_seed = 0
        pycolmap.set_random_seed(0)
        with self._timer.stage("Features"):
            pycolmap.extract_features(
                database, images, names, pycolmap.CameraMode.SINGLE, reader, extraction, pycolmap.Device.cpu
            )
        with self._timer.stage("Matching"):
            pycolmap.match_exhaustive(database, matching, verification_options=verification, device=pycolmap.Device.cpu)
        options = pycolmap.IncrementalPipelineOptions()
        options.num_threads = options.mapper.num_threads = 1
        options.random_seed = options.mapper.random_seed = options.triangulation.random_seed = 0
        options.ba_refine_focal_length = options.ba_refine_extra_params = False
        with self._timer.stage("Mapping"):
            models = pycolmap.incremental_mapping(database, images, folder / "models", options)
        return max(models.values(), key=lambda m: (m.num_reg_images(), m.num_points3D()), default=None)
