"""Dense stereo on an NVIDIA GPU: pycolmap-cuda12's patch_match_stereo and stereo_fusion in a COLMAP workspace.

Without a device `patch_match_stereo` aborts the whole process, so nothing here calls it before `cuda_devices` has
been asked.

The workspace (colmap.github.io/format.html#dense-reconstruction):

    images/NAME.png              the views
    sparse/                      cameras and poses, and points that say which images overlap
    stereo/patch-match.cfg       source views of each view
    stereo/fusion.cfg            views to fuse
    stereo/depth_maps/NAME.png.geometric.bin, stereo/normal_maps/…
    masks/NAME.png.png           black where nothing is to be fused
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fieldkit.cache import StageCache
from fieldkit.clouds.cloud import Cloud
from fieldkit.clouds.thinning import voxel_thin
from fieldkit.clouds.volume import Volume, crop
from fieldkit.errors import ReconstructionError, UsageError
from fieldkit.reconstruction.dense.fusion import ground_sampling_distance
from fieldkit.reconstruction.dense.settings import Settings
from fieldkit.reconstruction.dense.source_views import choose_sources
from fieldkit.reconstruction.dense.views import DepthMap, View
from fieldkit.runtime.progress import Progress

_GRID = 6
"""Points along each edge of the volume that tell COLMAP which images overlap."""


def cuda_devices() -> int:
    """CUDA devices that pycolmap can use; 0 for a build without CUDA, whatever it says of itself."""
    from fieldkit.reconstruction.colmap import pycolmap

    count = getattr(pycolmap, "get_num_cuda_devices", None)
    return int(count()) if pycolmap.has_cuda and count is not None else 0


class Cuda:
    """COLMAP's dense stereo on the GPU."""

    name = "cuda"

    def compute_depth_maps(
        self,
        views: Sequence[View],
        volume: Volume,
        settings: Settings,
        *,
        seed: int,
        progress: Progress,
        cache: StageCache,
        workers: int = 1,
    ) -> list[DepthMap]:
        """COLMAP's geometrically filtered depth maps; it keeps no costs, so they are 0 where there is a depth.

        COLMAP draws its random numbers itself: ``seed`` has no effect, nothing is cached,
        and ``workers`` are not used.

        Raises:
            UsageError: there is no CUDA device.
            ReconstructionError: COLMAP failed.
        """
        if cuda_devices() == 0:
            raise UsageError("there is no CUDA device", remedy="Choose --backend cpu.")
        from fieldkit.reconstruction.colmap import pycolmap

        if not views:
            return []
        names = _file_names(views)
        with tempfile.TemporaryDirectory(prefix="fieldkit-dense-") as folder:
            workspace = Path(folder)
            write_workspace(workspace, views, volume, settings)
            with progress.stage("depth maps (cuda)"):
                try:
                    pycolmap.patch_match_stereo(str(workspace), options=patch_match_options(views, volume))
                except RuntimeError as error:
                    raise ReconstructionError(
                        f"COLMAP's dense stereo failed: {error}", remedy="Choose --backend cpu."
                    ) from error
            return [_read_maps(workspace, view, name) for view, name in zip(views, names, strict=True)]

    def fuse(self, views: Sequence[View], depth_maps: Sequence[DepthMap], volume: Volume, settings: Settings) -> Cloud:
        """Fusion by COLMAP, with its rule set to the nearest it has to ours; needs no GPU.

        Raises:
            ReconstructionError: COLMAP failed.
        """
        from fieldkit.reconstruction.colmap import pycolmap

        if not views:
            return Cloud.empty()
        with tempfile.TemporaryDirectory(prefix="fieldkit-dense-") as folder:
            workspace = Path(folder)
            write_workspace(workspace, views, volume, settings)
            write_maps(workspace, views, depth_maps, settings)
            fused = workspace / "fused.ply"
            try:
                pycolmap.stereo_fusion(
                    str(fused),
                    str(workspace),
                    input_type="geometric",
                    options=fusion_options(workspace, views, volume, settings),
                    output_type="ply",
                )
            except RuntimeError as error:
                raise ReconstructionError(f"COLMAP's fusion failed: {error}", remedy="Choose --backend cpu.") from error
            return _read_cloud(fused, views, volume, settings)


