"""fieldkit plan."""

from __future__ import annotations

import json
import math
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from typer import Option

from fieldkit.cli.boundary import say
from fieldkit.cli.common import (
    RUN,
    SEED,
    JsonOption,
    OutputOption,
    OverwriteOption,
    ResumeOption,
    emit_json,
    read_numbers,
    read_pose_noise,
    scenes_like,
    show,
    vehicles_like,
)
from fieldkit.cli.options import Panels
from fieldkit.cli.reconstruction_options import SchedulerOption, WorkersOption, run_context
from fieldkit.errors import UsageError
from fieldkit.figures.style import format_length
from fieldkit.planning.plan_settings import EnvelopeSettings, NoiseSettings, PlanSettings, Range, TrialSettings
from fieldkit.vocabulary import PlanningMethod
from fieldkit.wording import count

if TYPE_CHECKING:
    from fieldkit.planning.run.folder import LogEntry, RunFolder
    from fieldkit.planning.run.outcome import Outcome
    from fieldkit.planning.settings import SearchSettings
    from fieldkit.runtime.context import Context
    from fieldkit.runtime.progress import Advance, Progress


class Watched(ExitStack):
    """Counts a run's evaluations, and knows its search's best."""

    def __init__(self, progress: Progress, *, as_json: bool) -> None:
        super().__init__()
        self._progress, self._as_json = progress, as_json
        self._advance: Advance | None = None
        self._confirming = False

    def expect(self, run: RunFolder, total: int) -> None:
        """The search of a run has this many evaluations, at most, with those that its log holds already."""
        settings = run.settings
        searched = [entry for entry in run.entries if entry.stage == "search"]
        self._plots, self._total, self._done = settings.plots, total, len(searched)
        self._confirmations = settings.finalists * settings.repeats - (len(run.entries) - len(searched))
        self._best_m = min((entry.value_m for entry in searched if entry.measured), default=math.inf)
        if total > self._done:
            self._begin(f"Searching, at most {total} evaluations", total - self._done)

    def watch(self, entry: LogEntry) -> None:
        """An evaluation has finished."""
        if entry.stage == "confirmation" and not self._confirming:
            self._confirming = True
            self._begin("Confirming", max(self._confirmations, 1))
        if self._advance is not None:
            self._advance(1)
        if entry.stage == "search":
            self._done += 1
            if entry.measured and entry.value_m < self._best_m:
                self._best_m = entry.value_m
                on = f" on plot {entry.plot}" if self._plots > 1 else ""
                self._progress.note(f"best so far{on}: {format_length(entry.value_m)} ({entry.origin})")
        if self._as_json:
            line: dict[str, Any] = {
                "stage": entry.stage,
                "number": entry.number,
                "origin": entry.origin,
                "value_m": entry.value_m,
                "best_m": None if math.isinf(self._best_m) else self._best_m,
                "done": self._done,
                "of": self._total,
            }
            say(json.dumps(line, ensure_ascii=False))

    def _begin(self, name: str, evaluations: int) -> None:
        self.close()  # the search may have ended before its limit
        self._advance = self.enter_context(self._progress.stage(name, evaluations))


_FROM = "from:"


def _height(text: str) -> Range:
    low, high = read_numbers("--height", text, (2,))
    return low, high


def pose_noise(text: str) -> NoiseSettings:
    """M,DEG, or from:EVAL."""
    if not text.startswith(_FROM):
        pose_m, pose_deg = read_pose_noise(text)
        return NoiseSettings(pose_m=pose_m, pose_deg=pose_deg)
    from fieldkit.campaign import CAMPAIGN_FILE, read_campaign, visit_plots
    from fieldkit.evaluation.adherence import flown_noise
    from fieldkit.results.report_files import load_evaluation_report

    file = Path(text.removeprefix(_FROM))
    if not file.name:
        raise UsageError("--pose-noise: from what?", remedy="Write it like --pose-noise from:EVAL, a folder or a file.")
    if (file / CAMPAIGN_FILE).is_file():
        pose_m, pose_deg = flown_noise(visit_plots(read_campaign(file)), file)
    else:
        pose_m, pose_deg = flown_noise(load_evaluation_report(file).plots, file)
    return NoiseSettings(pose_m=pose_m, pose_deg=pose_deg)


