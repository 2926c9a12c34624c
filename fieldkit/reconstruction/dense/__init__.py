"""Dense stereo: undistorted views with known poses in, depth maps and a fused cloud out.

views = [prepare_view(...), ...]
maps = compute_depth_maps(views, volume, seed=0, context=Context())
cloud, scatter_px = fuse(views, maps, volume)
"""

from fieldkit.reconstruction.dense.depth_maps import compute_depth_maps
from fieldkit.reconstruction.dense.fusion import fuse
from fieldkit.reconstruction.dense.resolution import resolution
from fieldkit.reconstruction.dense.views import DepthMap, View, prepare_view

__all__ = ["DepthMap", "View", "compute_depth_maps", "fuse", "prepare_view", "resolution"]
