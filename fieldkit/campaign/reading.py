"""A campaign read from its folder: campaign.toml, plan, site, plots and visits (visit.json in visits/PLOT/DATE)."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import Field, model_validator

from fieldkit.documents.mistaken import refuse_other
from fieldkit.documents.toml_file import read_versioned, toml_text, validated_toml
from fieldkit.errors import MetadataError, MissionError, about
from fieldkit.evaluation.prediction import prediction_model
from fieldkit.evaluation.settings import EvaluationSettings
from fieldkit.files import file_beside, named_file
from fieldkit.reconstruction.versions import STAGES
from fieldkit.results.evaluation import PlotEvaluation
from fieldkit.results.fields import Sha256, Strict
from fieldkit.results.plan import Plan, plan_on
from fieldkit.results.plan_file import load_plan
from fieldkit.results.report_files import EVALUATION_FILE, REFERENCE_FILE, file_sha256, load_evaluation_report
from fieldkit.results.visit import CAMPAIGN_FILE, VISIT_FILE, VISITS_FOLDER, Visit, load_visit, save_visit
from fieldkit.runtime.shipped import shipped_page
from fieldkit.sites.fitted import flown_plans
from fieldkit.sites.plot_ids import plot_file_name
from fieldkit.sites.site import Name, Site, SitePlot
from fieldkit.sites.site_file import load_site, plots_named
from fieldkit.sites.vector_files import read_features

_REMEDY = "Make a campaign with `fieldkit campaign init`."
_MAX_BYTES = 1 << 20
"""Largest campaign.toml that is read, bytes."""
_KEYS_REMEDY = f"{shipped_page('docs/campaigns.md')} lists the keys of campaign.toml."

FileName = Annotated[str, Field(min_length=1, max_length=1000, pattern=r"^[^\x00]+$")]
Visits = dict[tuple[str, str], Visit]
"""By plot and date."""
_OWN = (VISIT_FILE, EVALUATION_FILE)


class ReferenceTable(Strict):
    """The dense reference of one plot."""

    plot: Name
    path: FileName
    """Folder that `fieldkit reference` wrote; relative to the campaign's folder, or absolute."""
    sha256: Sha256
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
    with about(path, _KEYS_REMEDY):
        return validated_toml(CampaignTable, read_versioned(path, "campaign", _MAX_BYTES))


def campaign_text(table: CampaignTable) -> str:
    """The text of a campaign.toml, every setting written out, so that people see what they can change."""
    document = table.model_dump()
    return toml_text({**document, "references": list(document["references"]) or None})


def visit_place(plot: str, date: str) -> str:
    """A visit's folder, relative to the campaign's."""
    return f"{VISITS_FOLDER}/{plot_file_name(plot)}/{date}"


def visit_files(campaign: Path, visit: Visit) -> dict[str, Path]:
    """The files of a visit's evaluation that are still there, by their own name without folders."""
    if not visit.folder:
        return {}
    folder = campaign / visit.folder
    listed = [file.name for plot in load_evaluation_report(folder).plots for file in plot.files]
    return {Path(name).name: folder / name for name in listed if (folder / name).is_file()}


def read_visits(campaign: Path) -> list[Visit]:
    """All visits of a campaign's folder, by plot and date; a copy in another folder than its own is passed over."""
    files = (campaign / VISITS_FOLDER).glob(f"[!.]*/[!.]*/{VISIT_FILE}")
    visits = ((load_visit(file.parent), file.parent) for file in files)
    return sorted((v for v, place in visits if campaign / visit_place(*v.key) == place), key=lambda visit: visit.key)


def keep_visit(campaign: Path, visit: Visit) -> bool:
    """Write a visit into its folder, beside an evaluation that may be there.

    False if it could not be: a folder that holds something else than a visit is somebody's other work.
    """
    place = campaign / visit_place(*visit.key)
    if place.is_dir() and any(place.iterdir()) and not any((place / name).is_file() for name in _OWN):
        return False
    save_visit(place, visit)
    return True


def stage_versions() -> dict[str, int]:
    """Versions of all that a visit is computed by: what invalidates results, and the fit that predictions are by."""
    return {**STAGES, "prediction": prediction_model().version}


def changed_stages(visit: Visit) -> tuple[str, ...] | None:
    """Stages that computed a visit and have another version today; none where it is current, None where not known."""
    if not visit.stages:
        return None
    now = stage_versions()
    return tuple(name for name in {**now, **visit.stages} if now.get(name) != visit.stages.get(name))


def is_current(visit: Visit) -> bool:
    """Whether this fieldkit would compute a visit in the same way."""
    return changed_stages(visit) == ()


