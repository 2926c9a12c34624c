"""fieldkit geotag, and where its local frame lies."""

import json
from pathlib import Path

import pytest

from fieldkit.cli.common import SitePlotOptions
from fieldkit.cli.geotag import frame_of_plot
from fieldkit.cli.main import main
from fieldkit.errors import UsageError
from fieldkit.flightlogs import read_flight_log
from tests.campaign.examples import field, plots_geojson
from tests.captures.photographs import MakePhoto
from tests.flightlogs.recordings import recording
from tests.flightlogs.test_geotag import make
from tests.photo_fixture import photo_file as photo_file

FIELD = field(1, 2)


def test_the_frame_is_a_plots(tmp_path: Path) -> None:
    (tmp_path / "plots.geojson").write_text(plots_geojson(FIELD))
    site = tmp_path / "site.toml"
    site.write_text("format = 1\n[home]\nlatitude_deg = 52.296\nlongitude_deg = 10.437\namsl_m = 40.0\n")
    told: list[str] = []
    place = SitePlotOptions(site, tmp_path / "plots.geojson", None, "r1c2")
    frame, heading_deg = frame_of_plot(place, tell=told.append)
    assert heading_deg == FIELD[1].row_heading_deg
    expected = (FIELD[1].latitude_deg, FIELD[1].longitude_deg)
    assert (frame.latitude_deg, frame.longitude_deg) == pytest.approx(expected, abs=1e-7)
    assert (frame.altitude_m, frame.datum) == (40.0, "sea level")
    assert told == ['2 plots, ids from "name": r1c1, r1c2.']
    with pytest.raises(UsageError, match="which plot"):
        frame_of_plot(SitePlotOptions(site, tmp_path / "plots.geojson"), tell=None)


def test_the_command(photo_file: MakePhoto, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log = recording("mount_then_yaw.tlog")
    for k, trigger in enumerate(read_flight_log(log).triggers):
        folder = make(photo_file, f"{k}.jpg", trigger.utc_s).parent
    call = ["geotag", str(folder), "--log", str(log), "-o", str(tmp_path / "poses.csv")]
    for wrong in (["--mount=-100"], ["--plot", "x"]):
        assert main([*call, *wrong]) == 2
    assert not (tmp_path / "poses.csv").exists()
    assert main([*call, "--mount=-40,0", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert (told["matched"], told["origin"]["source"]) == (13, "home of the log")
    assert main([*call, "--overwrite"]) == 0
    assert "13 of 13" in capsys.readouterr().out


def test_contradictions() -> None:
    assert frame_of_plot(SitePlotOptions(), tell=None) == (None, 90.0)
    with pytest.raises(UsageError, match="--plots goes with a site file"):
        frame_of_plot(SitePlotOptions(plots=Path("x")), tell=None)
