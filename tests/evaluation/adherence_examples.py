"""Evaluated plots for tests of adherence: reports as a reconstruction leaves them, with poses that are known."""

from collections.abc import Mapping, Sequence
from typing import Any, cast

import numpy as np

from fieldkit.errors import MetadataError
from fieldkit.evaluation.conversion import failed_plot
from fieldkit.geometry import Pose, Similarity
from fieldkit.geometry.geodesy import LocalFrame
from fieldkit.results.evaluation import ImageReport, PlotEvaluation
from fieldkit.results.frame import FrameEntry


def plot_report(
    source: str, motion: Similarity, origin: LocalFrame | None, images: Mapping[str, Pose | None], name: str = "a"
) -> PlotEvaluation:
    """A plot whose photographs were reconstructed at these poses in the plot frame; None: not registered."""
    plot = failed_plot(name, MetadataError("none"))
    frame = FrameEntry(
        plot_from_source=cast("Any", tuple(tuple(float(v) for v in row) for row in motion.matrix())),
        origin=origin,
        crs_epsg=None,
        ground=None,
        notes=(),
    )
    entries = tuple(_image(image, pose) for image, pose in images.items())
    return plot.model_copy(
        update={
            "error": None,
            "frame": frame,
            "metric": True,
            "metric_source": source,
            "image_reports": entries,
            "images": len(entries),
        }
    )


def _image(name: str, pose: Pose | None) -> ImageReport:
    yaw, pitch, roll = (None, None, None) if pose is None else pose.yaw_pitch_roll_deg()
    return ImageReport(
        name=name,
        features=100,
        registered=pose is not None,
        right=None if pose is None else True,
        reason="" if pose is not None else "no pair verified",
        observations=0,
        reprojection_px=None,
        position_residual_m=None,
        angle_residual_deg=None,
        known_center_m=None,
        center_m=None if pose is None else cast("Any", tuple(float(v) for v in pose.center)),
        yaw_deg=yaw,
        pitch_deg=pitch,
        roll_deg=roll,
    )


def disturbed(poses: Sequence[Pose], metres: float, degrees: float, seed: int) -> list[Pose]:
    """Poses with independent normal errors of position and of yaw and pitch."""
    rng = np.random.default_rng(seed)
    result = []
    for pose in poses:
        yaw, pitch, _ = pose.yaw_pitch_roll_deg()
        turn = rng.normal(0.0, degrees, 2)
        result.append(Pose.from_yaw_pitch(pose.center + rng.normal(0, metres, 3), yaw + turn[0], pitch + turn[1]))
    return result
