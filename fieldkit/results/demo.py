"""What demo.json holds: planned views against a circle on two simulated plots. Lengths are metres."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from fieldkit.documents.json_file import read_model
from fieldkit.results.fields import Count, Length, Strict
from fieldkit.results.traits import TraitsEntry

DEMO_FILE = "demo.json"
_MAX_BYTES = 1 << 20
"""Largest report of a demo that is read, bytes."""
_AGAIN = "Run `fieldkit demo` again."

PlotName = Literal["seen", "unseen"]
Views = Literal["circle", "planned"]


class DemoEntry(Strict):
    """One capture of one plot."""

    plot: PlotName
    """"seen" is the plot that the plan was made on."""
    views: Views
    images: Count
    """Photographs."""
    right: Count
    """Those whose pose counts."""
    to_reference_m: Length
    """Chamfer distance to the plot's reference, after ICP."""
    to_true_plants_m: Length
    """Chamfer distance to the rendered plants, after ICP: what real photographs do not tell."""


class DemoReport(Strict):
    """demo.json: what planned views are worth beside the best circle."""

    kind: Literal["demo"] = "demo"
    version: Literal[5] = 5
    seed: int
    pose_noise: tuple[float, float]
    """Standard deviations of the flights over both plots: metres and degrees."""
    wind_m: Length
    """Sway of the leaves by wind, root mean square half a metre out."""
    vehicle_kg: Length
    """Mass of the vehicle whose wash moves leaves, too."""
    reference_to_true_plants_m: Length
    """Chamfer distance of the seen plot's reference to the rendered plants, after ICP."""
    scores: tuple[DemoEntry, ...]
    truth: dict[PlotName, TraitsEntry]
    """Of the rendered plants, within the plot's outline."""

    def score(self, plot: PlotName, views: Views) -> DemoEntry | None:
        """The capture of a plot from these views, or None."""
        return next((each for each in self.scores if (each.plot, each.views) == (plot, views)), None)


def load_demo(path: Path) -> DemoReport:
    """Read demo.json; ``path`` is the file or the folder that holds it."""
    file = path / DEMO_FILE if path.is_dir() else path
    return read_model(DemoReport, "demo", file, _AGAIN, max_bytes=_MAX_BYTES)
