"""Dense stereo: undistorted views with known poses in, depth maps and a fused cloud out.

    views = [prepare_view(...), ...]
    backend = select_backend("auto")
    maps = backend.compute_depth_maps(views, volume, Settings(), seed=0, progress=Silent(), cache=StageCache(None))
    cloud = backend.fuse(views, maps, volume, Settings())

`compute_depth_maps` and `fuse` of this package are those of the backend `cpu`.
"""

from fieldkit.reconstruction.dense.backends import Backend, select_backend
from fieldkit.reconstruction.dense.depth_maps import compute_depth_maps
from fieldkit.reconstruction.dense.fusion import fuse
from fieldkit.reconstruction.dense.settings import Settings
from fieldkit.reconstruction.dense.views import DepthMap, View, prepare_view, working_size

__all__ = [
    "Backend",
    "DepthMap",
    "Settings",
    "View",
    "compute_depth_maps",
    "fuse",
    "prepare_view",
    "select_backend",
    "working_size",
]
