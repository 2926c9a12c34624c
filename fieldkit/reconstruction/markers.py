"""Metric scale from printed square markers (ArUco, AprilTag): known sides and distances against triangulated corners.

OpenCV finds and reads markers. Corners are the intersections of lines that the AprilTag library's method (Wang & Olson
2016) fits to the black square's edges; cornerSubPix would draw them inwards, by half a percent of a metric scale.

Corners are triangulated over all posed photographs that see them (RANSAC over pairs of views). Each marker's side and
each measured distance between centres then proposes a scale; the one that most of them agree with is refined by least
squares over those. What disagrees is named: a typing error, a print that was scaled, a marker that was moved.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from fieldkit.arrays import ByteArray, FloatArray
from fieldkit.captures.markers_file import MarkersFile, marker_dictionary
from fieldkit.errors import ReconstructionError
from fieldkit.geometry import Intrinsics, Pose
from fieldkit.reconstruction.colmap_model import to_colmap_camera, to_rigid, triangulation
from fieldkit.runtime.colmap import pycolmap

_MIN_SIDE_PX = 16.0
"""Least side of a marker, and of a photograph, pixels."""


@dataclass(frozen=True, eq=False)
class MarkerDetection:
    """One marker in one photograph."""

    id: int
    """Its number in the dictionary."""
    corners: FloatArray
    """(4, 2) pixels, clockwise from the marker's upper left as printed; (0, 0) is the upper left corner of the
    first pixel."""


def detect_markers(gray: ByteArray, dictionary: str) -> list[MarkerDetection]:
    """The markers in a grey image (h, w), uint8, sorted by number.

    A number that appears more than once is left out: which of the two is meant cannot be told. Markers smaller than
    16 px are not looked for.
    """
    book = marker_dictionary(dictionary)
    if min(gray.shape) < _MIN_SIDE_PX:
        return []
    parameters = cv2.aruco.DetectorParameters()
    parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_APRILTAG
    # OpenCV's default of 0.03 is a side of 45 px in a photograph of 6000.
    parameters.minMarkerPerimeterRate = min(0.03, 4.0 * _MIN_SIDE_PX / max(gray.shape))
    quads, ids, _ = cv2.aruco.ArucoDetector(book, parameters).detectMarkers(gray)
    if len(quads) == 0:
        return []
    numbers, counts = np.unique(np.asarray(ids).ravel(), return_counts=True)
    once = {int(number) for number, count in zip(numbers, counts, strict=True) if count == 1}
    found = [
        MarkerDetection(int(number), np.asarray(quad, dtype=np.float64).reshape(4, 2))
        for quad, number in zip(quads, np.asarray(ids).ravel(), strict=True)
        if int(number) in once
    ]
    return sorted(found, key=lambda detection: detection.id)


AGREE = 0.02
"""A length that differs from the scale's by more than this share is an outlier: a tape reads to a few millimetres per
metre, printers scale to "fit the page" by 3 % and more."""
_LEAST_ERROR = 0.005
"""Relative standard error of a scale that several lengths give, at least: they may share the tape's or printer's."""
_SQUARE = 0.1
"""Largest difference of a marker's sides, as a share."""
_MIN_ANGLE_DEG = 1.0
"""Least angle between the rays to a corner, degrees."""
_MAX_ERROR_PX = 4.0
"""Largest reprojection error of a view that counts, in pixels of a 1600-pixel-wide photograph."""


@dataclass(frozen=True, eq=False)
class MarkerScale:
    """A metric scale."""

    scale: float
    """Metres per model unit."""
    inliers: int
    """How many known lengths it rests on."""
    error: float
    """Its relative standard error."""
    corners: Mapping[int, FloatArray]
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
) -> dict[int, list[tuple[str, FloatArray]]]:
    seen: dict[int, list[tuple[str, FloatArray]]] = {}
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
    views: Sequence[tuple[str, FloatArray]], poses: Mapping[str, Pose], intrinsics: Mapping[str, Intrinsics], seed: int
) -> FloatArray | None:
    """The four corners (4, 3) where at least two views agree on each; else None."""
    width = float(np.median([intrinsics[name].width for name, _ in views]))
    options = triangulation(_MAX_ERROR_PX * max(width / 1600.0, 0.5), _MIN_ANGLE_DEG, trials=1000, seed=seed)
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


def _sides(corners: FloatArray) -> FloatArray:
    lengths: FloatArray = np.linalg.norm(np.roll(corners, -1, axis=0) - corners, axis=1)
    return lengths


def _unevenness(corners: FloatArray) -> float:
    """How far a quadrilateral's sides and diagonals are from a square's, as a share of its mean side."""
    sides = _sides(corners)
    diagonals = np.linalg.norm(corners[:2] - corners[2:], axis=1) / np.sqrt(2.0)
    return float(np.ptp(np.concatenate([sides, diagonals])) / max(sides.mean(), 1e-300))


def _lengths(
    corners: Mapping[int, FloatArray], markers: MarkersFile, notes: list[str]
) -> list[tuple[str, float, float]]:
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
    measured: Sequence[tuple[str, float, float]], corners: Mapping[int, FloatArray], notes: list[str]
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
    outliers = [
        f"{what}: {metres:g} m in markers.toml, {scale * length:.4g} m in the model "
        f"({scale * length / metres - 1.0:+.1%}); not used"
        for (what, metres, length), used in zip(measured, inlier, strict=True)
        if not used
    ]
    doubt = []
    if rivals:
        doubt.append("as many known lengths speak for another scale as for this one; measure again")
    elif len(measured) == 1:
        doubt.append(f"the scale rests on one length alone ({measured[0][0]})")
    spread = np.log(known / units)[inlier]
    error = AGREE if len(spread) == 1 else max(_LEAST_ERROR, float(spread.std(ddof=1) / np.sqrt(len(spread))))
    return MarkerScale(scale, len(spread), error, dict(corners), (*notes, *outliers, *doubt))
