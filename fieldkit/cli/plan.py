"""fieldkit plan."""

from __future__ import annotations

import os
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from fieldkit.cli.common import (
    SEED,
    DebugOption,
    JsonOption,
    OutputOption,
    OverwriteOption,
    ResumeOption,
    console,
    emit_json,
)
from fieldkit.cli.help_page import RUN
from fieldkit.cli.numbers import read_numbers
from fieldkit.cli.plan_values import pose_noise_of, score_weights, seconds
from fieldkit.errors import UsageError

if TYPE_CHECKING:
    from fieldkit.planning.run.outcome import Outcome
    from fieldkit.planning.settings import SearchSettings

_PLOT, _SEARCH, _NOISE, _ENVELOPE = "What to plan on", "Search", "Noise to plan for", "Where cameras may be"


class Preset(StrEnum):
    """A set of defaults."""

    FIELD = "field"
    PAPER = "paper"


class Method(StrEnum):
    """How cameras are looked for."""

    FIELD = "field"
    BOSFM = "bosfm"
    BOSFM_TUNED = "bosfm-tuned"
    SCORE = "score"
    CIRCLE = "circle"
    CIRCLE_AIM = "circle-aim"
    TWO_RINGS = "two-rings"
    HEMISPHERE = "hemisphere"
    MCP = "mcp"
    GEOMETRIC = "geometric"
    SMITH = "smith"
    RANDOM = "random"
    UNIFORM = "uniform"
    MATCH_GRAPH = "match-graph"


class Fidelity(StrEnum):
    """What an evaluation costs and how fine it is."""

    DRAFT = "draft"
    STANDARD = "standard"
    FINE = "fine"


class For(StrEnum):
    """Which plots a plan is for."""

    KIND = "kind"
    THIS_PLOT = "this-plot"


class Mapping(StrEnum):
    """How camera poses are found in an evaluation."""

    PRIOR = "prior"
    INCREMENTAL = "incremental"
    GLOBAL = "global"


