"""Mean absolute error of depth images, in the two countings that are in use."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray


@dataclass(frozen=True)
class DepthError:
    """Mean absolute depth error (MAE) of one depth image or several."""

    mae_common_m: float
    """Mean of |estimate − reference| over the pixels where both have a depth; NaN where none has. It says how precise
    the depths are and nothing about how many there are."""
    mae_whole_m: float
    """Mean of |estimate − reference| over every pixel, where a missing depth counts as 0, the value an empty pixel has
    in a depth image. A pixel the estimate lacks costs the reference's whole depth, and a depth where the reference has
    none costs itself. NaN for images without pixels."""
    pixels: int
    reference_pixels: int
    """Pixels where the reference has a depth."""
    common_pixels: int
    """Pixels where both have one."""


def depth_mae(reference: ArrayLike, estimate: ArrayLike) -> DepthError:
    """Both mean absolute errors of depth images (…, H, W) in metres; 0, NaN and infinity mean "no depth".

    BOSfM reports the MAE "of the depth images" with the ground in them, about 1.0 to 1.16 m for scenes of that
    order in depth. Depths that exist are wrong by millimetres to centimetres, so figures that large can only come
    from pixels without a depth taking part as zeros: `DepthError.mae_whole_m` counts as the paper must have.
    """
    truth, guess = _depths(reference), _depths(estimate)
    if truth.shape != guess.shape:
        raise ValueError(f"depth images of the shapes {truth.shape} and {guess.shape} cannot be compared")
    common = (truth > 0) & (guess > 0)
    difference = np.abs(guess - truth)
    return DepthError(
        mae_common_m=_mean(float(difference[common].sum()), int(common.sum())),
        mae_whole_m=_mean(float(difference.sum()), truth.size),
        pixels=truth.size,
        reference_pixels=int((truth > 0).sum()),
        common_pixels=int(common.sum()),
    )


def pooled_depth_error(errors: Sequence[DepthError]) -> DepthError:
    """The error over several images of any size, every pixel weighing the same."""
    common, pixels = sum(e.common_pixels for e in errors), sum(e.pixels for e in errors)
    return DepthError(
        mae_common_m=_mean(sum(e.mae_common_m * e.common_pixels for e in errors if e.common_pixels), common),
        mae_whole_m=_mean(sum(e.mae_whole_m * e.pixels for e in errors if e.pixels), pixels),
        pixels=pixels,
        reference_pixels=sum(e.reference_pixels for e in errors),
        common_pixels=common,
    )


def _depths(values: ArrayLike) -> NDArray[np.float64]:
    depths = np.nan_to_num(np.asarray(values, dtype=np.float64), nan=0.0, posinf=0.0, neginf=-1.0)
    if depths.size and depths.min() < 0:
        raise ValueError("depths must not be negative")
    return depths


def _mean(total: float, count: int) -> float:
    return total / count if count else float("nan")
