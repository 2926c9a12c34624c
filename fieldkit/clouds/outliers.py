"""Removal of points that stand apart."""

from __future__ import annotations

import numpy as np

from fieldkit.clouds.cloud import Cloud
from fieldkit.clouds.neighbors import z_order


def remove_outliers(cloud: Cloud, *, neighbors: int = 16, deviations: float = 2.0) -> Cloud:
    """Statistical outlier removal (Rusu et al. 2008).

    A point goes where its mean distance to its nearest neighbours exceeds the mean of that figure over the cloud by
    more than ``deviations`` standard deviations. A cloud of no more than ``neighbors`` points is returned as it is.

    Args:
        cloud: n points.
        neighbors: how many nearest neighbours to look at, at least 1.
        deviations: how far beyond the mean a point may be.
    """
    if neighbors < 1:
        raise ValueError("at least one neighbour is needed")
    if len(cloud) <= neighbors:
        return cloud
    from scipy.spatial import cKDTree

    # Queries in Z-order find their part of the tree in the processor's cache.
    order = z_order(cloud.points)
    points = cloud.points[order]
    distances = np.empty(len(cloud))
    distances[order] = cKDTree(points).query(points, k=neighbors + 1, workers=1)[0][:, 1:].mean(axis=1)
    return cloud.select(distances <= distances.mean() + deviations * distances.std())
