"""What a person can choose about references and evaluations, as options and in campaign.toml. Imports nothing heavy."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Self

from pydantic import Field, model_validator

from fieldkit.results.fields import Strict
from fieldkit.vocabulary import DISTANCES_M, Fidelity, MappingChoice, Mask, TiesName

if TYPE_CHECKING:
    from fieldkit.evaluation.rasters import Rasters
    from fieldkit.reconstruction.settings import ReconstructionSettings

Distance = Annotated[float, Field(gt=0, le=10)]


class EvaluationSettings(Strict):
    """How photographs are reconstructed and scored."""

    mapping: MappingChoice = "auto"
    """How poses are found; auto (where not given): prior with known positions, else incremental."""
    ties: TiesName = "sift"
    """Matches that tie photographs: SIFT's, or networks', too, where poses are loose."""
    fidelity: Fidelity = "standard"
    """What a pixel covers at the plants: 4, 2 or 1.2 mm, or the photographs' own; standard where not given."""
    mask: Mask = "exg"
    """What is plant: exg what is green (where not given), none everything, file masks/NAME.png."""
    bounds_m: tuple[float, float, float, float, float, float] | None = None
    """Lowest and highest corner of the volume of interest, metres in the plot frame. Found where not given."""
    refine: bool = False
    """Move each cloud onto its plot's reference by ICP first; the motion is reported."""
    distances_m: Annotated[tuple[Distance, ...], Field(min_length=1, max_length=20)] = DISTANCES_M
    """Distances for precision, recall and F-score, metres; 0.002,0.005,0.01,0.02 where not given."""
    seed: Annotated[int, Field(ge=0, lt=2**32)] = 0
    rasters: bool = False
    """Also write canopy-height.tif and surface.tif (GeoTIFF in UTM, with QGIS styles); of many plots orthophoto.tif."""
    gsd_m: Annotated[float | None, Field(gt=0, lt=10)] = None
    """With rasters: edge of their cells, metres; 5 mm or the depth maps' pixel where not given."""

    @model_validator(mode="after")
    def _bounds_are_a_box(self) -> Self:
        b = self.bounds_m
        if b is not None and not all(b[k] < b[k + 3] for k in range(3)):
            raise ValueError("bounds_m: the lowest corner is not below the highest")
        if tuple(sorted(set(self.distances_m))) != self.distances_m:
            raise ValueError("distances_m: they are not ascending")
        if self.gsd_m is not None and not self.rasters:
            raise ValueError("gsd_m: it is the cells of rasters, which are not asked for (rasters = true)")
        return self

    @property
    def reconstruction(self) -> ReconstructionSettings:
        """The same as the reconstruction takes it. Raises UsageError: the networks are not installed."""
        from fieldkit.clouds.volume import Volume
        from fieldkit.reconstruction.learned import ties_name
        from fieldkit.reconstruction.settings import ReconstructionSettings

        b = self.bounds_m
        return ReconstructionSettings(
            mapping=self.mapping,
            ties=ties_name(self.ties),
            fidelity=self.fidelity,
            mask=self.mask,
            bounds=None if b is None else Volume(b[:3], b[3:]),
            seed=self.seed,
        )

    @property
    def wanted_rasters(self) -> Rasters | None:
        """The height models to write; None for none. Raises UsageError: what writes them is not installed."""
        if not self.rasters:
            return None
        from fieldkit.evaluation.rasters import Rasters, require_rasters

        require_rasters()
        return Rasters(self.gsd_m)
