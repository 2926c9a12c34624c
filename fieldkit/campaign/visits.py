"""A campaign's visits: visit.json in visits/PLOT/DATE, and nowhere else; and which fieldkit computed them."""

from __future__ import annotations

from pathlib import Path

from fieldkit.evaluation.prediction import prediction_model
from fieldkit.reconstruction.versions import STAGES
from fieldkit.results.evaluation import CLOUD_FILE
from fieldkit.results.report_files import EVALUATION_FILE, load_evaluation_report
from fieldkit.results.visit import VISIT_FILE, VISITS_FOLDER, Visit, load_visit, save_visit
from fieldkit.sites.plot_ids import plot_file_name

Visits = dict[tuple[str, str], Visit]
"""By plot and date."""
_OWN = (VISIT_FILE, EVALUATION_FILE)


def visit_place(plot: str, date: str) -> str:
    """A visit's folder, relative to the campaign's."""
    return f"{VISITS_FOLDER}/{plot_file_name(plot)}/{date}"


def visit_cloud(campaign: Path, visit: Visit) -> Path | None:
    """The cloud of a visit's plants; None where it has none."""
    return None if visit.error else visit_files(campaign, visit).get(CLOUD_FILE)


def visit_files(campaign: Path, visit: Visit) -> dict[str, Path]:
    """The files of a visit's evaluation that are still there, by their own name without folders."""
    if not visit.folder:
        return {}
    folder = campaign / visit.folder
    listed = [file.name for plot in load_evaluation_report(folder).plots for file in plot.files]
    return {Path(name).name: folder / name for name in listed if (folder / name).is_file()}


def read_visits(campaign: Path) -> list[Visit]:
    """All visits of a campaign's folder, by plot and date; a copy in another folder than its own is passed over."""
    visits, known, stages = [], set(Visit.model_fields), dict[str, dict[str, int]]()
    for file in (campaign / VISITS_FOLDER).glob(f"[!.]*/[!.]*/{VISIT_FILE}"):
        visit = load_visit(file.parent)
        # What is the same in all is held once: a season may have 20,000.
        visit.__dict__["stages"] = stages.setdefault(repr(visit.stages), visit.stages)
        object.__setattr__(visit, "__pydantic_fields_set__", known)
        if campaign / visit_place(*visit.key) == file.parent:
            visits.append(visit)
    return sorted(visits, key=lambda visit: visit.key)


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
