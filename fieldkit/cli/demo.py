"""fieldkit demo."""

from __future__ import annotations

from typing import TYPE_CHECKING

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
from fieldkit.cli.reconstruction_options import NoCacheOption, WorkersOption, open_cache, run_context

if TYPE_CHECKING:
    from rich.table import Table

    from fieldkit.demo.loop import Demo


def command(
    output: OutputOption,
    workers: WorkersOption = 1,
    seed: SeedOption = 0,
    overwrite: OverwriteOption = False,
    resume: ResumeOption = False,
    no_cache: NoCacheOption = False,
    as_json: JsonOption = False,
    debug: DebugOption = False,
) -> None:
    """Try fieldkit without a drone: the whole way from a dense capture to scores, on two simulated plots of maize.

    Photographs two plots densely and builds their references; plans ten views for plots like the first; writes the
    mission and uploads it to a stand-in for a recorded ArduPilot; photographs both plots, the second of which the plan
    has not seen, with the pose noise of the recorded flight, from the planned views and from the best circle; scores
    all without optimising again; and writes a report. Takes three to five minutes on two cores.

    Examples:
        fieldkit demo -o demo-output --workers 2

    Exit codes:
        0  done
        2  wrong usage, or the output exists already
        3  this machine cannot render, or the output folder cannot be used
        4  a reconstruction failed

    See Also:
        fieldkit doctor, fieldkit report
    """
    cache = open_cache(no_cache=no_cache, resume=resume)
    from fieldkit.demo.loop import figures, run_demo

    with run_context(as_json=as_json) as progress:
        demo = run_demo(output, seed=seed, cache=cache, progress=progress, overwrite=overwrite, workers=workers)
    if as_json:
        emit_json({"output": output, **figures(demo)})
        return
    from fieldkit.present.style import format_length, format_seconds

    show = console()
    truth = demo.truth.chamfer
    show.print(
        f"\nReference: {demo.reference.right} of {demo.reference.images} photographs, {demo.reference.points:,} "
        f"points; {format_length(truth.chamfer_m)} (chamfer distance) from the plants' true surfaces."
    )
    show.print(
        f"Plan: {demo.outcome.cameras} views for {demo.outcome.plots} plots like the first, confirmed "
        f"{demo.outcome.confirmations} times on others. Mission: {demo.items} items, uploaded to the stand-in vehicle, "
        "read back and compared."
    )
    show.print(
        f"Flight: the recorded vehicle kept to its plan within {format_length(demo.flight.position_m)} and "
        f"{demo.flight.angle_deg:.1f}° (standard deviations, {demo.flight.photographs} photographs). "
        "The captures below have this noise.\n"
    )
    show.print(_scores(demo))
    show.print(f"\nIn {format_seconds(demo.seconds)}. Open the report in a browser:")
    show.print(str(demo.report), markup=False, soft_wrap=True)


def _scores(demo: Demo) -> Table:
    from fieldkit.present.style import DASH, decimal, format_length, table

    found = table(
        "Chamfer distance of planned views and of the best circle, to each plot's reference",
        "plot",
        "views",
        "right",
        "chamfer>",
        "accuracy>",
        "complete>",
        "F at 10 mm>",
        "to true plants>",
    )
    for each in demo.scores:
        plot = each.evaluation
        f_score = None if plot.f_score is None else plot.f_score.get("0.010")
        found.add_row(
            each.plot, each.cameras, f"{plot.right}/{plot.images}",
            *(format_length(value) for value in (plot.chamfer_m, plot.accuracy_m, plot.completeness_m)),
            decimal(f_score, 3) or DASH, format_length(each.truth.chamfer.chamfer_m),
        )  # fmt: skip
    return found
