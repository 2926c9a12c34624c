"""Metric scale from printed markers: known sides and distances against triangulated corners.

Corners are triangulated over all posed photographs that see them (RANSAC over pairs of views). Each marker's side and
each measured distance between centres then proposes a scale; the one that most of them agree with is refined by least
squares over those. What disagrees is named: a typing error, a print that was scaled, a marker that was moved.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fieldkit.captures.markers_file import MarkersFile
from fieldkit.errors import ReconstructionError
from fieldkit.geometry import Intrinsics, Pose
from fieldkit.reconstruction.colmap_model import to_colmap_camera, to_rigid
from fieldkit.reconstruction.marker_detection import MarkerDetection
from fieldkit.runtime.colmap import pycolmap

Floats = NDArray[np.float64]

AGREE = 0.02
"""A length that differs from the scale's by more than this share is an outlier: a tape reads to a few millimetres per
metre, printers scale to "fit the page" by 3 % and more."""
_SQUARE = 0.1
_MIN_ANGLE_DEG = 1.0
_MAX_ERROR_PX = 4.0
"""Largest reprojection error of a view that counts, in pixels of a 1600-pixel-wide photograph."""


@dataclass(frozen=True)
class MarkerLength:
    """One known length against the model."""

    what: str
    """E.g. ``"side of marker 3"`` or ``"markers 3–7"``."""
    known_m: float
    """As the sidecar says."""
    model_units: float
    """As triangulated."""
    residual: float
    """Scale · model_units / known_m − 1, a share."""
    inlier: bool
    """Whether the scale rests on it."""


@dataclass(frozen=True, eq=False)
class MarkerScale:
    """A metric scale."""

    scale: float
    """Metres per model unit."""
    lengths: tuple[MarkerLength, ...]
    """All known lengths that were seen, sides first."""
    inliers: int
    """How many of them the scale rests on."""
    rms_m: float
    """Of the inliers' differences."""
    corners: Mapping[int, Floats]
    """(4, 3) per marker number, model units."""
    notes: tuple[str, ...]
    """Outliers, and markers or lengths not used, in sentences."""


def marker_scale(
    detections: Mapping[str, Sequence[MarkerDetection]],
    poses: Mapping[str, Pose],
    intrinsics: Mapping[str, Intrinsics],
    markers: MarkersFile,
    *,
    seed: int,
) -> MarkerScale:
    """Metres per model unit.

    Args:
        detections: by photograph name, full-size pixels.
        poses: of the registered photographs, in any frame and unit.
        intrinsics: full-size, of the same photographs.
    """
    seen = _by_marker(detections, poses)
    if not any(len(views) >= 2 for views in seen.values()):
        raise _not_seen(detections, markers)
    corners, notes = {}, []
    for number in sorted(n for n, views in seen.items() if len(views) >= 2):
        found = _triangulate(seen[number], poses, intrinsics, seed)
        if found is None:
            notes.append(f"marker {number} does not lie where its photographs say; not used")
        elif (uneven := _unevenness(found)) > _SQUARE:
            notes.append(f"marker {number} is not square (its sides differ by {uneven:.0%}); not used")
        else:
            corners[number] = found
    measured = _lengths(corners, markers, notes)
    if not measured:
        raise ReconstructionError(
            "the markers give no scale: " + ("; ".join(notes) or "no known length lies between those that were seen"),
            remedy="Check the numbers in markers.toml, or give side_m, which every marker in view then serves.",
        )
    return _robust_scale(measured, corners, notes)


def _by_marker(
    detections: Mapping[str, Sequence[MarkerDetection]], poses: Mapping[str, Pose]
) -> dict[int, list[tuple[str, Floats]]]:
    seen: dict[int, list[tuple[str, Floats]]] = {}
    for name in sorted(detections):
        if name in poses:
            for detection in detections[name]:
                seen.setdefault(detection.id, []).append((name, detection.corners))
    return seen


def _not_seen(detections: Mapping[str, Sequence[MarkerDetection]], markers: MarkersFile) -> ReconstructionError:
    views = sum(bool(found) for found in detections.values())
    if not views:
        message = f"no marker of {markers.dictionary} was found in any of the {len(detections)} photographs"
        remedy = "Check the dictionary in markers.toml; a marker needs a white margin and about 20 pixels a side."
    else:
        message = f"no marker is seen in two registered photographs (markers were found in {views})"
        remedy = "Take photographs that share a marker; print each number only once."
    return ReconstructionError(message, remedy=remedy)


