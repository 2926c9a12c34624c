"""Findings about a finished reconstruction: results that are hardly those of the plot."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np
from scipy.spatial.distance import pdist

from fieldkit.captures.compared import groups_apart
from fieldkit.clouds.cells import find_stand
from fieldkit.clouds.cloud import Cloud
from fieldkit.clouds.ground import MAX_TILT_DEG
from fieldkit.clouds.volume import Volume
from fieldkit.geometry import Pose
from fieldkit.reconstruction.result import MetricFrame
from fieldkit.results.finding import PLOTS_TOGETHER, VOLUME_CUTS_PLANTS, Finding
from fieldkit.results.frame import Plane
from fieldkit.wording import count

_FEW_POINTS = 100
"""Number of points below which a plants' cloud is nearly empty."""
_STEEP_DEG = 8.0
"""Fields that are worked by machines are rarely steeper than 15 %."""
_NO_GROUND = (
    f"no ground was found: nothing level to {MAX_TILT_DEG:.0f}° stands out below the plants, so nothing was removed as "
    "ground, and heights are not known; photograph some bare soil beside the plants or between them"
)
_OFF_LEVEL_DEG = 15.0
"""Median roll from which a frame or camera stands askew, degrees."""
_WHERE = ("center", "forward")
_LEAST_DOWN = 0.1
"""Least sine by which an axis points down."""
_SIDEWAYS_DEG = 70.0
"""Pitch below which a camera's roll is hardly determined: it looks down."""
_LEAST_CAMERAS = 3
"""Least number of cameras whose rolls tell that."""
_CUT_LAYER = 0.005  # of the box's height
_CUT_POINTS = 20
"""Number of points in the volume's top layer from which it cuts plants."""
_AROUND_M = 0.10  # about the stand, in the bounds that are suggested


def quality_flags(
    name: str,
    plants: Cloud,
    volume: Volume,
    gsd_m: float,
    frame: MetricFrame,
    poses: Mapping[str, Pose],
    *,
    own_ground: bool,
    own_volume: bool = False,
) -> list[Finding]:
    """What speaks against a result, with the remedy.

    Args:
        plants: the plants' cloud, plot frame.
        gsd_m: metres per pixel at its centre.
        poses: of the photographs that count, plot frame.
        own_ground: whether the ground was looked for in these photographs.
    """
    flags = [*_of_plants(plants, volume, gsd_m, own_volume=own_volume and frame.metric)]
    if frame.ground is None and own_ground:
        flags.append(("no-ground", _NO_GROUND))
    elif frame.ground is not None:
        flags += _of_places(frame.ground, plants, poses) if own_volume and frame.metric else ()
        flags += _of_ground(frame.ground, volume, poses, own=own_ground, level=frame.origin is not None)
    return [Finding(name, code, message) for code, message in flags]


def _of_plants(plants: Cloud, volume: Volume, gsd_m: float, *, own_volume: bool) -> Iterator[tuple[str, str]]:
    if len(plants) < _FEW_POINTS:
        message = (
            f"the plants' cloud has only {count(len(plants), 'point')}: hardly anything of them was reconstructed; "
            "look at the overview picture, and check --bounds and --mask"
        )
        yield "few-plant-points", message
    layer = max(_CUT_LAYER * (volume.upper[2] - volume.lower[2]), 2.0 * gsd_m)
    if np.count_nonzero(plants.points[:, 2] > volume.upper[2] - layer) >= _CUT_POINTS:
        message = (
            f"the plants reach the top of the volume of interest (z = {volume.upper[2]:.2f} m) and are cut off "
            "there; give a higher one with --bounds"
        )
        yield VOLUME_CUTS_PLANTS, message
    stand = find_stand(plants.points) if own_volume else None
    if stand is not None and stand.apart > 0.0:
        (x0, y0), (x1, y1) = stand.low, stand.high
        low = f"{x0 - _AROUND_M:.2f},{y0 - _AROUND_M:.2f},{volume.lower[2]:.2f}"
        high = f"{x1 + _AROUND_M:.2f},{y1 + _AROUND_M:.2f},{volume.upper[2]:.2f}"
        message = (
            f"{100 * (1 - stand.apart):.1f} % of the plants stand on {x1 - x0:.1f} × {y1 - y0:.1f} m, the rest "
            f"apart on {stand.reach[0]:.1f} × {stand.reach[1]:.1f} m: if those are weeds or neighbours, leave them "
            f"out of the plot and of plans for it with --bounds {low},{high}"
        )
        yield "plants-apart", message


def _of_places(ground: Plane, plants: Cloud, poses: Mapping[str, Pose]) -> Iterator[tuple[str, str]]:
    """That cameras look at places, halfway up the plants, which are farther apart than they are from these."""
    centers, axes = (np.array([getattr(p, what) for p in poses.values()]).reshape(-1, 3) for what in _WHERE)
    down = axes @ np.negative(ground.normal)
    above = ground.heights(centers) - np.median(ground.heights(plants.points))
    away = above[down > _LEAST_DOWN] / down[down > _LEAST_DOWN]
    looked_at = centers[down > _LEAST_DOWN] + away[:, None] * axes[down > _LEAST_DOWN]
    middles = groups_apart(looked_at[:, :2], float(np.median(away)) if len(away) else 0.0)
    if len(middles):
        message = (
            f"the photographs look at {len(middles)} places, {pdist(middles).min():.1f} m apart and more, as of so "
            "many plots, and were reconstructed as one; give the plots' outlines with `fieldkit evaluate --plots`, or "
            "let `campaign init` and `evaluate --campaign` sort the photographs"
        )
        yield PLOTS_TOGETHER, message


def _of_ground(
    ground: Plane, volume: Volume, poses: Mapping[str, Pose], *, own: bool, level: bool
) -> Iterator[tuple[str, str]]:
    """Of a ground, found in the photographs that are reconstructed (``own``), in a frame whose z is up (``level``)."""
    top_m = float(ground.heights(volume.corners()).max())
    if top_m < 0.0:
        message = (
            f"the volume of interest ends {-top_m:.1f} m below the ground that was found: one of the two is wrong; "
            "give --bounds about the plants, and check the heights of the photographs' positions"
        )
        yield "volume-below-ground", message
    if not own:
        return
    if level and ground.tilt_deg() > _STEEP_DEG:
        message = (
            f"the ground came out {ground.tilt_deg():.0f}° from level; where the land is flatter, little of the "
            "soil was seen, and heights above it are wrong"
        )
        yield "steep-ground", message
    # Cameras on a gimbal or a tripod are level, upright or turned by 90°.
    angles = np.array([pose.yaw_pitch_roll_deg()[1:] for pose in poses.values()]).reshape(-1, 2)
    rolls = angles[np.abs(angles[:, 0]) < _SIDEWAYS_DEG, 1]
    off = float(np.median(np.abs((rolls + 45.0) % 90.0 - 45.0))) if len(rolls) >= _LEAST_CAMERAS else 0.0
    if off > _OFF_LEVEL_DEG:
        message = (
            f"the cameras are rolled by {off:.0f}° against the ground that was found (median); where they were "
            "level, the ground is wrong, and with it heights and the plot's axes: give positions in poses.csv, "
            "or --bounds"
        )
        yield "cameras-off-level", message
