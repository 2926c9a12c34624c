"""Options of the commands that reconstruct photographs, and the settings they make. Imports nothing heavy."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar, TypeAlias

from typer import Option

from fieldkit.cli.common import RUN, OverwriteOption, ResumeOption, SeedOption
from fieldkit.documents.csv_text import finite_numbers
from fieldkit.errors import UsageError
from fieldkit.vocabulary import DISTANCES_M, Fidelity, MappingChoice, Mask, TiesChoice

if TYPE_CHECKING:
    from fieldkit.cache import StageCache
    from fieldkit.captures.programs import PosesFile
    from fieldkit.evaluation.rasters import Rasters
    from fieldkit.reconstruction.settings import ReconstructionSettings
    from fieldkit.runtime.progress import Progress

Box: TypeAlias = tuple[float, float, float, float, float, float]
_DISTANCES_REMEDY = "Write it like --distances 0.002,0.005,0.01 (metres)."
_FARTHEST_M = 100.0
"""Of --bounds; a plot is smaller, in metres."""
DISTANCES = ",".join(f"{distance:.3f}" for distance in DISTANCES_M)
DistancesOption = Annotated[
    str, Option("--distances", metavar="M,M,…", help="Distances for precision, recall and F-score, metres.")
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
NoCacheOption = Annotated[
    bool, Option("--no-cache", rich_help_panel=RUN, help="Neither use nor keep what stages computed.")
]


@dataclass(frozen=True)
class ReconstructionOptions:
    """How photographs are reconstructed."""

    panel: ClassVar[str] = "Reconstruction"

    mapping: MappingChoice = "auto"
    """How poses are found; auto: prior with known positions, else incremental."""
    ties: TiesChoice = "auto"
    """Matches that tie photographs: SIFT's; learned: networks', too, where poses are loose; auto: if installed."""
    fidelity: Fidelity = "standard"
    """What a pixel covers at the plants: 4, 2 or 1.2 mm, or the photographs' own."""
    mask: Mask = "exg"
    """What is plant: exg what is green, none everything, file masks/NAME.png."""
    bounds: Annotated[str, Option(metavar="X,Y,Z,X,Y,Z")] = ""
    """Lowest and highest corner of the volume of interest, metres in the plot frame. Found where not given."""

    @property
    def corners(self) -> Box | None:
        """The numbers of --bounds."""
        return parse_bounds(self.bounds) if self.bounds else None

    def settings(self, seed: int) -> ReconstructionSettings:
        """The library's settings for these options."""
        corners = self.corners
        from fieldkit.clouds.volume import Volume
        from fieldkit.reconstruction.learned import ties_name
        from fieldkit.reconstruction.settings import ReconstructionSettings

        return ReconstructionSettings(
            mapping=self.mapping, ties=ties_name(self.ties), fidelity=self.fidelity, mask=self.mask,
            bounds=None if corners is None else Volume(corners[:3], corners[3:]), seed=seed,
        )  # fmt: skip


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

    workers: WorkersOption = None
    seed: SeedOption = 0
    overwrite: OverwriteOption = False
    resume: ResumeOption = False
    no_cache: NoCacheOption = False

    @property
    def processes(self) -> int:
        """The number of --workers, or the usual one."""
        return processes(self.workers)

    def cache(self) -> StageCache:
        """The stage cache, as `open_cache` gives it."""
        return open_cache(no_cache=self.no_cache, resume=self.resume)


def processes(workers: int | None) -> int:
    """The number of --workers, or the usual one."""
    from fieldkit.runtime.machine import usual_workers

    return workers or usual_workers()


def parse_frame(option: str, text: str) -> str:
    """What a person says of a frame: "metres", "EPSG:CODE", or "" for nothing."""
    if text.lower() in ("", "metres", "meters"):
        return "metres" if text else ""
    kind, colon, code = text.partition(":")
    if kind.upper() == "EPSG" and colon and code.replace("+", "").isdecimal() and 4 <= len(code) <= 12:
        return f"EPSG:{code}"
    raise UsageError(f"{option}: neither metres nor EPSG:CODE: {text}", remedy=f"Write it like {option} EPSG:32633.")


@dataclass(frozen=True)
class RasterOptions:
    """Height models."""

    rasters: bool = False
    """Also write canopy-height.tif and surface.tif (GeoTIFF in UTM, with QGIS styles)."""
    gsd: Annotated[float | None, Option(metavar="M")] = None
    """With --rasters: edge of their cells, metres; 5 mm or the depth maps' pixel."""

    def wanted(self) -> Rasters | None:
        """What is to be written; None without --rasters."""
        if not self.rasters:
            if self.gsd is not None:
                raise UsageError("--gsd is the cells of --rasters", remedy="Give --rasters, too, or leave --gsd out.")
            return None
        if self.gsd is not None and not 0.0 < self.gsd <= 1.0:
            raise UsageError(f"--gsd: no edge of cells in metres: {self.gsd:g}", remedy="Write it like --gsd 0.01.")
        from fieldkit.evaluation.rasters import Rasters, require_rasters

        require_rasters()
        return Rasters(self.gsd)


def parse_bounds(text: str) -> Box:
    """The six numbers of --bounds: xmin,ymin,zmin,xmax,ymax,zmax."""
    remedy = "Write it like --bounds -1.5,-0.75,0,1.5,0.75,1.2 (xmin,ymin,zmin,xmax,ymax,zmax; metres)."
    numbers = finite_numbers(text)
    if len(numbers) != 6:
        raise UsageError(f"--bounds: not six numbers: {text}", remedy=remedy)
    x0, y0, z0, x1, y1, z1 = numbers
    if not (x0 < x1 and y0 < y1 and z0 < z1):
        raise UsageError(f"--bounds: the lowest corner is not below the highest: {text}", remedy=remedy)
    if max(map(abs, numbers)) > _FARTHEST_M:
        raise UsageError(f"--bounds: metres about the plot, at most {_FARTHEST_M:g}, and not {text}", remedy=remedy)
    return x0, y0, z0, x1, y1, z1


def parse_distances(text: str) -> tuple[float, ...]:
    """The metres of --distances, ascending and each once."""
    numbers = sorted(set(finite_numbers(text)))
    if not numbers or numbers[0] <= 0:
        raise UsageError(f"--distances: not positive numbers: {text}", remedy=_DISTANCES_REMEDY)
    if numbers[-1] > 1.0:
        raise UsageError(
            f"--distances: at most 1 m, and not {numbers[-1]:g}: in millimetres?", remedy=_DISTANCES_REMEDY
        )
    return tuple(numbers)


def open_cache(*, no_cache: bool, resume: bool) -> StageCache:
    """The stage cache; one that keeps nothing with --no-cache."""
    if no_cache and resume:
        raise UsageError(
            "--resume goes on from what the cache holds, and --no-cache does without", remedy="Give one of the two."
        )
    from fieldkit.cache import StageCache, default_cache_root

    return StageCache(None if no_cache else default_cache_root())


@contextmanager
def run_context(*, as_json: bool) -> Iterator[Progress]:
    """One thread in every library, and progress that suits where stderr goes."""
    from fieldkit.cli.progress import open_progress
    from fieldkit.runtime.threads import limit_threads

    limit_threads()
    with open_progress(as_json=as_json) as progress:
        yield progress
