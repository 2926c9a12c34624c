"""Options of the commands that reconstruct photographs, and the settings they make. Imports nothing heavy."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from enum import StrEnum
from math import isfinite
from typing import TYPE_CHECKING, Annotated

import typer

from fieldkit.cli.help_page import RUN
from fieldkit.errors import UsageError

if TYPE_CHECKING:
    from fieldkit.cache import StageCache
    from fieldkit.reconstruction.settings import ReconstructionSettings
    from fieldkit.runtime.progress import Progress

_GROUP = "Reconstruction"


class Mapping(StrEnum):
    """How camera poses are found."""

    AUTO = "auto"
    INCREMENTAL = "incremental"
    GLOBAL = "global"
    PRIOR = "prior"


class Fidelity(StrEnum):
    """Working size of dense stereo."""

    DRAFT = "draft"
    STANDARD = "standard"
    FINE = "fine"
    FULL = "full"


class Mask(StrEnum):
    """Which pixels are plant."""

    EXG = "exg"
    NONE = "none"
    FILE = "file"


class Backend(StrEnum):
    """What computes depth maps."""

    AUTO = "auto"
    CPU = "cpu"
    CUDA = "cuda"


MappingOption = Annotated[
    Mapping,
    typer.Option(
        "--mapping",
        rich_help_panel=_GROUP,
        help="How poses are found; auto: prior with known positions, else incremental.",
    ),
]
FidelityOption = Annotated[
    Fidelity,
    typer.Option(
        "--fidelity",
        rich_help_panel=_GROUP,
        help="Size of dense stereo: 500×375, 750×562, 1000×750 pixels, or the photographs'.",
    ),
]
MaskOption = Annotated[
    Mask,
    typer.Option(
        "--mask", rich_help_panel=_GROUP, help="What is plant: exg what is green, none everything, file masks/NAME.png."
    ),
]
BackendOption = Annotated[
    Backend,
    typer.Option(
        "--backend",
        rich_help_panel=_GROUP,
        help="What computes depth; auto: cuda with the CUDA build and a GPU, else cpu.",
    ),
]
DISTANCES = "0.002,0.005,0.010,0.020"
DistancesOption = Annotated[
    str, typer.Option("--distances", metavar="M,M,…", help="Distances for precision, recall and F-score, metres.")
]
BoundsOption = Annotated[
    str,
    typer.Option(
        "--bounds",
        rich_help_panel=_GROUP,
        metavar="X,Y,Z,X,Y,Z",
        help="Lowest and highest corner of the volume of interest, metres in the plot frame. Found where not given.",
    ),
]
WorkersOption = Annotated[
    int, typer.Option("--workers", min=1, rich_help_panel=RUN, help="Processes. The result does not depend on it.")
]
NoCacheOption = Annotated[
    bool, typer.Option("--no-cache", rich_help_panel=RUN, help="Neither use nor keep what stages computed.")
]


def make_settings(
    *, mapping: Mapping, fidelity: Fidelity, mask: Mask, backend: Backend, bounds: str, seed: int
) -> ReconstructionSettings:
    """The library's settings for these options.

    Raises:
        UsageError: ``bounds`` is no box.
    """
    corners = parse_bounds(bounds) if bounds else None
    from fieldkit.clouds.volume import Volume
    from fieldkit.reconstruction.settings import ReconstructionSettings

    return ReconstructionSettings(
        mapping=mapping.value,
        fidelity=fidelity.value,
        mask=mask.value,
        backend=backend.value,
        bounds=None if corners is None else Volume(corners[:3], corners[3:]),
        seed=seed,
    )


def parse_bounds(text: str) -> tuple[float, float, float, float, float, float]:
    """The six numbers of --bounds: xmin,ymin,zmin,xmax,ymax,zmax."""
    remedy = "Write it like --bounds -1.5,-0.75,0,1.5,0.75,1.2 (xmin,ymin,zmin,xmax,ymax,zmax; metres)."
    try:
        numbers = tuple(float(part) for part in text.split(","))
    except ValueError as error:
        raise UsageError(f"--bounds: not six numbers: {text}", remedy=remedy) from error
    if len(numbers) != 6 or not all(isfinite(n) for n in numbers):
        raise UsageError(f"--bounds: not six numbers: {text}", remedy=remedy)
    x0, y0, z0, x1, y1, z1 = numbers
    if not (x0 < x1 and y0 < y1 and z0 < z1):
        raise UsageError(f"--bounds: the lowest corner is not below the highest: {text}", remedy=remedy)
    return x0, y0, z0, x1, y1, z1


def parse_distances(text: str) -> tuple[float, ...]:
    """The metres of --distances, ascending and each once."""
    remedy = "Write it like --distances 0.002,0.005,0.01 (metres)."
    try:
        numbers = sorted({float(part) for part in text.split(",")})
    except ValueError as error:
        raise UsageError(f"--distances: not numbers: {text}", remedy=remedy) from error
    if not all(isfinite(n) and n > 0 for n in numbers):
        raise UsageError(f"--distances: not positive numbers: {text}", remedy=remedy)
    return tuple(numbers)


def open_cache(*, no_cache: bool, resume: bool) -> StageCache:
    """The stage cache; one that keeps nothing with --no-cache.

    Raises:
        UsageError: --no-cache leaves --resume nothing to go on from.
    """
    if no_cache and resume:
        raise UsageError(
            "--resume goes on from what the cache holds, and --no-cache does without", remedy="Give one of the two."
        )
    from fieldkit.cache import StageCache, default_cache_root

    return StageCache(None if no_cache else default_cache_root())


@contextmanager
def run_context(*, as_json: bool) -> Iterator[Progress]:
    """One thread in every library, and progress that suits where stderr goes."""
    import pycolmap  # noqa: F401 - here, since importing it takes SIGTERM away

    from fieldkit.cli.boundary import end_on_terminate
    from fieldkit.cli.progress import open_progress
    from fieldkit.runtime.threads import limit_threads

    end_on_terminate()
    limit_threads()
    with open_progress(as_json=as_json) as progress:
        yield progress
