"""Point clouds: files, metrics, alignment, thinning, ground and the volume of interest."""

from fieldkit.clouds.alignment import icp
from fieldkit.clouds.cells import voxel_thin
from fieldkit.clouds.cloud import Cloud, concatenate
from fieldkit.clouds.ground import fit_ground_plane
from fieldkit.clouds.las import read_las, write_las
from fieldkit.clouds.metrics import (
    CloudScore,
    ReferenceIndex,
    nearest_distances,
    score,
    score_distances,
)
from fieldkit.clouds.neighbors import PointIndex
from fieldkit.clouds.ply import read_cloud, read_ply, write_cloud, write_ply
from fieldkit.clouds.volume import Volume, crop

__all__ = [
    "Cloud",
    "CloudScore",
    "PointIndex",
    "ReferenceIndex",
    "Volume",
    "concatenate",
    "crop",
    "fit_ground_plane",
    "icp",
    "nearest_distances",
    "read_cloud",
    "read_las",
    "read_ply",
    "score",
    "score_distances",
    "voxel_thin",
    "write_cloud",
    "write_las",
    "write_ply",
]
