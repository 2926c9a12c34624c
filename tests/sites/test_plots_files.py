"""Plots files as people have them: kinds, reference systems, ids, and what is wrong with them."""

import json
import re
import sys
import warnings
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
from pyogrio.raw import write
from pyproj import Transformer

from benchmarks.fuzzing import Target, fuzz
from fieldkit.campaign.create import CampaignSources, init_campaign
from fieldkit.campaign.reading import read_campaign
from fieldkit.errors import MetadataError
from fieldkit.results.plan import Plan, Station
from fieldkit.results.plan_file import save_plan
from fieldkit.sites.plot_ids import IdProblem, plot_file_name, plot_ids
from fieldkit.sites.plots_file import load_plots, read_plots
from fieldkit.sites.site import SitePlot
from fieldkit.sites.site_file import load_site
from fieldkit.sites.vector_files import read_features
from tests.sites.test_site_file import SITE, geojson, point, polygon, rectangle, site_file

MIDDLE = (50.8650, 6.4473)
UTM = "EPSG:25832"
IDS = ("A01", "A02", "B01", "B02")
KINDS = {"ESRI Shapefile": ".shp", "GPKG": ".gpkg", "KML": ".kml", "GeoJSON": ".geojson"}


def places(ids: tuple[str, ...] = IDS) -> list[shapely.Polygon]:
    """Plots of 6 × 3 m whose rows lead to 20°, 8 m apart, in longitude and latitude."""
    return [shapely.Polygon(rectangle((MIDDLE[0], MIDDLE[1] + 1.2e-4 * k), 20.0, 6.0, 3.0)) for k in range(len(ids))]


def in_crs(shapes: list[shapely.Polygon], crs: str) -> list[shapely.Polygon]:
    there = Transformer.from_crs("EPSG:4326", crs, always_xy=True)
    return [shapely.transform(s, lambda xy: np.column_stack(there.transform(xy[:, 0], xy[:, 1]))) for s in shapes]


def write_plots(
    path: Path,
    shapes: list[Any],
    crs: str | None,
    *,
    driver: str | None = None,
    layer: str | None = None,
    append: bool = False,
    kind: str = "Polygon",
    **fields: list[Any],
) -> Path:
    """A file as a GIS writes it."""
    warnings.simplefilter("ignore")  # of cut names and of no reference system
    suffixes = {suffix: name for name, suffix in KINDS.items()}
    write(
        str(path),
        np.array([shapely.to_wkb(s) for s in shapes], dtype=object),
        [np.array(values, dtype=object if isinstance(values[0], str | None) else None) for values in fields.values()],
        list(fields),
        driver=driver or suffixes[path.suffix],
        geometry_type=kind,
        crs=crs,
        layer=layer,
        append=append,
    )
    return path


def assert_same(plots: tuple[SitePlot, ...], names: tuple[str, ...] = IDS) -> None:
    expected = load_plots_of(places(names), names)
    assert [plot.name for plot in plots] == list(names)
    for plot, wanted in zip(plots, expected, strict=True):
        assert plot.latitude_deg == pytest.approx(wanted.latitude_deg, abs=2e-8)  # 2 mm
        assert plot.longitude_deg == pytest.approx(wanted.longitude_deg, abs=2e-8)
        assert plot.row_heading_deg == pytest.approx(20.0, abs=0.05)
        assert plot.size_m == pytest.approx((6.0, 3.0), abs=5e-3)


def load_plots_of(shapes: list[shapely.Polygon], names: tuple[str, ...]) -> tuple[SitePlot, ...]:
    return tuple(
        SitePlot(name=name, latitude_deg=shape.centroid.y, longitude_deg=shape.centroid.x)
        for shape, name in zip(shapes, names, strict=True)
    )


