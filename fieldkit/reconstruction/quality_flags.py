"""Findings about a finished reconstruction: results that are hardly those of the plot."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from fieldkit.clouds.cells import Stand, find_stand
from fieldkit.clouds.cloud import Cloud
from fieldkit.clouds.volume import Volume
from fieldkit.geometry import Pose
from fieldkit.reconstruction.plot_frame import cuts_plants
from fieldkit.reconstruction.result import MetricFrame
from fieldkit.results.finding import Finding
from fieldkit.results.frame import Plane
from fieldkit.wording import count

_FEW_POINTS = 100
_STEEP_DEG = 8.0
"""Fields that are worked by machines are rarely steeper than 15 %."""
_OFF_LEVEL_DEG = 15.0
_WEAK_SHARE = 0.05
_SIDEWAYS_DEG = 70.0
"""Pitch below which a camera's roll is hardly determined: it looks down."""
_LEAST_CAMERAS = 3
_AROUND_M = 0.10  # about the stand, in the bounds that are suggested


def quality_flags(
    name: str, plants: Cloud, volume: Volume, gsd_m: float, frame: MetricFrame, poses: Mapping[str, Pose], *,
    own_ground: bool, own_volume: bool = False,
) -> list[Finding]:  # fmt: skip
    """What speaks against a result, with the remedy.

    Args:
        plants: the plants' cloud, plot frame.
        gsd_m: metres per pixel at its centre.
        poses: of the photographs that count, plot frame.
        own_ground: whether the ground was found in these photographs.
    """
    ground = frame.ground
    found = [_few(len(plants)), _cut(volume) if cuts_plants(plants.points, volume, gsd_m) else None]
    if own_volume and frame.metric:
        found.append(_apart(find_stand(plants.points), volume))
    if ground is not None:
        found.append(_below(ground, volume))
        if own_ground:
            found += [_steep(ground) if frame.origin is not None else None, _weak(ground), _off_level(poses)]
    return [Finding(name, code, message) for code, message in filter(None, found)]


_Found = tuple[str, str] | None


def _few(points: int) -> _Found:
    if points >= _FEW_POINTS:
        return None
    return "few-plant-points", (
        f"the plants' cloud has only {count(points, 'point')}: hardly anything of them was reconstructed; look at the "
        "overview picture, and check --bounds and --mask"
    )


def _cut(volume: Volume) -> _Found:
    return "volume-cuts-plants", (
        f"the plants reach the top of the volume of interest (z = {volume.upper[2]:.2f} m) and are cut off there; "
        "give a higher one with --bounds"
    )


def _apart(stand: Stand | None, volume: Volume) -> _Found:
    if stand is None or stand.apart == 0.0:
        return None
    (x0, y0), (x1, y1) = stand.low, stand.high
    low = f"{x0 - _AROUND_M:.2f},{y0 - _AROUND_M:.2f},{volume.lower[2]:.2f}"
    high = f"{x1 + _AROUND_M:.2f},{y1 + _AROUND_M:.2f},{volume.upper[2]:.2f}"
    return "plants-apart", (
        f"{100 * (1 - stand.apart):.1f} % of the plants stand on {x1 - x0:.1f} × {y1 - y0:.1f} m, the rest apart on "
        f"{stand.reach[0]:.1f} × {stand.reach[1]:.1f} m: if those are weeds or neighbours, leave them out of the plot "
        f"and of plans for it with --bounds {low},{high}"
    )


def _below(ground: Plane, volume: Volume) -> _Found:
    top_m = float(ground.heights(volume.corners()).max())
    if top_m >= 0.0:
        return None
    return "volume-below-ground", (
        f"the volume of interest ends {-top_m:.1f} m below the ground that was found: one of the two is wrong; give "
        "--bounds about the plants, and check the heights of the photographs' positions"
    )


def _steep(ground: Plane) -> _Found:
    if ground.tilt_deg() <= _STEEP_DEG:
        return None
    return "steep-ground", (
        f"the ground came out {ground.tilt_deg():.0f}° from level; where the land is flatter, little of the soil "
        "was seen, and heights above it are wrong"
    )


def _weak(ground: Plane) -> _Found:
    if ground.inlier_share >= _WEAK_SHARE:
        return None
    return "weak-ground", (
        f"only {100 * ground.inlier_share:.0f} % of the points lie on the ground that was found: it may be none, and "
        "heights above it wrong; photograph some bare soil beside the plants"
    )


def _off_level(poses: Mapping[str, Pose]) -> _Found:
    """Cameras on a gimbal or a tripod are level, upright or turned by 90°."""
    angles = np.array([pose.yaw_pitch_roll_deg()[1:] for pose in poses.values()]).reshape(-1, 2)
    rolls = angles[np.abs(angles[:, 0]) < _SIDEWAYS_DEG, 1]
    if len(rolls) < _LEAST_CAMERAS:
        return None
    off = float(np.median(np.abs((rolls + 45.0) % 90.0 - 45.0)))
    if off <= _OFF_LEVEL_DEG:
        return None
    return "cameras-off-level", (
        f"the cameras are rolled by {off:.0f}° against the ground that was found (median); where they were level, the "
        "ground is wrong, and with it heights and the plot's axes: give positions in poses.csv, or --bounds"
    )
