"""Height models: where their cells lie, what they hold, and the files."""

from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from fieldkit.clouds import Cloud
from fieldkit.errors import UsageError
from fieldkit.evaluation.rasters import (
    CANOPY_FILE,
    REFUSED_TAG,
    HeightRaster,
    Rasters,
    coarse_place,
    height_rasters,
    require_rasters,
    style_text,
    to_utm,
    write_heights,
    write_rasters,
)
from fieldkit.geometry import Similarity
from fieldkit.results.traits import TraitsEntry
from tests.evaluation.examples import reconstruction

pytest.importorskip("pyproj")
CELL_M = 0.02
FOUND = reconstruction()
FRAME = FOUND.sparse.frame


def plate(low: tuple[float, float], high: tuple[float, float], z: float, count: int = 20_000) -> Cloud:
    xy = np.random.default_rng(0).uniform(low, high, (count, 2))
    return Cloud(np.column_stack([xy, np.full(count, z)]))


LEAF, SOIL = plate((0.0, 0.0), (0.2, 0.1), 0.3), plate((-0.3, -0.3), (0.3, 0.3), 0.004, 60_000)


def at(raster: HeightRaster, x: float, y: float) -> float:
    """The height at a place of the plot frame."""
    moved, epsg = to_utm(Cloud(np.array([[x, y, 0.0]])), FRAME)
    assert epsg == raster.grid.epsg
    (row,), (column,) = raster.grid.cells(moved.points)
    return float(raster.heights[row, column])


def test_the_canopy_is_where_the_leaf_is() -> None:
    raster, _ = height_rasters(LEAF, SOIL, FRAME, CELL_M)
    assert at(raster, 0.1, 0.05) == pytest.approx(0.3, abs=1e-6)
    assert at(raster, -0.1, 0.05) == 0.0
    assert at(raster, 0.1, -0.05) == 0.0
    assert np.isnan(raster.heights).any()  # UTM's north is not the plot's: the corners were not seen
    covered = np.count_nonzero(raster.heights > 0.2) * CELL_M**2
    assert covered == pytest.approx(0.02, abs=0.5 * 0.6 * CELL_M + 0.002)  # cells that the edge runs through count


def test_the_surface_is_above_the_datum() -> None:
    _, raster = height_rasters(LEAF, SOIL, FRAME, CELL_M)
    ground = FRAME.origin.altitude_m + 1.2  # the example's source frame lies 1.2 m below the ground
    assert at(raster, 0.1, 0.05) == pytest.approx(ground + 0.3, abs=1e-3)
    assert at(raster, -0.1, 0.05) == pytest.approx(ground + 0.004, abs=1e-3)


def test_positions_of_metres_leave_the_plot_where_its_site_has_it(tmp_path: Path) -> None:
    """A visit's own frame is then moved to where its cameras look; its rasters stay on the plot."""
    rasterio = pytest.importorskip("rasterio")
    moved = replace(FRAME, plot_from_source=Similarity(1.0, np.eye(3), np.array([7.0, -4.0, -1.2])))
    found = replace(FOUND, sparse=replace(FOUND.sparse, frame=moved))
    for name, at_origin in (("gps", False), ("site", True)):
        write_rasters(tmp_path / name, found, Rasters(CELL_M, at_origin))
    write_rasters(tmp_path / "right", FOUND, Rasters(CELL_M))
    places = {}
    for name in ("gps", "site", "right"):
        with rasterio.open(tmp_path / name / "surface.tif") as file:
            places[name] = np.array([file.bounds.left, file.bounds.top, file.read(1, masked=True).max()])
    np.testing.assert_allclose(places["site"], places["right"], atol=1e-6)
    assert np.hypot(*(places["gps"] - places["right"])[:2]) == pytest.approx(np.hypot(7.0, 4.0), abs=0.05)
    assert coarse_place(FRAME) == ""
    assert coarse_place(replace(FRAME, bound_m=None)) == ""
    assert "good to 3.0 m only" in coarse_place(replace(FRAME, bound_m=4.03 * 3.0))


def test_refusals(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(UsageError, match="no ground"):
        height_rasters(LEAF, SOIL, replace(FRAME, ground=None), CELL_M)
    with pytest.raises(UsageError, match="too large"):
        height_rasters(LEAF, SOIL, FRAME, 1e-5)
    monkeypatch.setattr("importlib.util.find_spec", lambda name: object())
    with pytest.raises(UsageError, match="no place on Earth"):
        require_rasters(replace(FRAME, origin=None))
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(UsageError, match="extra 'geo'"):
        require_rasters()


def test_a_style_has_its_colours_in_order() -> None:
    text = style_text(0.0, 1.2, ("#ffffff", "#888888", "#000000"))
    shader = ElementTree.fromstring(text.partition("\n")[2]).find("pipe/rasterrenderer/rastershader/colorrampshader")
    assert [(item.get("value"), item.get("color")) for item in shader.findall("item")] == [
        ("0.000", "#ffffff"),
        ("0.600", "#888888"),
        ("1.200", "#000000"),
    ]
    ramp = {prop.get("k"): prop.get("v") for prop in shader.findall("colorramp/prop")}
    assert (ramp["color1"], ramp["color2"]) == ("255,255,255,255", "0,0,0,255")
    assert ramp["stops"] == "0.5;136,136,136,255"
    assert {o.get("name"): o.get("value") for o in shader.findall("colorramp/Option/Option")} == ramp


def test_files(tmp_path: Path) -> None:
    """Opened as any program would: the place, the datum, no data, overviews and the layout for the web."""
    rasterio = pytest.importorskip("rasterio")
    rasters = height_rasters(LEAF, plate((-3.0, -3.0), (3.0, 3.0), 0.0, 400_000), FRAME, CELL_M)
    raster, _ = rasters
    write_heights(tmp_path, raster.grid, [rasters])
    with rasterio.open(tmp_path / CANOPY_FILE) as file:
        assert file.crs.to_epsg() == raster.grid.epsg
        assert file.tags(ns="IMAGE_STRUCTURE")["LAYOUT"] == "COG"
        assert file.overviews(1)
        assert file.nodata == -9999.0
        assert file.res == (CELL_M, CELL_M)
        assert file.transform.almost_equals(raster.grid.transform())
        np.testing.assert_array_equal(file.read(1, masked=True).filled(np.nan), raster.heights)
        east, north, _ = to_utm(Cloud(np.array([[0.1, 0.05, 0.0]])), FRAME)[0].points[0]
        assert next(file.sample([(east, north)]))[0] == pytest.approx(0.3, abs=1e-6)
    assert (tmp_path / "canopy-height.qml").is_file()
    names = write_rasters(tmp_path / "both", FOUND, Rasters(CELL_M), TraitsEntry(unknown={"height_m": "pictures end"}))
    assert sorted(path.name for path in (tmp_path / "both").iterdir()) == sorted(names)
    with rasterio.open(tmp_path / "both" / CANOPY_FILE) as file:  # a height that the traits refuse is marked
        assert (file.descriptions, file.tags()[REFUSED_TAG]) == (
            ("canopy height, m, AT LEAST: pictures end",),
            "pictures end",
        )
