"""fieldkit scene from-reference."""

from __future__ import annotations

from pathlib import Path

from fieldkit.cli.common import JsonOption, OutputOption, OverwriteOption, answer, emit_json


def command(
    reference: Path,
    output: OutputOption,
    images: Path | None = None,
    overwrite: OverwriteOption = False,
    as_json: JsonOption = False,
) -> None:
    """Make a scene of a reference's clouds, so that a real plot can be simulated and planned on.

    Every point becomes a small square in its photographed colour, with --images in the photographs' own resolution.
    The result is a folder with scene.toml that goes wherever a scene file does.

    Args:
        reference: What `fieldkit reference` wrote, with scene.ply.
        images: Its photographs: surfels take their pixels from them.

    Examples:
        fieldkit scene from-reference plot_7-reference --images plot_7/ -o plot_7-scene
    """
    from fieldkit.cli.progress import open_progress
    from fieldkit.evaluation.proxy import make_proxy

    with open_progress(as_json=as_json) as progress:
        made = make_proxy(reference, output, images=images, overwrite=overwrite, progress=progress)
    if as_json:
        from dataclasses import asdict

        emit_json({"output": output, **asdict(made)})
    else:
        answer(f"{made.plant_surfels:,} surfels of plants and {made.ground_surfels:,} of the rest: {made.scene}")
