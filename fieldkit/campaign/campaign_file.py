"""campaign.toml: what a campaign's folder holds, and how its visits are evaluated. docs/campaigns.md lists the keys."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from fieldkit.documents.toml_file import read_versioned, toml_text, validated_toml
from fieldkit.evaluation.settings import EvaluationSettings
from fieldkit.results.fields import Strict
from fieldkit.runtime.shipped import shipped_page
from fieldkit.sites.site import Name

_MAX_BYTES = 1 << 20
"""Largest campaign.toml that is read, bytes."""
_REMEDY = f"{shipped_page('docs/campaigns.md')} lists the keys of campaign.toml."

FileName = Annotated[str, Field(min_length=1, max_length=1000, pattern=r"^[^\x00]+$")]


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
    evaluation: EvaluationSettings = EvaluationSettings()
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