def command(
    output: OutputOption,
    scenes: Annotated[
        list[Path] | None,
        typer.Option(
            "--scene",
            rich_help_panel=_PLOT,
            metavar="SCENE",
            help="Plan on a scene: a file, a folder or a name such as case-1. Repeatable.",
        ),
    ] = None,
    references: Annotated[
        list[Path] | None,
        typer.Option(
            "--reference",
            rich_help_panel=_PLOT,
            metavar="REF",
            help="Plan on a proxy of a reference; repeatable. With --captures: their truth.",
        ),
    ] = None,
    captures: Annotated[
        Path | None,
        typer.Option("--captures", rich_help_panel=_PLOT, help="Choose of recorded photographs with known poses."),
    ] = None,
    images: Annotated[
        list[Path] | None,
        typer.Option(
            "--images",
            rich_help_panel=_PLOT,
            metavar="FOLDER",
            help="Photographs of each --reference, for a finer proxy.",
        ),
    ] = None,
    plan_for: Annotated[
        For | None,
        typer.Option(
            "--for",
            rich_help_panel=_PLOT,
            help="kind: plots like this one, which field and score plan for; this-plot: it alone.",
        ),
    ] = None,
    vary: Annotated[
        int | None,
        typer.Option(
            "--vary",
            rich_help_panel=_PLOT,
            metavar="K",
            min=1,
            help="Plots of the kind, those given among them; 8 where not given.",
        ),
    ] = None,
    cameras: Annotated[int | None, typer.Option("--cameras", "-n", min=3, help="N; 10 where not given.")] = None,
    preset: Annotated[
        Preset | None,
        typer.Option(
            "--preset", rich_help_panel=_SEARCH, help="paper: Algorithm 1, blind incremental mapping, 50 initial."
        ),
    ] = None,
    method: Annotated[
        Method | None, typer.Option("--method", rich_help_panel=_SEARCH, help="Instead of the preset's.")
    ] = None,
    evaluations: Annotated[
        int | None,
        typer.Option("--evaluations", rich_help_panel=_SEARCH, min=1, help="At most; 100 where not given."),
    ] = None,
    at_least: Annotated[
        int | None,
        typer.Option(
            "--at-least", rich_help_panel=_SEARCH, min=0, help="Evaluations before the search may end itself."
        ),
    ] = None,
    initial: Annotated[
        int | None, typer.Option("--initial", rich_help_panel=_SEARCH, min=1, help="Trials before a model is asked.")
    ] = None,
    time_budget: Annotated[
        str,
        typer.Option(
            "--time-budget", rich_help_panel=_SEARCH, metavar="TIME", help="No trial starts later: 600, 10m, 2h."
        ),
    ] = "",
    fidelity: Annotated[
        Fidelity | None,
        typer.Option("--fidelity", rich_help_panel=_SEARCH, help="Of the search; standard where not given."),
    ] = None,
    confirm: Annotated[
        Fidelity | None,
        typer.Option("--confirm", rich_help_panel=_SEARCH, help="Of the finalists; fine where not given."),
    ] = None,
    finalists: Annotated[
        int | None, typer.Option("--finalists", rich_help_panel=_SEARCH, min=1, help="Evaluated again at fresh seeds.")
    ] = None,
    repeats: Annotated[
        int | None,
        typer.Option("--repeats", rich_help_panel=_SEARCH, min=0, help="Fresh seeds for each; 0: no confirmation."),
    ] = None,
    weights: Annotated[
        str,
        typer.Option(
            "--weights",
            rich_help_panel=_SEARCH,
            metavar="GAP,NOISE,TIE",
            help="Of the geometric score's terms; from:RUN fits them to a run.",
        ),
    ] = "",
    mapping: Annotated[
        Mapping | None, typer.Option("--mapping", rich_help_panel=_SEARCH, help="Of the evaluations.")
    ] = None,
    pose_noise: Annotated[
        str,
        typer.Option(
            "--pose-noise",
            rich_help_panel=_NOISE,
            metavar="M,DEG",
            help="Plan for flights that miss stations by this; from:EVAL as one. For a kind: the vehicle's; 0,0: none.",
        ),
    ] = "",
    image_noise: Annotated[
        float | None,
        typer.Option(
            "--image-noise", rich_help_panel=_NOISE, metavar="GREY", min=0, help="Plan for noise of this size."
        ),
    ] = None,
    wind: Annotated[
        float | None,
        typer.Option(
            "--wind", rich_help_panel=_NOISE, metavar="M", min=0, max=0.2, help="Plan for leaves that sway by this."
        ),
    ] = None,
    risk: Annotated[
        float | None,
        typer.Option(
            "--risk", rich_help_panel=_NOISE, metavar="SHARE", help="Count the worst share of repeats (CVaR); 1: all."
        ),
    ] = None,
    refine: Annotated[
        bool | None,
        typer.Option(
            "--refine/--no-refine",
            rich_help_panel=_NOISE,
            help="Move clouds onto the reference before they are scored; of a kind's plots they are.",
        ),
    ] = None,
    margin: Annotated[
        float | None,
        typer.Option("--margin", rich_help_panel=_ENVELOPE, metavar="M", min=0, help="Beyond the plants, for cameras."),
    ] = None,
    height: Annotated[
        str, typer.Option("--height", rich_help_panel=_ENVELOPE, metavar="LOW,HIGH", help="Above the ground, metres.")
    ] = "",
    clearance: Annotated[
        float | None,
        typer.Option("--clearance", rich_help_panel=_ENVELOPE, metavar="M", min=0, help="From cameras to plants."),
    ] = None,
    pitch: Annotated[
        str, typer.Option("--pitch", rich_help_panel=_ENVELOPE, metavar="LOW,HIGH", help="Of the gimbal, degrees.")
    ] = "",
    vehicle: Annotated[
        str | None,
        typer.Option(
            "--vehicle",
            rich_help_panel=_ENVELOPE,
            metavar="NAME",
            help="A profile's name or file: plan what it can fly, with its camera.",
        ),
    ] = None,
    camera_file: Annotated[
        Path | None,
        typer.Option(
            "--camera-file", rich_help_panel=_ENVELOPE, help="camera.toml: instead of the vehicle's or the scene's."
        ),
    ] = None,
    separation: Annotated[
        float | None,
        typer.Option("--separation", rich_help_panel=_ENVELOPE, metavar="M", min=0, help="Between stations."),
    ] = None,
    seed: Annotated[int | None, SEED] = None,
    workers: Annotated[
        int | None,
        typer.Option("--workers", rich_help_panel=RUN, min=1, help="Processes; as many as cores where not given."),
    ] = None,
    scheduler: Annotated[
        str,
        typer.Option(
            "--scheduler", rich_help_panel=RUN, metavar="URL", help="Evaluate on a Dask cluster: tcp://host:8786."
        ),
    ] = "",
    deterministic: Annotated[
        bool, typer.Option("--deterministic", rich_help_panel=RUN, help="The same plan whatever --workers is.")
    ] = False,
    resume: ResumeOption = False,
    overwrite: OverwriteOption = False,
    as_json: JsonOption = False,
    debug: DebugOption = False,
) -> None:
    """Find the camera poses that reconstruct a plot best.

    Photographs of every trial are taken (rendered, or looked up in a recorded set), reconstructed by real structure
    from motion and scored against the reference. The result holds plan.json, pictures and every evaluation. --resume
    goes on with an interrupted run, and with more --evaluations a finished one. With --json a line per evaluation goes
    to stderr.

    Examples:
        fieldkit plan --reference plot_7-reference --images plot_7/ -n 12 -o trial-plan
        fieldkit plan --reference plot_7-reference --vehicle ardupilot-pitch --pose-noise from:flight_1 -o plot_7-plan
        fieldkit plan --captures plot_7/ --reference plot_7-reference -n 13 -o plot_7-best-views
        fieldkit plan --scene case-1 --for this-plot -o case-1-plan
        fieldkit plan --scene case-1 --preset paper --evaluations 200 -o case-1-paper
        fieldkit plan --resume --evaluations 150 -o plot_7-plan

    Files:
        OUTPUT/plan.json  the stations, for simulate, export-mission and evaluate
        OUTPUT/search.json, evaluations.jsonl  what was asked for, every evaluation
        OUTPUT/outcome.json, plan.png, search.png  what came of it

    Exit codes:
        0  done
        2  wrong usage, limits that the vehicle does not keep, or the output exists already
        3  what is planned on cannot be used, or this machine cannot render
        4  no evaluation gave anything

    See Also:
        fieldkit reference, fieldkit export-mission, fieldkit simulate
    """
    given: dict[str, Any] = {
        "cameras": cameras, "plots": vary, "preset": preset, "method": method, "evaluations": evaluations,
        "at_least": at_least, "initial": initial,
        "time_budget_s": seconds(time_budget) if time_budget else None, "fidelity": fidelity,
        "confirm_fidelity": confirm, "finalists": finalists, "repeats": repeats, "mapping": mapping, "seed": seed,
        "refine": refine, "weights": score_weights(weights) if weights else None,
    }  # fmt: skip
    given = {key: str(value) if isinstance(value, StrEnum) else value for key, value in given.items()}
    pose = pose_noise_of(pose_noise) if pose_noise else (None, None)
    noise = {"pose_m": pose[0], "pose_deg": pose[1], "image_grey": image_noise, "wind_m": wind, "risk": risk}
    envelope = {
        "margin_m": margin, "height_m": read_numbers("--height", height, (2,)) if height else None,
        "clearance_m": clearance, "pitch_deg": read_numbers("--pitch", pitch, (2,), least=-90.0) if pitch else None,
        "separation_m": separation,
    }  # fmt: skip
    if resume and overwrite:
        raise UsageError("--resume goes on with what --overwrite would replace", remedy="Give one of them.")

    from fieldkit.cache import StageCache, default_cache_root
    from fieldkit.cli.live_plan import open_watch
    from fieldkit.cli.progress import Lines
    from fieldkit.planning.run import request
    from fieldkit.planning.run.folder import read_log, read_settings
    from fieldkit.planning.run.plan_views import plan_views, resume_plan
    from fieldkit.runtime.progress import Silent
    from fieldkit.runtime.threads import limit_threads

    limit_threads(1)
    count = workers or os.cpu_count() or 1
    purpose = None if plan_for is None else plan_for.value
    wishes = request.PlanRequest(
        given, noise, envelope, tuple(scenes or ()), tuple(references or ()), captures, tuple(images or ()), vehicle,
        camera_file, purpose,
    )  # fmt: skip
    settings = read_settings(output) if resume else request.new_settings(wishes, count, deterministic=deterministic)
    if resume:
        settings = request.resumed_settings(settings, wishes)
    before = read_log(output) if resume else []
    cache = StageCache(default_cache_root())
    progress = Silent() if as_json else Lines()  # bars of their own would quarrel with the live view
    with open_watch(settings, before, as_json=as_json) as watch:
        if resume:
            outcome = resume_plan(
                output, settings, cache=cache, workers=count, scheduler=scheduler, progress=progress, watch=watch
            )
        else:
            outcome = plan_views(
                output, settings, cache=cache, workers=count, scheduler=scheduler, overwrite=overwrite,
                progress=progress, watch=watch,
            )  # fmt: skip
    if as_json:
        emit_json({"output": output, **outcome.model_dump()})
    else:
        _show(output, settings, outcome)


