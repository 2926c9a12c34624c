"""`python -m benchmarks`: measure speed and accuracy, fieldkit's and an alternative's in the same run."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Literal

import typer

from fieldkit.cli.boundary import Boundary
from fieldkit.cli.common import JsonOption, OverwriteOption, emit_json, show, table
from fieldkit.cli.main import parser_of
from fieldkit.cli.reconstruction_options import run_context
from fieldkit.runtime.threads import set_memory_environment, set_thread_environment


class Suite(StrEnum):
    """A suite of studies."""

    ENGINE = "engine"
    OBJECTIVE = "objective"
    PLANNER = "planner"
    MISSIONS = "missions"
    CAMPAIGN = "campaign"
    PAPER = "paper"


class Study(StrEnum):
    """A study of a suite."""

    DENSE = "dense"
    EVALUATION = "evaluation"
    SCALING = "scaling"
    FEW_VIEWS = "few-views"
    KNOWN_POSES = "known-poses"
    LEARNED_TIES = "learned-ties"
    REFERENCES = "references"
    MATCH_DECAY = "match-decay"
    SUBSET_SCORES = "subset-scores"
    RECORDED = "recorded"
    PROXY = "proxy"
    SIMULATED = "simulated"
    TRANSFER = "transfer"
    CHOSEN = "chosen"
    TABLES = "tables"
    POSE_NOISE = "pose-noise"
    IMAGE_NOISE = "image-noise"
    NEW_PLOTS = "new-plots"
    NEW_TRAITS = "new-traits"
    TRIPS = "trips"
    PASSES = "passes"
    POSES = "poses"
    UPLOADS = "uploads"
    ROUTES = "routes"
    FUZZ = "fuzz"
    SEASON = "season"
    TRIALS = "trials"
    PATTERNS = "patterns"
    FIELD_CHECK = "field-check"
    PLANT_FIGURES = "plant-figures"
    PLANT_COUNTS = "plant-counts"
    SCORE_PREDICTION = "score-prediction"


def command(
    suite: Annotated[
        Suite,
        typer.Argument(
            help="engine: photographs to scores; objective: what is minimised; planner: searches; missions: routes, "
            "files and uploads; campaign: plot after plot."
        ),
    ],
    output: Annotated[
        Path, typer.Option("--output", "-o", help="The result's folder. It appears when the run is complete.")
    ] = Path("benchmark-results"),
    only: Annotated[
        list[Study] | None,
        typer.Option("--only", metavar="STUDY", help="Repeatable; the studies of speed where not given."),
    ] = None,
    draws: Annotated[int, typer.Option("--draws", min=1, help="In few-views: seeds and draws of the noise.")] = 5,
    whole_grid: Annotated[
        bool, typer.Option("--whole-grid", help="In few-views: every accuracy of the priors on every subset.")
    ] = False,
    evaluations: Annotated[int, typer.Option("--evaluations", min=2, help="Of each search of planner.")] = 100,
    configurations: Annotated[int, typer.Option("--configurations", min=5, help="In recorded: subsets.")] = 20,
    scene: Annotated[
        list[str] | None,
        typer.Option(
            "--scene",
            metavar="SCENE",
            help="Repeatable; in match-decay and planner: a name or file; all for every one of "
            "fieldkit's. The tuning scenes where not given. In chosen: a recorded set. In field-check: those held out.",
        ),
    ] = None,
    block: Annotated[
        list[str] | None,
        typer.Option(
            "--block", metavar="STAGE/FLIGHT", help="Repeatable; in trials, such as V10/five-8; in patterns a stage."
        ),
    ] = None,
    seeds: Annotated[int, typer.Option("--seeds", min=1, help="In planner and paper.")] = 5,
    workers: Annotated[int, typer.Option("--workers", min=1, help="Processes of planner and paper.")] = 1,
    runs: Annotated[
        Path,
        typer.Option(
            "--runs", metavar="DIR", help="In planner and paper: keeps every run; finished ones are read again."
        ),
    ] = Path("planner-runs"),
    cameras: Annotated[int, typer.Option("--cameras", "-n", min=3, help="In simulated.")] = 10,
    method: Annotated[
        list[str] | None, typer.Option("--method", metavar="NAME", help="Repeatable; in planner: all where not given.")
    ] = None,
    mapping: Annotated[
        Literal["prior", "incremental"], typer.Option("--mapping", help="In planner, of the evaluations.")
    ] = "prior",
    fidelity: Annotated[
        Literal["draft", "standard"], typer.Option("--fidelity", help="In planner, of searches on plots.")
    ] = "standard",
    onto: Annotated[
        list[str] | None,
        typer.Option("--onto", metavar="SCENE", help="Repeatable; in transfer: where plans go. like:N: new plots."),
    ] = None,
    count: Annotated[
        int | None,
        typer.Option(
            "--count",
            min=1,
            help="In missions: missions, uploads, plots or changed files. In field-check: captures; in season: plots.",
        ),
    ] = None,
    width: Annotated[
        int, typer.Option("--width", metavar="PX", min=400, max=6000, help="In season: of the photographs.")
    ] = 2000,
    work: Annotated[
        Path | None, typer.Option("--work", metavar="DIR", help="In campaign: keeps photographs and evaluations.")
    ] = None,
    quick: Annotated[
        bool, typer.Option("--quick", help="In paper: case-1 and its test cases, few methods and evaluations.")
    ] = False,
    no_scene: Annotated[bool, typer.Option("--no-scene", help="In scaling: plants only, in half the time.")] = False,
    overwrite: OverwriteOption = False,
    as_json: JsonOption = False,
) -> None:
    """Measure speed and accuracy on this machine, fieldkit's and an alternative's in the same run.

    The engine's studies are dense, evaluation and scaling (speed), few-views, references,
    subset-scores and match-decay (quality); the objective's are recorded and proxy; the planner's are simulated,
    transfer and chosen (of recorded sets); missions has trips, passes, poses, uploads, routes and fuzz; campaign's
    are season, trials, patterns, field-check, plant-figures, plant-counts and score-prediction; paper's
    are tables, pose-noise, image-noise, new-plots and new-traits, all by default. FIELDKIT_DATA names the recorded
    image sets; studies that need them are skipped without it. The result holds results.json, results.md and pictures.

    Examples:
        python -m benchmarks engine --only dense -o benchmark-results
        python -m benchmarks planner --only simulated --scene case-1 --seeds 3 --workers 2 --overwrite

    Exit codes:
        0  done
        2  wrong usage, or the output exists already
        3 an input cannot be used, or this machine cannot render

    See Also:
        fieldkit doctor
    """
    from benchmarks.campaign import CampaignOptions, run_campaign
    from benchmarks.engine import EngineOptions, run_engine
    from benchmarks.missions import MissionOptions, run_missions
    from benchmarks.objective import ObjectiveOptions, run_objective
    from benchmarks.paper import PaperOptions, run_paper
    from benchmarks.planner import PlannerOptions, run_planner
    from benchmarks.suite import report

    data = Path(os.environ["FIELDKIT_DATA"]) if os.environ.get("FIELDKIT_DATA") else None
    names = [study.value for study in only or []]
    with run_context(as_json=as_json) as context:
        cache, progress = context.cache, context.progress
        if suite is Suite.ENGINE:
            engine = EngineOptions(
                data, cache, draws=draws, scene=not no_scene, whole_grid=whole_grid, scenes=tuple(scene or ())
            )
            results = run_engine(output, names, engine, progress=progress, overwrite=overwrite)
        elif suite is Suite.PLANNER:
            planner = PlannerOptions(
                data,
                cache,
                runs,
                tuple(scene or ("tuning-1",)),
                evaluations,
                seeds,
                cameras,
                mapping,
                fidelity,
                workers,
                tuple(method or ()),
                *([tuple(onto)] if onto else []),
            )
            results = run_planner(output, names, planner, progress=progress, overwrite=overwrite)
        elif suite is Suite.PAPER:
            paper = PaperOptions(cache, runs, evaluations, seeds, workers, tuple(scene or ()), count or 10, quick)
            results = run_paper(output, names, paper, progress=progress, overwrite=overwrite)
        elif suite is Suite.MISSIONS:
            missions = MissionOptions(data, **({} if count is None else _counts(count)))
            results = run_missions(output, names, missions, progress=progress, overwrite=overwrite)
        elif suite is Suite.CAMPAIGN:
            campaign = CampaignOptions(
                data, cache, tuple(scene or ()), tuple(block or ()), count, width, workers=workers, work=work
            )
            results = run_campaign(output, names, campaign, progress=progress, overwrite=overwrite)
        else:
            objective = ObjectiveOptions(data, cache, configurations)
            results = run_objective(output, names, objective, progress=progress, overwrite=overwrite)
    if as_json:
        emit_json({"output": output, **report(results)})
        return
    for result in results:
        for found in result.tables:
            rows = ([None if cell is None else str(cell) for cell in row] for row in found.rows)
            show(table(found.title, found.columns, rows))
        show(result.notes)
    show([], output)


def _counts(count: int) -> dict[str, int]:
    return dict.fromkeys(("missions", "passes", "uploads", "plots", "files"), count)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command line and give its exit code."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    with Boundary(given) as boundary:
        set_thread_environment()
        set_memory_environment()
        parser_of(command).main(args=given, prog_name="python -m benchmarks", standalone_mode=False)
    return boundary.exit_code


if __name__ == "__main__":
    sys.exit(main())
