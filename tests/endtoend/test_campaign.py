"""A campaign by the command line: init, evaluate, killed and resumed, show, export."""

import json
import math
import shutil
import signal
from pathlib import Path

import numpy as np
import pytest

from fieldkit.campaign import read_campaign, visit_plots
from fieldkit.campaign.reading import read_visits
from fieldkit.evaluation.adherence import flown_noise
from fieldkit.geometry import Intrinsics
from fieldkit.geometry.geodesy import LocalFrame
from fieldkit.results.plan_file import plan_from_poses, save_plan
from fieldkit_sim.simulation import poses_from_csv
from tests.endtoend.commands import DRAFT, CommandLine, contents, finish, set_gps, wait_until
from tests.endtoend.conftest import Built

FIELD = LocalFrame(52.296, 10.437, 81.0, "ellipsoid")
PLOTS = ("A", "B", "C", "D")


def capture(
    line: CommandLine, small_plot: Path, plot: str, date: str, count: int = 8, *, tilt_deg: float = 0.0
) -> Path:
    """The small plot's photographs as those of a plot on a date, with bytes of their own, at stations of the plan.

    With a tilt the tags are all that is known, and say that the whole plot is tilted.
    """
    folder = line.folder / "captures" / plot / date
    folder.mkdir(parents=True)
    for name in ("camera.toml", "poses.csv")[: 1 if tilt_deg else 2]:
        shutil.copyfile(small_plot / name, folder / name)
    poses = poses_from_csv(small_plot / "poses.csv")
    for k, path in enumerate(sorted(small_plot.glob("*.jpg"))[:count]):
        shutil.copyfile(path, folder / path.name)
        x, y, z = poses[k].center
        c, s = math.cos(math.radians(tilt_deg)), math.sin(math.radians(tilt_deg))
        x, z = c * x - s * z, s * x + c * z
        day = 0.001 * int(date[-2:])  # so that no two photographs have the same bytes
        latitude, longitude, altitude = FIELD.to_geodetic((x + 6.0 * PLOTS.index(plot) + day, y, z))
        taken = f"{date.replace('-', ':')} 1{PLOTS.index(plot)}:00:{2 * k:02}"
        set_gps(folder / path.name, float(latitude[0]), float(longitude[0]), float(altitude[0]), taken)
    return folder


@pytest.fixture
def season(line: CommandLine, small_plot: Path) -> Path:
    """A campaign of four plots, 6 m apart, without captures."""
    plan = plan_from_poses(poses_from_csv(small_plot / "poses.csv"), Intrinsics.pinhole(320, 240, 304.0))
    save_plan(line.folder / "plan.json", plan)
    rows = []
    for k, name in enumerate(PLOTS):
        latitude, longitude = (float(v[0]) for v in FIELD.to_geodetic((6.0 * k, 0.0, 0.0))[:2])
        rows.append(f'[[plots]]\nname = "{name}"\nlatitude_deg = {latitude}\nlongitude_deg = {longitude}\n')
    (line.folder / "site.toml").write_text(
        "format = 1\n[home]\nlatitude_deg = 52.296\nlongitude_deg = 10.437\namsl_m = 40.0\n" + "\n".join(rows)
    )
    return line.folder / "season"


def init(line: CommandLine, *more: str) -> None:
    done = line.run("campaign", "init", "season", "--plan", "plan.json", "--site", "site.toml", *DRAFT, *more, "--json")
    assert done.json["plots"] == list(PLOTS)


def evaluate(line: CommandLine, *more: str) -> tuple[list[str], list[str], dict[str, object]]:
    """What was evaluated, what was there already, and the whole answer."""
    done = line.run("evaluate", "captures", "--campaign", "season", *more, "--json")
    keys = [[f"{visit['plot']} {visit['date']}" for visit in done.json[key]] for key in ("evaluated", "kept")]
    return keys[0], keys[1], done.json


