"""What a caller chooses about dense stereo."""

from __future__ import annotations

from dataclasses import dataclass

from fieldkit.errors import UsageError


@dataclass(frozen=True)
class DenseSettings:
    """What callers choose about dense stereo; its other constants stand beside the code that uses them."""

    sources: int = 4
    """Source views per reference view."""
    best_sources: int = 2
    """A hypothesis costs the mean over its best so many source views, so that the others may be occluded; 1 to 3."""
    min_angle_deg: float = 3.0
    """Least angle between a reference and a source view, about the volume."""
    starts: int = 8
    """Random planes per pixel."""
    beyond: float = 0.3
    """How far behind the volume depths are sought in views with a mask, as a share of the depth at which the ray leaves
    it. What is found there is dropped in the end, but otherwise the background would have to match something inside."""
    min_agreeing: int = 2
    """Other views that have to agree for a point to be kept; so many more views must have its depth at its pixel than
    see through it."""

    def __post_init__(self) -> None:
        if not 1 <= self.best_sources <= 3 or not 1 <= self.sources <= 16:
            raise UsageError("dense stereo takes 1 to 16 source views and the mean of their best 1 to 3")