def _show(output: Path, settings: SearchSettings, outcome: Outcome) -> None:
    from fieldkit.present.sections.finalists import finalist_table
    from fieldkit.present.style import format_length, format_seconds
    from fieldkit.present.terminal.blocks import rendered

    show = console()
    for shown in rendered([finalist_table(outcome)]):
        show.print(shown)
    why = {
        "evaluations": "its evaluations are used up", "time": "its time is used up",
        "exhausted": "the method has no more to try",
        "converged": f"stopped after {outcome.evaluations}: nothing left above ± {format_length(outcome.noise_m)}",
    }[outcome.stopped]  # fmt: skip
    expected = "" if outcome.expected_m is None else f" (expected {format_length(outcome.expected_m)})"
    show.print(
        f"{outcome.cameras} cameras by {outcome.method}: {format_length(outcome.chamfer_m)}{expected} on "
        f"{_planned_on(settings)}, {outcome.evaluations} evaluations ({outcome.failed_evaluations} without a cloud) "
        f"and {outcome.confirmations} confirmations in {format_seconds(outcome.seconds)}; {why}.",
        markup=False, soft_wrap=True,
    )  # fmt: skip
    if not outcome.confirmations:
        show.print(
            "This plan is NOT CONFIRMED: no photograph was taken of it. Of two sets of which as much is expected, one "
            "can be half as good as the other.",
            soft_wrap=True,
        )
    if outcome.photographs:
        show.print(f"photographs: {', '.join(outcome.photographs)}", markup=False, soft_wrap=True)
    show.print(f"{output / 'plan.json'}\n{output / 'plan.png'}", markup=False, soft_wrap=True)


def _planned_on(settings: SearchSettings) -> str:
    name, others = settings.source.name, len(settings.others)
    if settings.plots == 1:
        return name
    more = f" and {others} more" if others else ""
    return f"plots like {name}{more} that it had not met ({settings.plots} were planned on)"
