"""Options of `fieldkit plan` for its settings. Imports nothing heavy."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, ClassVar

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
from fieldkit.cli.options import Panels
from fieldkit.cli.reconstruction_options import SchedulerOption, WorkersOption
from fieldkit.errors import UsageError
from fieldkit.planning.plan_settings import NoiseSettings, Range
from fieldkit.vocabulary import PlanningMethod

_FROM = "from:"


@dataclass(frozen=True)
class PlanRunOptions:
    """How the search is run."""

    panel: ClassVar[str] = RUN

    workers: WorkersOption = None
    scheduler: SchedulerOption = ""
    resume: ResumeOption = False
    overwrite: OverwriteOption = False


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