SETTINGS: Panels = {
    "Options": {"cameras": Option("--cameras", "-n", min=3, max=200)},
    "What to plan on": {
        "scene": Annotated[list[Path] | None, Option(metavar="SCENE", autocompletion=scenes_like)],
        "reference": Annotated[list[Path] | None, Option(metavar="REF")],
        "captures": None,
        "images": Annotated[list[Path] | None, Option(metavar="FOLDER")],
        "purpose": Option("--for"),
        "plots": Option("--vary", metavar="K", min=1),
    },
    "Search": {
        "method": Annotated[PlanningMethod, Option()],
        "evaluations": Option(min=1),
        "fidelity": None,
        "repeats": Option(min=0),
        "preset": None,
    },
    "Where cameras may be": {"vehicle": Annotated[str, Option(autocompletion=vehicles_like, metavar="NAME")]},
    RUN: {"seed": SEED},
}
ENVELOPE: Panels = {
    "Where cameras may be": {
        "height_m": Annotated[str, Option("--height", parser=_height, metavar="LOW,HIGH")],
        "clearance_m": Option("--clearance", metavar="M", min=0),
    }
}


def _metres(text: str) -> float:
    """Such as 4cm or 0.04."""
    value, hundredths = text.removesuffix("cm"), text.endswith("cm")
    (number,) = read_numbers("--height-error", value, (1,))
    return 0.01 * number if hundredths else number


TRIAL: Panels = {
    "A trial": {
        "trial": Annotated[Path | None, Option(metavar="PLOTS")],
        "stage": None,
        "minutes": Annotated[float | None, Option(metavar="MIN")],
        "height_error_m": Annotated[str | None, Option("--height-error", parser=_metres, metavar="LENGTH")],
    }
}
PLAN_PICTURE = "plan.png"


def command(
    output: OutputOption,
    settings: Annotated[PlanSettings, SETTINGS],
    envelope: Annotated[EnvelopeSettings, ENVELOPE],
    trial: Annotated[TrialSettings, TRIAL],
    *,
    noise: Annotated[str, Option("--pose-noise", metavar="M,DEG", rich_help_panel="Search")] = "",
    workers: WorkersOption = None,
    scheduler: SchedulerOption = "",
    resume: ResumeOption = False,
    overwrite: OverwriteOption = False,
    as_json: JsonOption = False,
) -> None:
    """Find the camera poses that reconstruct a plot best, or a pattern of passes over a trial.

    Photographs of every trial are taken (rendered, or looked up in a recorded set), reconstructed by real structure
    from motion and scored against the reference. The result holds plan.json, pictures and every evaluation. --resume
    goes on with an interrupted run, and with more --evaluations a finished one. With --json a line per evaluation goes
    to stderr. Patterns for a trial come with fieldkit; with --evaluations they are searched for.

    Args:
        noise: Plan for flights that miss stations by this; from:EVAL as one. For a kind: the vehicle's; 0,0: none.

    Examples:
        fieldkit plan --reference plot_7-reference --images plot_7/ -n 12 -o trial-plan
        fieldkit plan --reference plot_7-reference --vehicle ardupilot-pitch --pose-noise from:flight_1 -o plot_7-plan
        fieldkit plan --trial plots.geojson --vehicle dji-mavic-3-enterprise --stage V10 --minutes 5 -o trial-plan
        fieldkit plan --trial plots.geojson --vehicle ardupilot-pitch --stage V10 --evaluations 8 -o searched-plan
        fieldkit plan --captures plot_7/ --reference plot_7-reference -n 13 -o plot_7-best-views
        fieldkit plan --scene case-1 --for this-plot -o case-1-plan
        fieldkit plan --scene case-1 --method bosfm --evaluations 200 -o case-1-bosfm
        fieldkit plan --resume --evaluations 150 -o plot_7-plan
    """
    if trial.trial is not None:
        if settings.sources or settings.vehicle is None:
            raise UsageError("--trial needs --vehicle, and no other source", remedy="Give the vehicle that flies it.")
        with run_context(as_json=as_json, seed=settings.seed) as context:
            _plan_trial(output, trial, settings, context, overwrite=overwrite, as_json=as_json)
        return
    own = {"noise": pose_noise(noise)} if noise else {}
    asked = settings.model_copy(update={"envelope": envelope, **own})
    if not resume or asked.sources:
        asked.check_sources()
    if resume and overwrite:
        raise UsageError("--resume goes on with what --overwrite would replace", remedy="Give one of them.")
    from fieldkit.planning.run.folder import read_settings
    from fieldkit.planning.run.plan import plan

    computing = run_context(as_json=as_json, workers=workers, scheduler=scheduler)
    with computing as context, Watched(context.progress, as_json=as_json) as watched:
        outcome = plan(
            output,
            asked,
            context,
            overwrite=overwrite,
            resume=resume,
            watch=watched.watch,
            expect=watched.expect,
        )
    planned = read_settings(output)
    _draw(output, planned)
    if as_json:
        emit_json({"output": output, **outcome.model_dump()})
    else:
        _show(output, planned, outcome)


