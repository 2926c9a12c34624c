"""What commands share: options, and the way they print. Imports Typer and the standard library only."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from fieldkit.cli.boundary import emit_json, say
from fieldkit.cli.help_page import OUTPUT, RUN

if TYPE_CHECKING:
    from collections.abc import Iterable

    from rich.console import Console, RenderableType
    from rich.table import Table

__all__ = [
    "SEED", "DebugOption", "JsonOption", "OutputOption", "OverwriteOption", "ResumeOption", "SeedOption",
    "console", "emit_json", "say", "show", "table",
]  # fmt: skip

JsonOption = Annotated[
    bool, typer.Option("--json", rich_help_panel=OUTPUT, help="Print one JSON object on stdout and nothing else there.")
]
DebugOption = Annotated[
    bool, typer.Option("--debug", rich_help_panel=OUTPUT, help="Show tracebacks and other libraries' warnings.")
]
# COLMAP takes no larger seed.
SEED = typer.Option(
    "--seed", min=0, max=2**31 - 1, rich_help_panel=RUN, help="The same seed gives the same result, byte for byte."
)
SeedOption = Annotated[int, SEED]
OutputOption = Annotated[
    Path, typer.Option("--output", "-o", help="The result's folder. It appears when the run is complete.")
]
OverwriteOption = Annotated[bool, typer.Option("--overwrite", rich_help_panel=RUN, help="Replace an existing result.")]
ResumeOption = Annotated[bool, typer.Option("--resume", rich_help_panel=RUN, help="Go on with an interrupted run.")]


def console() -> Console:
    """Rich's console for people, on stderr."""
    from rich.console import Console

    return Console(stderr=True, highlight=False)


def show(things: Iterable[RenderableType], *lines: object) -> None:
    """Print tables and texts for people, then lines that are neither markup nor broken, such as paths."""
    out = console()
    for thing in things:
        out.print(thing)
    for line in lines:
        out.print(str(line), markup=False, soft_wrap=True)


def table(title: str, *columns: str) -> Table:
    """An empty table in the one style all commands use; columns whose name ends in ">" are set flush right."""
    from fieldkit.present.style import table

    return table(title, *columns)