@pytest.mark.slow
def test_plots_with_and_without_reference(line: CommandLine, season: Path, small_plot: Path, built: Built) -> None:
    init(line, "--reference", f"A={built.reference}")
    capture(line, small_plot, "A", "2026-06-18")
    capture(line, small_plot, "B", "2026-06-18")
    capture(line, small_plot, "C", "2026-06-18", count=1)  # one bad plot does not stop the others
    before = contents(line.folder / "captures")
    evaluated, _, answer = evaluate(line, "--workers", "2")
    assert sorted(evaluated) == ["A 2026-06-18", "B 2026-06-18", "C 2026-06-18"]
    assert answer["failed"] == 1
    assert answer["left_out"] == answer["findings"] == []
    visits = {visit.plot: visit for visit in read_campaign(season).visits}
    assert visits["A"].chamfer_m < 0.01  # the reference is of the same photographs
    assert visits["A"].right == visits["B"].right == 8
    assert visits["B"].chamfer_m is None
    assert "8 photographs count, and traits need 9" in visits["B"].traits.unknown["height_m"]
    assert "needs at least two photographs" in visits["C"].error
    assert "1 photograph, fewer than the plan's 8" in visits["C"].notes
    assert (season / visits["A"].folder / "A" / "cloud.ply").is_file()
    for plot in ("A", "B"):  # photographed at the plan's stations
        report = json.loads((season / visits[plot].folder / "evaluation.json").read_text("utf-8"))
        adherence = report["plots"][0]["adherence"]
        assert [row["station"] for row in adherence["stations"]] == [f"station {k}" for k in range(1, 9)]
        assert (season / visits[plot].folder / plot / "adherence.csv").is_file()
    position_m, angle_deg = flown_noise(visit_plots(read_campaign(season)), season)
    assert 0.0 < position_m < 0.02  # the photographs were taken at the stations
    assert 0.0 < angle_deg < 2.0
    # Again: nothing is computed, not even what failed.
    evaluated, kept, _ = evaluate(line)
    assert (evaluated, len(kept)) == ([], 3)
    assert {visit.plot: visit for visit in read_campaign(season).visits} == visits
    assert contents(line.folder / "captures") == before
    done = line.run("campaign", "show", "season", "--json")
    assert done.json["dates"] == ["2026-06-18"]
    assert [entry["plot"] for entry in done.json["ranking"]["2026-06-18"]][:1] == ["A"]
    for name in ("out.csv", "out.gpkg"):
        done = line.run("campaign", "export", "season", "-o", name, "--json")
        assert done.json["visits"] == 3


@pytest.mark.slow
def test_height_models(line: CommandLine, season: Path, small_plot: Path) -> None:
    """The heights are those that evaluating the same photographs alone gives, and the plot is where the site has it."""
    rasterio = pytest.importorskip("rasterio")
    pyproj = pytest.importorskip("pyproj")
    init(line, "--rasters", "--gsd", "0.01")
    photographs = capture(line, small_plot, "B", "2026-06-18", tilt_deg=1e-6)
    unplaced = capture(line, small_plot, "C", "2026-06-18")  # poses.csv in the plan's frame: nowhere on Earth
    for path in [*unplaced.glob("IMG_00*")]:  # numbered on by the camera, so no copies of B's
        path.rename(path.with_name(path.name.replace("IMG_00", "IMG_01")))
    table = unplaced / "poses.csv"
    table.write_text(table.read_text("utf-8").replace("IMG_00", "IMG_01"), "utf-8")
    assert evaluate(line)[2]["failed"] == 0
    assert evaluate(line)[0] == []
    line.run("evaluate", str(photographs), "-o", "alone", "--rasters", "--gsd", "0.01", *DRAFT)
    done = line.run("campaign", "export", "season", "-o", "maps", "--rasters", "--json")
    made, refused = done.json["rasters"]
    assert (refused["plot"], refused["canopy_height"]) == ("C", "")
    assert "no place on Earth" in refused["no_rasters"]
    for key, source in (("canopy_height", "canopy-height.tif"), ("surface", "surface.tif")):
        (own,) = line.folder.joinpath("alone").glob(f"*/{source}")
        with rasterio.open(line.folder / "maps" / made[key]) as file, rasterio.open(own) as other:
            assert made[key] == f"B_2026-06-18_{source}"
            assert file.crs.to_epsg() == made["crs_epsg"] == 32632
            assert file.tags(ns="IMAGE_STRUCTURE")["LAYOUT"] == "COG"
            heights, expected = file.read(1, masked=True).compressed(), other.read(1, masked=True).compressed()
            assert np.quantile(heights, 0.99) == pytest.approx(np.quantile(expected, 0.99), abs=0.02)
            assert np.quantile(heights, 0.05) == pytest.approx(np.quantile(expected, 0.05), abs=0.02)
            places = []
            for each in (file, other):
                rows, columns = np.nonzero(each.read(1, masked=True).filled(-1e9) > np.quantile(expected, 0.9))
                places.append(each.xy(rows.mean(), columns.mean()))
            np.testing.assert_allclose(places[0], places[1], atol=0.03)
            latitude, longitude = (float(v[0]) for v in FIELD.to_geodetic((6.0, 0.0, 0.0))[:2])
            east, north = pyproj.Transformer.from_crs(4326, 32632, always_xy=True).transform(longitude, latitude)
            assert file.bounds.left < east < file.bounds.right
            assert file.bounds.bottom < north < file.bounds.top


