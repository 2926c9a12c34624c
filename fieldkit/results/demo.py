"""What demo.json holds: two flights over a block of a trial, and the truth about its plots. Lengths are metres."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from fieldkit.documents.json_file import read_model
from fieldkit.results.fields import Count, Length, Strict
from fieldkit.results.traits import Trait, TraitsEntry

DEMO_FILE = "demo.json"
_MAX_BYTES = 1 << 20
"""Largest report of a demo that is read, bytes."""
_AGAIN = "Run `fieldkit demo` again."

JUDGED: tuple[Trait, ...] = ("height_p95_m", "height_p99_m", "cover_percent", "canopy_volume_m3")
"""Traits whose errors are told."""


class DemoFlight(Strict):
    """A way of flying over the block: by the plan's pattern, or as an app's grid straight down."""

    name: Literal["planned", "grid"]
    """Its evaluation is evaluation-NAME."""
    minutes: Length
    """In the air."""
    photographs: Count
    errors: dict[str, Length]
    """By trait, root mean square over the plots that have it, against the truth."""
    held: Count
    """True values that are within what is stated."""
    known: Count
    """Of so many, over plots and traits."""


class DemoReport(Strict):
    """demo.json: what the plan's pattern is held against, and what is true."""

    kind: Literal["demo"] = "demo"
    version: Literal[6] = 6
    seed: int
    pose_noise: tuple[float, float]
    """Standard deviations of both flights: metres and degrees."""
    wind_m: Length
    """Sway of the leaves by wind, root mean square half a metre out."""
    vehicle_kg: Length
    """Mass of the vehicle whose wash moves leaves, too."""
    flights: tuple[DemoFlight, DemoFlight]
    """The planned one first."""
    truth: dict[str, TraitsEntry]
    """Of the rendered plants, by plot."""


def load_demo(path: Path) -> DemoReport:
    """Read demo.json; ``path`` is the file or the folder that holds it."""
    file = path / DEMO_FILE if path.is_dir() else path
    return read_model(DemoReport, "demo", file, _AGAIN, max_bytes=_MAX_BYTES)
