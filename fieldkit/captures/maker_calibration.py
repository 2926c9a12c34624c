"""The calibration that a maker measured of each camera and writes into its photographs' XMP.

DJI's guides to image processing (P4 Multispectral, Mavic 3M) define DewarpData as
``date;fx,fy,cx,cy,k1,k2,p1,p2,k3``: pixels of the whole picture, cx and cy from its middle, OpenCV's distortion.
DewarpFlag is 1 where the camera has straightened the picture already.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from fieldkit.documents.csv_text import finite_numbers
from fieldkit.geometry import Intrinsics

_VALUES = 9
"""Number of numbers behind the date, as the guides define them."""
_MOST_K = 1.0
"""Largest coefficient of distortion that a lens has; what is above it is no calibration."""
_OFF_CENTRE = 0.1
"""Largest distance of a principal point from the middle, share of the longer side."""
_FOCAL_SIDES = (0.25, 50.0)
"""Shortest and longest focal length, shares of the longer side."""
_RADII = 64
"""Number of radii at which the bends with and without k3 are compared."""


def calibration_of(fields: Mapping[str, str], width: int, height: int) -> Intrinsics | None:
    """The calibration of a picture of that size by the fields of DJI's XMP; None without a plausible one.

    The middle of the sensor (CalibratedOpticalCenterX and Y), where it is given, says how large the picture was before
    it was resized.
    """
    flag = fields.get("dewarp_flag", "").strip()
    numbers = finite_numbers(fields.get("dewarp", "").rpartition(";")[2])
    if flag not in ("0", "1") or len(numbers) != _VALUES:
        return None
    fx, fy, dx, dy, *bend = numbers
    middle = finite_numbers(f"{fields.get('center_x', '')},{fields.get('center_y', '')}")
    whole = (round(2 * middle[0]), round(2 * middle[1])) if len(middle) == 2 and min(middle) > 0.0 else (width, height)
    side = max(whole)
    if not all(_FOCAL_SIDES[0] < f / side < _FOCAL_SIDES[1] for f in (fx, fy)):
        return None
    if max(abs(dx), abs(dy)) > _OFF_CENTRE * side or max(map(abs, bend)) > _MOST_K:
        return None
    centre = whole[0] / 2 + dx, whole[1] / 2 + dy
    if flag == "1":
        return Intrinsics("PINHOLE", *whole, (fx, fy, *centre)).at_size(width, height)
    k1, k2, p1, p2, k3 = bend
    k1, k2 = _without_k3(k1, k2, k3, float(np.hypot(*whole)) / (fx + fy))
    return Intrinsics("OPENCV", *whole, (fx, fy, *centre, k1, k2, p1, p2)).at_size(width, height)


def _without_k3(k1: float, k2: float, k3: float, corner: float) -> tuple[float, float]:
    """The k1 and k2 that bend a picture most nearly as with k3, to its ``corner`` (tangent of the angle).

    Mapping adjusts k1 and k2; with k3, COLMAP's cameras have three more that a few photographs do not determine.
    """
    if k3 == 0.0:
        return k1, k2
    r = np.linspace(0.0, corner, _RADII)[1:]
    weight = np.sqrt(r)  # a picture has as much area as radius there
    found = np.linalg.lstsq((weight * [r**3, r**5]).T, weight * (k1 * r**3 + k2 * r**5 + k3 * r**7), rcond=None)[0]
    return float(found[0]), float(found[1])
