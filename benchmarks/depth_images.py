"""Depth images of a set's reconstruction, ground included, against those of the true scene."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from fieldkit.arrays import Float32Array, FloatArray
from fieldkit.clouds.volume import Volume
from fieldkit.errors import ReconstructionError
from fieldkit.geometry import Intrinsics, Pose
from fieldkit.planning.objective.objective import FIDELITIES
from fieldkit.planning.objective.simulated import Proxy, SimulatedSource
from fieldkit.planning.space.cameras import Cameras
from fieldkit.reconstruction.pipeline import reconstruct
from fieldkit.reconstruction.settings import ReconstructionSettings
from fieldkit.runtime.context import Context
from fieldkit.runtime.progress import Silent
from fieldkit.scenes.renderer import Renderer

_WIDTH = 320
"""Width of the compared images, pixels: a cloud at standard has several points for each."""
_AROUND_M, _BELOW_M = 0.5, 0.1


def depth_error(source: SimulatedSource, cameras: Cameras, seed: int) -> DepthError:
    """Errors of depth images seen by the cameras themselves, pooled over them.

    Plants and soil are reconstructed at standard up to half a metre about the volume of interest; the true images have
    no depth beyond it either. A pixel's depth is that of the nearest point in it; a pixel without points has none.

    Args:
        source: photographs with exact poses.
        cameras: N of them.
        seed: of the photographs' noise.

    Returns:
        Errors in metres. If nothing was reconstructed, no pixel has a depth.
    """
    fidelity = FIDELITIES["standard"]
    proxy = source.proxy
    camera, volume = _reduced(proxy.camera), _with_ground(proxy)
    points = np.zeros((0, 3))
    with source.photograph(cameras, fidelity, seed, Silent()) as shot:
        wanted = ReconstructionSettings(
            features=shot.features,
            mapping="prior",
            fidelity=fidelity.dense,
            mask="none",
            bounds=volume,
            trust_orientations=True,
        )
        try:
            found = reconstruct(shot.capture, wanted, known_plot=source.plot, context=Context(source.cache))
            points = found.nearby.points
        except ReconstructionError:
            pass
    with Renderer(proxy.scene) as renderer:
        return pooled_depth_error(
            [
                depth_mae(
                    _within(renderer.depth(pose, camera), pose, camera, volume), depth_image(points, pose, camera)
                )
                for pose in cameras.poses()
            ]
        )


def depth_image(points: FloatArray, pose: Pose, camera: Intrinsics) -> FloatArray:
    """(height, width) metres along the optical axis of the nearest of points (n, 3) in each pixel; 0 where none is."""
    depths = np.full((camera.height, camera.width), np.inf)
    seen = pose.to_camera(points) if len(points) else points
    seen = seen[seen[:, 2] > 0.0]
    if len(seen):
        pixels = np.floor(camera.project(seen)).astype(np.int64)
        inside = ((pixels >= 0) & (pixels < (camera.width, camera.height))).all(axis=1)
        np.minimum.at(depths, (pixels[inside, 1], pixels[inside, 0]), seen[inside, 2])
    return np.where(np.isfinite(depths), depths, 0.0)


def _within(depth: Float32Array, pose: Pose, camera: Intrinsics, volume: Volume) -> FloatArray:
    """A depth image (height, width) without depths outside a volume."""
    rows, columns = np.indices(depth.shape)
    rays = np.stack(
        [(columns + 0.5 - camera.cx) / camera.fx, (rows + 0.5 - camera.cy) / camera.fy, np.ones(depth.shape)], axis=-1
    )
    points = pose.center + (depth[..., None] * rays).reshape(-1, 3) @ pose.rotation
    return np.where(volume.contains(points).reshape(depth.shape), depth, 0.0)


def _with_ground(proxy: Proxy) -> Volume:
    around = proxy.volume.grown(_AROUND_M)
    return Volume((*around.lower[:2], -_BELOW_M), (*around.upper[:2], proxy.volume.upper[2]))


def _reduced(camera: Intrinsics) -> Intrinsics:
    return camera.scaled(_WIDTH, round(_WIDTH * camera.height / camera.width))


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


def _depths(values: ArrayLike) -> FloatArray:
    depths = np.nan_to_num(np.asarray(values, dtype=np.float64), nan=0.0, posinf=0.0, neginf=-1.0)
    if depths.size and depths.min() < 0:
        raise ValueError("depths must not be negative")
    return depths


def _mean(total: float, count: int) -> float:
    return total / count if count else float("nan")
