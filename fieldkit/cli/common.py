"""What commands share: options, and the way they print. Imports Typer and the standard library only."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from fieldkit.cli.boundary import emit_json, say

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

__all__ = [
    "DebugOption", "JsonOption", "OutputOption", "OverwriteOption", "ResumeOption", "SeedOption",
    "console", "emit_json", "say", "table",
]  # fmt: skip

JsonOption = Annotated[bool, typer.Option("--json", help="Print one JSON object on stdout and nothing else there.")]
DebugOption = Annotated[bool, typer.Option("--debug", help="Show tracebacks and other libraries' warnings.")]
SeedOption = Annotated[int, typer.Option("--seed", min=0, help="The same seed gives the same result, byte for byte.")]
OutputOption = Annotated[
    Path, typer.Option("--output", "-o", help="The result's folder. It appears when the run is complete.")
]
OverwriteOption = Annotated[bool, typer.Option("--overwrite", help="Replace an existing result.")]
ResumeOption = Annotated[bool, typer.Option("--resume", help="Go on with an interrupted run.")]


def console() -> Console:
    """Rich's console for people, on stderr."""
    from rich.console import Console

    return Console(stderr=True, highlight=False)


def table(title: str, *columns: str) -> Table:
    """An empty table in the one style all commands use; columns whose name ends in ">" are set flush right."""
    from fieldkit.reporting.style import table

    return table(title, *columns)
