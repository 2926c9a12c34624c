"""fieldkit demo."""

from __future__ import annotations

from fieldkit.cli.common import JsonOption, OutputOption, SeedOption, emit_json, show
from fieldkit.cli.reconstruction_options import RunOptions, run_context


def command(output: OutputOption, run: RunOptions, seed: SeedOption = 0, as_json: JsonOption = False) -> None:
    """Try fieldkit without a drone: a small simulated trial, from its plots' outlines to a table of their traits.

    Plans a pattern of passes for a block of maize; writes the mission; photographs the block by it and by an app's
    grid, which may both take two minutes, in wind and with the noise of a flight with RTK; measures all plots by both;
    and writes a report with the truth beside what was measured. Takes three to four minutes on two cores.

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
    from fieldkit.report.sections.demo import demo_errors, demo_statement, demo_traits

    end = f"In {format_seconds(demo.seconds)}. Open the report in a browser:"
    first, tables = Statements((demo_statement(demo.compared),)), demo_traits(demo.compared, demo.evaluations)
    show(rendered([first, demo_errors(demo.compared), tables]), end, demo.report)
