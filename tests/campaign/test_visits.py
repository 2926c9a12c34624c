"""Visits in their folders."""

import json
from pathlib import Path

import pytest

from fieldkit.campaign import Visit
from fieldkit.campaign.reading import keep_visit, read_visits
from fieldkit.errors import CaptureError, MetadataError
from fieldkit.evaluation.conversion import failed_plot
from fieldkit.results.evaluation import Prediction
from fieldkit.results.traits import TraitsEntry
from fieldkit.results.visit import load_visit

FULL = Visit(
    plot="r1c1", date="2026-06-18", captures="flights/1", folder="visits/r1c1/2026-06-18", images=13, registered=12,
    right=11, pose_rms_m=0.02, chamfer_m=0.011, accuracy_m=0.006, completeness_m=0.005, f_score={"0.010": 0.9},
    predicted_chamfer_m=0.012, predicted_low_m=0.01, predicted_high_m=0.015,
    cpu_s=20.5, error="", notes=("one", "two ü"), inputs="abc",
)  # fmt: skip
FAILED = Visit(plot="r1c1", date="2026-06-25", error="it’s <b>broken</b>")


def test_visits_come_back_and_replace_each_other(tmp_path: Path) -> None:
    assert read_visits(tmp_path) == []
    assert not list(tmp_path.iterdir())
    slashed = FAILED.model_copy(update={"plot": "a/b"})
    for visit in (FULL, FAILED, slashed):
        assert keep_visit(tmp_path, visit)
    assert read_visits(tmp_path) == [slashed, FULL, FAILED]
    later = FAILED.model_copy(update={"inputs": "later"})
    assert keep_visit(tmp_path, later)
    assert read_visits(tmp_path) == [slashed, FULL, later]
    assert [path.name for path in (tmp_path / "visits" / "a%2Fb" / FAILED.date).iterdir()] == ["visit.json"]


def test_copies_and_what_killed_runs_left_are_no_visits(tmp_path: Path) -> None:
    keep_visit(tmp_path, FULL)
    text = (tmp_path / FULL.folder / "visit.json").read_text()
    for name in (f"{FULL.date} copy", f".{FULL.date}.0123456789ab.partial"):
        place = tmp_path / "visits" / FULL.plot / name
        place.mkdir()
        (place / "visit.json").write_text(text)
    assert read_visits(tmp_path) == [FULL]


def test_somebodys_other_work_is_left_alone(tmp_path: Path) -> None:
    place = tmp_path / FULL.folder
    place.mkdir(parents=True)
    assert keep_visit(tmp_path, FULL)  # empty
    (place / "visit.json").rename(place / "notes.txt")
    assert not keep_visit(tmp_path, FULL)
    (place / "evaluation.json").touch()
    assert keep_visit(tmp_path, FULL)


@pytest.mark.parametrize(
    "change",
    [
        {"date": "20260618"},
        {"chamfer_m": float("nan")},
        {"images": 1.5},
        {"folder": "visits/../../etc"},
        {"photographs": {"ab": "a\0b"}},
        {"colour": "green"},
        {"version": 3},
    ],
)
def test_values_that_nobody_wrote(change: dict[str, object], tmp_path: Path) -> None:
    keep_visit(tmp_path, FULL)
    file = tmp_path / FULL.folder / "visit.json"
    file.write_text(json.dumps(json.loads(file.read_text()) | change))
    for read in (lambda: load_visit(file.parent), lambda: read_visits(tmp_path)):
        with pytest.raises(MetadataError) as caught:
            read()
        assert caught.value.path == file
        assert caught.value.remedy


def test_a_visit_has_the_figures_of_its_evaluation() -> None:
    figures = {
        "images": 9,
        "registered": 8,
        "right": 7,
        "pose_rms_m": 0.1,
        "chamfer_m": 0.2,
        "accuracy_m": 0.3,
        "completeness_m": 0.4,
        "f_score": {"0.010": 0.5},
    }
    traits = TraitsEntry(height_m=0.6, cover_percent=8.0, canopy_volume_m3=0.9, unknown={"covered_area_m2": "why"})
    prediction = Prediction(chamfer_m=0.11, low_m=0.12, high_m=0.13, reason="", model=1)
    failed = failed_plot("p", CaptureError("too dark", path=Path("x"), remedy=""))
    plot = failed.model_copy(update={**figures, "metric": True, "traits": traits, "prediction": prediction})
    row = Visit.of_evaluation(plot, plot="p", date="2026-06-18").row()
    assert {name: row[name] for name in figures} == figures
    assert [row[f"predicted_{name}_m"] for name in ("chamfer", "low", "high")] == [0.11, 0.12, 0.13]
    assert (row["height_m"], row["cover_percent"], row["canopy_volume_m3"]) == (0.6, 8.0, 0.9)
    assert row["no_trait"] == "covered_area_m2: why"
    assert "too dark" in row["error"]
    unscaled = Visit.of_evaluation(plot.model_copy(update={"metric": False}), plot="p", date="2026-06-18")
    assert unscaled.pose_rms_m is None