def patch_match_options(views: Sequence[View], volume: Volume) -> Any:
    """pycolmap.PatchMatchOptions with the depths between which the volume lies, over all views."""
    from fieldkit.reconstruction.colmap import pycolmap

    near, far = _depths(views, volume)
    options = pycolmap.PatchMatchOptions()
    options.depth_min, options.depth_max = near, far
    options.geom_consistency = True
    options.filter = True
    options.num_threads = 1
    return options


def fusion_options(workspace: Path, views: Sequence[View], volume: Volume, settings: Settings) -> Any:
    """pycolmap.StereoFusionOptions that come nearest to `Settings`' rule (COLMAP counts the view itself)."""
    from fieldkit.reconstruction.colmap import pycolmap

    options = pycolmap.StereoFusionOptions()
    options.num_threads = 1
    options.min_num_pixels = settings.min_agreeing + 1
    options.max_reproj_error = settings.max_reprojection_px
    options.max_depth_error = settings.max_relative_depth
    options.check_num_images = settings.fusion_neighbors
    options.bounding_box = (np.array(volume.lower, dtype=np.float32), np.array(volume.upper, dtype=np.float32))
    if any(view.mask is not None for view in views):
        options.mask_path = str(workspace / "masks")
    return options


def write_workspace(workspace: Path, views: Sequence[View], volume: Volume, settings: Settings) -> None:
    """Write images, masks, the sparse model and the lists of source views."""
    import cv2

    names = _file_names(views)
    for folder in ("images", "masks", "sparse", "stereo/depth_maps", "stereo/normal_maps", "stereo/consistency_graphs"):
        (workspace / folder).mkdir(parents=True, exist_ok=True)
    for view, name in zip(views, names, strict=True):
        _write_png(workspace / "images" / name, cv2.cvtColor(view.image, cv2.COLOR_RGB2BGR))
        if view.mask is not None:
            _write_png(workspace / "masks" / f"{name}.png", view.mask.astype(np.uint8) * 255)
    _sparse_model(views, names, volume).write(str(workspace / "sparse"))
    lines = []
    for name, sources in zip(names, choose_sources(views, volume, settings), strict=True):
        if sources:
            lines += [name, ", ".join(names[j] for j in sources)]
    (workspace / "stereo" / "patch-match.cfg").write_text("\n".join(lines) + "\n", encoding="utf-8")
    (workspace / "stereo" / "fusion.cfg").write_text("\n".join(names) + "\n", encoding="utf-8")


def write_maps(workspace: Path, views: Sequence[View], depth_maps: Sequence[DepthMap], settings: Settings) -> None:
    """Write depth and normal maps as COLMAP reads them (normals in the camera's frame)."""
    for view, found, name in zip(views, depth_maps, _file_names(views), strict=True):
        kept = (found.depth > 0) & (found.cost < settings.max_cost)
        depth = np.where(kept, found.depth, np.float32(0.0)).astype(np.float32)
        normal = (found.normal @ view.pose.rotation.T).astype(np.float32)
        normal[~kept] = 0.0
        stereo = workspace / "stereo"
        write_array(stereo / "depth_maps" / f"{name}.geometric.bin", depth)
        write_array(stereo / "normal_maps" / f"{name}.geometric.bin", normal)


def write_array(path: Path, array: NDArray[np.float32]) -> None:
    """Write (H, W) or (H, W, C) float32 as COLMAP's dense maps: `W&H&C&`, then channel by channel, row by row.

    pycolmap.NormalMap.from_array (4.2) writes the channels of each pixel together, which COLMAP then reads wrongly.
    """
    planes = array[..., None] if array.ndim == 2 else array
    height, width, channels = planes.shape
    body = np.ascontiguousarray(planes.transpose(2, 0, 1), dtype="<f4").tobytes()
    path.write_bytes(f"{width}&{height}&{channels}&".encode() + body)


def read_array(path: Path) -> NDArray[np.float32]:
    """Read one of COLMAP's dense maps as (H, W) or (H, W, C) float32.

    Raises:
        ReconstructionError: the file is not such a map.
    """
    data = path.read_bytes()
    parts = data[:64].split(b"&", 3)
    try:
        width, height, channels = (int(part) for part in parts[:3])
        start = sum(len(part) + 1 for part in parts[:3])
        planes = np.frombuffer(data, dtype="<f4", offset=start).reshape(channels, height, width)
    except ValueError as error:
        raise ReconstructionError("not a COLMAP depth or normal map", path=path) from error
    array = np.ascontiguousarray(planes.transpose(1, 2, 0), dtype=np.float32)
    return array[..., 0] if channels == 1 else array


