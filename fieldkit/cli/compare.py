"""fieldkit compare."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from fieldkit.cli.common import JsonOption, OverwriteOption, emit_json, show


def command(
    evaluations: Annotated[list[str], Argument(metavar="EVAL...")],
    output: Annotated[Path | None, Option("--output", "-o")] = None,
    overwrite: OverwriteOption = False,
    as_json: JsonOption = False,
) -> None:
    """Compare evaluations plot by plot: values, differences, and which of these are more than noise.

    Plots are matched by their names. Each evaluation is compared with the first and with the one before it. Distances
    and F-scores are compared only where all were scored against the same reference. Evaluations of one label repeat one
    another: their scatter is then the noise; else traits and predictions have the errors that the benchmark found.

    Args:
        evaluations: What `fieldkit evaluate` wrote, in order of dates: PATH, or LABEL=PATH.
        output: The result's folder. Without: only the tables.

    Examples:
        fieldkit compare may-scores june-scores -o spring
        fieldkit compare windy=flight_1 windy=flight_2 calm=flight_3
    """
    from fieldkit.cli.progress import open_progress
    from fieldkit.evaluation.compare import compare_evaluations

    with open_progress(as_json=as_json) as progress:
        done = compare_evaluations(evaluations, output, overwrite=overwrite, progress=progress)
    if as_json:
        emit_json({"output": done.output, **done.report.model_dump(mode="json")})
        return
    from fieldkit.figures.terminal import comparison_output

    show(comparison_output(done.report), *([] if done.output is None else [done.output]))
