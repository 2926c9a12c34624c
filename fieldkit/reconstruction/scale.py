"""What decides the scale: the one place where lengths become metres, or are said not to be.

1. Known positions do, where their errors leave a scale: those stated before mapping (`may_give_scale`), and those that
   the model shows after it (`scale_error_of_model`). Else mapping is done without them, and no pose is checked by them.
2. Another program's poses without a frame of their own have no metres: `SourceFrame.scaled`.
3. Printed markers do, where positions do not or give a doubtful one (`scale_by_markers`).
4. Else nothing does, and the result says so (`source_of_scale`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from fieldkit.arrays import FloatArray
from fieldkit.captures import read_image
from fieldkit.captures.model import Capture
from fieldkit.geometry import Similarity
from fieldkit.geometry.priors import Priors
from fieldkit.reconstruction.colmap_model import model_intrinsics, model_poses, transform_model
from fieldkit.reconstruction.markers import MarkerScale, detect_markers, marker_scale
from fieldkit.results.evaluation import ImageReport
from fieldkit.results.finding import Finding
from fieldkit.runtime.colmap import pycolmap
from fieldkit.vocabulary import LEAST_POSITIONS

POSITIONS_TOO_COARSE = "positions-too-coarse"
"""Code of the finding that positions give no scale."""
LARGEST_SCALE_ERROR = 0.2
"""Relative standard error from which positions give no scale: chance alone never comes near five times its spread."""
_TOLD_SCALE_ERROR = 0.03
"""Relative standard error of a scale from which it is told."""
_DOUBTFUL = 0.01
"""Relative standard error of the positions' scale from which that of printed markers is taken: these are good to half a
percent."""
OF_POSITIONS_SCALE = ("scale-uncertain", POSITIONS_TOO_COARSE)
"""Codes of findings that hold no more once markers give the scale."""
_LEAST_APART = 0.25
"""Of a stated σ: so much at least differs between the photographs of a flight."""
_SIMILARITY = 7  # parameters


def scale_error(positions: FloatArray, sigma_m: float, *, with_errors: bool = True) -> float:
    """Relative standard error of the scale that positions (n, 3) give a model: σ / √Σ|x − x̄|².

    The sum is without what errors alone add to it, 3 (n − 1) σ²: where nothing is left, there is no scale (infinite).

    Args:
        sigma_m: standard deviation per axis of what differs between them.
        with_errors: whether the positions are the measured ones; False for those that a model puts in their place,
            whose spread holds no such errors.
    """
    if len(positions) < LEAST_POSITIONS:
        return float("inf")
    own = 3.0 * (len(positions) - 1) * sigma_m**2 if with_errors else 0.0
    squares = ((positions - positions.mean(axis=0)) ** 2).sum() - own
    return sigma_m / float(np.sqrt(squares)) if squares > 0.0 else float("inf")


def sigma_apart(stated_m: float, residuals_m: FloatArray) -> float:
    """What differs between the errors of positions: standard deviation per axis, metres.

    Most of a receiver's error is the same all along a flight, and says nothing of distances. Residuals (n,) of a model
    after its similarity tell the rest; the stated σ weighs as much as one photograph's. A quarter of it is the least,
    so that a coarse receiver is not taken for an exact one.
    """
    freedom = 3 * len(residuals_m) - _SIMILARITY
    if freedom <= 0:
        return stated_m
    pooled = (3.0 * stated_m**2 + float(np.square(residuals_m).sum())) / (3.0 + freedom)
    return max(float(np.sqrt(pooled)), _LEAST_APART * stated_m)


def stated_scale_error(priors: Priors) -> float:
    """Of the scale that known positions give, by the errors that they are stated to have."""
    return scale_error(priors.positions(), priors.sigma_m)


def may_give_scale(priors: Priors) -> bool:
    """Whether known positions can give a scale, however little of their stated errors differs between them."""
    return scale_error(priors.positions(), _LEAST_APART * priors.sigma_m) <= LARGEST_SCALE_ERROR


def scale_error_of_model(priors: Priors, images: Sequence[ImageReport]) -> float:
    """Of the scale that known positions gave a model, by what its poses differ from them; as stated where few count."""
    residuals = {i.name: i.position_residual_m for i in images if i.counts and i.position_residual_m is not None}
    if len(residuals) < LEAST_POSITIONS:
        return stated_scale_error(priors)
    apart = sigma_apart(priors.sigma_m, np.array(list(residuals.values())))
    return scale_error(priors.positions(residuals), apart)


def scale_findings(name: str, priors: Priors, error: float) -> list[Finding]:
    """That positions give no scale, or a poor one; ``error`` is the scale's."""
    if error <= _TOLD_SCALE_ERROR:
        return []
    within_m = float(np.linalg.norm(np.ptp(priors.positions(), axis=0)))
    said = f"the photographs' positions are good to {priors.sigma_m:.2g} m, and lie within {within_m:.2g} m"
    if error <= LARGEST_SCALE_ERROR:
        message = f"{said}: lengths may all be off by {100 * error:.0f} % (one standard deviation)"
        code = "scale-uncertain"
    else:
        message = f"{said}: they give no scale, and no pose is checked by them; the result's lengths are not metres"
        code = POSITIONS_TOO_COARSE
    remedy = "give more exact positions (RTK, poses.csv) or printed markers (markers.toml)"
    return [Finding(name, code, f"{message}; {remedy}")]


def wants_markers(priors: Priors, images: Sequence[ImageReport]) -> bool:
    """Whether printed markers better the scale that known positions gave a model."""
    return scale_error_of_model(priors, images) > _DOUBTFUL


def scale_by_markers(
    model: pycolmap.Reconstruction, capture: Capture, *, seed: int, advance: Callable[[int], None]
) -> MarkerScale:
    """Scale a model, in place and about the middle of its cameras, by the printed markers seen in its photographs."""
    assert capture.markers is not None
    detections = {}
    for photo in capture.photos:
        detections[photo.name] = detect_markers(read_image(photo, gray=True), capture.markers.dictionary)
        advance(1)
    poses = model_poses(model)
    scale = marker_scale(detections, poses, model_intrinsics(model), capture.markers, seed=seed)
    middle = np.mean([pose.center for pose in poses.values()], axis=0)
    transform_model(model, Similarity(scale.scale, np.eye(3), (1.0 - scale.scale) * middle))
    return scale


def source_of_scale(priors: Priors, markers: MarkerScale | None, *, metric: bool) -> tuple[str, tuple[str, ...]]:
    """What a model has its place from, else its scale ("none": its lengths are not metres), and what is to be noted.

    ``markers`` is the scale that they gave; ``metric`` says whether the model has the place of the known positions.
    """
    notes = () if markers is None else markers.notes
    if metric and priors.frame is not None:
        return priors.frame.source, notes
    if markers is not None:
        return "markers", notes
    return "none", ("no metric source: the result has no scale, and its lengths are not metres",)
