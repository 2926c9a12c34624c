"""fieldkit evaluate."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

from typer import Option

from fieldkit.cli.common import JsonOption, LogOption, PlotIdOption, emit_json, show
from fieldkit.cli.options import Panels
from fieldkit.cli.reconstruction_options import (
    RECONSTRUCTION,
    ComputingOptions,
    PosesOptions,
    TiesOption,
    parse_distances,
    parse_frame,
    with_ties,
)
from fieldkit.errors import EXIT_OK, ReconstructionError, UsageError
from fieldkit.evaluation.settings import EvaluationSettings
from fieldkit.wording import count

SETTINGS: Panels = {
    **RECONSTRUCTION,
    "Options": {
        "refine": None,
        "distances_m": Annotated[str, Option("--distances", parser=parse_distances, metavar="M,M,…")],
        **RECONSTRUCTION["Options"],
    },
}

_OF_ONE_PLOT = {"bounds_m": "--bounds", "refine": "--refine", "distances_m": "--distances"}
"""Settings that a flight over many plots does not take, and their options."""


def command(
    captures: Path,
    *,
    output: Annotated[Path | None, Option("--output", "-o")] = None,
    campaign: Path | None = None,
    reference: Path | None = None,
    reference_frame: Annotated[str, Option(metavar="FRAME")] = "",
    log: LogOption = None,
    plan: Path | None = None,
    plots: Path | None = None,
    plot_id: PlotIdOption = None,
    ground: Path | None = None,
    shared: bool = False,
    settings: Annotated[EvaluationSettings, SETTINGS],
    ties: TiesOption = None,
    poses: PosesOptions,
    run: ComputingOptions,
    as_json: JsonOption = False,
) -> int:
    """Reconstruct new captures of one or many plots and score them against a reference.

    Each plot is reconstructed in the reference's frame by its own metric source, and compared with it. Without
    --reference the figures that need none are reported. The result holds evaluation.json, plots.csv, traits.csv with
    plants' height, cover and volume, and for each plot its cloud and a picture. Plots that fail are listed; the exit
    code is 4 only where all of them do.

    With --plots a flight over many plots, of whatever pattern, is mapped once, and each photograph counts for every
    plot that it shows.

    In a campaign's folder, or with --campaign, the photographs are sorted into its plots and dates by geotag and time,
    or by folders, and every visit that is new or changed is scored by the campaign's settings. A run that was stopped
    goes on when the same command is given again.

    Args:
        captures: Folder of photographs of one plot, or a folder of such folders; in a campaign any folder.
        output: The result's folder. It appears when the run is complete.
        campaign: Campaign to add to. Without -o: the one about the current folder.
        reference: What `fieldkit reference` wrote, or a cloud (PLY, LAS, LAZ). Without: no distances.
        reference_frame: Of a cloud that does not say it: EPSG:CODE or metres.
        plan: plan.json that was flown: how the photographs kept to it.
        shared: In a campaign: the photographs are of one flight over its plots, and each counts for every plot that it
            shows.
        plots: Plots that the photographs show together: GeoJSON, Shapefile (.shp or .zip), KML or GeoPackage.
        ground: With --plots or --shared: photographs of an earlier flight over the bare soil, for the ground under
            closed canopies.

    Examples:
        fieldkit evaluate flights/ --reference plot_7-reference -o scores
        fieldkit evaluate flight_7/ --log flight_7.tlog --plan plot_7-plan --reference plot_7-reference -o scores
        fieldkit evaluate grid_8m/ --plots plots.geojson -o scores --workers 2
        fieldkit evaluate card/DCIM --campaign season --workers 2
    """
    own = settings.model_fields_set
    others = {"--reference": reference, "--reference-frame": reference_frame, "--plan": plan, "--log": log}
    others |= {"--poses": poses.poses}
    others = {option: value for option, value in others.items() if value}
    if output is None:
        of_field = {"rasters", "gsd_m"} if shared else set()
        given = [f"--{name.removesuffix('_m')}" for name in type(settings).model_fields if name in own - of_field]
        given += [*others, *(option for option, value in {"--ties": ties, "--plots": plots}.items() if value)]
        if ground is not None and not shared:
            given.append("--ground")
        folder = _campaign_folder(campaign, given)
        whole = settings if shared else None
        return _in_campaign(folder, captures, run, shared=whole, ground=ground, as_json=as_json)
    if shared:
        raise UsageError("--shared is of a campaign", remedy="Leave -o out, or give --plots instead.")
    if campaign is not None:
        raise UsageError("a campaign's results go into its own folder", remedy="Leave -o out, or --campaign.")
    if plots is not None:
        unfit = [*others, *(option for name, option in _OF_ONE_PLOT.items() if name in own)]
        if unfit:
            raise UsageError(
                f"{unfit[0]} is of one plot, and --plots of all that a flight shows",
                remedy=f"Leave {unfit[0]} out, or evaluate each plot's photographs without --plots.",
            )
    elif plot_id is not None or ground is not None:
        option = "--plot-id" if plot_id is not None else "--ground"
        raise UsageError(f"{option} goes with --plots", remedy="Give --plots with it.")
    settings, found_poses = with_ties(settings, ties), poses.given()
    frame = parse_frame("--reference-frame", reference_frame)
    if frame and reference is None:
        raise UsageError("--reference-frame is that of --reference", remedy="Give --reference with it.")
    from fieldkit.evaluation.evaluate import AllFailedError, evaluate
    from fieldkit.evaluation.flight import evaluate_flight
    from fieldkit.pictures.overview import write_overviews

    with run.context(as_json=as_json) as context:
        try:
            if plots is not None:
                report = evaluate_flight(
                    captures, plots, output, settings, context, plot_id=plot_id, ground=ground, overwrite=run.overwrite
                )
            else:
                report = evaluate(
                    captures,
                    output,
                    settings,
                    context,
                    reference=reference,
                    reference_frame=frame,
                    log=log,
                    plan=plan,
                    poses=found_poses,
                    overwrite=run.overwrite,
                )
        except AllFailedError as error:
            report = error.report
    write_overviews(output, report)
    if as_json:
        emit_json(
            {"output": output, **report.model_dump(mode="json", exclude={"plots": {"__all__": {"image_reports"}}})}
        )
    else:
        from fieldkit.figures.terminal import evaluation_output

        show(evaluation_output(report), output)
    return ReconstructionError.exit_code if report.failed == len(report.plots) else EXIT_OK


def _campaign_folder(campaign: Path | None, given: Sequence[str]) -> Path:
    """The campaign that is meant; ``given`` are options of which campaign.toml says for all visits what they are."""
    from fieldkit.results.visit import find_campaign

    folder = campaign or find_campaign(Path.cwd())
    if folder is None:
        raise UsageError("missing option '--output' / '-o'", remedy="Give -o FOLDER, or --campaign CAMPAIGN.")
    for option in given:
        raise UsageError(
            f"{option} is not taken for the visits of a campaign",
            remedy=f"Edit campaign.toml in {folder}, give -o, or for a log write its poses with `fieldkit geotag`.",
        )
    return folder


def _in_campaign(
    folder: Path,
    captures: Path,
    run: ComputingOptions,
    *,
    shared: EvaluationSettings | None,
    ground: Path | None,
    as_json: bool,
) -> int:
    """Evaluate the photographs' visits in a campaign; ``shared`` asks for rasters of a flight over all plots."""
    from fieldkit.campaign.run import evaluate_campaign
    from fieldkit.campaign.shared import evaluate_shared

    with run.context(as_json=as_json) as context:
        if shared is not None:
            done = evaluate_shared(folder, captures, context, ground=ground, rasters=shared.wanted_rasters)
        else:
            done = evaluate_campaign(folder, captures, context, overwrite=run.overwrite)
    if as_json:
        emit_json(
            {
                "campaign": folder,
                "photographs": done.photographs,
                "evaluated": [visit.row() for visit in done.evaluated],
                "kept": [visit.row() for visit in done.kept],
                "failed": done.failed,
                "left_out": [finding.stored() for finding in done.left_out],
                "findings": [finding.stored() for finding in done.findings],
                "vanished": list(done.campaign.vanished),
            }
        )
    else:
        from fieldkit.campaign.overview import MOST_SHOWN, campaign_tables, verdict
        from fieldkit.figures.terminal import rendered

        left = f"; {count(len(done.left_out), 'file')} left out" if done.left_out else ""
        show(
            f"{verdict(done.campaign)[0]}.",
            f"{count(len(done.evaluated), 'visit')} evaluated, {len(done.kept)} there already, {done.failed} failed"
            f"{left}",
            rendered(campaign_tables(done.campaign), most_rows=MOST_SHOWN),
        )
    return ReconstructionError.exit_code if done.failed == len(done.evaluated) + len(done.kept) else EXIT_OK
