"""What a person can choose about missions. Imports nothing heavy."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from fieldkit.vocabulary import MissionFormat


@dataclass(frozen=True)
class MissionSettings:
    """How a plan is flown over the plots of a site."""

    format: MissionFormat | None = None
    """QGroundControl, MAVLink waypoints, DJI WPML, or Litchi. Without: by the file's suffix (.plan, .waypoints, .kmz,
    .csv), else plan."""
    only: Sequence[str] | None = None
    """Fly these plots; the others stay obstacles. Without: all."""
    lines: Sequence[int] | None = None
    """Fly these lines of a pattern, as numbered from 1. Without: all."""
    plant_height: float | Literal["unknown"] | None = None
    """Height of the highest plants of all plots; or "unknown", where plots do not say theirs, for 30 % more than the
    plan's. Without: plant_height_m of the plots."""
    fit: bool | None = None
    """Fit the plan to each plot's plant height and size, as the site gives them. Without: a plan for plots of a kind is
    fitted to the height."""
    adjust: bool = False
    """Fly the nearest poses where the vehicle cannot take the plan's."""
    burst: int = 1
    """Photographs per station, one after the other: wind's swing averages out."""
    seed: int = 0
