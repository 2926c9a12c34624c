"""fieldkit report."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from typer import Option

from fieldkit.cli.common import JsonOption, OverwriteOption, answer, emit_json, say


def command(
    folder: Path,
    output: Annotated[Path | None, Option("--output", "-o")] = None,
    points: int = 1_000_000,
    title: str = "",
    overwrite: OverwriteOption = False,
    as_json: JsonOption = False,
) -> None:
    """Show results as one HTML file that opens from disk, without network.

    Whatever fieldkit wrote in the folder or up to two levels below is joined: references, plans, missions, evaluations
    and campaigns, with a summary in words, tables, charts, 3D views and where every figure comes from.

    Args:
        folder: Folder of a reference, plan, mission, evaluation, campaign, or of several of these.
        output: The HTML file; DIR/report.html where not given.
        points: At most so many points in all 3D views together.
        title: Of the report; the folder's name where not given.

    Examples:
        fieldkit report season/ -o season.html
        fieldkit report plot_7-plan --title "Plot 7" --points 300000
    """
    import gc

    from fieldkit.cli.progress import open_progress
    from fieldkit.report.write_report import write_report

    with open_progress(as_json=as_json) as progress:
        gc.disable()  # nothing here is held in circles, and to look for such takes a sixth of the time
        done = write_report(folder, output, points=points, title=title, overwrite=overwrite, progress=progress)
        gc.enable()
    if as_json:
        from dataclasses import asdict

        emit_json(asdict(done))
        return
    for name in done.unreadable:
        say(f"{name} is damaged and not shown; the report says why")
    answer(f"{done.output} ({done.bytes / 1e6:.1f} MB): open it in a browser")
