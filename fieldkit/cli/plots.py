"""fieldkit plots."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from typer import Option

from fieldkit.cli.common import JsonOption, OverwriteOption, emit_json, show
from fieldkit.documents.csv_text import finite_numbers
from fieldkit.errors import UsageError


def command(
    *,
    corners: Annotated[str, Option(metavar="LAT,LON,…")],
    grid: Annotated[str, Option(metavar="RANGESxCOLUMNS")],
    output: Annotated[Path, Option("--output", "-o")],
    alley: Annotated[float, Option(metavar="M", min=0.0, max=20.0)] = 0.0,
    gap: Annotated[float, Option(metavar="M", min=0.0, max=20.0)] = 0.0,
    overwrite: OverwriteOption = False,
    as_json: JsonOption = False,
) -> None:
    """Write the plots of a block from its four corners, for every option --plots.

    Plot r2c5 is the fifth column of the second range.

    Args:
        corners: Of the block: the first plot's outer corner, then along the rows to the last range, across to the last
            column, and back.
        grid: Ranges (plots along the rows) and columns (plots across them).
        output: GeoJSON file.
        alley: Bare ground between ranges.
        gap: Room between columns.

    Examples:
        fieldkit plots --corners 52.1,10.4,52.1,10.4003,52.1002,10.4003,52.1002,10.4 --grid 4x10 -o plots.geojson
    """
    import json

    from fieldkit.files import write_atomic
    from fieldkit.sites.plots_grid import plots_grid

    ranges, _, columns = grid.lower().replace("×", "x").partition("x")
    if not (ranges.isdecimal() and columns.isdecimal()):
        raise UsageError(f"--grid: {grid} is no number of plots", remedy="Write it like --grid 4x10.")
    if output.exists() and not overwrite:
        raise UsageError("exists already", path=output, remedy="Give --overwrite to replace it.")
    made = plots_grid(finite_numbers(corners), int(ranges), int(columns), alley_m=alley, gap_m=gap)
    write_atomic(output, json.dumps(made, indent=1) + "\n")
    if as_json:
        emit_json({"output": output, "plots": len(made["features"])})
    else:
        show(output)
