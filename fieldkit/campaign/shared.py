"""fieldkit evaluate --shared in a campaign: one flight over its plots becomes a visit of each plot that it shows."""

from __future__ import annotations

import shutil
import tempfile
from pathlib import Path

from fieldkit.campaign.reading import Campaign, read_campaign, stage_versions, visit_place
from fieldkit.campaign.run import CampaignRun, campaign_lock, sweep, write_traits
from fieldkit.campaign.sorting import folder_date
from fieldkit.errors import CaptureError
from fieldkit.evaluation.conversion import evaluation_report
from fieldkit.evaluation.evaluate_plot import RESERVED, write_evaluation
from fieldkit.evaluation.flight import LEAST_VIEWS, evaluate_plots
from fieldkit.evaluation.rasters import CANOPY_FILE, Rasters
from fieldkit.files import atomic_folder, check_writable
from fieldkit.results.evaluation import FlightEntry, PlotEvaluation
from fieldkit.results.visit import CAMPAIGN_FILE, VISIT_FILE, Visit, save_visit
from fieldkit.runtime.context import Context
from fieldkit.sites.plot_ids import plot_file_name
from fieldkit.version import __version__

FLIGHTS_FOLDER = "flights"
"""Of a campaign, with rasters of the whole field in a folder a date."""


def evaluate_shared(
    folder: Path,
    captures: Path,
    context: Context | None = None,
    *,
    ground: Path | None = None,
    rasters: Rasters | None = None,
) -> CampaignRun:
    """Map a flight over a campaign's plots once, and make a visit of every plot that it shows.

    The visits take the place of those of the same plots and date. They are made by the campaign's settings, without
    references, plans and rasters of single plots. With rasters the folder flights/DATE holds what
    `fieldkit.evaluation.field.write_field` makes of the whole field.

    Args:
        folder: of the campaign, whose plots have outlines.
        captures: folder of georeferenced photographs, of one date.
        ground: of an earlier flight over the bare soil.
        rasters: of the field; None takes the campaign's settings.

    Raises:
        FieldkitError: as `fieldkit.evaluation.flight.evaluate_flight`.
        CaptureError: nothing says the date.
    """
    context = context or Context.usual()
    folder = read_campaign(folder).folder
    check_writable(folder)
    with campaign_lock(folder, note=context.progress.note):
        sweep(folder)
        campaign = read_campaign(folder)
        # A cluster's workers see the folder of the cache, but not this machine's temporary ones.
        seen_by_all = context.cache.root if context.scheduler else None
        with tempfile.TemporaryDirectory(prefix="fieldkit-flight-", dir=seen_by_all) as made:
            drawn = [(plot, plot.shape) for plot in campaign.plots]
            settings, asked = campaign.evaluation.reconstruction, rasters or campaign.evaluation.wanted_rasters
            results, flight = evaluate_plots(
                captures,
                folder / CAMPAIGN_FILE,
                drawn,
                Path(made),
                settings,
                context,
                ground=ground,
                rasters=asked,
            )
            shown = [plot for plot in results if plot.images >= LEAST_VIEWS]
            date = next((plot.date for plot in shown if plot.date), None) or folder_date(captures.absolute().name)
            if date is None:
                raise CaptureError(
                    "nothing says when the photographs were taken",
                    path=captures,
                    remedy="Put them into a folder that is called by the date, like 2026-06-30.",
                )
            if (Path(made) / CANOPY_FILE).is_file():
                with atomic_folder(folder / FLIGHTS_FOLDER / date, overwrite=True, marker=CANOPY_FILE) as field:
                    for file in (file for file in Path(made).iterdir() if file.is_file()):
                        shutil.copy(file, field)
                flight = flight.model_copy(update={"picture": ()})  # it is not beside the visits
            visits = [_kept(campaign, plot, date, captures, Path(made), flight) for plot in shown]
        campaign = write_traits(folder)
    return CampaignRun(campaign, flight.images, tuple(visits), (), (), ())


def _kept(
    campaign: Campaign, plot: PlotEvaluation, date: str, captures: Path, made: Path, flight: FlightEntry
) -> Visit:
    """A plot's evaluation as a visit, written into its folder."""
    place, name = visit_place(plot.name, date), plot_file_name(plot.name, RESERVED)
    visit = Visit.of_evaluation(
        plot,
        plot=plot.name,
        date=date,
        captures=str(captures),
        folder=place,
        cpu_s=plot.cpu_seconds,
        fieldkit=__version__,
        stages=stage_versions(),
    )
    asked = campaign.evaluation
    report = evaluation_report(
        captures.absolute().name,
        [plot],
        asked.reconstruction,
        reference_sha256=None,
        refine=False,
        distances_m=asked.distances_m,
    )
    with atomic_folder(campaign.folder / place, overwrite=True, marker=VISIT_FILE) as folder:
        if (made / name).is_dir():
            shutil.copytree(made / name, folder / name)
        write_evaluation(folder, report.model_copy(update={"flight": flight}))
        save_visit(folder, visit)
    return visit
