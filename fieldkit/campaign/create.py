"""fieldkit campaign init: a folder that knows plan, site, plots, vehicle and references."""

from __future__ import annotations

import os
import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from pydantic import ValidationError

from fieldkit.campaign.reading import (
    Campaign,
    CampaignTable,
    ReferenceTable,
    campaign_text,
    read_campaign,
)
from fieldkit.captures.camera_file import read_camera_file
from fieldkit.documents.toml_file import read_versioned, sentence
from fieldkit.errors import MetadataError, UsageError
from fieldkit.evaluation.settings import EvaluationSettings
from fieldkit.files import atomic_folder, file_beside, write_atomic
from fieldkit.regular_files import check_regular
from fieldkit.results.finding import Refused
from fieldkit.results.plan_file import PLAN_FILE, load_plan, save_plan
from fieldkit.results.report_files import REFERENCE_FILE, file_sha256, load_reference_report
from fieldkit.results.visit import CAMPAIGN_FILE, find_campaign
from fieldkit.sites.fit import other_camera
from fieldkit.sites.plots_file import read_plots
from fieldkit.sites.site_file import MAX_BYTES, Tell, load_site, plots_file_beside, plots_named
from fieldkit.sites.vector_files import parts_of
from fieldkit.vehicles.vehicle_file import find_vehicle, load_vehicle
from fieldkit.wording import listed

SITE_FILE, PLOTS_FILE, VEHICLE_FILE, CAMERA_FILE = "site.toml", "plots.geojson", "vehicle.toml", "camera.toml"
_ZONES = ("geofence", "no_fly", "plots", "neighbours")


@dataclass(frozen=True)
class CampaignSources:
    """What a campaign is made of."""

    plan: Path
    """Plan.json or its folder."""
    site: Path
    plots: Path | None = None
    """File whose plots take the place of the site's; None keeps those."""
    vehicle: str | None = None
    """Profile, by name or path; None for none."""
    camera: Path | None = None
    """Calibration for photographs that have none beside them; None for none."""
    references: Mapping[str, Path] | None = None
    """Folders that `fieldkit reference` wrote, by plot."""
    plot_id: str | None = None
    """Field of the plots file that holds their ids; None looks for one."""


def init_campaign(
    folder: Path,
    sources: CampaignSources,
    evaluation: EvaluationSettings | None = None,
    *,
    name: str | None = None,
    tell: Tell | None = None,
) -> Campaign:
    """Make a campaign's folder, whole or not at all.

    Plan, site, plots, vehicle and camera are copied, so that the folder can be taken along; plots of another kind than
    GeoJSON in WGS 84 are copied as that, so that the folder needs nothing more. References are large and
    stay where they are, named by a path relative to the folder where they share one with it.
    """
    folder = Path(folder).absolute()
    around = find_campaign(folder.resolve())
    if around is not None:
        why = "is a campaign already" if around == folder.resolve() else f"lies in the campaign {around}"
        raise UsageError(why, path=folder, remedy="Choose another folder, or evaluate captures into that campaign.")
    plan = load_plan(sources.plan)
    site = load_site(sources.site, sources.plots, sources.plot_id, tell=tell)
    if sources.vehicle is not None:
        against = list(other_camera(plan, site.plots[0], load_vehicle(sources.vehicle)))
        if against:
            raise Refused(against)
    if sources.camera is not None:
        read_camera_file(sources.camera)
    references = [_reference(plot, path, folder) for plot, path in (sources.references or {}).items()]
    with atomic_folder(folder) as partial:
        plots = _copy_site(sources, partial, sources.plot_id or (site.plot_id if sources.plots is None else None))
        save_plan(partial / PLAN_FILE, plan)
        if sources.vehicle is not None:
            _copy(find_vehicle(sources.vehicle), partial / VEHICLE_FILE)
        if sources.camera is not None:
            _copy(sources.camera, partial / _camera_name(sources.camera))
        try:
            table = CampaignTable(
                name=folder.name[:80].strip() or "campaign" if name is None else name,
                plots=plots,
                vehicle=None if sources.vehicle is None else VEHICLE_FILE,
                camera=None if sources.camera is None else _camera_name(sources.camera),
                evaluation=evaluation or EvaluationSettings(),
                references=tuple(references),
            )
        except ValidationError as error:
            raise UsageError(sentence(error), remedy="Give another name.") from error
        write_atomic(partial / CAMPAIGN_FILE, campaign_text(table))
        read_campaign(partial)
    return read_campaign(folder)


def _copy_site(sources: CampaignSources, folder: Path, plot_id: str | None) -> str | None:
    """Copy the site file and what it names; the name of the file that holds the plots, None where the site file does.

    Files that the site file names absolutely stay where they are.
    """
    _copy(sources.site, folder / SITE_FILE)
    plots = sources.plots or plots_file_beside(sources.site)
    converted = None if plots is None else read_plots(plots, plot_id).geojson()
    document = read_versioned(sources.site, "site file", MAX_BYTES)
    for key in _ZONES:
        named = document.get(key)
        its_own = key == "plots" and converted and not sources.plots
        if not isinstance(named, str) or Path(named).is_absolute() or its_own:
            continue
        found = file_beside(Path(named), sources.site)  # load_site has read it
        target = folder / os.path.normpath(named)
        if found is None or not found.exists() or target.exists() or not target.is_relative_to(folder):
            continue
        target.parent.mkdir(parents=True, exist_ok=True)
        for part in parts_of(found):
            _copy(part, target.with_suffix(part.suffix))
    if plots is None:
        return None
    target = folder / PLOTS_FILE
    target = target.with_stem("flown-plots") if target.exists() else target  # beside the site's own: neighbours
    if converted is not None:
        write_atomic(target, converted)
        return target.name
    if sources.plots is None:
        return plots_named(sources.site)
    _copy(plots, target)
    return target.name


def _copy(source: Path, target: Path) -> None:
    try:
        check_regular(source)
        shutil.copyfile(source, target)
    except OSError as error:
        if error.filename is not None and Path(os.fsdecode(error.filename)) != Path(source):
            raise  # of the target: the disk's business
        raise MetadataError(
            f"cannot be read: {error.strerror}", path=source, remedy="Check its permissions."
        ) from error


def _camera_name(camera: Path) -> str:
    return Path(CAMERA_FILE).with_suffix(".json" if camera.suffix.lower() == ".json" else ".toml").name


def _reference(plot: str, path: Path, folder: Path) -> ReferenceTable:
    report = load_reference_report(path)
    if not report.metric:
        raise MetadataError(
            "this reference has no metric scale, so no visit can be compared with it",
            path=path,
            remedy="Build it again with poses.csv, geo.txt, GPS or markers.toml beside the photographs.",
        )
    place = path.absolute() if path.is_dir() else path.absolute().parent
    near = place.parts[:2] == folder.parts[:2]  # else a path between them, over the root or to another drive, says less
    written = os.path.relpath(place, folder) if near else place
    return ReferenceTable(plot=plot, path=Path(written).as_posix(), sha256=file_sha256(place / REFERENCE_FILE))


def split_references(texts: Sequence[str], plots: Sequence[str]) -> dict[str, Path]:
    """PLOT=REF as people give it."""
    references: dict[str, Path] = {}
    for text in texts:
        plot, _, path = text.partition("=")
        if plot not in plots or not path or plot in references:
            raise UsageError(
                f"--reference: names no plot of the site, or one twice: {text}",
                remedy=f"Write it like --reference {plots[0]}=references/7, with one of: {listed(list(plots), 40)}.",
            )
        references[plot] = Path(path)
    return references
