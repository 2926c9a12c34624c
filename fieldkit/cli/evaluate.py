"""fieldkit evaluate."""

from __future__ import annotations

from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from typer import Context, Option

from fieldkit.cli.common import JsonOption, LogOption, emit_json, show
from fieldkit.cli.reconstruction_options import (
    DISTANCES,
    DistancesOption,
    PosesOptions,
    RasterOptions,
    ReconstructionOptions,
    RunOptions,
    SchedulerOption,
    parse_distances,
    parse_frame,
    run_context,
)
from fieldkit.errors import EXIT_OK, ReconstructionError, UsageError
from fieldkit.wording import count

if TYPE_CHECKING:
    from fieldkit.cache import StageCache

# Parameters of which campaign.toml says for all visits alike what they are.
_OF_CAMPAIGN = {
    "reference",
    "reference_frame",
    "plan",
    "refine",
    "distances",
    "seed",
    *(each.name for group in (ReconstructionOptions, RasterOptions) for each in fields(group)),
}


@dataclass(frozen=True)
class FlightOptions:
    """What was flown."""

    log: LogOption = None
    plan: Path | None = None
    """plan.json that was flown: how the photographs kept to it."""


def command(
    context: Context,
    captures: Path,
    *,
    output: Annotated[Path | None, Option("--output", "-o")] = None,
    campaign: Path | None = None,
    reference: Path | None = None,
    reference_frame: Annotated[str, Option(metavar="FRAME")] = "",
    flight: FlightOptions,
    refine: bool = False,
    distances: DistancesOption = DISTANCES,
    reconstruction: ReconstructionOptions,
    poses: PosesOptions,
    rasters: RasterOptions,
    run: RunOptions,
    scheduler: SchedulerOption = "",
    as_json: JsonOption = False,
) -> int:
    """Reconstruct new captures of one or many plots and score them against a reference.

    Each plot is reconstructed in the reference's frame by its own metric source, and compared with it. Without
    --reference the figures that need none are reported. The result holds evaluation.json, plots.csv, traits.csv with
    plants' height, cover and volume, and for each plot its cloud and a picture. Plots that fail are listed; the exit
    code is 4 only where all of them do.

    In a campaign's folder, or with --campaign, the photographs are sorted into its plots and dates by geotag and time,
    or by folders, and every visit that is new or changed is scored by the campaign's settings. A run that was stopped
    goes on when the same command is given again.

    Args:
        captures: Folder of photographs of one plot, or a folder of such folders; in a campaign any folder.
        output: The result's folder. It appears when the run is complete.
        campaign: Campaign to add to. Without -o: the one about the current folder.
        reference: What `fieldkit reference` wrote, or a cloud (PLY, LAS, LAZ). Without: no distances.
        reference_frame: Of a cloud that does not say it: EPSG:CODE or metres.
        refine: Move each cloud onto the reference by ICP first; the motion is reported.

    Examples:
        fieldkit evaluate flights/ --reference plot_7-reference -o scores
        fieldkit evaluate flight_7/ --log flight_7.tlog --plan plot_7-plan --reference plot_7-reference -o scores
        fieldkit evaluate card/DCIM --campaign season --workers 2
    """
    distances_m = parse_distances(distances)
    cache = run.cache()
    if output is None:
        folder = _campaign_folder(context, campaign, flight, poses)
        return _in_campaign(folder, captures, cache, run, scheduler, as_json=as_json)
    if campaign is not None:
        raise UsageError("a campaign's results go into its own folder", remedy="Leave -o out, or --campaign.")
    wanted, settings = rasters.wanted(), reconstruction.settings(run.seed)
    given, frame = poses.given(), parse_frame("--reference-frame", reference_frame)
    if frame and reference is None:
        raise UsageError("--reference-frame is that of --reference", remedy="Give --reference with it.")
    from fieldkit.evaluation.evaluate import evaluate_captures

    with run_context(as_json=as_json) as progress:
        report = evaluate_captures(
            captures, output, settings, reference=reference, reference_frame=frame, refine=refine,
            distances_m=distances_m, log=flight.log, plan=flight.plan, poses=given, rasters=wanted,
            cache=cache, progress=progress, overwrite=run.overwrite, workers=run.processes,
            scheduler=scheduler,
        )  # fmt: skip
    if as_json:
        emit_json(
            {"output": output, **report.model_dump(mode="json", exclude={"plots": {"__all__": {"image_reports"}}})}
        )
    else:
        from fieldkit.figures.terminal.results import evaluation_output

        show(evaluation_output(report), output)
    return ReconstructionError.exit_code if report.failed == len(report.plots) else EXIT_OK


def _campaign_folder(context: Context, campaign: Path | None, flight: FlightOptions, poses: PosesOptions) -> Path:
    """The campaign that is meant."""
    from fieldkit.results.visit import find_campaign

    folder = campaign or find_campaign(Path.cwd())
    if folder is None:
        raise UsageError("missing option '--output' / '-o'", remedy="Give -o FOLDER, or --campaign CAMPAIGN.")
    for param in context.command.params:
        if param.name in _OF_CAMPAIGN and _was_given(context, param.name):
            raise UsageError(
                f"{param.opts[0]} is one for all visits of a campaign",
                remedy=f"Edit campaign.toml in {folder}, or give -o.",
            )
    if flight.log is not None:
        raise UsageError(
            "--log is not taken in a campaign", remedy="Write the poses with `fieldkit geotag` first, or give -o."
        )
    if poses.poses is not None:
        raise UsageError("--poses is not taken in a campaign", remedy="Leave it out, or give -o.")
    return folder


def _in_campaign(
    folder: Path, captures: Path, cache: StageCache, run: RunOptions, scheduler: str, *, as_json: bool
) -> int:
    """Evaluate the photographs' visits in a campaign."""
    from fieldkit.campaign.run import evaluate_campaign

    with run_context(as_json=as_json) as progress:
        done = evaluate_campaign(
            folder, captures, cache=cache, progress=progress, workers=run.processes, scheduler=scheduler,
            overwrite=run.overwrite,
        )  # fmt: skip
    if as_json:
        emit_json(
            {
                "campaign": folder, "photographs": done.photographs,
                "evaluated": [visit.row() for visit in done.evaluated],
                "kept": [visit.row() for visit in done.kept],
                "failed": done.failed, "left_out": [finding.stored() for finding in done.left_out],
                "findings": [finding.stored() for finding in done.findings], "vanished": list(done.campaign.vanished),
            }
        )  # fmt: skip
    else:
        from fieldkit.campaign.overview import MOST_SHOWN, campaign_tables, verdict
        from fieldkit.figures.terminal.blocks import rendered

        left = f"; {count(len(done.left_out), 'file')} left out" if done.left_out else ""
        show(
            f"{verdict(done.campaign)[0]}.",
            f"{count(len(done.evaluated), 'visit')} evaluated, {len(done.kept)} there already, {done.failed} failed"
            f"{left}",
            rendered(campaign_tables(done.campaign), most_rows=MOST_SHOWN),
        )
    return ReconstructionError.exit_code if done.failed == len(done.evaluated) + len(done.kept) else EXIT_OK


def _was_given(context: Context, name: str) -> bool:
    source = context.get_parameter_source(name)
    return source is not None and source.name == "COMMANDLINE"