class CampaignPlot(SitePlot):
    """A plot of the site, with its outline and its reference."""

    shape: tuple[tuple[float, float], ...] | None = None
    """Corners (latitude, longitude) where it is drawn as a polygon, the last not the first again; else None."""
    reference: Path | None = None
    """Folder of its dense reference, or None."""
    reference_sha256: str | None = None
    """Of the reference.json that campaign.toml names, or None."""

    def reference_sha256_now(self) -> str:
        """The SHA-256 of the reference.json that is there; "" where there is none."""
        if self.reference is None:
            return ""
        try:
            return file_sha256(self.reference / REFERENCE_FILE)
        except OSError:
            return ""


@dataclass(frozen=True)
class Campaign:
    """A campaign's folder, read."""

    name: str
    """In words."""
    folder: Path
    """Absolute."""
    plan: Plan
    """That is flown over every plot."""
    site: Site
    """Home, fence and the plots as missions need them."""
    plots: tuple[CampaignPlot, ...]
    """In the order of their file."""
    visits: tuple[Visit, ...]
    """By plot in that order (plots that are gone come last), then by date."""
    evaluation: EvaluationSettings
    """How every visit is evaluated."""
    plan_file: Path
    vehicle_file: Path | None = None
    camera_file: Path | None = None
    """In the folder; the latter two None where there is none."""

    def carried_plan(self, plot: str) -> Plan:
        """The campaign's plan as it is flown over a plot: fitted to it, if the plan is made for that."""
        known = [each for each in self.site.plots if each.name == plot]
        with suppress(MissionError):  # too different a plot: nothing was exported for it
            plans = flown_plans(self.plan, known)
            return plan_on(plans, plot) if known else self.plan
        return self.plan

    @cached_property
    def dates(self) -> tuple[str, ...]:
        """All dates with a visit, ascending."""
        return tuple(sorted({visit.date for visit in self.visits}))

    @cached_property
    def vanished(self) -> tuple[str, ...]:
        """Plots that have visits and are no longer among the plots."""
        known = {plot.name for plot in self.plots}
        return tuple(dict.fromkeys(visit.plot for visit in self.visits if visit.plot not in known))


def read_campaign(folder: Path) -> Campaign:
    """Read a campaign's folder."""
    folder = Path(folder).absolute()
    folder = folder.parent if folder.name == CAMPAIGN_FILE and folder.is_file() else folder
    file = folder / CAMPAIGN_FILE
    if not file.is_file():
        refuse_other(folder, "campaign", _REMEDY)
        raise MetadataError(f"is no campaign: there is no {CAMPAIGN_FILE} in it", path=folder, remedy=_REMEDY)
    table = read_campaign_file(file)
    plan_file = named_file(table.plan, file, "plan", what="campaign")
    site_file = named_file(table.site, file, "site", what="campaign")
    plots_file = None if table.plots is None else named_file(table.plots, file, "plots", what="campaign")
    site = load_site(site_file, plots_file, converted=True)
    plots = _plots(site, _shapes(site_file, plots_file), table, file)
    order = {plot.name: k for k, plot in enumerate(plots)}
    visits = sorted(read_visits(folder), key=lambda v: (order.get(v.plot, len(order)), v.plot, v.date))
    return Campaign(
        name=table.name,
        folder=folder,
        plan=load_plan(plan_file),
        site=site,
        plots=plots,
        visits=tuple(visits),
        evaluation=table.evaluation,
        plan_file=plan_file,
        vehicle_file=None if table.vehicle is None else named_file(table.vehicle, file, "vehicle", what="campaign"),
        camera_file=None if table.camera is None else named_file(table.camera, file, "camera", what="campaign"),
    )


def visit_plots(campaign: Campaign) -> list[PlotEvaluation]:
    """The evaluations of all visits with a result."""
    reports = (load_evaluation_report(campaign.folder / v.folder) for v in campaign.visits if v.folder and not v.error)
    return [plot for report in reports for plot in report.plots]


def _shapes(site_file: Path, plots_file: Path | None) -> dict[int, tuple[tuple[float, float], ...]]:
    """Polygons by the plot's place in the order of the plots file."""
    if plots_file is None:
        own = plots_named(site_file)
        plots_file = None if own is None else file_beside(Path(own), site_file)
    if plots_file is None:
        return {}
    return {k: f.parts[0] for k, f in enumerate(read_features(plots_file)) if f.kind == "Polygon"}


def _plots(
    site: Site, shapes: dict[int, tuple[tuple[float, float], ...]], table: CampaignTable, file: Path
) -> tuple[CampaignPlot, ...]:
    named: dict[str, dict[str, Any]] = {
        each.plot: {"reference": file.parent / each.path, "reference_sha256": each.sha256} for each in table.references
    }
    return tuple(
        CampaignPlot.model_construct(**dict(plot), shape=shapes.get(place), **named.get(plot.name, {}))
        for place, plot in enumerate(site.plots)
    )
