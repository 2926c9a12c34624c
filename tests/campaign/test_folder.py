"""A campaign's folder: made, read, shown, exported."""

import csv
import json
import sqlite3
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import shapely
from pyogrio import list_layers
from pyogrio.raw import read

from fieldkit.campaign import Campaign, Visit, find_campaign, read_campaign
from fieldkit.campaign.create import CampaignSources, init_campaign, split_references
from fieldkit.campaign.export import campaign_csv, export_campaign
from fieldkit.campaign.overview import campaign_object, campaign_tables, remarks, verdict
from fieldkit.campaign.ranks import drift, ranking
from fieldkit.campaign.reading import CampaignTable, campaign_text, keep_visit, read_campaign_file
from fieldkit.cli.boundary import emit_json
from fieldkit.errors import MetadataError, UsageError
from fieldkit.evaluation.conversion import evaluation_report
from fieldkit.evaluation.settings import EvaluationSettings
from fieldkit.reconstruction.settings import ReconstructionSettings
from fieldkit.results.finding import OTHER_PLANTS
from fieldkit.results.plan import PlanMethod
from fieldkit.results.plan_file import plan_from_poses
from fieldkit.results.report_files import EVALUATION_FILE, save_report
from fieldkit.results.traits import PlantEntry, TraitsEntry
from tests.campaign.examples import PLAN, STATIONS, campaign_folder, field, plots_geojson
from tests.figures.terminal.test_results import scored

FIELD = field(2, 2)
EVIL = "=HYPERLINK(0)</script><b>"


def visit(plot: str, date: str, chamfer: float | None = None, **more: object) -> Visit:
    return Visit(plot=plot, date=date, chamfer_m=chamfer, images=8, right=8, registered=8, **more)  # type: ignore[arg-type]


VISITS = (
    visit("r1c1", "2026-06-18", 0.010, f_score={"0.010": 0.8}, traits=TraitsEntry(height_m=0.5, height_error_m=0.03)),
    visit("r1c2", "2026-06-18", 0.0105),
    visit("r2c1", "2026-06-18", None, predicted_chamfer_m=0.02, predicted_low_m=0.015, predicted_high_m=0.03),
    visit("r1c1", "2026-06-25", 0.020, traits=TraitsEntry(height_m=0.7)),
    Visit(plot="r2c2", date="2026-06-25", error=EVIL, notes=(EVIL,), captures=EVIL),
)


def campaign(tmp_path: Path, visits: tuple[Visit, ...] = VISITS) -> Campaign:
    folder = campaign_folder(tmp_path, FIELD)
    for each in visits:
        assert keep_visit(folder, each)
    return read_campaign(folder)


class TestInit:
    def test_the_folder_holds_everything(self, tmp_path: Path) -> None:
        folder = campaign_folder(tmp_path, FIELD, evaluation=EvaluationSettings(fidelity="draft", refine=True))
        assert sorted(path.name for path in folder.iterdir()) == [
            "campaign.toml",
            "plan.json",
            "plots.geojson",
            "site.toml",
        ]
        (tmp_path / "sources").rename(tmp_path / "gone")
        found = read_campaign(folder)
        assert found.name == "season"
        assert found.plan.stations == PLAN.stations
        assert found.evaluation == EvaluationSettings(fidelity="draft", refine=True)
        assert found.visits == ()
        assert [plot.name for plot in found.plots] == [plot.name for plot in FIELD]
        for plot, drawn in zip(found.plots, FIELD, strict=True):
            assert plot.row_heading_deg == drawn.row_heading_deg
            assert plot.latitude_deg == pytest.approx(drawn.latitude_deg, abs=1e-9)
            assert plot.shape == drawn.shape
        assert not list(tmp_path.glob(".*"))

    def test_plots_vehicle_and_camera(self, tmp_path: Path) -> None:
        campaign_folder(tmp_path, FIELD)
        sources = tmp_path / "sources"
        (tmp_path / "others.json").write_text(plots_geojson(FIELD[:1]))
        (tmp_path / "calibration.toml").write_text(
            'model = "PINHOLE"\nwidth = 120\nheight = 90\nparams = [100, 100, 60, 45]\n'
        )
        found = init_campaign(
            tmp_path / "other",
            CampaignSources(
                sources / "plan.json",
                sources / "site.toml",
                tmp_path / "others.json",
                "ardupilot-pitch",
                tmp_path / "calibration.toml",
            ),
            name="Über",
        )
        assert found.name == "Über"
        assert [plot.name for plot in found.plots] == ["r1c1"]
        assert found.vehicle_file == tmp_path / "other" / "vehicle.toml"
        assert found.camera_file == tmp_path / "other" / "camera.toml"
        assert (tmp_path / "other" / "camera.toml").is_file()

    def test_plots_can_be_added_and_vanish(self, tmp_path: Path) -> None:
        made = campaign(tmp_path)
        more = field(3, 2)
        (made.folder / "plots.geojson").write_text(plots_geojson(more[1:]))
        found = read_campaign(made.folder)
        assert [plot.name for plot in found.plots] == [plot.name for plot in more[1:]]
        assert found.vanished == ("r1c1",)
        assert len(found.visits) == len(VISITS)
        assert [v.plot for v in found.visits][-2:] == ["r1c1", "r1c1"]
        assert any("r1c1 has visits" in remark for remark in remarks(found))

    @pytest.mark.parametrize("text", ["r1c1", "=x", "r1c1=", "nowhere=ref", "a=y"])
    def test_references_that_name_no_plot(self, text: str) -> None:
        assert split_references(["a=b=c"], ["r1c1", "a"]) == {"a": Path("b=c")}
        with pytest.raises(UsageError, match="--reference: names no plot"):
            split_references(["a=x", text], ["r1c1", "a"])