@pytest.mark.parametrize("crs", ["EPSG:4326", UTM, "EPSG:28992", "EPSG:2263"])
@pytest.mark.parametrize("driver", ["ESRI Shapefile", "GPKG", "GeoJSON"])
def test_any_kind_in_any_reference_system(tmp_path: Path, driver: str, crs: str) -> None:
    """UTM, a national grid on another ellipsoid, Web Mercator, and feet far from where they are used."""
    here = -73.9 if crs == "EPSG:2263" else None
    shapes = (
        places()
        if here is None
        else [shapely.transform(s, lambda xy: xy + np.array([-80.35, -10.15])) for s in places()]
    )
    file = write_plots(tmp_path / f"plots{KINDS[driver]}", in_crs(shapes, crs), crs, plot_id=list(IDS))
    plots = load_plots(file)
    assert [plot.name for plot in plots] == list(IDS)
    # The drivers of GeoJSON keep 7 decimals of a degree or of a metre.
    for plot, shape in zip(plots, shapes, strict=True):
        assert plot.latitude_deg == pytest.approx(shape.centroid.y, abs=1e-7)
        assert plot.longitude_deg == pytest.approx(shape.centroid.x, abs=1e-7)
        assert plot.row_heading_deg == pytest.approx(plots[0].row_heading_deg, abs=0.3)


def test_kml_with_its_folders_and_attributes(tmp_path: Path) -> None:
    file = write_plots(tmp_path / "plots.kml", places()[:2], "EPSG:4326", layer="Block_A", Name=list(IDS[:2]))
    assert_same(load_plots(file), IDS[:2])
    marks = "".join(
        f"<Folder><name>{name}</name><Placemark><name>maize</name><ExtendedData><Data name='plot_id'><value>{name}"
        f"</value></Data><Data name='plant_height_m'><value>1,8</value></Data></ExtendedData><Polygon>"
        f"<outerBoundaryIs><LinearRing><coordinates>{' '.join(f'{x},{y},0' for x, y in shape.exterior.coords)}"
        "</coordinates></LinearRing></outerBoundaryIs></Polygon></Placemark></Folder>"
        for name, shape in zip(IDS, places(), strict=True)
    )
    text = f'<?xml version="1.0"?><kml xmlns="http://www.opengis.net/kml/2.2"><Document>{marks}</Document></kml>'
    (tmp_path / "folders.kml").write_text(text)
    with zipfile.ZipFile(tmp_path / "folders.kmz", "w") as archive:
        archive.writestr("doc.kml", text)
    for name in ("folders.kml", "folders.kmz"):
        plots = load_plots(tmp_path / name)
        assert_same(plots)
        assert [plot.plant_height_m for plot in plots] == [1.8] * 4


def test_a_zipped_shapefile_and_its_cut_names(tmp_path: Path) -> None:
    write_plots(
        tmp_path / "plots.shp",
        in_crs(places(), UTM),
        UTM,
        PLOT_ID=list(IDS),
        row_heading_deg=[200.0] * 4,
        plant_height_m=[1.5] * 4,
    )
    with zipfile.ZipFile(tmp_path / "plots.zip", "w") as archive:
        for part in sorted(tmp_path.glob("plots.*")):
            if part.suffix != ".zip":
                archive.write(part, f"export/{part.name}")
    assert load_plots(tmp_path / "plots.zip") == load_plots(tmp_path / "plots.shp")
    plots = read_plots(tmp_path / "plots.zip")
    assert plots.ids.sentence() == '4 plots, ids from "PLOT_ID": A01 … B02'
    assert {plot.row_heading_deg for plot in plots.plots} == {200.0}
    assert {plot.plant_height_m for plot in plots.plots} == {1.5}


def test_a_multipolygon_of_one_part_and_whole_numbers_as_ids(tmp_path: Path) -> None:
    """QGIS's GeoPackages hold multipolygons; numbers of a table with gaps come as floats."""
    shapes = [shapely.MultiPolygon([shape]) for shape in in_crs(places(), UTM)]
    file = write_plots(tmp_path / "plots.gpkg", shapes, UTM, kind="MultiPolygon", id=[1.0, 2.0, 3.0, 10.0])
    assert [plot.name for plot in load_plots(file)] == ["1", "2", "3", "10"]
    bare = write_plots(tmp_path / "bare.gpkg", shapes, UTM, kind="MultiPolygon", crop=["maize"] * 4)
    assert read_plots(bare).ids.sentence() == '4 plots, ids from "fid": 1 … 4'


