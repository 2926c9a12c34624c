"""Options of the commands that reconstruct photographs, and the settings they make. Imports nothing heavy."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar, TypeAlias

from typer import Option

from fieldkit.cli.common import RUN, SEED, OverwriteOption, ResumeOption
from fieldkit.cli.options import Panels
from fieldkit.documents.csv_text import finite_numbers
from fieldkit.errors import UsageError
from fieldkit.vocabulary import TiesChoice

if TYPE_CHECKING:
    from fieldkit.captures.programs import PosesFile
    from fieldkit.evaluation.settings import EvaluationSettings
    from fieldkit.runtime.context import Context

Box: TypeAlias = tuple[float, float, float, float, float, float]
_FARTHEST_M = 100.0
"""Of --bounds; a plot is smaller, in metres."""
TiesOption = Annotated[
    TiesChoice | None,
    Option(
        "--ties",
        rich_help_panel="Reconstruction",
        help="Matches that tie photographs: SIFT's; learned: networks', too, where poses are loose; auto (where not "
        "given): if installed.",
    ),
]
WorkersOption = Annotated[
    int | None,
    Option("--workers", min=1, rich_help_panel=RUN, help="Processes; as many as cores and memory allow if not given."),
]
SchedulerOption = Annotated[
    str,
    Option(
        "--scheduler", metavar="URL", rich_help_panel=RUN, help="Compute on a Dask cluster instead: tcp://host:8786."
    ),
]


@dataclass(frozen=True)
class PosesOptions:
    """Poses that another program found."""

    panel: ClassVar[str] = "Another program's poses"

    poses: Path | None = None
    """A COLMAP model's folder, OpenDroneMap's shots.geojson, or Metashape's cameras as XML. Without: what lies
    beside the photographs."""
    poses_frame: Annotated[str, Option(metavar="FRAME")] = ""
    """Of --poses, where it says none, as COLMAP's do: metres, or EPSG:CODE."""

    def given(self) -> PosesFile | None:
        """The file and its frame; None where none was given."""
        if self.poses is None:
            if self.poses_frame:
                raise UsageError("--poses-frame is that of --poses", remedy="Give --poses with it.")
            return None
        from fieldkit.captures.programs import PosesFile

        return PosesFile(self.poses, parse_frame("--poses-frame", self.poses_frame))


@dataclass(frozen=True)
class RunOptions:
    """How the stages of a reconstruction are run."""

    panel: ClassVar[str] = RUN

    workers: WorkersOption = None
    overwrite: OverwriteOption = False
    resume: ResumeOption = False
    no_cache: bool = False
    """Neither use nor keep what stages computed."""

    def __post_init__(self) -> None:
        if self.no_cache and self.resume:
            raise UsageError(
                "--resume goes on from what the cache holds, and --no-cache does without",
                remedy="Give one of the two.",
            )


@dataclass(frozen=True)
class ComputingOptions(RunOptions):
    """The same, perhaps on a cluster."""

    scheduler: SchedulerOption = ""

    def context(self, *, as_json: bool) -> AbstractContextManager[Context]:
        """See `run_context`."""
        return run_context(as_json=as_json, workers=self.workers, scheduler=self.scheduler, no_cache=self.no_cache)


def parse_frame(option: str, text: str) -> str:
    """What a person says of a frame: "metres", "EPSG:CODE", or "" for nothing."""
    if text.lower() in ("", "metres", "meters"):
        return "metres" if text else ""
    kind, colon, code = text.partition(":")
    if kind.upper() == "EPSG" and colon and code.replace("+", "").isdecimal() and 4 <= len(code) <= 12:
        return f"EPSG:{code}"
    raise UsageError(f"{option}: neither metres nor EPSG:CODE: {text}", remedy=f"Write it like {option} EPSG:32633.")


def parse_bounds(text: str) -> Box:
    """The six numbers of --bounds: xmin,ymin,zmin,xmax,ymax,zmax."""
    numbers = finite_numbers(text)
    if len(numbers) == 6 and max(map(abs, numbers)) <= _FARTHEST_M:
        x0, y0, z0, x1, y1, z1 = numbers
        if x0 < x1 and y0 < y1 and z0 < z1:
            return x0, y0, z0, x1, y1, z1
    raise UsageError(
        f"--bounds: not the lowest and highest corner of a box in metres, at most {_FARTHEST_M:g} away: {text}",
        remedy="Write it like --bounds -1.5,-0.75,0,1.5,0.75,1.2 (xmin,ymin,zmin,xmax,ymax,zmax; metres).",
    )


def parse_distances(text: str) -> tuple[float, ...]:
    """The metres of --distances, ascending and each once."""
    numbers = sorted(set(finite_numbers(text)))
    if not numbers or numbers[0] <= 0 or numbers[-1] > 1.0:
        raise UsageError(
            f"--distances: not distances in metres, above 0 and at most 1: {text}",
            remedy="Write it like --distances 0.002,0.005,0.01 (metres).",
        )
    return tuple(numbers)


RECONSTRUCTION: Panels = {
    "Reconstruction": {
        "mapping": None,
        "fidelity": None,
        "mask": None,
        "bounds_m": Annotated[str, Option("--bounds", parser=parse_bounds, metavar="X,Y,Z,X,Y,Z")],
    },
    "Options": {"rasters": None, "gsd_m": Annotated[float, Option("--gsd", metavar="M")]},
    RUN: {"seed": SEED},
}
"""Options of the commands that reconstruct, for `EvaluationSettings`."""


def with_ties(settings: EvaluationSettings, choice: TiesChoice | None) -> EvaluationSettings:
    """The settings with what --ties stands for on this machine."""
    from fieldkit.reconstruction.learned import ties_name

    return settings.model_copy(update={"ties": ties_name(choice or "auto")})


@contextmanager
def run_context(
    *, as_json: bool, workers: int | None = None, seed: int = 0, scheduler: str = "", no_cache: bool = False
) -> Iterator[Context]:
    """How a command computes: one thread in every library, and progress that suits where stderr goes.

    ``workers`` is the number of --workers, None for the usual one.
    """
    from fieldkit.cache import StageCache, default_cache_root
    from fieldkit.cli.progress import open_progress
    from fieldkit.runtime.context import Context
    from fieldkit.runtime.machine import usual_workers
    from fieldkit.runtime.threads import limit_threads

    limit_threads()
    with open_progress(as_json=as_json) as progress:
        cache = StageCache(None if no_cache else default_cache_root())
        yield Context(cache, progress, workers or usual_workers(), seed, scheduler)