@pytest.mark.slow
def test_what_is_new_or_changed(line: CommandLine, season: Path, small_plot: Path) -> None:
    init(line)
    capture(line, small_plot, "A", "2026-06-18", count=3)
    assert evaluate(line)[0] == ["A 2026-06-18"]
    # One more date costs one visit.
    capture(line, small_plot, "A", "2026-06-25", count=3)
    evaluated, kept, _ = evaluate(line)
    assert (evaluated, kept) == (["A 2026-06-25"], ["A 2026-06-18"])
    # A re-flight, in a folder of its own: the visit's earlier photographs count, too.
    (line.folder / "captures").rename(line.folder / "aside")
    whole = capture(line, small_plot, "A", "2026-06-18", count=5)
    for path in sorted(whole.glob("*.jpg"))[:3]:
        path.unlink()
    (line.folder / "captures").rename(line.folder / "reflown")
    (line.folder / "aside").rename(line.folder / "captures")
    done = line.run("evaluate", "reflown", "--campaign", "season", "--json")
    assert [(visit["date"], visit["images"]) for visit in done.json["evaluated"]] == [("2026-06-18", 5)]
    assert evaluate(line)[0] == []  # also not when the other half is looked at
    # What changed is computed again.
    (line.folder / "captures" / "A" / "2026-06-18" / "IMG_0001.jpg").unlink()
    assert evaluate(line)[0] == ["A 2026-06-18"]
    assert [visit.images for visit in read_campaign(season).visits] == [4, 3]


@pytest.mark.slow
def test_killed_twice_and_resumed(line: CommandLine, season: Path, small_plot: Path) -> None:
    init(line)
    for plot in PLOTS[:3]:
        capture(line, small_plot, plot, "2026-06-18")
    stamps: dict[Path, int] = {}
    for rows in (1, 2):
        process = line.start("evaluate", "captures", "--campaign", "season", "--workers", "1")
        assert wait_until(process, lambda rows=rows: len(read_visits(season)) >= rows)
        process.kill()
        assert finish(process).code == -signal.SIGKILL
        done = {path: path.stat().st_mtime_ns for path in season.glob("visits/*/*/evaluation.json")}
        assert len(done) >= rows
        assert stamps.items() <= done.items()  # nothing was computed twice
        stamps = done
        whole = {(visit.plot, visit.date) for visit in read_campaign(season).visits}
        assert len(whole) >= rows
    evaluated, kept, _ = evaluate(line)
    assert len(evaluated) + len(kept) == 3
    assert len(kept) >= 2
    assert {path: path.stat().st_mtime_ns for path in stamps} == stamps
    assert [visit.error for visit in read_campaign(season).visits] == [""] * 3
    assert not list(season.glob("visits/*/.*"))