def _plan_trial(
    output: Path, asked: TrialSettings, search: PlanSettings, context: Context, *, overwrite: bool, as_json: bool
) -> None:
    from fieldkit.figures.content import Row, tabulated
    from fieldkit.figures.terminal import rendered
    from fieldkit.files import write_atomic
    from fieldkit.pictures.front import draw_front
    from fieldkit.planning.patterns.plan import FRONT_FILE, plan_trial

    made = plan_trial(
        output,
        asked,
        search.vehicle or "",
        context,
        method=search.method,
        evaluations=search.evaluations if "evaluations" in search.model_fields_set else 0,
        overwrite=overwrite,
    )
    title = f"Patterns over {count(made.plots, 'plot')} at {made.stage}"
    points = [(each.minutes, 1000.0 * each.worth.value_m, each is made.chosen) for each in made.front]
    write_atomic(output / PLAN_PICTURE, draw_front(title, points))
    if as_json:
        emit_json({"output": output, "stage": made.stage, **made.chosen.row})
        return
    marks = ["▸" if each is made.chosen else "" for each in made.front]
    rows: list[Row] = [dict(({"": mark} | each.figures).items()) for mark, each in zip(marks, made.front, strict=True)]
    show(
        rendered([tabulated(title, rows, f"▸ is the plan. {FRONT_FILE} has the patterns.")]),
        output / "plan.json",
        output / FRONT_FILE,
        output / PLAN_PICTURE,
    )


def _draw(output: Path, settings: SearchSettings) -> None:
    from fieldkit.figures.style import format_length
    from fieldkit.files import write_atomic
    from fieldkit.pictures.mission import draw_plan
    from fieldkit.pictures.panels import png
    from fieldkit.results.plan_file import load_plan

    made = load_plan(output)
    chamfer_m = None if made.method is None else made.method.chamfer_m
    worth = "not confirmed" if chamfer_m is None else f"chamfer distance {format_length(chamfer_m)}"
    like = "" if settings.plots == 1 else "plots like "
    title = f"{like}{settings.source.name}: {settings.cameras} cameras, {worth}"
    write_atomic(output / PLAN_PICTURE, png(draw_plan(title, made)))


def _show(output: Path, settings: SearchSettings, outcome: Outcome) -> None:
    from fieldkit.figures.style import format_seconds
    from fieldkit.figures.terminal import rendered
    from fieldkit.report.sections.plan import finalist_table
    from fieldkit.results.plan_file import load_plan

    why = {
        "evaluations": "its evaluations are used up",
        "exhausted": "the method has no more to try",
        "converged": f"stopped after {outcome.evaluations}: nothing left above ± {format_length(outcome.noise_m)}",
    }[outcome.stopped]
    known = {"": outcome.chamfer_m, "expected ": outcome.expected_m}
    values = ", ".join(f"{what}{format_length(value)}" for what, value in known.items() if value is not None)
    failed = f" ({outcome.failed_evaluations} without a cloud)" if outcome.failed_evaluations else ""
    told = (
        f"{outcome.cameras} cameras by {outcome.method}: {values} on {_planned_on(settings)}, "
        f"{count(outcome.evaluations, 'evaluation')}{failed} and {count(outcome.confirmations, 'confirmation')} "
        f"in {format_seconds(outcome.seconds)}; {why}."
    )
    lines = [told]
    if not outcome.confirmations:
        lines.append(
            "This plan is NOT CONFIRMED: no photograph was taken of it. Of two sets of which as much is expected, one "
            "can be half as good as the other."
        )
    height_m = load_plan(output).plant_height_m
    if height_m is not None:
        lines.append(
            f"Stations are stated for plants {format_length(height_m)} high; export-mission fits them to each plot's "
            "plant_height_m."
        )
    if outcome.photographs:
        lines.append(f"photographs: {', '.join(outcome.photographs)}")
    show(*lines, rendered([finalist_table(outcome)]), output / "plan.json", output / PLAN_PICTURE)


def _planned_on(settings: SearchSettings) -> str:
    name, others = settings.source.name, len(settings.given) - 1
    if settings.plots == 1:
        return name
    more = f" and {others} more" if others else ""
    if settings.source.kind == "reference":
        return f"{name}{more}, its height stated wrong by up to a quarter"
    return f"plots like {name}{more} that it had not met ({settings.plots} were planned on)"
