"""A flight over many plots: mapped once, one folder a plot, and wrong plots told before anything is computed."""

import csv
import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from fieldkit.campaign.reading import read_visits
from fieldkit.clouds import read_cloud
from fieldkit.geometry.geodesy import LocalFrame
from fieldkit.results.plan_file import plan_from_poses, save_plan
from fieldkit.results.report_files import load_evaluation_report
from tests.campaign.examples import CAMERA, STATIONS
from tests.endtoend.commands import CommandLine, differing

ORIGIN = LocalFrame(52.2960, 10.4370, 81.0, "ellipsoid")
"""Of the small plot on Earth."""
DATE = "2026-06-18"
WEST, EAST = (-0.28, -0.3, 0.0, 0.3), (0.0, -0.3, 0.28, 0.3)
"""Halves of the small plot as two plots: lowest and highest corner."""


@pytest.fixture
def flight(small_plot: Path, tmp_path: Path) -> Path:
    """The small plot's photographs as two flights of a day, with geographic positions."""
    rows = list(csv.DictReader((small_plot / "poses.csv").read_text("utf-8").splitlines()))
    for name, part in (("morning", rows[:4]), ("noon", rows[4:])):
        folder = tmp_path / DATE / name
        folder.mkdir(parents=True)
        lines = ["EPSG:4326"]
        for row in part:
            shutil.copy(small_plot / row["image"], folder)
            latitude, longitude, altitude = ORIGIN.to_geodetic([float(row[key]) for key in ("x_m", "y_m", "z_m")])
            lines.append(f"{row['image']} {longitude[0]:.10f} {latitude[0]:.10f} {altitude[0]:.4f} 0 0 0 0.003 0.003")
        (folder / "geo.txt").write_text("\n".join(lines) + "\n", "utf-8")
        shutil.copy(small_plot / "camera.toml", folder)
    return tmp_path / DATE


def drawn(path: Path, *boxes: tuple[float, float, float, float], heading_deg: float = 90.0) -> str:
    """A plots file of boxes, called A, B and so on; its path."""
    features = []
    for name, (x0, y0, x1, y1) in zip("ABCDE", boxes, strict=False):
        ring = np.array([(x0, y0, 0.0), (x1, y0, 0.0), (x1, y1, 0.0), (x0, y1, 0.0), (x0, y0, 0.0)])
        latitude, longitude, _ = ORIGIN.to_geodetic(ring)
        corners = np.stack([longitude, latitude], axis=1).tolist()
        properties = {"plot_id": name, "row_heading_deg": heading_deg, "row_spacing_m": 0.14}
        geometry = {"type": "Polygon", "coordinates": [corners]}
        features.append({"type": "Feature", "properties": properties, "geometry": geometry})
    path.write_text(json.dumps({"type": "FeatureCollection", "features": features}), "utf-8")
    return str(path)


