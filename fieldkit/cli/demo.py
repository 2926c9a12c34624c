"""fieldkit demo."""

from __future__ import annotations

from typing import TYPE_CHECKING

from fieldkit.cli.common import JsonOption, OutputOption, SeedOption, emit_json, show
from fieldkit.cli.reconstruction_options import RunOptions, run_context

if TYPE_CHECKING:
    from collections.abc import Iterator

    from fieldkit.figures.content import Paragraph
    from fieldkit_sim.demo.loop import Demo


def command(output: OutputOption, run: RunOptions, seed: SeedOption = 0, as_json: JsonOption = False) -> None:
    """Try fieldkit without a drone: the whole way from a dense capture to scores, on two simulated plots of maize.

    Photographs two plots densely and builds their references; plans ten views for plots like the first; writes the
    mission and uploads it to a stand-in for a recorded ArduPilot; photographs both plots, the second of which the plan
    has not seen, in wind and with the noise of a flight, from the planned views and from the best circle; scores all
    without optimising again; and writes a report. Takes three to four minutes on two cores.

    Examples:
        fieldkit demo -o demo-output --workers 2
    """
    from fieldkit.results.demo import DEMO_FILE
    from fieldkit_sim.demo.loop import figures, run_demo

    overwrite = run.overwrite or (run.resume and not (output / DEMO_FILE).exists())
    with run_context(as_json=as_json, workers=run.workers, seed=seed, no_cache=run.no_cache) as context:
        demo = run_demo(output, context, overwrite=overwrite)
    if as_json:
        emit_json({"output": output, **figures(demo)})
        return
    from fieldkit.figures.content import Statements
    from fieldkit.figures.style import format_seconds
    from fieldkit.figures.terminal import rendered
    from fieldkit.report.sections.in_short import demo_statements, demo_table, demo_traits

    end = f"In {format_seconds(demo.seconds)}. Open the report in a browser:"
    first = Statements(demo_statements(demo.compared))
    grown = demo_traits(demo.compared, demo.evaluations)
    show(rendered([first, *_story(demo), grown, demo_table(demo.compared)]), end, demo.report)


def _story(demo: Demo) -> Iterator[Paragraph]:
    """What was done, before the scores."""
    from fieldkit.figures.content import Paragraph
    from fieldkit.figures.style import format_length

    off = format_length(demo.compared.reference_to_true_plants_m)
    yield Paragraph(
        f"Reference: {demo.reference.right} of {demo.reference.images} photographs, {demo.reference.points:,} "
        f"points; {off} (chamfer distance) from the plants' true surfaces."
    )
    yield Paragraph(
        f"Plan: {demo.outcome.cameras} views for {demo.outcome.plots} plots like the first, confirmed "
        f"{demo.outcome.confirmations} times on others. Mission: {demo.items} items, uploaded to the stand-in vehicle, "
        "read back and compared."
    )
