"""fieldkit evaluate."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

from typer import Option

from fieldkit.cli.common import JsonOption, LogOption, emit_json, show
from fieldkit.cli.options import Panels
from fieldkit.cli.reconstruction_options import (
    RECONSTRUCTION,
    PosesOptions,
    RunOptions,
    SchedulerOption,
    TiesOption,
    parse_distances,
    parse_frame,
    run_context,
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


def command(
    captures: Path,
    *,
    output: Annotated[Path | None, Option("--output", "-o")] = None,
    campaign: Path | None = None,
    reference: Path | None = None,
    reference_frame: Annotated[str, Option(metavar="FRAME")] = "",
    log: LogOption = None,
    plan: Path | None = None,
    settings: Annotated[EvaluationSettings, SETTINGS],
    ties: TiesOption = None,
    poses: PosesOptions,
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
        plan: plan.json that was flown: how the photographs kept to it.

    Examples:
        fieldkit evaluate flights/ --reference plot_7-reference -o scores
        fieldkit evaluate flight_7/ --log flight_7.tlog --plan plot_7-plan --reference plot_7-reference -o scores
        fieldkit evaluate card/DCIM --campaign season --workers 2
    """
    if output is None:
        own = settings.model_fields_set
        given = [f"--{name.removesuffix('_m')}" for name in type(settings).model_fields if name in own]
        others = {"--reference": reference, "--reference-frame": reference_frame, "--plan": plan, "--ties": ties}
        others |= {"--log": log, "--poses": poses.poses}
        given += [option for option, value in others.items() if value]
        return _in_campaign(_campaign_folder(campaign, given), captures, run, scheduler, as_json=as_json)
    if campaign is not None:
        raise UsageError("a campaign's results go into its own folder", remedy="Leave -o out, or --campaign.")
    settings, found_poses = with_ties(settings, ties), poses.given()
    frame = parse_frame("--reference-frame", reference_frame)
    if frame and reference is None:
        raise UsageError("--reference-frame is that of --reference", remedy="Give --reference with it.")
    from fieldkit.evaluation.evaluate import AllFailedError, evaluate
    from fieldkit.pictures.overview import write_overviews

    computing = run_context(as_json=as_json, workers=run.workers, scheduler=scheduler, no_cache=run.no_cache)
    with computing as context:
        try:
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


def _in_campaign(folder: Path, captures: Path, run: RunOptions, scheduler: str, *, as_json: bool) -> int:
    """Evaluate the photographs' visits in a campaign."""
    from fieldkit.campaign.run import evaluate_campaign

    computing = run_context(as_json=as_json, workers=run.workers, scheduler=scheduler, no_cache=run.no_cache)
    with computing as context:
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
