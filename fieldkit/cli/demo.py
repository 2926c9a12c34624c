"""fieldkit demo."""

from __future__ import annotations

from typing import TYPE_CHECKING

from fieldkit.cli.common import (
    DebugOption,
    JsonOption,
    OutputOption,
    OverwriteOption,
    ResumeOption,
    SeedOption,
    console,
    emit_json,
)
from fieldkit.cli.reconstruction_options import NoCacheOption, WorkersOption, open_cache, run_context

if TYPE_CHECKING:
    from fieldkit.evaluation.demo import Demo

_PICTURES = ("reference/overview.png", "evaluation/few/overview.png", "evaluation/few/comparison.png")


def command(
    output: OutputOption,
    workers: WorkersOption = 1,
    seed: SeedOption = 0,
    overwrite: OverwriteOption = False,
    resume: ResumeOption = False,
    no_cache: NoCacheOption = False,
    as_json: JsonOption = False,
    debug: DebugOption = False,
) -> None:
    """Try fieldkit without photographs: render a small maize plot, build its reference, score a few-view capture.

    The two captures of the scene "demo" are rendered as a drone would take them, 30 photographs and 10, with poses.csv.
    Then the same runs as `fieldkit reference captures/dense` and `fieldkit evaluate captures/few`. Takes one to two
    minutes.

    Example: fieldkit demo -o demo-output
    """
    cache = open_cache(no_cache=no_cache, resume=resume)
    from fieldkit.evaluation.demo import run_demo

    with run_context(as_json=as_json) as progress:
        demo = run_demo(output, seed=seed, cache=cache, progress=progress, overwrite=overwrite, workers=workers)
    if as_json:
        emit_json({"output": output, **_figures(demo)})
        return
    from fieldkit.reporting.style import format_length
    from fieldkit.reporting.tables import evaluation_tables, quality_tables

    show = console()
    for table in (*quality_tables(demo.reference), *evaluation_tables(demo.evaluation)):
        show.print(table)
    truth = demo.truth.chamfer
    show.print(
        f"The reference against the rendered plants' true surfaces: chamfer distance {format_length(truth.chamfer_m)} "
        f"(accuracy {format_length(truth.accuracy_m)}, completeness {format_length(truth.completeness_m)}).\n"
    )
    for picture in _PICTURES:
        show.print(f"{output / picture}", markup=False, soft_wrap=True)


def _figures(demo: Demo) -> dict[str, object]:
    from dataclasses import asdict

    from fieldkit.evaluation.schema import distance_key

    return {
        "reference": demo.reference.model_dump(mode="json", exclude={"image_reports"}),
        "evaluation": demo.evaluation.model_dump(mode="json", exclude={"plots": {"__all__": {"image_reports"}}}),
        "truth": {
            **asdict(demo.truth.chamfer),
            "f_score": {distance_key(d): found.f_score for d, found in demo.truth.f_scores.items()},
        },
        "pictures": list(_PICTURES),
    }
