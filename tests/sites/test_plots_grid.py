"""Plots of a block from its four corners."""

import json
from pathlib import Path

import numpy as np
import pytest
import shapely

from fieldkit.cli.main import main
from fieldkit.errors import UsageError
from fieldkit.geometry.geodesy import LocalFrame, plot_from_enu
from fieldkit.sites.plots_file import read_plots
from fieldkit.sites.plots_grid import plots_grid

FRAME = LocalFrame(-33.4, 148.2)
"""Somewhere in the south."""
BLOCK = np.array([(0.0, 0.0, 0.0), (20.0, 0.0, 0.0), (20.0, 15.0, 0.0), (0.0, 15.0, 0.0)])
"""Along and across the rows, which run at 30°."""


def corners() -> np.ndarray:
    latitude, longitude, _ = FRAME.to_geodetic(BLOCK @ plot_from_enu(30.0))
    return np.stack([latitude, longitude], axis=1)


def test_plots_lie_in_ranges_and_columns_with_alleys_between(tmp_path: Path) -> None:
    out = tmp_path / "plots.geojson"
    text = ",".join(f"{number:.10f}" for number in corners().ravel())
    command = ["plots", "--corners", text, "--grid", "4x10", "--alley", "1", "-o", str(out), "--json"]
    assert main(command) == 0
    file = read_plots(out)
    assert [plot.name for plot in file.plots][8:11] == ["r1c9", "r1c10", "r2c1"]
    sizes = np.array([plot.size_m for plot in file.plots])
    np.testing.assert_allclose(sizes, np.tile((17.0 / 4, 1.5), (40, 1)), atol=2e-3)
    assert {round(plot.row_heading_deg, 2) for plot in file.plots} == {30.0}
    shape = np.array(file.shapes[11])  # r2c2
    local = FRAME.to_local(shape[:, 0], shape[:, 1], 0.0) @ plot_from_enu(30.0).T
    np.testing.assert_allclose(local[:, :2].min(axis=0), (17.0 / 4 + 1.0, 1.5), atol=2e-3)
    assert main(command) == 2  # nothing is overwritten


def test_a_block_need_not_be_square() -> None:
    askew = corners()
    askew[2] += (2e-5, 1e-5)
    rings = [f["geometry"]["coordinates"][0] for f in plots_grid(askew.ravel(), 3, 5)["features"]]
    whole = shapely.union_all([shapely.Polygon(ring).buffer(1e-9) for ring in rings])
    assert whole.area == pytest.approx(shapely.Polygon(askew[:, ::-1]).area, rel=1e-3)


@pytest.mark.parametrize(("order", "alley_m"), [((0, 2, 1, 3), 0.0), ((0, 1, 2, 3), 7.0)])
def test_what_is_no_block_is_refused(order: tuple[int, ...], alley_m: float) -> None:
    with pytest.raises(UsageError, match="4 × 10 plots do not fit"):
        plots_grid(corners()[list(order)].ravel(), 4, 10, alley_m=alley_m)


@pytest.mark.parametrize("grid", ["4", "4x", "x3", "4x10x2"])
def test_a_grid_is_two_numbers(grid: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["plots", "--corners", "0,0,0,1,1,1,1,0", "--grid", grid, "-o", str(tmp_path / "p.geojson"), "--json"]
    assert main(arguments) == 2
    assert "is no number of plots" in json.loads(capsys.readouterr().out)["error"]["message"]
