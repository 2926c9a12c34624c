"""Every constant of dense stereo, in one value."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

from fieldkit.errors import UsageError

Fidelity = Literal["draft", "standard", "fine", "full"]
MaskKind = Literal["exg", "none", "file"]

FIDELITY_SIZE: dict[str, tuple[int, int]] = {"draft": (500, 375), "standard": (750, 562), "fine": (1000, 750)}
"""Width and height of a 4:3 view; `full` is native. Other shapes get the same number of pixels."""


@dataclass(frozen=True)
class Settings:
    """How depth maps are computed and fused; recorded with every result.

    Attributes:
        fidelity: the views' working size (draft 500×375, standard 750×562, fine 1000×750 for 4:3, full native).

        sources: source views per reference view.
        best_sources: a hypothesis costs the mean over its best so many source views, so that the others may be
            occluded; 1 to 3.
        slack: none of these counts more than this above the lowest: the surface may be hidden in all but one.
        best_angle_deg: angle between two views about the volume at which a source view is worth most.
        min_angle_deg, max_angle_deg: limits of that angle.

        color_sigma: width of the bilateral weights, grey levels.
        off_mask_weight: factor for samples off the plant mask.
        noise: standard deviation of the grey levels that counts as no texture.

        beyond, beyond_unmasked: how far behind the volume depths are sought in views with and without a mask, as a
            share of the depth at which the ray leaves it. What is found there is dropped in the end, but otherwise
            the background would have to match something inside.
        starts: random planes per pixel.
        sweeps: rounds of propagation and perturbation (each a red and a black half).
        perturbations: random changes tried per pixel and round, each half as large as the one before.
        first_range_px, pyramid_range_px, second_range_px: size of the first change on the coarsest level, on the finer
            ones and in geometric passes, as the shift of a typical source pixel.
        pyramid_sweeps: rounds on every level above the coarsest.
        pyramid_starts: random planes per pixel there, beside the coarser level's.
        coarsest: views are halved as long as the largest has more pixels than this.
        coarse_passes, geometric_passes: geometric passes on levels of reduced views and on the last one. They take over
            planes of the source views and also ask for agreement with their depths; 0 leaves them out.
        geometric_sweeps: rounds in each of these passes.
        geometric_weight, geometric_cap_px: these passes add weight · min(round-trip error in pixels, cap) to the cost.

        max_cost: a depth whose cost (1 − correlation) is not below takes no part in the fusion.
        max_relative_depth: largest relative difference of two depths that agree.
        max_reprojection_px: largest round-trip distance of two pixels that agree.
        min_agreeing: other views that have to agree for a point to be kept; so many more views must have its depth at
            its pixel than see through it.
        see_through_px, see_through_depths: a view sees through a point if all of its pixels within so many are
            background or so many times farther behind than ``max_relative_depth``. Masks miss thin parts, and poses are
            off by a pixel.
        fusion_neighbors: views each view is compared with.
        thin_gsd: edge of the voxels that thin the cloud, in ground sampling distances at the volume's centre; 0: no
            thinning.
    """

    fidelity: Fidelity = "standard"

    sources: int = 4
    best_sources: int = 2
    slack: float = 0.4
    best_angle_deg: float = 12.0
    min_angle_deg: float = 3.0
    max_angle_deg: float = 50.0

    color_sigma: float = 20.0
    off_mask_weight: float = 0.15
    noise: float = 1.0

    starts: int = 8
    sweeps: int = 3
    perturbations: int = 3
    beyond: float = 0.3
    beyond_unmasked: float = 4.0
    first_range_px: float = 4.0
    pyramid_range_px: float = 1.5
    second_range_px: float = 1.0
    pyramid_sweeps: int = 2
    pyramid_starts: int = 1
    coarsest: int = 300_000
    coarse_passes: int = 2
    geometric_passes: int = 1
    geometric_sweeps: int = 1
    geometric_weight: float = 0.2
    geometric_cap_px: float = 3.0

    max_cost: float = 0.6
    max_relative_depth: float = 0.012
    max_reprojection_px: float = 1.5
    min_agreeing: int = 2
    see_through_px: int = 2
    see_through_depths: float = 3.0
    fusion_neighbors: int = 10
    thin_gsd: float = 1.0

    def __post_init__(self) -> None:
        if self.fidelity not in get_args(Fidelity):
            raise UsageError(
                f"there is no fidelity {self.fidelity!r}", remedy=f"Choose one of {', '.join(get_args(Fidelity))}."
            )
        if not 1 <= self.best_sources <= 3 or not 1 <= self.sources <= 16:
            raise UsageError("dense stereo takes 1 to 16 source views and the mean of their best 1 to 3")
