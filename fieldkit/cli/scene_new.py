"""fieldkit scene new."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from typer import Option

from fieldkit.cli.common import JsonOption, OverwriteOption, SeedOption, answer, emit_json
from fieldkit.wording import count

Layout = Literal["rows", "grid", "random"]


def command(
    plants: Annotated[int, Option(min=1, max=60)] = 3,
    layout: Layout = "rows",
    spacing: Annotated[float, Option(min=0.05, max=2.0)] = 0.22,
    row_spacing: Annotated[float, Option(min=0.05, max=3.0)] = 0.50,
    output: Annotated[Path | None, Option("--output", "-o")] = None,
    complete: bool = False,
    seed: SeedOption = 0,
    overwrite: OverwriteOption = False,
    as_json: JsonOption = False,
) -> None:
    """Write a new scene file: maize plants of their own forms, soil and sun, all from the seed.

    Edit it as you like; the command says which page explains every key.

    Args:
        plants: How many.
        layout: In rows along x, on a grid, or at random.
        spacing: Between plants, metres.
        row_spacing: Between rows, metres.
        output: The scene file. Without: the text goes to stdout.
        complete: Write every key, also those at their default.

    Examples:
        fieldkit scene new --plants 6 --seed 7 --layout rows -o plot.toml
        fieldkit scene new --plants 3 --complete
    """
    from fieldkit.regular_files import check_replaceable

    if output is not None:
        check_replaceable(output, overwrite=overwrite)
    import sys

    from fieldkit.scenes.scene_file import scene_text, write_scene
    from fieldkit_sim.generator import new_scene

    name = f"plants-{plants}-seed-{seed}" if output is None else output.stem
    scene = new_scene(
        plants,
        seed,
        layout=layout,
        spacing_m=spacing,
        row_spacing_m=row_spacing,
        name=name,
        notes=f"fieldkit scene new --plants {plants} --seed {seed} --layout {layout}",
    )
    text = scene_text(scene, complete=complete)
    if output is not None:
        write_scene(output, scene, complete=complete)
    if as_json:
        emit_json({"output": output, "name": name, "plants": plants, "seed": seed, "text": text})
    elif output is None:
        sys.stdout.write(text)
    else:
        from fieldkit.runtime.shipped import shipped_page

        answer(f"{count(plants, 'plant')} in {output}; {shipped_page('sim/README.md')} explains its keys")
