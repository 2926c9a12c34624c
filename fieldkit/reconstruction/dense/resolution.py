"""How finely dense stereo works: sizes of views by the ground sampling distance (GSD) at the plants."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from fieldkit.clouds.volume import Volume
from fieldkit.geometry import Intrinsics, Pose
from fieldkit.reconstruction.dense.views import depth_range
from fieldkit.vocabulary import GSD_M, Fidelity

MOST_PIXELS: Mapping[Fidelity, int] = MappingProxyType(
    {"draft": 1_500_000, "standard": 3_000_000, "fine": 6_000_000, "full": 6_000_000}
)
"""Of a view. A drone's wide-angle camera has a GSD of 1 mm with six million from 2.5 m, finer than `fine`; at 40
bytes a pixel ten views take 2.4 GB, and at 9 CPU s a megapixel of plants minutes. Of a plot from 8 m, twenty views of
three million show more than twelve of six, in less time."""
SMALL_M = 1.0
"""In a volume whose diagonal is shorter, of seedlings or a pot plant, the wanted GSD is shorter in proportion."""
PLANTS_M2 = 0.1
"""Plants that cover less in a photograph get as many pixels as if they covered so much."""
_MOST_FINER_PIXELS = 48_000_000
"""Of all views together, which are taken more finely for that."""
UNSCALED_M = 2.0, 1.5
"""What a photograph is taken to cover at the plants where nothing gives the scale."""
_STEPS = 8
"""Views are reduced in steps of 2^(1/8), so that the last digits of a pose change neither a view nor its random
numbers."""
_RAYS = (24, 18)
"""Columns and rows of the rays by which the plants' depth is taken."""


class Resolution(NamedTuple):
    """A view's size."""

    size: tuple[int, int]
    """Width and height, pixels."""
    gsd_m: float
    """At the plants."""
    capped: bool
    """Whether `MOST_PIXELS` makes it coarser than wanted."""


def steps_finer(shares: Sequence[float], sizes: Sequence[tuple[int, int]], fidelity: Fidelity) -> int:
    """By how many steps views are taken more finely than their fidelity asks for, since plants fill few pixels.

    ``shares`` are what plants fill of photographs, ``sizes`` those of all views, as their fidelity asks for.
    """
    pixels = sum(width * height for width, height in sizes)
    plants = float(np.median(shares)) * pixels / len(sizes) if shares else 0.0
    if not plants or not GSD_M[fidelity]:
        return 0
    times = min(PLANTS_M2 / GSD_M[fidelity] ** 2 / plants, _MOST_FINER_PIXELS / pixels)
    return max(0, math.floor(0.5 * _STEPS * math.log2(times)))


def resolution(
    size: tuple[int, int],
    camera: Intrinsics,
    pose: Pose,
    volume: Volume,
    fidelity: Fidelity,
    *,
    metric: bool = True,
    finer: int = 0,
) -> Resolution:
    """The size at which dense stereo takes a photograph; never finer than the photograph itself.

    Args:
        size: of the photograph, pixels.
        camera: at any size of the same aspect ratio.
        volume: of interest, as `plant_depth_m` takes it.
        metric: whether lengths are metres; else every photograph is taken to cover `UNSCALED_M`.
        finer: steps of `steps_finer`.
    """
    width, height = size
    if metric:
        own_m = pixel_m(camera, pose, volume, width)
        wanted_m = GSD_M[fidelity] * min(1.0, volume.diagonal / SMALL_M)
    else:
        own_m, wanted_m = math.sqrt(math.prod(UNSCALED_M) / (width * height)), GSD_M[fidelity]
    steps = max(0, round(_STEPS * math.log2(wanted_m / own_m)) - finer) if wanted_m else 0
    largest, wanted = (math.ceil(0.5 * _STEPS * math.log2(width * height / MOST_PIXELS[f])) for f in ("full", fidelity))
    least = max(0, largest, wanted - finer)
    scale = 2.0 ** (-max(steps, least) / _STEPS)
    reduced = max(1, round(width * scale)), max(1, round(height * scale))
    return Resolution(reduced, own_m / scale, least > steps)


def pixel_m(camera: Intrinsics, pose: Pose, volume: Volume, width: int) -> float:
    """Length that a pixel of a view so many pixels wide covers at the plants (`plant_depth_m`), metres."""
    return plant_depth_m(camera, pose, volume) * camera.width / (camera.fx * width)


def plant_depth_m(camera: Intrinsics, pose: Pose, volume: Volume) -> float:
    """Depth along the optical axis at which a view meets the plants.

    The median over its rays of the middle of their way through the volume: of a long plot seen from one end what fills
    the picture counts, not the plot's middle. The distance to the volume's centre where no ray meets it.
    """
    near, far = depth_range(camera.without_distortion().scaled(*_RAYS), pose, volume)
    met = far > near
    if not met.any():
        return float(np.linalg.norm(volume.center - pose.center))
    return float(np.median(0.5 * (near[met] + far[met])))