def test_photographs_count_for_every_plot_they_show(
    line: CommandLine, flight: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("fieldkit.evaluation.flight._HIGHEST", 0.0)  # a volume that is too low, and is raised
    monkeypatch.setattr("fieldkit.evaluation.flight._ABOVE_M", 0.1)
    first = drawn(tmp_path / "first.geojson", WEST, heading_deg=0.0)
    line.run("evaluate", DATE, "--plots", first, "-o", "first", "--fidelity", "draft")
    assert line.entries("plots") == 1
    depth, mapping = line.entries("depth"), line.entries("mapping")
    plots = drawn(tmp_path / "plots.geojson", WEST, (30.0, 0.0, 30.5, 0.4), EAST, heading_deg=0.0)
    done = line.run("evaluate", DATE, "--plots", plots, "-o", "scores", "--fidelity", "draft", "--rasters", "--json")
    # What is there is not computed again, whatever other plots there are.
    assert (line.entries("plots"), line.entries("depth"), line.entries("mapping")) == (2, 2 * depth, mapping)
    assert differing(line.folder / "first" / "A", line.folder / "scores" / "A") == []
    assert [plot["name"] for plot in done.json["plots"]] == ["A", "B", "C"]
    west, away, east = load_evaluation_report(line.folder / "scores").plots
    assert away.error is not None
    assert away.error.message == "is not in the pictures"
    assert not (line.folder / "scores" / "B").exists()
    for plot, (x0, y0, x1, y1) in ((west, WEST), (east, EAST)):
        assert plot.volume.upper_m[2] > 0.25
        assert "volume-cuts-plants" not in plot.doubts
        assert (plot.images, plot.right) == (8, 8)  # all of both flights show both
        names = {Path(file.name).name for file in plot.files}
        assert names >= {"cloud.ply", "photo.jpg"}
        cloud = read_cloud(line.folder / "scores" / plot.name / "cloud.ply").points
        assert len(cloud) > 200
        # x is along the rows, which run north: the plot frame is turned by a quarter.
        np.testing.assert_array_less((y0 - 0.35, -x1 - 0.35), cloud[:, :2].min(axis=0))
        np.testing.assert_array_less(cloud[:, :2].max(axis=0), (y1 + 0.35, -x0 + 0.35))
        assert plot.traits is not None
        assert plot.traits.plot_area_m2 == pytest.approx((x1 - x0) * (y1 - y0), rel=1e-3)
        assert [row.row for row in plot.rows] == [1, 2]
        assert plot.rows[1].traits.plot_area_m2 == pytest.approx(0.5 * plot.traits.plot_area_m2)
    with (line.folder / "scores" / "rows.csv").open(encoding="utf-8") as file:
        assert [(row["plot"], row["row"]) for row in csv.DictReader(file)] == [(p, r) for p in "AC" for r in "12"]
    report = load_evaluation_report(line.folder / "scores")
    assert report.flight.right == 8
    field = {"canopy-height.tif", "surface.tif", "orthophoto.tif", "field.jpg"}
    assert {file.name for file in report.files} >= field
    (x0, y0, *_), corners = WEST, np.array(west.outline)
    np.testing.assert_allclose(corners[0], (y0, -x0), atol=0.02)
    shown = np.array(report.flight.picture)
    assert (shown.min(axis=0) < corners.min(axis=0)).all()
    assert (shown.max(axis=0) > np.max(east.outline, axis=0)).all()
    assert shown[0, 0] < shown[1, 0]

    save_plan(line.folder / "plan.json", plan_from_poses(STATIONS, CAMERA))
    site = f"format = 1\n[home]\nlatitude_deg = {ORIGIN.latitude_deg}\nlongitude_deg = {ORIGIN.longitude_deg}\n"
    (line.folder / "site.toml").write_text(site, "utf-8")
    files = ("--plan", "plan.json", "--site", "site.toml", "--plots", plots, "--fidelity", "draft")
    line.run("campaign", "init", "season", *files)
    done = line.run("evaluate", DATE, "--campaign", "season", "--shared", "--rasters", "--json")
    assert line.entries("plots") == 2  # as evaluated before
    assert [(visit["plot"], visit["date"]) for visit in done.json["evaluated"]] == [("A", DATE), ("C", DATE)]
    (visit, _) = read_visits(line.folder / "season")
    kept = line.folder / "season" / visit.folder
    assert load_evaluation_report(kept).plots[0].points == west.points
    assert differing(line.folder / "scores" / "A", kept / "A") == ["overview.png"]
    maps = line.folder / "season" / "flights" / DATE
    assert {file.name for file in maps.iterdir()} == field | {"canopy-height.qml", "surface.qml"}
    assert field.isdisjoint(differing(maps, line.folder / "scores"))


@pytest.mark.parametrize(
    ("boxes", "message"),
    [
        ([(1e5, 0.0, 1e5 + 1.0, 0.5)], "the plots lie 100.0 km and more from where the photographs were taken"),
        ([WEST, EAST, WEST], "A and C lie on one another"),
    ],
)
def test_wrong_plots_are_told_first(
    line: CommandLine, flight: Path, tmp_path: Path, boxes: list[tuple[float, float, float, float]], message: str
) -> None:
    plots = drawn(tmp_path / "plots.geojson", *boxes)
    done = line.run("evaluate", str(flight), "--plots", plots, "-o", "scores", "--json", code=3)
    assert message in done.error["message"]
    assert done.error["path"] == plots
    assert line.entries() == 0


def test_points_need_a_size_and_photographs_a_place(line: CommandLine, flight: Path, tmp_path: Path) -> None:
    point = {"type": "Point", "coordinates": [ORIGIN.longitude_deg, ORIGIN.latitude_deg]}
    feature = {"type": "Feature", "properties": {"id": "A", "row_heading_deg": 0.0}, "geometry": point}
    (tmp_path / "points.geojson").write_text(json.dumps({"type": "FeatureCollection", "features": [feature]}), "utf-8")
    done = line.run("evaluate", DATE, "--plots", "points.geojson", "-o", "scores", "--json", code=3)
    assert "points without length_m and width_m: A" in done.error["message"]
    drawn(tmp_path / "plots.geojson", WEST)
    for file in flight.glob("*/geo.txt"):
        file.unlink()
    done = line.run("evaluate", DATE, "--plots", "plots.geojson", "-o", "scores", "--json", code=3)
    assert "the photographs have no place on Earth" in done.error["message"]
