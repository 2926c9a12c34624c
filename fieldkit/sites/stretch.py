"""Cameras moved as the plants about which they stand are stretched, to fit a plan to other plants."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

_NEAREST_AIM_M = 0.2

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Stretch:
    """The box about a plan's plants is stretched along its axes to the box about a plot's plants.

    A camera keeps to the stretched box as it kept to the plan's; its distance from the box goes with the plants'
    height, but is never less than the plan's clearance, where it was more. It looks at the stretched place of what it
    looked at.
    """

    low: Array
    high: Array
    """(3,) corners of the box about the plan's plants, plot frame, metres; z above the ground."""
    scale: Array
    """(3,) factors along, across and upwards."""
    clearance_m: float = 0.0
    """Of the plan."""
    lowest_m: float | None = None
    """Least z of a moved camera; None for no limit."""
    pitch_deg: tuple[float, float] | None = None
    """Range of the gimbal; None for no limit."""

    def moved(self, positions: Array, yaw_deg: Array, forward: Array) -> tuple[Array, Array, Array]:
        """The moved cameras' positions (n, 3), yaws (n,) and pitches (n,).

        Args:
            positions: (n, 3) of the plan's, plot frame, metres.
            yaw_deg: (n,) of the plan's; kept by a camera that looks straight down.
            forward: (n, 3) unit vectors of the optical axes.
        """
        kept = np.clip(positions, self.low, self.high)
        away = positions - kept
        distance = np.linalg.norm(away, axis=1)
        grown = np.maximum(distance * self.scale[2], np.minimum(distance, self.clearance_m))
        there = kept * self.scale + away * (grown / np.where(distance > 0.0, distance, 1.0))[:, None]
        if self.lowest_m is not None:
            there[:, 2] = np.maximum(there[:, 2], self.lowest_m)
        along = ((0.5 * (self.low + self.high) - positions) * forward).sum(axis=1)
        aims = (positions + np.maximum(along, _NEAREST_AIM_M)[:, None] * forward) * self.scale
        ray = aims - there
        flat = np.hypot(ray[:, 0], ray[:, 1])
        yaw = np.where(flat > 1e-9, np.degrees(np.arctan2(ray[:, 0], ray[:, 1])), yaw_deg)
        pitch = np.degrees(np.arctan2(ray[:, 2], flat))
        return there, yaw, pitch if self.pitch_deg is None else np.clip(pitch, *self.pitch_deg)