def _read_maps(workspace: Path, view: View, name: str) -> DepthMap:
    shape = view.image.shape[:2]
    path = workspace / "stereo" / "depth_maps" / f"{name}.geometric.bin"
    if not path.exists():  # a view without source views
        zero = np.zeros(shape, dtype=np.float32)
        return DepthMap(view.name, zero, np.zeros((*shape, 3), np.float32), np.full(shape, np.inf, np.float32))
    depth = read_array(path)
    if view.mask is not None:
        depth[~view.mask] = 0.0
    found = depth > 0
    camera_normal = read_array(workspace / "stereo" / "normal_maps" / f"{name}.geometric.bin")
    normal = camera_normal @ view.pose.rotation.astype(np.float32)
    normal[~found] = 0.0
    return DepthMap(view.name, depth, normal, np.where(found, np.float32(0.0), np.float32(np.inf)))


def _read_cloud(path: Path, views: Sequence[View], volume: Volume, settings: Settings) -> Cloud:
    from fieldkit.clouds.ply import read_ply

    cloud = crop(read_ply(path), volume) if path.exists() else Cloud.empty()
    if settings.thin_gsd > 0 and len(cloud):
        cloud = voxel_thin(cloud, settings.thin_gsd * ground_sampling_distance(views, volume))
    return cloud


def _sparse_model(views: Sequence[View], names: Sequence[str], volume: Volume) -> Any:
    """Cameras and poses, with a grid over the volume as points: COLMAP counts shared points to find overlap."""
    from fieldkit.reconstruction.colmap import pycolmap

    edges = [np.linspace(0.5 / _GRID, 1 - 0.5 / _GRID, _GRID)] * 3
    points = np.stack(np.meshgrid(*edges, indexing="ij"), axis=-1).reshape(-1, 3) * volume.size + volume.lower
    model = pycolmap.Reconstruction()
    tracks: list[list[Any]] = [[] for _ in points]
    for i, (view, name) in enumerate(zip(views, names, strict=True), start=1):
        camera = view.intrinsics
        params = [camera.fx, camera.fy, camera.cx, camera.cy]
        model.add_camera_with_trivial_rig(
            pycolmap.Camera(model="PINHOLE", width=camera.width, height=camera.height, params=params, camera_id=i)
        )
        pixels = camera.project(view.pose.to_camera(points))
        with np.errstate(invalid="ignore"):
            seen = np.flatnonzero(((pixels >= 0) & (pixels <= (camera.width, camera.height))).all(axis=1))
        keypoints = pixels[seen] if len(seen) else np.zeros((0, 2))
        image = pycolmap.Image(name=name, keypoints=keypoints, camera_id=i, image_id=i)
        world = np.concatenate([view.pose.rotation, view.pose.translation[:, None]], axis=1)
        model.add_image_with_trivial_frame(image, pycolmap.Rigid3d(world))
        for place, point in enumerate(seen):
            tracks[point].append(pycolmap.TrackElement(i, place))
    for point, elements in zip(points, tracks, strict=True):
        if len(elements) > 1:
            model.add_point3D(point, pycolmap.Track(elements))
    return model


def _depths(views: Sequence[View], volume: Volume) -> tuple[float, float]:
    """Smallest and largest depth of the volume's corners over all views, metres; at least 5 % of the largest."""
    depths = np.concatenate([view.pose.to_camera(volume.corners())[:, 2] for view in views])
    far = max(float(depths.max()), 1e-3)
    return max(float(depths.min()), 0.05 * far), far


def _file_names(views: Sequence[View]) -> list[str]:
    """File names without folders, in the views' order; the views' own names may be paths in any script."""
    digits = max(4, math.ceil(math.log10(len(views) + 1)))
    return [f"{i:0{digits}d}.png" for i in range(len(views))]


def _write_png(path: Path, image: NDArray[Any]) -> None:
    import cv2

    ok, data = cv2.imencode(".png", image, [cv2.IMWRITE_PNG_COMPRESSION, 1])
    if not ok:
        raise ReconstructionError("an image of the workspace could not be encoded", path=path)
    path.write_bytes(data.tobytes())