class TestReading:
    def test_the_file_round_trips(self, tmp_path: Path) -> None:
        table = CampaignTable(
            name='say "ü"',
            plots="p.geojson",
            vehicle="v.toml",
            evaluation=EvaluationSettings(bounds_m=(-1, -1, 0, 1, 1, 1.5), seed=3, rasters=True, gsd_m=0.01),
            references=(),
        )
        (tmp_path / "campaign.toml").write_text(campaign_text(table))
        assert read_campaign_file(tmp_path / "campaign.toml") == table

    @pytest.mark.parametrize(
        ("text", "message"),
        [
            ("", "has no 'format'"),
            ("format = 1\nx = 1", "x: is not a key"),
            ("format = 1\n[evaluation]\nfidelity = 'best'", "evaluation.fidelity"),
            ("format = 1\n[evaluation]\nbounds_m = [1, 0, 0, 0, 1, 1]", "the lowest corner is not below"),
            ("format = 1\n[evaluation]\ngsd_m = 0.01", "rasters = true"),
            ("format = 1\nplan = '../plan.json'", "leads out of the campaign's folder"),
            ("format = 1\n[[references]]\nplot = 'a'\npath = 'x'\nsha256 = 'short'", "references 1.sha256"),
        ],
    )
    def test_errors(self, text: str, message: str, tmp_path: Path) -> None:
        folder = campaign_folder(tmp_path, FIELD)
        (folder / "campaign.toml").write_text(text)
        with pytest.raises(MetadataError, match=message) as caught:
            read_campaign(folder)
        assert caught.value.remedy

    def test_which_folder(self, tmp_path: Path) -> None:
        folder = campaign_folder(tmp_path, FIELD)
        (folder / "captures" / "deep").mkdir(parents=True)
        assert find_campaign(folder / "captures" / "deep") == folder
        assert find_campaign(tmp_path) is None
        assert read_campaign(folder / "campaign.toml") == read_campaign(folder)
        with pytest.raises(MetadataError, match="is no campaign"):
            read_campaign(tmp_path)


