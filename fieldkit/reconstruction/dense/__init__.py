"""Dense stereo: undistorted views with known poses in, depth maps and a fused cloud out."""

from __future__ import annotations

from collections.abc import Sequence

from fieldkit.cache import StageCache
from fieldkit.clouds.volume import Volume
from fieldkit.progress import Progress
from fieldkit.reconstruction.dense.depth_maps import compute_planes, to_depth_map
from fieldkit.reconstruction.dense.fusion import fuse
from fieldkit.reconstruction.dense.settings import Settings
from fieldkit.reconstruction.dense.views import DepthMap, View, prepare_view

__all__ = ["DepthMap", "Settings", "View", "compute_depth_maps", "fuse", "prepare_view"]


def compute_depth_maps(
    views: Sequence[View],
    volume: Volume,
    settings: Settings,
    *,
    seed: int,
    progress: Progress,
    cache: StageCache,
) -> list[DepthMap]:
    """The depth map of every view, by PatchMatch on the CPU, one thread."""
    found = compute_planes(views, volume, settings, seed=seed, progress=progress, cache=cache)
    return [to_depth_map(view, planes, volume) for view, planes in zip(views, found, strict=True)]
