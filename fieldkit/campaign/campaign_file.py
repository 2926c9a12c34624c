"""campaign.toml: what a campaign's folder holds, and how its visits are evaluated. docs/campaigns.md lists the keys."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, Self

from pydantic import Field, model_validator

from fieldkit.documents.toml_file import read_versioned, toml_text, validated_toml
from fieldkit.results.fields import Strict
from fieldkit.runtime.shipped import shipped_page
from fieldkit.sites.site import Name
from fieldkit.vocabulary import DISTANCES_M, Fidelity, MappingChoice, Mask, TiesName

if TYPE_CHECKING:
    from fieldkit.evaluation.rasters import Rasters
    from fieldkit.reconstruction.settings import ReconstructionSettings

_MAX_BYTES = 1 << 20
"""Largest campaign.toml that is read, bytes."""
_REMEDY = f"{shipped_page('docs/campaigns.md')} lists the keys of campaign.toml."

FileName = Annotated[str, Field(min_length=1, max_length=1000, pattern=r"^[^\x00]+$")]
Distance = Annotated[float, Field(gt=0, le=10)]


class EvaluationTable(Strict):
    """How every visit is evaluated; see `ReconstructionSettings`."""

    mapping: MappingChoice = "auto"
    ties: TiesName = "sift"
    fidelity: Fidelity = "standard"
    mask: Mask = "exg"
    bounds_m: tuple[float, float, float, float, float, float] | None = None
    """Volume of interest for every plot, plot frame: xmin, ymin, zmin, xmax, ymax, zmax."""
    refine: bool = False
    """Move each cloud onto its plot's reference by ICP before it is scored."""
    distances_m: Annotated[tuple[Distance, ...], Field(min_length=1, max_length=20)] = DISTANCES_M
    """Of precision, recall and F-score."""
    seed: Annotated[int, Field(ge=0, lt=2**32)] = 0
    rasters: bool = False
    """Write height models of every visit, too."""
    gsd_m: Annotated[float | None, Field(gt=0, lt=10)] = None
    """Edge of their cells; None takes 5 mm or the depth maps' pixel."""

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
    def settings(self) -> ReconstructionSettings:
        """The same as the reconstruction takes it."""
        from fieldkit.clouds.volume import Volume
        from fieldkit.reconstruction.learned import ties_name
        from fieldkit.reconstruction.settings import ReconstructionSettings

        b = self.bounds_m
        return ReconstructionSettings(
            mapping=self.mapping, ties=ties_name(self.ties), fidelity=self.fidelity, mask=self.mask,
            bounds=None if b is None else Volume(b[:3], b[3:]), seed=self.seed,
        )  # fmt: skip

    @property
    def wanted_rasters(self) -> Rasters | None:
        """The height models to write; None for none."""
        from fieldkit.evaluation.rasters import Rasters

        return Rasters(self.gsd_m) if self.rasters else None


class ReferenceTable(Strict):
    """The dense reference of one plot."""

    plot: Name
    path: FileName
    """Folder that `fieldkit reference` wrote; relative to the campaign's folder, or absolute."""
    sha256: Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]
    """Of its reference.json."""


class CampaignTable(Strict):
    """campaign.toml. File names are relative to its folder."""

    format: Literal[1] = 1
    name: Name = "campaign"
    plan: FileName = "plan.json"
    site: FileName = "site.toml"
    plots: FileName | None = None
    """GeoJSON file whose plots take the place of the site file's own."""
    vehicle: FileName | None = None
    camera: FileName | None = None
    """Calibration (camera.toml) of photographs that have none beside them."""
    evaluation: EvaluationTable = EvaluationTable()
    references: Annotated[tuple[ReferenceTable, ...], Field(max_length=2000)] = ()

    @model_validator(mode="after")
    def _one_reference_a_plot(self) -> Self:
        seen: set[str] = set()
        for reference in self.references:
            if reference.plot in seen:
                raise ValueError(f'references: two of them are of plot "{reference.plot}"')
            seen.add(reference.plot)
        return self


def read_campaign_file(path: Path) -> CampaignTable:
    """Read campaign.toml."""
    document = read_versioned(path, "campaign", _REMEDY, _MAX_BYTES)
    return validated_toml(CampaignTable, document, path, _REMEDY)


def campaign_text(table: CampaignTable) -> str:
    """The text of a campaign.toml, every setting written out, so that people see what they can change."""
    document = table.model_dump()
    return toml_text({**document, "references": list(document["references"]) or None})
