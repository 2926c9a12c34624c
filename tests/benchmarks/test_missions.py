"""The missions' studies, small."""

import json
from pathlib import Path

import pytest

from benchmarks.mission_routes import route_field, tours
from benchmarks.missions import MissionOptions, recordings, run_missions
from fieldkit.errors import UsageError
from fieldkit.runtime.progress import Silent
from fieldkit.vehicles.vehicle_file import load_vehicle

OPTIONS = MissionOptions(None, missions=4, passes=6, uploads=1, plots=3, files=120)


@pytest.mark.slow
def test_studies_are_written(tmp_path: Path) -> None:
    results = run_missions(tmp_path / "out", ["trips", "passes", "poses", "fuzz"], OPTIONS, progress=Silent())
    trips, passes, poses, fuzzed = results
    assert {(row[0], row[1], row[3], row[6]) for row in trips.tables[0].rows} == {
        ("ardupilot", "plan", 4, 0),
        ("ardupilot", "waypoints", 4, 0),
        ("px4", "plan", 4, 0),
        ("px4", "waypoints", 4, 0),
    }
    assert all(row[5] == 0 and float(str(row[9])) < 0.05 for row in passes.tables[0].rows)
    assert {row[0] for row in poses.tables[0].rows} >= {"mount_then_yaw.tlog", "naive.tlog", "hold0.tlog"}
    assert all(float(str(row[3])) < 2.0 and float(str(row[4])) < 0.2 for row in poses.tables[0].rows)
    assert sum(int(str(row[1])) for row in fuzzed.tables[0].rows) >= 100
    assert all(row[4] == row[5] == row[7] == 0 for row in fuzzed.tables[0].rows), fuzzed.notes
    kept = json.loads((tmp_path / "out" / "results.json").read_text())
    assert set(kept["studies"]) == {"trips", "passes", "poses", "fuzz"}
    with pytest.raises(UsageError, match="no study"):
        run_missions(tmp_path / "other", ["speed"], OPTIONS, progress=Silent())


@pytest.mark.slow
def test_routes_are_measured() -> None:
    found = {tour.name: tour for tour in tours(0)}
    assert all(0.0 - 1e-9 <= tour.excess < 0.05 for tour in found.values())
    field = route_field(3, 13, load_vehicle("ardupilot-pitch"), 0)
    assert (field.plots, field.stations) == (3, 39)
    assert field.least_plants_m > load_vehicle("ardupilot-pitch").clearance_m - 0.07


@pytest.mark.slow
def test_uploads_are_counted(tmp_path: Path) -> None:
    assert "probe_items" in recordings()
    (result,) = run_missions(tmp_path / "out", ["uploads"], OPTIONS, progress=Silent())
    assert [row[:2] for row in result.tables[0].rows] == [(1, 1), (1, 1)]
    assert result.tables[1].rows[0][4:6] == (0, 1)
