"""What visit.json holds: one plot on one date in a campaign. Units are in the keys: _m metres, _s seconds."""

from __future__ import annotations

from datetime import date
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import AfterValidator, Field

from fieldkit.documents.json_file import read_model
from fieldkit.files import write_atomic
from fieldkit.results.evaluation import ByDistance, PlotEvaluation
from fieldkit.results.fields import Count, Strict, Text
from fieldkit.results.finding import NO_RASTERS
from fieldkit.results.traits import TraitsEntry

CAMPAIGN_FILE = "campaign.toml"
"""What makes a folder a campaign's."""
VISITS_FOLDER, VISIT_FILE = "visits", "visit.json"
_MAX_BYTES = 8 << 20
"""Largest visit that is read, bytes."""
_SAME = ("images", "registered", "right", "chamfer_m", "accuracy_m", "completeness_m", "traits", "doubts")
"""Fields of a visit that are those of its evaluation."""
_PREDICTED = ("chamfer_m", "low_m", "high_m")


def find_campaign(start: Path) -> Path | None:
    """The folder of the campaign that a folder lies in: the nearest one, itself or above, with campaign.toml."""
    start = Path(start).absolute()
    return next((folder for folder in (start, *start.parents) if (folder / CAMPAIGN_FILE).is_file()), None)


def _is_a_date(text: str) -> str:
    if date.fromisoformat(text).isoformat() != text:
        raise ValueError("is not written like 2026-06-30")
    return text


def _is_a_path(text: str) -> str:
    if "\0" in text:
        raise ValueError("is no path")
    return text


def _is_below_visits(folder: str) -> str:
    parts = _is_a_path(folder).split("/")
    if folder and (parts[0] != VISITS_FOLDER or ".." in parts):
        raise ValueError("leads out of the campaign's visits")
    return folder


class Visit(Strict):
    """visit.json: what one capture of one plot came to.

    What could not be given is null, and ``notes`` or ``error`` say why.
    """

    kind: Literal["visit"] = "visit"
    version: Literal[2] = 2
    plot: str
    """Its id in the campaign's plots."""
    date: Annotated[str, AfterValidator(_is_a_date)]
    """Local date of the photographs, ISO 8601 (2026-06-30)."""
    captures: Text = ""
    """The photographs' folder, as given."""
    folder: Annotated[str, AfterValidator(_is_below_visits)] = ""
    """Of the evaluation, relative to the campaign's; empty where there is none."""
    images: Count = 0
    """Photographs."""
    registered: Count = 0
    """Those with a pose."""
    right: Count = 0
    """Those whose pose counts."""
    pose_rms_m: float | None = None
    """Of reconstructed against known positions."""
    chamfer_m: float | None = None
    """Against the plot's own reference; so accuracy_m, completeness_m and f_score."""
    accuracy_m: float | None = None
    completeness_m: float | None = None
    f_score: ByDistance = Field(default_factory=dict)
    predicted_chamfer_m: float | None = None
    """Where there is no reference; nine in ten plots lie between predicted_low_m and predicted_high_m."""
    predicted_low_m: float | None = None
    predicted_high_m: float | None = None
    traits: TraitsEntry | None = None
    """Of the plants; null where there is no result."""
    cpu_s: float = 0.0
    """What the evaluation took."""
    error: Text = ""
    """Why there is no score; empty otherwise."""
    notes: tuple[Text, ...] = ()
    """What a person should know."""
    no_rasters: str = ""
    """Why it has none, though they were asked for; empty otherwise."""
    unpredicted: Text = ""
    """Why nothing is predicted where there is no reference; empty otherwise."""
    doubts: tuple[str, ...] = ()
    """Codes of findings with which the result must not be taken as it is."""
    fieldkit: str = ""
    """Version that computed it."""
    stages: dict[str, int] = Field(default_factory=dict)
    """Versions of the stages it was computed by."""
    inputs: str = ""
    """Digest of all that the result depends on; empty where it is to be evaluated again."""
    photographs: dict[str, Annotated[str, AfterValidator(_is_a_path)]] = Field(default_factory=dict)
    """Paths, absolute or relative to the campaign's folder, by the photographs' SHA-256."""

    @classmethod
    def of_evaluation(cls, evaluation: PlotEvaluation, **own: Any) -> Self:
        """A visit with the figures of its evaluation."""
        same: dict[str, Any] = {name: getattr(evaluation, name) for name in _SAME}
        if (prediction := evaluation.prediction) is not None:
            same |= {f"predicted_{name}": getattr(prediction, name) for name in _PREDICTED}
            same["unpredicted"] = prediction.reason
        return cls(
            **same,
            pose_rms_m=evaluation.pose_rms_m if evaluation.metric else None,
            f_score=evaluation.f_score or {},
            error="" if evaluation.error is None else evaluation.error.message,
            no_rasters="; ".join(f.message for f in evaluation.findings if f.code == NO_RASTERS),
            **own,
        )

    @property
    def height_m(self) -> float | None:
        """Of the highest leaf."""
        return None if self.traits is None else self.traits.height_m

    @property
    def key(self) -> tuple[str, str]:
        """Plot and date: a campaign has one visit of each."""
        return self.plot, self.date

    def row(self) -> dict[str, Any]:
        """What people see of it, as plain values by name."""
        row: dict[str, Any] = {}
        for name, value in self.model_dump(mode="json", exclude=_UNSEEN).items():
            row |= (self.traits or TraitsEntry()).row() if name == "traits" else {name: value}
        return row


_UNSEEN = {"kind", "version", "stages", "inputs", "photographs", "no_rasters", "unpredicted"}


def save_visit(folder: Path, visit: Visit) -> None:
    """Write visit.json (UTF-8, indented) into a visit's folder, which is made where it is missing."""
    write_atomic(folder / VISIT_FILE, visit.model_dump_json(indent=2) + "\n")


def load_visit(folder: Path) -> Visit:
    """Read a folder's visit.json."""
    remedy = "Move it away, and run `fieldkit evaluate` on the photographs again."
    return read_model(Visit, "visit", folder / VISIT_FILE, remedy, max_bytes=_MAX_BYTES)
