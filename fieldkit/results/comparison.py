"""What compare.json holds. Units are in the figures' names: _m metres, _px pixels, _m3 cubic metres."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field

from fieldkit.documents.json_file import read_model
from fieldkit.results.fields import Length, Sha256, Strict

COMPARE_FILE = "compare.json"
_MAX_BYTES = 1 << 26
"""Largest comparison that is read, bytes."""
_AGAIN = "Run `fieldkit compare` again."

NoiseSource = Literal["repeats", "flights"]
"""Evaluations of one label; what the benchmark found between flights."""


class ComparedEvaluation(Strict):
    """One of the evaluations, or several that repeat one."""

    label: str
    sources: tuple[str, ...]
    """Names of the folders of captures; more than one: repeats."""
    reference_sha256: Sha256 | None
    """Null without a reference, and where repeats have different ones."""
    plots: tuple[str, ...]


class ValueEntry(Strict):
    """A figure of a plot in an evaluation."""

    plot: str
    figure: str
    label: str
    value: float
    """Mean over repeats."""
    repeats: Annotated[int, Field(gt=0)]
    spread: Length | None
    """Standard deviation over repeats; null for one."""


class DifferenceEntry(Strict):
    """A figure's difference between two evaluations, and whether that is more than noise."""

    plot: str
    figure: str
    label: str
    less: str
    """The other evaluation: the first one, or the one before."""
    difference: float
    noise: NoiseSource | None = None
    """Where the noise is known from; null where it cannot be told."""
    noise_sd: Length | None = None
    """Standard deviation of the difference if nothing but noise differed."""
    low: float | None = None
    high: float | None = None
    """95 % interval of the difference."""
    beyond: bool | None = None
    """Whether the interval leaves 0 out; null where the noise cannot be told."""


class ComparisonReport(Strict):
    """compare.json: several evaluations side by side."""

    kind: Literal["comparison"] = "comparison"
    version: Literal[1] = 1
    fieldkit: str
    """Version that wrote it."""
    evaluations: Annotated[tuple[ComparedEvaluation, ...], Field(min_length=1)]
    """In the order given."""
    figures: tuple[str, ...]
    """Those that were compared."""
    values: tuple[ValueEntry, ...]
    differences: tuple[DifferenceEntry, ...]
    notes: tuple[str, ...]
    """What could not be compared or told, and why."""


def load_comparison(path: Path) -> ComparisonReport:
    """Read compare.json; ``path`` is the file or the folder that holds it."""
    file = path / COMPARE_FILE if path.is_dir() else path
    return read_model(ComparisonReport, "comparison", file, _AGAIN, max_bytes=_MAX_BYTES)