@pytest.mark.parametrize(
    ("rows", "field", "said"),
    [
        (
            [{"name": "a", "id": 1, "plot_id": "X"}, {"name": "b", "id": 2, "plot_id": "Y"}],
            None,
            '2 plots, ids from "plot_id": X, Y',
        ),
        ([{"Name": "a", "ID": 1}, {"Name": "b", "ID": 2}], None, '2 plots, ids from "ID": 1, 2'),
        (
            [{"crop": "maize"}, {"crop": "maize"}],
            None,
            "2 plots, counted in the file's order, which has no ids: plot-1, plot-2. --plot-id FIELD takes others",
        ),
    ],
)
def test_ids(tmp_path: Path, rows: list[dict[str, Any]], field: str | None, said: str) -> None:
    features = read_features(geojson(tmp_path, *(point(**row) for row in rows)))
    assert plot_ids(features, field).sentence() == said


@pytest.mark.parametrize(
    ("rows", "field", "problem", "remedy"),
    [
        ([{"plot_id": "b1"}, {"plot_id": "B1"}], None, 'feature 2: is called "B1" and feature 1 "b1"', ""),
        (
            [{"plot_id": "X", "id": 1}, {"plot_id": "X", "id": 2}],
            None,
            'feature 2: is called "X", as feature 1 is',
            "Give every plot an id of its own",
        ),
        ([{"name": "a"}, {"name": " "}], None, 'feature 2: has no "name"', "Give every plot an id of its own"),
        ([{"id": "X", "fid": 1}, {"fid": 2}], None, 'feature 2: has no "id"', "--plot-id fid"),
        (
            [{"name": "a", "rep": 1}, {"name": "b", "rep": 1}],
            "rep",
            'feature 2: is called "1", as feature 1 is',
            "--plot-id name",
        ),
        ([{"name": "a", "rep": 1}, {"name": "b", "rep": 1}], "plot", 'no plot has a field "plot"', "name and rep"),
    ],
)
def test_ids_that_are_none(tmp_path, rows, field, problem, remedy) -> None:
    features = read_features(geojson(tmp_path, *(point(**row) for row in rows)))
    with pytest.raises(IdProblem, match=re.escape(problem)) as caught:
        plot_ids(features, field)
    assert remedy in caught.value.remedy


def _plots(name: str, crs: str = UTM, stated: str | None = UTM, *, without: str = "", part: str = "") -> Any:
    """Writes plots in one reference system that are said to be in another; gives a part of the file, or all but one."""

    def written(folder: Path) -> Path:
        file = write_plots(folder / name, in_crs(places(), crs), stated, name=list(IDS))
        if without:
            file.with_suffix(without).unlink()
        return file.with_suffix(part) if part else file

    return written


def _layers(folder: Path) -> Path:
    file = write_plots(folder / "plots.gpkg", places(), "EPSG:4326", layer="2025", name=list(IDS))
    return write_plots(file, places(), "EPSG:4326", layer="2026", append=True, name=list(IDS))


def _lines(folder: Path) -> Path:
    rows = [shapely.LineString(shape.exterior) for shape in places()]
    return write_plots(folder / "rows.gpkg", rows, "EPSG:4326", kind="LineString", name=list(IDS))


def _text(name: str, content: str) -> Any:
    def written(folder: Path) -> Path:
        (folder / name).write_text(content)
        return folder / name

    return written


def _zip(*names: str) -> Any:
    def written(folder: Path) -> Path:
        with zipfile.ZipFile(folder / "plots.zip", "w") as archive:
            for name in names:
                archive.writestr(name, b"")
        return folder / "plots.zip"

    return written


@pytest.mark.parametrize(
    ("make", "message", "remedy"),
    [
        (_plots("plots.shp", without=".prj"), "does not say its coordinate reference system", "set the layer's CRS"),
        (_plots("plots.gpkg", stated=None), "reference system; metres of a map projection", "set the layer's CRS"),
        (
            _plots("plots.gpkg", stated="EPSG:4326"),
            "has coordinates that are none in WGS 84 (EPSG:4326): metres",
            "set the layer's CRS",
        ),
        (
            _plots("plots.gpkg", "EPSG:31467", "EPSG:31467"),
            "without the grid de_adv_BETA2007.tif PROJ takes that to WGS 84 only to 3 m",
            "pyproj sync",
        ),
        (_layers, "has 2 layers with places: 2025, 2026", "export the one with the plots"),
        (_lines, "feature 1: is a LineString, not a Point or Polygon", "points or polygons"),
        (_text("plots.csv", "plot_id;x;y\nA01;1;2\n"), "is no file of plots or zones", "Delimited Text"),
        (_text("plots.kml", "<kml xmlns='http://www.opengis.net/kml/2.2'><Document>"), "cannot be read", ""),
        (_text("plan.json", '{"kind": "plan", "version": 1}'), "is fieldkit's plan, not a file of plots", ""),
        (_zip("wpmz/waylines.wpml"), "is a zip archive with 0 Shapefiles", ""),
        (_zip("a.shp", "b.shp"), "is a zip archive with 2 Shapefiles", "by itself"),
    ],
)
def test_what_is_wrong_is_named(tmp_path: Path, make: Any, message: str, remedy: str) -> None:
    file = make(tmp_path)
    with pytest.raises(MetadataError, match=re.escape(message)) as caught:
        load_plots(file)
    assert caught.value.path == file
    assert remedy in caught.value.remedy
    assert caught.value.remedy


