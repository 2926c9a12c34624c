"""The campaign's benchmark on one plot of two dates."""

from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks.season import run_season
from fieldkit.runtime.progress import Silent


@pytest.mark.slow
def test_killed_twice_and_complete(tmp_path: Path) -> None:
    result = run_season(1, width_px=600, workers=2, work=tmp_path, progress=Silent())
    figures = dict(result.tables[0].rows)
    assert figures["visits in the table, of those flown"] == "2 of 2"
    assert figures["visits with an error"] == 0
    assert figures["rows that were computed again"] == 0
    assert figures["starts of the command, killed"] in ("3, 2", "3, 1")  # the second may end before it is killed
    for reached in result.figures["chamfer_m"].values():
        assert 0.001 < reached < 0.08
    # What is there is kept: nothing is photographed or evaluated again.
    stamps = {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*.jpg")}
    again = run_season(1, width_px=600, workers=2, work=tmp_path, progress=Silent())
    assert again.figures["chamfer_m"] == result.figures["chamfer_m"]
    assert {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*.jpg")} == stamps