class TestRanking:
    def test_plots_within_noise_share_a_rank(self) -> None:
        found = ranking(VISITS, PLAN, "2026-06-18")
        assert [(e.rank, e.tied, e.visit.plot) for e in found] == [
            (1, True, "r1c1"),
            (1, True, "r1c2"),
            (1, False, "r2c1"),  # predicted: ranked on its own
        ]
        assert found[2].predicted
        assert found[0].noise_m == pytest.approx(0.001645)

    def test_without_known_noise_there_are_no_ties(self) -> None:
        single = PlanMethod(name="ring", chamfer_m=0.01, chamfer_spread_m=0.0, repeats=1)
        for plan in (plan_from_poses(STATIONS), plan_from_poses(STATIONS, method=single)):
            found = ranking(VISITS, plan, "2026-06-18")
            assert [(e.rank, e.tied) for e in found] == [(1, False), (2, False), (1, False)]
            assert found[0].noise_m is None

    def test_other_plants_than_the_references_have_no_rank(self) -> None:
        odd = visit("r2c2", "2026-06-18", 0.148, doubts=(OTHER_PLANTS,))
        assert ranking((*VISITS, odd), PLAN, "2026-06-18") == ranking(VISITS, PLAN, "2026-06-18")

    def test_what_has_no_score_is_told_with_why(self, tmp_path: Path) -> None:
        made = replace(
            campaign(tmp_path),
            visits=(
                visit("r1c1", "2026-06-18", 0.01),
                visit("r1c2", "2026-06-18", 0.01, doubts=("weakly-tied",)),
                visit("r2c1", "2026-06-18", 0.148, doubts=(OTHER_PLANTS,)),
                visit("r2c2", "2026-06-18", 0.148, doubts=(OTHER_PLANTS,)),
            ),
        )
        said = [sentence for sentence in remarks(made) if "notes in visit.json" in sentence]
        assert [sentence.partition(";")[0] for sentence in said] == [
            "r1c2 2026-06-18: doubtful (weakly tied)",
            "r2c1 2026-06-18 and r2c2 2026-06-18: without a score, and not ranked (other plants)",
        ]

    def test_drift(self) -> None:
        found = drift(VISITS, PLAN)
        assert [(d.plot, d.figure, d.beyond_noise) for d in found] == [
            ("r1c1", "chamfer_m", True),
            ("r1c1", "height_m", None),
        ]
        assert found[0].change == pytest.approx(0.010)
        assert found[1].change == pytest.approx(0.2)
        assert drift(VISITS, plan_from_poses(STATIONS))[0].beyond_noise is None
        grown = [
            visit(
                "r1c1",
                f"2026-06-{day}",
                traits=TraitsEntry(height_m=height, height_error_m=above, height_error_below_m=0.03),
            )
            for day, height, above in ((18, 0.5, 0.03), (25, 0.6, 0.12), (26, 0.5, 0.12))
        ]
        assert [d.beyond_noise for d in drift(grown, PLAN)] == [True, False]  # lost tips make no plant grow
        assert [d.beyond_noise for d in drift(grown[1:], PLAN)] == [False]