def _triangulate(
    views: Sequence[tuple[str, Floats]],
    poses: Mapping[str, Pose],
    intrinsics: Mapping[str, Intrinsics],
    seed: int,
) -> Floats | None:
    """The four corners (4, 3) where at least two views agree on each; else None."""
    width = float(np.median([intrinsics[name].width for name, _ in views]))
    options = pycolmap.EstimateTriangulationOptions()
    options.min_tri_angle = np.radians(_MIN_ANGLE_DEG)
    options.residual_type = pycolmap.TriangulationResidualType.REPROJECTION_ERROR
    options.ransac.max_error = _MAX_ERROR_PX * max(width / 1600.0, 0.5)
    options.ransac.random_seed = seed
    options.ransac.min_inlier_ratio = 0.02
    options.ransac.confidence = 0.9999
    options.ransac.max_num_trials = 1000
    rigid = [to_rigid(poses[name]) for name, _ in views]
    cameras = [to_colmap_camera(intrinsics[name], 1) for name, _ in views]
    corners = np.empty((4, 3))
    for k in range(4):
        pixels = np.array([quad[k] for _, quad in views], dtype=np.float64)
        found = pycolmap.estimate_triangulation(pixels, rigid, cameras, options)
        if found is None or np.sum(found["inliers"]) < 2:
            return None
        corners[k] = found["xyz"]
    return corners


def _sides(corners: Floats) -> Floats:
    lengths: Floats = np.linalg.norm(np.roll(corners, -1, axis=0) - corners, axis=1)
    return lengths


def _unevenness(corners: Floats) -> float:
    """How far a quadrilateral's sides and diagonals are from a square's, as a share of its mean side."""
    sides = _sides(corners)
    diagonals = np.linalg.norm(corners[:2] - corners[2:], axis=1) / np.sqrt(2.0)
    return float(np.ptp(np.concatenate([sides, diagonals])) / max(sides.mean(), 1e-300))


def _lengths(corners: Mapping[int, Floats], markers: MarkersFile, notes: list[str]) -> list[tuple[str, float, float]]:
    """(what, known metres, model units) of every known length that was seen."""
    measured = []
    if markers.side_m is not None:
        # One length per marker: its four sides share their errors.
        measured = [(f"side of marker {n}", markers.side_m, float(_sides(c).mean())) for n, c in corners.items()]
    for known in markers.distances:
        missing = [n for n in (known.a, known.b) if n not in corners]
        if missing:
            which = " and ".join(str(n) for n in missing)
            notes.append(f"the distance {known.a}–{known.b} is not used: marker {which} was not located")
            continue
        units = float(np.linalg.norm(corners[known.a].mean(axis=0) - corners[known.b].mean(axis=0)))
        measured.append((f"markers {known.a}–{known.b}", known.distance_m, units))
    return [entry for entry in measured if entry[2] > 0]


def _robust_scale(
    measured: Sequence[tuple[str, float, float]], corners: Mapping[int, Floats], notes: list[str]
) -> MarkerScale:
    known = np.array([k for _, k, _ in measured])
    units = np.array([u for _, _, u in measured])
    agreeing = np.abs(np.log(known / units)[:, None] - np.log(known / units)[None, :]) <= np.log1p(AGREE)
    votes = agreeing.sum(axis=1)
    # Every length proposes a scale; among equal votes the longest length, which is measured best, decides.
    winner = max(range(len(measured)), key=lambda i: (votes[i], known[agreeing[i]].max(), -i))
    inlier = agreeing[winner]
    rivals = [i for i in range(len(measured)) if votes[i] == votes[winner] and not (agreeing[i] & inlier).any()]
    # Errors in the model are about the same for long and short lengths, so plain least squares on metres.
    scale = float((known[inlier] @ units[inlier]) / (units[inlier] @ units[inlier]))
    residual = scale * units / known - 1.0
    lengths = tuple(
        MarkerLength(what, k, u, float(r), bool(i))
        for (what, k, u), r, i in zip(measured, residual, inlier, strict=True)
    )
    outliers = [
        f"{one.what}: {one.known_m:g} m in markers.toml, {scale * one.model_units:.4g} m in the model "
        f"({one.residual:+.1%}); not used"
        for one in lengths
        if not one.inlier
    ]
    doubt = []
    if rivals:
        doubt.append("as many known lengths speak for another scale as for this one; measure again")
    elif len(measured) == 1:
        doubt.append(f"the scale rests on one length alone ({measured[0][0]})")
    rms = float(np.sqrt(np.mean((scale * units[inlier] - known[inlier]) ** 2)))
    return MarkerScale(scale, lengths, int(inlier.sum()), rms, dict(corners), (*notes, *outliers, *doubt))
