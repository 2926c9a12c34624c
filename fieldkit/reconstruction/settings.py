"""What a person can choose about a reconstruction."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import get_args

from fieldkit.clouds.volume import Volume
from fieldkit.errors import UsageError
from fieldkit.vocabulary import LEAST_POSITIONS, Fidelity, MappingChoice, Mask, TiesName

BLIND_METHODS = ("incremental", "global")
"""In the order in which they are tried where neither is asked for."""
_SHARE_FOR_PRIOR = 0.8
"""Least share of photographs with known positions for prior mapping."""


@dataclass(frozen=True)
class FeatureSettings:
    """How features are found."""

    working_side: int = 1600
    """Longer side the image is reduced to before detection, pixels; never enlarged."""
    max_features: int = 4096
    """The strongest are kept."""
    contrast_threshold: float = 0.02
    """OpenCV's `contrastThreshold`; lower finds more on dark leaves."""
    edge_threshold: float = 10.0
    """OpenCV's `edgeThreshold`."""
    kept: float = 1.0
    """Share of these that is not withheld at random: plants that match worse are rehearsed with it."""
    draw: int = 0
    """Which ones are withheld."""


@dataclass(frozen=True)
class VerificationSettings:
    """COLMAP's two-view options that matter here."""

    max_error_px: float = 4.0
    """Of RANSAC's epipolar error, in full-size pixels."""
    min_inliers: int = 15
    """Fewer verified matches and the pair does not count."""


@dataclass(frozen=True)
class PriorMappingSettings:
    """What callers choose about prior mapping; its other constants stand beside the code that uses them."""

    max_neighbours: int = 16
    """Per image, only that many nearest cameras are tried."""
    bands_px: tuple[float, ...] = (12.0, 6.0, 3.0)
    """Half widths of the bands after the first, in pixels of a 1600-pixel-wide photograph."""
    loss_px: float = 0.5
    """Scale of the last robust loss."""
    max_error_px: float = 4.0
    """Largest reprojection error of an observation that stays."""
    min_agreeing: int = 20
    """Least number of matches, in all pairs together, that put two of the first round's sub-models together."""


@dataclass(frozen=True)
class ReconstructionSettings:
    """Every choice that changes a reconstruction's result."""

    features: FeatureSettings = field(default_factory=FeatureSettings)
    verification: VerificationSettings = field(default_factory=VerificationSettings)
    """Of blind matching's pairs."""
    prior: PriorMappingSettings = field(default_factory=PriorMappingSettings)
    """Constants of prior mapping."""
    mapping: MappingChoice = "auto"
    """How poses are found; what ``auto`` stands for, `mapping_methods` says."""
    ties: TiesName = "sift"
    """Whose matches tie photographs."""
    fidelity: Fidelity = "standard"
    """Ground sampling distance of dense stereo, see `fieldkit.vocabulary.GSD_M`."""
    mask: Mask = "exg"
    """Which pixels are plant."""
    bounds: Volume | None = None
    """Volume of interest in the plot frame, metres; None finds it from the cameras."""
    min_agreeing_views: int = 2
    """Of the fusion rule."""
    trust_orientations: bool = False
    """Recorded orientations are right to their accuracy, as commands are: a photograph that prior mapping cannot
    register is left out. Else its orientation is first looked for in blind matches, which costs seconds, for
    cameras do record wrong ones."""
    seed: int = 0

    def __post_init__(self) -> None:
        if self.fidelity not in get_args(Fidelity):
            remedy = f"Choose one of {', '.join(get_args(Fidelity))}."
            raise UsageError(f"there is no fidelity {self.fidelity!r}", remedy=remedy)


def mapping_methods(mapping: MappingChoice, positioned: int, photographs: int) -> tuple[str, ...]:
    """The methods that a choice stands for; each is tried where those before it make no model.

    ``auto`` is ``prior`` where at least 80 % of the photographs, and three, have known positions; else it is
    ``incremental``, then ``global``. Any other choice is that method alone.
    """
    if mapping != "auto":
        return (mapping,)
    return ("prior",) if positioned >= max(LEAST_POSITIONS, _SHARE_FOR_PRIOR * photographs) else BLIND_METHODS