class TestShow:
    def test_object_and_tables(self, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
        made = campaign(tmp_path)
        emit_json(campaign_object(made))
        found = json.loads(capsys.readouterr().out)
        assert found["dates"] == ["2026-06-18", "2026-06-25"]
        assert found["missing"] == {"2026-06-18": ["r2c2"], "2026-06-25": ["r1c2", "r2c1"]}
        assert [entry["plot"] for entry in found["ranking"]["2026-06-18"]] == ["r1c1", "r1c2", "r2c1"]
        assert len(found["visits"]) == 5
        told, complete = verdict(made)
        assert told.startswith("1 of 4 plots of 2026-06-25; no photographs of r1c2 and r2c1; no result of r2c2; height")
        assert told.endswith("height of 1 of 4 plots (0.70 m), cover of none")
        assert not complete
        _, *tables = campaign_tables(made)
        captions = [table.caption for table in tables]
        assert captions[-2:] == ["Change from 2026-06-18 to 2026-06-25"] * 2
        assert [[column.label for column in table.columns] for table in tables[-2:]] == [
            ["plot", "chamfer"],
            ["plot", "height"],
        ]
        assert [table.rows for table in tables[-2:]] == [(("r1c1", "+10.0 mm, beyond noise"),), (("r1c1", "+0.20 m"),)]

    def test_measured_and_predicted_distances_are_never_ranked_together(self, tmp_path: Path) -> None:
        made = campaign(tmp_path, tuple(visit for visit in VISITS if visit.date == "2026-06-18"))
        rankings = [table for table in campaign_tables(made) if table.caption.startswith("Ranking")]
        assert [[row[:2] for row in table.rows] for table in rankings] == [[("r1c1", "1="), ("r1c2", "1=")]]
        rows = {(row["plot"], row["date"]): row for row in csv.DictReader(campaign_csv(made).splitlines())}
        ranks = [
            (rows[plot, "2026-06-18"]["rank"], rows[plot, "2026-06-18"]["predicted_rank"]) for plot in ("r1c1", "r2c1")
        ]
        assert ranks == [("1", ""), ("", "1")]


class TestExport:
    def test_csv(self, tmp_path: Path) -> None:
        rows = list(csv.DictReader(campaign_csv(campaign(tmp_path)).splitlines()))
        assert len(rows) == 5
        first = rows[0]
        assert (first["plot"], first["date"], first["rank"], first["chamfer_m"]) == ("r1c1", "2026-06-18", "1", "0.01")
        assert first["f_score_0.010"] == "0.8"
        assert first["predicted_chamfer_m"] == ""
        assert rows[-1]["error"] == rows[-1]["notes"] == rows[-1]["captures"] == f"'{EVIL}"
        assert all(not cell.startswith(("=", "+", "@")) for row in rows for cell in row.values())

    def test_geojson(self, tmp_path: Path) -> None:
        made = campaign(tmp_path)
        assert export_campaign(made, tmp_path / "out.geojson") == "geojson"
        document = json.loads((tmp_path / "out.geojson").read_text())
        assert document["type"] == "FeatureCollection"
        assert len(document["features"]) == 5
        ring = shapely.geometry.shape(document["features"][0]["geometry"]).exterior
        assert ring.is_ccw
        assert shapely.Polygon(ring).centroid.x == pytest.approx(FIELD[0].longitude_deg, abs=1e-8)

    def test_geopackage(self, tmp_path: Path) -> None:
        made = campaign(tmp_path)
        gone = replace(made, visits=(*made.visits, visit("vanished", "2026-06-25", 0.03)))
        file = tmp_path / "out.gpkg"
        assert export_campaign(gone, file) == "gpkg"
        assert list_layers(file).tolist() == [["visits", "Polygon"], ["plots", "Polygon"]]
        meta, _, geometry, data = read(file, layer="visits")
        columns = dict(zip(meta["fields"], data, strict=True))
        assert meta["crs"] == "EPSG:4326"
        assert columns["plot"].tolist() == ["r1c1", "r1c1", "r1c2", "r2c1", "r2c2", "vanished"]
        assert columns["date"].dtype.kind == "M"
        assert str(columns["date"][0])[:10] == "2026-06-18"
        assert columns["chamfer_m"][0] == 0.01
        assert np.isnan(columns["chamfer_m"][3])
        assert columns["error"][4] == EVIL
        assert shapely.from_wkb(geometry[0]).contains(shapely.Point(FIELD[0].longitude_deg, FIELD[0].latitude_deg))
        assert geometry[5] is None
        meta, _, _, data = read(file, layer="plots")
        columns = dict(zip(meta["fields"], data, strict=True))
        assert columns["plot"].tolist() == [plot.name for plot in FIELD]
        assert columns["visits"].tolist() == [2, 1, 1, 1]
        assert columns["chamfer_m"][0] == 0.02  # the latest
        database = sqlite3.connect(file)
        try:
            assert database.execute("PRAGMA application_id").fetchone()[0] == 0x47504B47  # "GPKG"
            assert database.execute("PRAGMA user_version").fetchone()[0] == 10200  # read by every QGIS in use
        finally:
            database.close()

    def test_plants_are_points_of_a_geopackage(self, tmp_path: Path) -> None:
        made = campaign(tmp_path, (visit("r1c1", "2026-06-18", 0.01, folder="visits/r1c1/2026-06-18"),))
        plant = PlantEntry(
            plant=1,
            x_m=0.1,
            y_m=0.2,
            latitude_deg=50.6,
            longitude_deg=6.98,
            height_m=0.8,
            height_certain=True,
            area_m2=0.05,
            touching=0.1,
        )
        nowhere = plant.model_copy(update={"plant": 2, "latitude_deg": None, "longitude_deg": None})
        plot = scored("r1c1").model_copy(update={"plants": (plant, nowhere)})
        report = evaluation_report(
            "c", [plot], ReconstructionSettings(), reference_sha256=None, refine=False, distances_m=(0.01,)
        )
        save_report(made.folder / made.visits[0].folder / EVALUATION_FILE, report)
        export_campaign(made, tmp_path / "out.gpkg")
        meta, _, geometry, data = read(tmp_path / "out.gpkg", layer="plants")
        columns = {name: values.tolist() for name, values in zip(meta["fields"], data, strict=True)}
        assert shapely.from_wkb(geometry).tolist() == [shapely.Point(6.98, 50.6)]
        assert (columns["plot"], columns["plant"], columns["height_m"]) == (["r1c1"], [1], [0.8])

    @pytest.mark.parametrize("name", ["out.geojson", "out.gpkg"])
    def test_an_empty_campaign_and_points(self, name: str, tmp_path: Path) -> None:
        points = tuple(plot.model_copy(update={"shape": None}) for plot in FIELD)
        folder = campaign_folder(tmp_path, points)
        made = read_campaign(folder)
        export_campaign(made, tmp_path / name)
        assert (tmp_path / name).stat().st_size > 0
        if name.endswith("gpkg"):
            meta, _, geometry, _ = read(tmp_path / name, layer="plots")
            assert len(geometry) == 4
            assert meta["geometry_type"] == "Point"
            assert len(read(tmp_path / name, layer="visits")[2]) == 0
        with pytest.raises(UsageError, match="exists already"):
            export_campaign(made, tmp_path / name)
        export_campaign(made, tmp_path / name, overwrite=True)
        with pytest.raises(UsageError, match=r"which format is out\.txt"):
            export_campaign(made, tmp_path / "out.txt")
