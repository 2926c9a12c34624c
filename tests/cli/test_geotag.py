"""Where the local frame of fieldkit geotag lies."""

from pathlib import Path

import pytest

from fieldkit.cli.common import SitePlotOptions
from fieldkit.cli.geotag import FrameOptions
from fieldkit.errors import UsageError
from tests.campaign.examples import field, plots_geojson

FIELD = field(1, 2)


def test_the_frame_is_a_plots(tmp_path: Path) -> None:
    (tmp_path / "plots.geojson").write_text(plots_geojson(FIELD))
    site = tmp_path / "site.toml"
    site.write_text("format = 1\n[home]\nlatitude_deg = 52.296\nlongitude_deg = 10.437\namsl_m = 40.0\n")
    told: list[str] = []
    frame, heading_deg = FrameOptions().frame(
        SitePlotOptions(site, tmp_path / "plots.geojson", None, "r1c2"), tell=told.append
    )
    assert heading_deg == FIELD[1].row_heading_deg
    expected = (FIELD[1].latitude_deg, FIELD[1].longitude_deg)
    assert (frame.latitude_deg, frame.longitude_deg) == pytest.approx(expected, abs=1e-7)
    assert (frame.altitude_m, frame.datum) == (40.0, "sea level")
    assert told == ['2 plots, ids from "name": r1c1, r1c2.']
    with pytest.raises(UsageError, match="which plot"):
        FrameOptions().frame(SitePlotOptions(site, tmp_path / "plots.geojson"), tell=None)


def test_contradictions() -> None:
    assert FrameOptions().frame(SitePlotOptions(), tell=None) == (None, 90.0)
    with pytest.raises(UsageError, match="--plots goes with a site file"):
        FrameOptions("50.8,6.4,90").frame(SitePlotOptions(plots=Path("x")), tell=None)
    with pytest.raises(UsageError, match="both say where"):
        FrameOptions("50.8,6.4,90").frame(SitePlotOptions(Path("x")), tell=None)
