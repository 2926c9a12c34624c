"""Which photographs of a pattern show a block's plot."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely
import shapely.affinity

from fieldkit.clouds.volume import Volume
from fieldkit.geometry import Intrinsics, Pose
from fieldkit.planning.patterns.block import ROWS_DEG, Block
from fieldkit.reconstruction.dense.views import views_of
from fieldkit.results.pattern import Pattern
from fieldkit.routing.passes import lines_over

_BESIDE_M = 0.15
"""Room beside the plot's outline, metres."""
_ABOVE_M = 0.3
"""Room above its plants, metres."""
_REACH = 0.8
"""How far beside the plot photographs look at most that may show it well, in heights above the ground."""


def poses_about(pattern: Pattern, block: Block, camera: Intrinsics, phase: Sequence[float]) -> list[Pose]:
    """Photographs of a pattern over a large field that have the middle of a block's plot in the picture.

    Args:
        phase: by which lines lie beside the plot, (2,) shares of their spacings.
    """
    plot = shapely.Polygon(block.outline)
    middle = np.array([*plot.centroid.coords[0], 0.5 * block.height_m])
    shift = np.asarray(phase) * (pattern.along_m, pattern.between_m)
    reach = _REACH * pattern.height_m + max(pattern.along_m, pattern.between_m)
    field = shapely.affinity.translate(plot.envelope.buffer(reach, join_style="mitre"), *shift)
    poses = []
    for line in lines_over(pattern, field, ROWS_DEG):
        turned = Pose.from_yaw_pitch(middle, line.yaw_deg, line.pitch_deg).rotation
        seen = camera.sees((middle - line.stations_m) @ turned.T)
        poses += [Pose(turned, place) for place in line.stations_m[seen]]
    return poses


def plot_volume(block: Block) -> Volume:
    """Of a block's plot, with room about it."""
    low, high = np.min(block.outline, axis=0) - _BESIDE_M, np.max(block.outline, axis=0) + _BESIDE_M
    return Volume((*low, 0.03), (*high, block.height_m + _ABOVE_M))


def showing(poses: Sequence[Pose], camera: Intrinsics, volume: Volume, most: int) -> list[Pose]:
    """Those that show a volume best, in the order of flight."""
    names = {f"{k:06d}": pose for k, pose in enumerate(poses)}
    return [names[name] for name in sorted(views_of(names, dict.fromkeys(names, camera), volume, most))]
