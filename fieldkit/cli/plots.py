"""fieldkit plots."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from typer import Option

from fieldkit.cli.common import JsonOption, OverwriteOption, emit_json, show
from fieldkit.documents.csv_text import finite_numbers
from fieldkit.errors import UsageError
from fieldkit.wording import count


def parse_grid(text: str) -> tuple[int, int]:
    """Ranges and columns of --grid."""
    numbers = text.lower().replace("×", "x").split("x")
    if len(numbers) == 2 and all(n.isdecimal() and 1 <= int(n) <= 1000 for n in numbers):
        return int(numbers[0]), int(numbers[1])
    raise UsageError(f"--grid: {text} is no number of plots", remedy="Write it like --grid 4x10.")


def parse_corners(text: str) -> tuple[float, ...]:
    """The eight numbers of --corners."""
    numbers = finite_numbers(text)
    if len(numbers) == 8 and all(abs(n) <= 90.0 for n in numbers[::2]) and all(abs(n) <= 180.0 for n in numbers[1::2]):
        return numbers
    raise UsageError(
        f"--corners: not four corners in degrees: {text}",
        remedy="Write it like --corners 52.1,10.4,52.1,10.41,52.11,10.41,52.11,10.4 (latitude, longitude, …).",
    )


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

    import numpy as np

    from fieldkit.files import write_atomic
    from fieldkit.sites.plots_grid import plots_grid

    (ranges, columns), places = parse_grid(grid), parse_corners(corners)
    if output.exists() and not overwrite:
        raise UsageError("exists already", path=output, remedy="Give --overwrite to replace it.")
    made = plots_grid(np.reshape(places, (4, 2)), ranges, columns, alley_m=alley, gap_m=gap)
    write_atomic(output, json.dumps(made, indent=1) + "\n")
    if as_json:
        emit_json({"output": output, "plots": len(made["features"])})
    else:
        show(count(len(made["features"]), "plot"), output)
