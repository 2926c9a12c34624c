"""Plots of a block by its four corners: ranges along the rows, columns across them."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import Any

import numpy as np
import shapely

from fieldkit.errors import UsageError
from fieldkit.geometry.geodesy import LocalFrame

_LEAST_M = 0.1
"""Least side of a plot, metres."""


def plots_grid(
    corners: Sequence[float], ranges: int, columns: int, *, alley_m: float = 0.0, gap_m: float = 0.0
) -> dict[str, Any]:
    """GeoJSON of a block's plots; plot ``r2c5`` is the fifth column of the second range.

    Args:
        corners: four times latitude and longitude, degrees: of the first plot's outer corner, then along the rows to
            the last range, across to the last column, and back along the rows. Sides need not be square to each other.
        ranges: plots along the rows.
        columns: plots across them.
        alley_m: bare ground between ranges.
        gap_m: room between columns.

    Raises:
        UsageError: these are not the corners of a block, or leave no room for the plots.
    """
    places = np.reshape(corners, (-1, 2))
    if len(places) != 4 or (np.abs(places) > (90.0, 180.0)).any():
        raise UsageError(
            "--corners: these are not four corners in degrees",
            remedy="Write latitude and longitude of each: 52.1,10.4,52.1,10.41,52.11,10.41,52.11,10.4.",
        )
    frame = LocalFrame(*places.mean(axis=0).tolist())
    block = frame.to_local(places[:, 0], places[:, 1], 0.0)
    along, across = (block[1] - block[0] + block[2] - block[3]) / 2, (block[3] - block[0] + block[2] - block[1]) / 2
    spans = []
    for side, number, gap in ((along, ranges, alley_m), (across, columns, gap_m)):
        whole_m = float(np.linalg.norm(side))
        length_m = (whole_m + gap) / max(number, 1) - gap
        if number < 1 or length_m < _LEAST_M or not shapely.Polygon(block[:, :2]).is_valid:
            raise UsageError(
                f"{ranges} × {columns} plots do not fit between these corners",
                remedy="Check their order (along the rows first), --grid, --alley and --gap.",
            )
        starts = (length_m + gap) * np.arange(number)
        spans.append(np.stack([starts, starts + length_m], axis=1) / whole_m)
    heading = float(np.degrees(np.arctan2(along[0], along[1]))) % 360.0
    features = []
    for (i, (u0, u1)), (j, (v0, v1)) in product(enumerate(spans[0], 1), enumerate(spans[1], 1)):
        a, b = np.array([[u0, u1, u1, u0, u0], [v0, v0, v1, v1, v0]])
        ring = np.stack([(1 - a) * (1 - b), a * (1 - b), a * b, (1 - a) * b], axis=1) @ block
        latitude, longitude, _ = frame.to_geodetic(ring)
        corners_deg = np.stack([longitude, latitude], axis=1).round(9).tolist()
        properties = {"plot_id": f"r{i}c{j}", "row_heading_deg": round(heading, 3)}
        geometry = {"type": "Polygon", "coordinates": [corners_deg]}
        features.append({"type": "Feature", "properties": properties, "geometry": geometry})
    return {"type": "FeatureCollection", "features": features}
