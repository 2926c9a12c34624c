"""fieldkit evaluate."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from fieldkit.cli.common import (
    DebugOption,
    JsonOption,
    OutputOption,
    OverwriteOption,
    ResumeOption,
    SeedOption,
    console,
    emit_json,
)
from fieldkit.cli.reconstruction_options import (
    Backend,
    BackendOption,
    BoundsOption,
    Fidelity,
    FidelityOption,
    Mapping,
    MappingOption,
    Mask,
    MaskOption,
    NoCacheOption,
    WorkersOption,
    make_settings,
    open_cache,
    parse_distances,
    run_context,
)
from fieldkit.errors import EXIT_OK, ReconstructionError


def command(
    captures: Annotated[Path, typer.Argument(help="Folder of photographs of one plot, or a folder of such folders.")],
    output: OutputOption,
    reference: Annotated[
        Path | None, typer.Option("--reference", help="What `fieldkit reference` wrote. Without: no distances.")
    ] = None,
    log: Annotated[
        Path | None,
        typer.Option(
            "--log", help="Flight log (.tlog, .BIN, .ulg): poses of its triggers instead of poses.csv or GPS."
        ),
    ] = None,
    plan: Annotated[
        Path | None, typer.Option("--plan", help="plan.json that was flown: how the flight kept to it, with --log.")
    ] = None,
    refine: Annotated[
        bool, typer.Option("--refine", help="Move each cloud onto the reference by ICP first; the motion is reported.")
    ] = False,
    distances: Annotated[
        str, typer.Option("--distances", metavar="M,M,…", help="Distances for precision, recall and F-score, metres.")
    ] = "0.002,0.005,0.010,0.020",
    mapping: MappingOption = Mapping.AUTO,
    fidelity: FidelityOption = Fidelity.STANDARD,
    mask: MaskOption = Mask.EXG,
    backend: BackendOption = Backend.AUTO,
    bounds: BoundsOption = "",
    workers: WorkersOption = 1,
    seed: SeedOption = 0,
    overwrite: OverwriteOption = False,
    resume: ResumeOption = False,
    no_cache: NoCacheOption = False,
    as_json: JsonOption = False,
    debug: DebugOption = False,
) -> int:
    """Reconstruct new captures of one or many plots and score them against a reference.

    Each plot is reconstructed in the reference's frame by its own metric source, and compared with it. Without
    --reference the figures that need none are reported. The result holds evaluation.json, plots.csv, and for each plot
    its cloud and a picture. Plots that fail are listed; the exit code is 4 only where all of them do.

    Example: fieldkit evaluate flights/ --reference plot_7-reference -o scores
    """
    cache = open_cache(no_cache=no_cache, resume=resume)
    distances_m = parse_distances(distances)
    settings = make_settings(mapping=mapping, fidelity=fidelity, mask=mask, backend=backend, bounds=bounds, seed=seed)
    from fieldkit.evaluation.evaluate import evaluate_captures

    with run_context(as_json=as_json) as progress:
        report = evaluate_captures(
            captures,
            output,
            settings,
            reference=reference,
            refine=refine,
            distances_m=distances_m,
            log=log,
            plan=plan,
            cache=cache,
            progress=progress,
            overwrite=overwrite,
            workers=workers,
        )
    if as_json:
        emit_json(
            {"output": output, **report.model_dump(mode="json", exclude={"plots": {"__all__": {"image_reports"}}})}
        )
    else:
        from fieldkit.reporting.tables import evaluation_tables

        show = console()
        for table in evaluation_tables(report):
            show.print(table)
        show.print(f"{output}", markup=False, soft_wrap=True)
    return ReconstructionError.exit_code if report.failed == len(report.plots) else EXIT_OK
