"""A campaign's height models in one folder: what lies there, under which names, and what is said of the others."""

import csv
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from fieldkit.campaign import Campaign, Visit, read_campaign
from fieldkit.campaign.export import GEOPACKAGE_FILE, RASTERS_FILE, export_rasters, without_rasters
from fieldkit.campaign.reading import keep_visit, visit_place
from fieldkit.clouds import Cloud, write_cloud
from fieldkit.errors import UsageError
from fieldkit.evaluation.conversion import evaluation_report, plot_evaluation
from fieldkit.evaluation.rasters import Rasters, write_rasters
from fieldkit.reconstruction.settings import ReconstructionSettings
from fieldkit.results.evaluation import CLOUD_FILE
from fieldkit.results.report_files import EVALUATION_FILE, describe_files, save_report
from fieldkit.sites.plot_ids import plot_file_name
from tests.campaign.examples import campaign_folder, field
from tests.evaluation.examples import plant_cloud, reconstruction

rasterio = pytest.importorskip("rasterio")
pytest.importorskip("pyogrio")
SLASH = "a/1"
FIELD = (field(2, 2)[0].model_copy(update={"name": SLASH}), *field(2, 2)[1:])
DATE, LATER = "2026-06-18", "2026-06-25"
HIGHER = Cloud(plant_cloud().points * (1.0, 1.0, 2.0))


def evaluated(folder: Path, plot: str, date: str, cloud: Cloud | None = None, *, rasters: bool = True) -> None:
    """A visit as `fieldkit evaluate` leaves it."""
    found, settings = reconstruction(cloud=cloud), ReconstructionSettings()
    place, own = folder / visit_place(plot, date), plot_file_name(plot)
    (place / own).mkdir(parents=True)
    write_cloud(place / own / CLOUD_FILE, found.plants)
    names = write_rasters(place / own, found, Rasters(0.01)) if rasters else []
    files = describe_files(place, [f"{own}/{name}" for name in (CLOUD_FILE, *names)])
    draft = plot_evaluation(plot, found, settings, score=None)
    entry = draft.model_copy(update={"files": files})
    report = evaluation_report("x", [entry], settings, reference_sha256=None, refine=False, distances_m=(0.01,))
    save_report(place / EVALUATION_FILE, report)
    assert keep_visit(folder, Visit.of_evaluation(entry, plot=plot, date=date, folder=visit_place(plot, date)))


@pytest.fixture
def season(tmp_path: Path) -> Campaign:
    """One plot on two dates; three other plots without rasters, each for its own reason."""
    folder = campaign_folder(tmp_path, FIELD)
    evaluated(folder, SLASH, DATE)
    evaluated(folder, SLASH, LATER, HIGHER)
    evaluated(folder, "r1c2", DATE, rasters=False)
    assert keep_visit(folder, Visit(plot="r2c1", date=DATE, notes=("x",), no_rasters="no ground was found"))
    assert keep_visit(folder, Visit(plot="r2c2", date=DATE, error="too dark"))
    return read_campaign(folder)


def span(file: Path) -> tuple[float, float]:
    renderer = ElementTree.fromstring(file.read_text().partition("\n")[2]).find("pipe/rasterrenderer")
    return float(renderer.get("classificationMin", "")), float(renderer.get("classificationMax", ""))


def test_one_folder_for_a_map(season: Campaign, tmp_path: Path) -> None:
    rows = export_rasters(season, tmp_path / "maps")
    names = [f"a%2F1_{date}_{kind}" for date in (DATE, LATER) for kind in ("canopy-height", "surface")]
    expected = {RASTERS_FILE, GEOPACKAGE_FILE, *(f"{name}.{suffix}" for name in names for suffix in ("tif", "qml"))}
    assert {path.name for path in (tmp_path / "maps").iterdir()} == expected
    for row in rows[:2]:
        own = season.folder / visit_place(row.plot, row.date) / plot_file_name(row.plot)
        for name, source in ((row.canopy_height, "canopy-height.tif"), (row.surface, "surface.tif")):
            assert (tmp_path / "maps" / name).read_bytes() == (own / source).read_bytes()
            with rasterio.open(tmp_path / "maps" / name) as file:
                assert (file.crs.to_epsg(), file.res[0]) == (row.crs_epsg, row.cell_m)
                assert file.tags(ns="IMAGE_STRUCTURE")["LAYOUT"] == "COG"
    # The colours mean the same on all dates, though the plants have grown.
    for kind in ("canopy-height", "surface"):
        spans = {span(tmp_path / "maps" / f"a%2F1_{date}_{kind}.qml") for date in (DATE, LATER)}
        assert len(spans) == 1
    with rasterio.open(tmp_path / "maps" / rows[1].canopy_height) as file:
        highest = float(np.nanmax(file.read(1, masked=True).filled(np.nan)))
    assert span(tmp_path / "maps" / f"a%2F1_{DATE}_canopy-height.qml") == pytest.approx((0.0, highest), abs=1e-3)


def test_every_visit_has_a_row(season: Campaign, tmp_path: Path) -> None:
    rows = export_rasters(season, tmp_path / "maps")
    table = list(csv.DictReader((tmp_path / "maps" / RASTERS_FILE).read_text("utf-8").splitlines()))
    assert [(row["plot"], row["date"]) for row in table] == [visit.key for visit in season.visits]
    assert table[0] == {
        "plot": SLASH,
        "date": DATE,
        "canopy_height": f"a%2F1_{DATE}_canopy-height.tif",
        "surface": f"a%2F1_{DATE}_surface.tif",
        "crs_epsg": "32632",
        "cell_m": "0.01",
        "height_datum": "sea level",
        "height_refused": "",
        "no_rasters": "",
        "notes": "",
    }
    assert [row["no_rasters"] for row in table[2:]] == ["evaluated without rasters", "no ground was found", "too dark"]
    assert without_rasters(rows) == [
        f"no rasters of r1c2 {DATE}: evaluated without rasters",
        f"no rasters of r2c1 {DATE}: no ground was found",
        f"no rasters of r2c2 {DATE}: too dark",
    ]


def test_a_damaged_raster_is_left_out_and_named(season: Campaign, tmp_path: Path) -> None:
    file = season.folder / visit_place(SLASH, DATE) / plot_file_name(SLASH) / "surface.tif"
    file.write_bytes(b"no raster")
    rows = export_rasters(season, tmp_path / "maps")
    assert rows[0].no_rasters.startswith("cannot be read: ")
    assert sorted(path.name for path in (tmp_path / "maps").glob("*.tif")) == [
        f"a%2F1_{LATER}_canopy-height.tif",
        f"a%2F1_{LATER}_surface.tif",
    ]


def test_refusals(season: Campaign, tmp_path: Path) -> None:
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.txt").touch()
    for options in ({}, {"overwrite": True}):
        with pytest.raises(UsageError, match=r"exists|holds no rasters\.csv"):
            export_rasters(season, tmp_path / "mine", **options)
    export_rasters(season, tmp_path / "maps")
    export_rasters(season, tmp_path / "maps", overwrite=True)
    with pytest.raises(UsageError, match="there are no visits"):
        export_rasters(replace(season, visits=()), tmp_path / "none")
    with pytest.raises(UsageError, match="no visit has rasters: no rasters of r1c2"):
        export_rasters(replace(season, visits=season.visits[2:]), tmp_path / "none")
    assert not (tmp_path / "none").exists()
