"""fieldkit reference."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from fieldkit.cli.common import JsonOption, OutputOption, emit_json, show
from fieldkit.cli.reconstruction_options import (
    RECONSTRUCTION,
    ComputingOptions,
    PosesOptions,
    TiesOption,
    with_ties,
)
from fieldkit.errors import UsageError
from fieldkit.evaluation.settings import EvaluationSettings


def command(
    images: Path,
    output: OutputOption,
    settings: Annotated[EvaluationSettings, RECONSTRUCTION],
    poses: PosesOptions,
    ties: TiesOption = None,
    *,
    run: ComputingOptions,
    no_scene: bool = False,
    as_json: JsonOption = False,
) -> None:
    """Build the reference cloud of a plot from a dense capture.

    Reads the photographs with what lies beside them (poses.csv, geo.txt, camera.toml, masks), finds their poses, puts
    the model into the plot's metric frame, and reconstructs the plants. The result holds reference.json, cloud.ply, the
    model in COLMAP's format and overview.png. The scene about the plants comes after that, and takes most of the time:
    OUTPUT holds the plants' whole reference by then, also where the run is interrupted. Plans of new poses need the
    scene; scores do not.

    Args:
        images: Folder of photographs of one plot, 45 or more for a good reference.
        no_scene: The plants alone, without scene.ply.

    Examples:
        fieldkit reference plot_7/ -o plot_7-reference
        fieldkit reference plot_7/ --fidelity fine --workers 4 -o plot_7-reference
        fieldkit reference plot_7/ --no-scene -o plot_7-reference
        fieldkit reference plot_7/ --poses sparse/0 --poses-frame metres -o plot_7-reference
        fieldkit reference plot_7/ --bounds -1.5,-0.75,0,1.5,0.75,1.2 --resume -o plot_7-reference
    """
    if settings.rasters and no_scene:
        raise UsageError("--rasters need the scene", remedy="Leave --no-scene out.")
    settings, found_poses = with_ties(settings, ties), poses.given()
    from fieldkit.evaluation.reference import build_reference
    from fieldkit.pictures.overview import write_overviews

    with run.context(as_json=as_json) as context:
        report = build_reference(
            images,
            output,
            settings,
            context,
            scene=not no_scene,
            poses=found_poses,
            overwrite=run.overwrite,
            resume=run.resume,
        )
    write_overviews(output, report)
    if as_json:
        emit_json({"output": output, **report.model_dump(mode="json", exclude={"image_reports"})})
        return
    from fieldkit.figures.terminal import reference_output

    show(reference_output(report), output)
