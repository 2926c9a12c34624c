"""fieldkit benchmark."""

from __future__ import annotations

import os
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from fieldkit.cli.common import DebugOption, JsonOption, OverwriteOption, console, emit_json
from fieldkit.cli.common import table as new_table
from fieldkit.cli.reconstruction_options import open_cache, run_context


class Suite(StrEnum):
    """What is measured."""

    ENGINE = "engine"


class Study(StrEnum):
    """A part of it."""

    HELP = "help"
    CLOUDS = "clouds"
    DENSE = "dense"
    EVALUATION = "evaluation"
    SCALING = "scaling"
    FEW_VIEWS = "few-views"
    MAPPINGS = "mappings"
    REFERENCES = "references"
    MATCH_DECAY = "match-decay"
    BLIND_RINGS = "blind-rings"
    SUBSET_SCORES = "subset-scores"


def command(
    suite: Annotated[Suite, typer.Argument(help="engine: photographs to scores.")],
    output: Annotated[
        Path, typer.Option("--output", "-o", help="The result's folder. It appears when the run is complete.")
    ] = Path("benchmark-results"),
    only: Annotated[
        list[Study] | None,
        typer.Option(
            "--only", metavar="STUDY", help="Repeatable; help, clouds, dense, evaluation and scaling where not given."
        ),
    ] = None,
    draws: Annotated[int, typer.Option("--draws", min=1, help="In few-views: seeds and draws of the noise.")] = 5,
    whole_grid: Annotated[
        bool, typer.Option("--whole-grid", help="In few-views: every accuracy of the priors on every subset.")
    ] = False,
    no_scene: Annotated[bool, typer.Option("--no-scene", help="In scaling: plants only, in half the time.")] = False,
    overwrite: OverwriteOption = False,
    as_json: JsonOption = False,
    debug: DebugOption = False,
) -> None:
    """Measure this machine's speed and accuracy, ours and the alternative's in the same run.

    The studies are help, clouds, dense, evaluation and scaling (speed), few-views, mappings, references,
    subset-scores, match-decay and blind-rings (quality). FIELDKIT_DATA names the recorded image sets; what needs them
    is left out without it. The result holds results.json, results.md and pictures.

    Example: fieldkit benchmark engine --only dense -o benchmark-results
    """
    cache = open_cache(no_cache=False, resume=False)
    from fieldkit.benchmarks.engine import EngineOptions, report, run_engine

    data = os.environ.get("FIELDKIT_DATA")
    options = EngineOptions(Path(data) if data else None, cache, draws=draws, scene=not no_scene, whole_grid=whole_grid)
    with run_context(as_json=as_json) as progress:
        results = run_engine(
            output, [study.value for study in only or []], options, progress=progress, overwrite=overwrite
        )
    if as_json:
        emit_json({"output": output, **report(results)})
        return
    show = console()
    for result in results:
        for found in result.tables:
            drawn = new_table(found.title, *found.columns)
            for row in found.rows:
                drawn.add_row(*("–" if cell is None else str(cell) for cell in row))
            show.print(drawn)
        for note in result.notes:
            show.print(note, markup=False)
    show.print(f"{output}", markup=False, soft_wrap=True)
