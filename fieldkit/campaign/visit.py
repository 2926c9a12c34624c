"""A row of a campaign's table: one plot on one date."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field


@dataclass(frozen=True)
class Visit:
    """What one capture of one plot came to.

    Lengths are metres. What could not be given is None, and ``notes`` or ``error`` say why.

    Attributes:
        plot: its id in the campaign's plots.
        date: local date of the photographs, ISO 8601 (2026-06-30).
        captures: the photographs' folder, as given.
        folder: of the evaluation, relative to the campaign's.
        images, registered, right: photographs, those with a pose, those whose pose counts.
        pose_rms_m: of reconstructed against known positions.
        chamfer_m, accuracy_m, completeness_m: against the plot's own reference.
        f_score: by distance ("0.010").
        predicted_chamfer_m, predicted_low_m, predicted_high_m: where there is no reference: prediction, and the
            interval that holds nine in ten plots.
        height_m: of the plants: 95 % of their points are lower.
        cover: share of the plot's ground that plants cover, seen from above.
        hull_m3: volume of the plants' hull.
        cpu_s: what the evaluation took.
        error: why there is no score; empty otherwise.
        notes: what a person should know.
    """

    plot: str
    date: str
    captures: str = ""
    folder: str = ""
    images: int = 0
    registered: int = 0
    right: int = 0
    pose_rms_m: float | None = None
    chamfer_m: float | None = None
    accuracy_m: float | None = None
    completeness_m: float | None = None
    f_score: Mapping[str, float] = field(default_factory=dict)
    predicted_chamfer_m: float | None = None
    predicted_low_m: float | None = None
    predicted_high_m: float | None = None
    height_m: float | None = None
    cover: float | None = None
    hull_m3: float | None = None
    cpu_s: float = 0.0
    error: str = ""
    notes: tuple[str, ...] = ()
