"""Plots of a block by its four corners: ranges along the rows, columns across them."""

from __future__ import annotations

from typing import Any

import numpy as np
import shapely

from fieldkit.arrays import FloatArray
from fieldkit.errors import UsageError
from fieldkit.geometry.geodesy import LocalFrame

_LEAST_M = 0.1
"""Least side of a plot, metres."""


def plots_grid(
    corners: FloatArray, ranges: int, columns: int, *, alley_m: float = 0.0, gap_m: float = 0.0
) -> dict[str, Any]:
    """GeoJSON of a block's plots; plot ``r2c5`` is the fifth column of the second range.

    Args:
        corners: (4, 2) latitude and longitude, degrees: of the first plot's outer corner, then along the rows to the
            last range, across to the last column, and back along the rows. Sides need not be square to each other.
        ranges: plots along the rows.
        columns: plots across them.
        alley_m: bare ground between ranges.
        gap_m: room between columns.

    Raises:
        UsageError: the corners are not those of a block, or leave no room for the plots.
    """
    frame = LocalFrame(float(corners[:, 0].mean()), float(corners[:, 1].mean()))
    block = frame.to_local(corners[:, 0], corners[:, 1], 0.0)
    if not shapely.Polygon(block[:, :2]).is_valid:
        raise UsageError("--corners: their sides cross", remedy="Give them in the order in which one walks around.")
    along, across = (block[1] - block[0] + block[2] - block[3]) / 2, (block[3] - block[0] + block[2] - block[1]) / 2
    spans = [
        _spans(count, gap / float(np.linalg.norm(side)), _LEAST_M / float(np.linalg.norm(side)))
        for count, gap, side in ((ranges, alley_m, along), (columns, gap_m, across))
    ]
    heading = float(np.degrees(np.arctan2(along[0], along[1]))) % 360.0
    features = []
    for i, (u0, u1) in enumerate(spans[0], 1):
        for j, (v0, v1) in enumerate(spans[1], 1):
            u, v = np.array([[u0, u1, u1, u0, u0], [v0, v0, v1, v1, v0]])
            weights = np.stack([(1 - u) * (1 - v), u * (1 - v), u * v, (1 - u) * v], axis=1)
            latitude, longitude, _ = frame.to_geodetic(weights @ block)
            ring = np.stack([longitude, latitude], axis=1).round(9).tolist()
            properties = {"plot_id": f"r{i}c{j}", "row_heading_deg": round(heading, 3)}
            geometry = {"type": "Polygon", "coordinates": [ring]}
            features.append({"type": "Feature", "properties": properties, "geometry": geometry})
    return {"type": "FeatureCollection", "features": features}


def _spans(count: int, gap: float, least: float) -> list[tuple[float, float]]:
    """Where parts of a side of 1 begin and end, with gaps between them."""
    length = (1.0 - (count - 1) * gap) / count
    if not length >= least:
        raise UsageError(
            f"{count} plots side by side do not fit between the corners",
            remedy="Check the corners' order (along the rows first), --grid, --alley and --gap.",
        )
    return [(k * (length + gap), k * (length + gap) + length) for k in range(count)]
