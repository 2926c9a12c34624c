"""What a person can choose about a check. Imports nothing heavy."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class CheckSettings:
    """Limits of a check."""

    position_m: float = 0.25
    """Farthest that a photograph may be taken from its station. RTK flights keep to 5 cm per axis."""
    angle_deg: float = 8.0
    """Most that its optical axis may be turned away from the plan's."""
    seed: int = 0