@pytest.mark.parametrize("gone", ["pyogrio", "pyproj"])
def test_without_the_extra(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, gone: str) -> None:
    """GeoJSON in WGS 84 needs nothing more; all else says what to install."""
    file = write_plots(tmp_path / "plots.gpkg", places(), "EPSG:4326", name=list(IDS))
    there = geojson(tmp_path, *(polygon(list(map(list, s.exterior.coords)), name=n) for s, n in zip(places(), IDS)))  # noqa: B905
    monkeypatch.setitem(sys.modules, gone, None)
    assert_same(load_plots(there))
    with pytest.raises(MetadataError, match="is a GeoPackage; reading that needs the extra 'geo'") as caught:
        load_plots(file)
    assert "pip install 'fieldkit[geo]'" in caught.value.remedy


def test_a_site_names_its_file_and_its_field_and_tells_of_them(tmp_path: Path) -> None:
    write_plots(tmp_path / "field.gpkg", in_crs(places(), UTM), UTM, name=["x"] * 4, entry=list(IDS))
    alone = SITE.partition("[[plots]]")[0].replace("format = 1", 'format = 1\nplots = "field.gpkg"\nplot_id = "entry"')
    said: list[str] = []
    site = load_site(site_file(tmp_path, alone), tell=said.append)
    assert_same(site.plots)
    assert said[0] == '4 plots, ids from "entry": A01 … B02.'
    assert "ETRS89 / UTM zone 32N to WGS 84 to 1 m" in said[1]
    with pytest.raises(MetadataError, match='no plot has a field "row"'):
        load_site(site_file(tmp_path, alone), plot_id="row")
    with pytest.raises(MetadataError, match="lists its plots itself"):
        load_site(site_file(tmp_path), plot_id="row")


@pytest.mark.parametrize("named", [False, True])
def test_a_campaign_takes_its_plots_along_as_geojson(tmp_path, monkeypatch, named) -> None:
    """Whatever they were, with the ids that were chosen: in the folder nothing more is needed to read them."""
    shapes = in_crs(places(), UTM)
    file = write_plots(tmp_path / "field.shp", shapes, UTM, name=["x"] * 4, Plot_ID=["old"] * 4, entry=list(IDS))
    plan = Plan(fieldkit="0", stations=(Station(position_m=(1.0, 0.0, 2.0), yaw_deg=270.0, pitch_deg=-60.0),))
    save_plan(tmp_path / "plan.json", plan)
    text = SITE.partition("[[plots]]")[0].replace("format = 1", 'format = 1\nplots = "field.shp"') if named else SITE
    sources = CampaignSources(
        tmp_path / "plan.json", site_file(tmp_path, text), None if named else file, plot_id="entry"
    )
    said: list[str] = []
    made = init_campaign(tmp_path / "season", sources, tell=said.append)
    assert said[:1] == ['4 plots, ids from "entry": A01 … B02.']
    monkeypatch.setitem(sys.modules, "pyogrio", None)
    for campaign in (made, read_campaign(tmp_path / "season")):
        assert_same(campaign.site.plots)
        assert [plot.name for plot in campaign.plots] == list(IDS)
        assert all(plot.shape is not None and len(plot.shape) == 4 for plot in campaign.plots)
    first = json.loads((tmp_path / "season" / "plots.geojson").read_text())["features"][0]
    assert first["properties"] == {"plot_id": "A01", "name": "x", "entry": "A01"}


