"""Options of `fieldkit plan` in groups, and what each says of a run's settings. Imports nothing heavy."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

from typer import Option

from fieldkit.cli.common import (
    RUN,
    SEED,
    OverwriteOption,
    ResumeOption,
    read_numbers,
    read_pose_noise,
    scenes_like,
    vehicles_like,
)
from fieldkit.cli.reconstruction_options import SchedulerOption, WorkersOption
from fieldkit.errors import UsageError
from fieldkit.vocabulary import PlanningMethod, Preset, SearchFidelity

_FROM = "from:"
Purpose = Literal["kind", "this-plot"]


@dataclass(frozen=True)
class PlotOptions:
    """What is planned on."""

    panel: ClassVar[str] = "What to plan on"

    scenes: Annotated[list[Path] | None, Option("--scene", metavar="SCENE", autocompletion=scenes_like)] = None
    """Plan on a scene: a file, a folder or a name such as case-1. Repeatable."""
    references: Annotated[list[Path] | None, Option("--reference", metavar="REF")] = None
    """Plan on a proxy of a reference; repeatable. With --captures: their truth."""
    captures: Path | None = None
    """Choose of recorded photographs with known poses."""
    images: Annotated[list[Path] | None, Option(metavar="FOLDER")] = None
    """Photographs of each --reference, for a finer proxy."""
    purpose: Annotated[Purpose | None, Option("--for")] = None
    """kind: plots like this one, which field and score plan for; this-plot: it alone."""
    plots: Annotated[int | None, Option("--vary", metavar="K", min=1)] = None
    """Plots of the kind, those given among them; 8 where not given."""


@dataclass(frozen=True)
class SearchOptions:
    """How cameras are looked for."""

    panel: ClassVar[str] = "Search"

    cameras: Annotated[int | None, Option("--cameras", "-n", rich_help_panel="Options", min=3, max=200)] = None
    """10 where not given."""
    method: PlanningMethod | None = None
    """score where plans are for a kind and nothing of a search is given, else field."""
    evaluations: Annotated[int | None, Option(min=1)] = None
    """At most; 100 where not given."""
    fidelity: SearchFidelity | None = None
    """Of the search; standard where not given."""
    repeats: Annotated[int | None, Option(min=0)] = None
    """Fresh seeds that finalists are confirmed at; 0: none."""
    preset: Preset = "outdoors"
    """What plans for a kind expect: a flight outdoors, or the paper's still air and exact poses."""
    pose_noise: Annotated[str, Option(metavar="M,DEG")] = ""
    """Plan for flights that miss stations by this; from:EVAL as one. For a kind: the vehicle's; 0,0: none."""

    def values(self) -> dict[str, Any]:
        """By the keys of `SearchSettings`; None where nothing is given."""
        return {name: value for name, value in asdict(self).items() if name not in ("pose_noise", "preset")}


@dataclass(frozen=True)
class EnvelopeOptions:
    """Where cameras may be, and whose."""

    panel: ClassVar[str] = "Where cameras may be"

    height: Annotated[str, Option(metavar="LOW,HIGH")] = ""
    """Above the ground, metres."""
    clearance_m: Annotated[float | None, Option("--clearance", metavar="M", min=0)] = None
    """From cameras to plants."""
    vehicle: Annotated[str | None, Option(autocompletion=vehicles_like, metavar="NAME")] = None
    """A profile's name or file: plan what it can fly, with its camera."""

    def values(self) -> dict[str, Any]:
        """By the keys of `EnvelopeSettings`; None where nothing is given."""
        height_m = read_numbers("--height", self.height, (2,)) if self.height else None
        return {"height_m": height_m, "clearance_m": self.clearance_m}


@dataclass(frozen=True)
class PlanRunOptions:
    """How the search is run."""

    panel: ClassVar[str] = RUN

    seed: Annotated[int | None, SEED] = None
    workers: WorkersOption = None
    scheduler: SchedulerOption = ""
    resume: ResumeOption = False
    overwrite: OverwriteOption = False


def plan_arguments(
    plot: PlotOptions, search: SearchOptions, envelope: EnvelopeOptions, run: PlanRunOptions
) -> dict[str, Any]:
    """The arguments that `search_settings` and `resumed_settings` share."""
    pose_m, pose_deg = _pose_noise(search.pose_noise) if search.pose_noise else (None, None)
    limits = envelope.values()
    from fieldkit.planning.run.given import check_given

    scenes, references, images = (tuple(each or ()) for each in (plot.scenes, plot.references, plot.images))
    if not run.resume or any((scenes, references, plot.captures, images)):
        check_given(scenes, references, plot.captures, images)
    return search.values() | {
        "scene": scenes, "reference": references, "captures": plot.captures, "images": images,
        "vehicle": envelope.vehicle, "purpose": plot.purpose, "plots": plot.plots,
        "seed": run.seed, "noise": {"pose_m": pose_m, "pose_deg": pose_deg}, "envelope": limits,
    }  # fmt: skip


def _pose_noise(text: str) -> tuple[float, float]:
    """M,DEG, or from:EVAL."""
    if not text.startswith(_FROM):
        return read_pose_noise(text)
    from fieldkit.campaign import CAMPAIGN_FILE, read_campaign, visit_plots
    from fieldkit.evaluation.adherence import flown_noise
    from fieldkit.results.report_files import load_evaluation_report

    file = Path(text.removeprefix(_FROM))
    if not file.name:
        raise UsageError("--pose-noise: from what?", remedy="Write it like --pose-noise from:EVAL, a folder or a file.")
    if (file / CAMPAIGN_FILE).is_file():
        return flown_noise(visit_plots(read_campaign(file)), file)
    return flown_noise(load_evaluation_report(file).plots, file)
