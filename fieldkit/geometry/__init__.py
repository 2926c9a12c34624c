"""Poses, intrinsics, similarities and the plot frame: values and pure functions, no I/O."""

from fieldkit.geometry.intrinsics import Intrinsics
from fieldkit.geometry.pose import Pose
from fieldkit.geometry.similarity import Similarity

__all__ = ["Intrinsics", "Pose", "Similarity"]