@pytest.mark.parametrize(
    ("known", "message"),
    [
        ({"plant_height_m": 250}, r"plant_height_m: input should be less than or equal to 20"),
        ({"row_spacing_m": 75}, r"row_spacing_m: input should be less than or equal to 10"),
        ({"plant_height_m": "1,3"}, 'plant_height_m: should be a number and is the text "1,3": with a point'),
    ],
)
def test_slips_in_numbers_are_told(tmp_path: Path, known: dict[str, Any], message: str) -> None:
    with pytest.raises(MetadataError, match=message):
        load_plots(geojson(tmp_path, point(row_heading_deg=0, **known)))


@pytest.mark.parametrize("suffix", [".gpkg", ".kml", ".geojson"])
def test_changed_at_random(tmp_path: Path, suffix: str) -> None:
    """A file that is damaged is read or refused, and never a traceback; only GDAL knows what it still makes of it."""
    crs = "EPSG:4326" if suffix == ".kml" else UTM
    whole = write_plots(tmp_path / f"whole{suffix}", in_crs(places(), crs), crs, plot_id=list(IDS))
    found = fuzz(Target(suffix, [whole.read_bytes()], load_plots), 60, tmp_path, seed=3)
    assert not found.defects
    assert (found.hangs, found.written) == (0, ())
    assert found.refused > 20


@pytest.mark.parametrize(
    ("plot", "name"),
    [
        ("r1c1", "r1c1"),
        ("..", "%2E%2E"),
        ("x\\y:z", "x%5Cy%3Az"),
        ("CON", "%43ON"),
        ("aux.1", "%61ux.1"),
    ],
)
def test_names_of_plots_files(plot: str, name: str) -> None:
    assert plot_file_name(plot) == name


def test_names_of_a_results_own_files_are_left_to_them() -> None:
    reserved = ("evaluation.json", "plots.csv")
    names = [plot_file_name(name, reserved) for name in ("evaluation.json", "plot 1", "Plots.csv", "plots.csv")]
    assert names == ["%65valuation.json", "plot 1", "%50lots.csv", "%70lots.csv"]


@pytest.mark.parametrize(
    ("column", "meant"),
    [
        ("plant_heigth_m", "plant_height_m"),
        ("plant height (m)", "plant_height_m"),
        ("plant_height", "plant_height_m"),
    ],
)
@pytest.mark.parametrize("driver", ["GeoJSON", "GPKG"])
def test_a_column_that_nearly_is_a_property_is_named(tmp_path: Path, driver: str, column: str, meant: str) -> None:
    file = write_plots(
        tmp_path / f"plots{KINDS[driver]}", places(), "EPSG:4326", plot_id=list(IDS), **{column: [1] * 4}
    )
    with pytest.raises(
        MetadataError, match=re.escape(f'"{column}", which is not used. Did you mean {meant}?')
    ) as caught:
        load_plots(file)
    assert meant in caught.value.remedy


def test_columns_that_are_not_used_are_told(tmp_path: Path) -> None:
    file = write_plots(
        tmp_path / "plots.geojson",
        places(),
        "EPSG:4326",
        plot_id=list(IDS),
        variety=list("abcd"),
        height=[1] * 4,
        plant_height_m=[1.0] * 4,
        plant_height_cm=[100] * 4,
    )
    assert read_plots(file).unused == ("variety", "height", "plant_height_cm")
    told: list[str] = []
    load_site(site_file(tmp_path), file, tell=told.append)
    assert told[1] == "Columns that are not used: variety, height and plant_height_cm."


def test_a_label_point_beside_the_polygon_is_passed_over(tmp_path: Path) -> None:
    """QGIS's label points make a MultiGeometry of a plot; two polygons of one feature are no plot."""
    bare = write_plots(tmp_path / "bare.kml", places()[:2], "EPSG:4326", Name=list(IDS[:2]))
    text = bare.read_text()
    polygons = re.findall("<Polygon>.*?</Polygon>", text, re.DOTALL)
    assert len(polygons) == 2
    label = "<Point><coordinates>6.4,50.8,0</coordinates></Point>"
    for beside in (label, polygons[1]):
        other = text
        for own in polygons:
            other = other.replace(own, f"<MultiGeometry>{beside}{own}</MultiGeometry>")
        (tmp_path / f"{len(beside)}.kml").write_text(other)
    assert load_plots(tmp_path / f"{len(label)}.kml") == load_plots(bare)
    with pytest.raises(MetadataError, match="feature 1: "):
        load_plots(tmp_path / f"{len(polygons[1])}.kml")
