"""What a report says of results: the summary's rules, views, and the file as a whole."""

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import fieldkit
from fieldkit.clouds import PointIndex, read_cloud
from fieldkit.errors import MetadataError, StorageError, UsageError
from fieldkit.figures.content import Picture
from fieldkit.report.html.drawings import draw_map
from fieldkit.report.sections.campaign import charts
from fieldkit.report.sections.in_short import next_step, verdict
from fieldkit.report.sections.loaded import PlanRun, Results, read_results
from fieldkit.report.sections.plots import flight_map
from fieldkit.report.sections.views_3d import plan_view, plot_view, points_of, within_budget
from fieldkit.report.write_report import summarise, write_report
from fieldkit.results.evaluation import EvaluationReport, PlotEvaluation, Prediction
from fieldkit.results.finding import OTHER_PLANTS, Finding
from fieldkit.results.report_files import file_sha256, load_evaluation_report
from fieldkit.results.traits import TraitsEntry
from fieldkit.results.visit import Visit
from tests.report.page_checks import checked
from tests.report.sections.examples import (
    HOSTILE,
    SECTIONS,
    SHOWN,
    write_evaluation,
    write_everything,
    write_flight,
    write_mission,
    write_reference,
    write_run,
)


@pytest.fixture(scope="module")
def season(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("results") / "season"
    write_everything(root)
    return root


@pytest.fixture
def scored(tmp_path: Path) -> Results:
    write_reference(tmp_path / "ref")
    write_evaluation(tmp_path / "eval", tmp_path / "ref")
    return read_results(tmp_path)


def test_a_flight_has_a_photograph_of_each_plot_that_the_map_leads_to(tmp_path: Path) -> None:
    write_flight(tmp_path / "scores")
    parsed = checked(write_report(tmp_path / "scores").output.read_text(encoding="utf-8"))
    photographs = [a["alt"] for a in parsed.all("img")]
    assert photographs == ["photograph 118/photo.jpg", "photograph 119/photo.jpg"]
    places = {a["href"] for a in parsed.all("a") if a.get("class") == "plot"}
    assert places == {f"#evaluation-1-plot-{k}" for k in (1, 2, 3)}
    assert {f"evaluation-1-plot-{k}-more" for k in (1, 2, 3)} <= {a.get("id") for _, a in parsed.elements}
    assert "1.00 ± 0.03 m" in parsed.text
    assert len(parsed.all("image")) == 1


@pytest.mark.parametrize("picture", [True, False])
def test_the_map_of_a_flight_is_north_up_and_its_picture_lies_below_it(tmp_path: Path, picture: bool) -> None:
    """In a frame whose x points south, plot 119 is south of 118."""
    write_flight(tmp_path / "scores", picture=picture)
    report = load_evaluation_report(tmp_path / "scores")
    turned = ((0.0, -1.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 1.0, 0.0), (0.0, 0.0, 0.0, 1.0))
    plots = [
        plot.model_copy(update={"frame": report.plots[0].frame.model_copy(update={"plot_from_source": turned})})
        for plot in report.plots
    ]
    drawn = draw_map(flight_map(report.model_copy(update={"plots": tuple(plots)}), "e", Picture(b"", 4, 3, "")))
    ((_, shapes),) = drawn.measures[0].dates
    (x, y), (x2, y2) = ((float(shape.x), float(shape.y)) for shape in shapes[:2])
    assert x2 == pytest.approx(x, abs=0.1)
    assert y2 > y
    if not picture:
        assert drawn.beneath == ""
        return
    a, b, c, d, e, f = map(float, drawn.beneath.split())
    metre = (y2 - y) / 2.0
    np.testing.assert_allclose((a, b, c, d), (0.0, 8.0 * metre, -6.0 * metre, 0.0), atol=0.1)
    np.testing.assert_allclose((x - e, y - f), (-3.0 * metre, 2.75 * metre), atol=0.1)


class TestFile:
    def test_it_shows_every_part_in_order_and_hostile_names_stay_text(self, season: Path, tmp_path: Path) -> None:
        done = write_report(season, tmp_path / "report.html")
        assert (done.references, done.plans, done.missions, done.evaluations, done.campaigns) == (1, 1, 1, 1, 1)
        assert done.unreadable == ("broken/evaluation.json",)
        assert (done.views, done.thumbnails) == (5, 0)
        assert done.bytes == (tmp_path / "report.html").stat().st_size
        parsed = checked((tmp_path / "report.html").read_text(encoding="utf-8"))
        ids = [a["id"] for a in parsed.all("section")]
        assert tuple(ids) == SECTIONS
        assert SHOWN in parsed.text
        assert "\u202e" not in (tmp_path / "report.html").read_text(encoding="utf-8")
        assert "broken/evaluation.json is damaged" in parsed.text
        for file in ("reference/reference.json", "scores/evaluation.json"):
            assert file_sha256(season / file) in parsed.text
        assert f"fieldkit {fieldkit.__version__}" in parsed.text

    def test_the_same_results_give_the_same_bytes(self, season: Path, tmp_path: Path) -> None:
        for name in ("a.html", "b.html"):
            write_report(season, tmp_path / name, points=1000)
        assert (tmp_path / "a.html").read_bytes() == (tmp_path / "b.html").read_bytes()

    def test_never_overwrites_unasked_and_never_leaves_half_a_file(self, scored: Results, tmp_path: Path) -> None:
        folder = scored.root / "eval"
        file = tmp_path / "r.html"
        file.write_text("mine")
        with pytest.raises(UsageError, match="exists already"):
            write_report(folder, file)
        assert file.read_text() == "mine"
        write_report(folder, file, overwrite=True, title=HOSTILE)
        assert SHOWN in checked(file.read_text()).text
        with pytest.raises(UsageError, match="is a folder"):
            write_report(folder, folder, overwrite=True)
        for name in ("r.pdf", "r.zip", "r.html.gz"):
            with pytest.raises(UsageError, match="HTML"):
                write_report(folder, tmp_path / name)
        with pytest.raises(UsageError, match="cannot show"):
            write_report(folder, tmp_path / "x.html", points=5)
        with pytest.raises(StorageError):
            write_report(folder, file / "below.html")
        with pytest.raises(MetadataError, match="no result"):
            write_report(_empty(tmp_path), tmp_path / "x.html")
        assert [p.name for p in tmp_path.iterdir() if p.name.startswith(".")] == []

    def test_hostile_names_of_plots_read_nothing_outside(self, tmp_path: Path) -> None:
        write_reference(tmp_path / "r" / "ref")
        write_evaluation(tmp_path / "r" / "eval", tmp_path / "r" / "ref")
        write_evaluation(tmp_path / "outside", tmp_path / "r" / "ref", plots=("secret",))
        document = json.loads((tmp_path / "r" / "eval" / "evaluation.json").read_text())
        secret = json.loads((tmp_path / "outside" / "evaluation.json").read_text())["plots"][0]
        secret["name"] = "../../outside/secret"
        secret["files"][0]["name"] = "../../outside/secret/cloud.ply"
        document["plots"] = [secret]
        (tmp_path / "r" / "eval" / "evaluation.json").write_text(json.dumps(document))
        done = write_report(tmp_path / "r")
        assert done.views == 1  # the reference's
        assert "does not lie in the evaluation" in (tmp_path / "r" / "report.html").read_text()


class TestSummary:
    def test_rules_follow_the_figures(self, scored: Results) -> None:
        def told(**changed: object) -> str:
            return _told(scored, **changed)

        base = {"chamfer_m": 0.008, "pose_rms_m": 0.001}
        assert "not metres" in told(**base | {"metric": False})
        assert "fell apart into 2 groups" in told(**base | {"models": (5, 3)})

    def test_of_plants_and_predictions(self, tmp_path: Path) -> None:
        write_evaluation(tmp_path / "eval")
        results = read_results(tmp_path)
        traits = TraitsEntry(height_m=0.42, cover_percent=31.0, covered_area_m2=0.1, canopy_volume_m3=0.012)
        likely = Prediction(chamfer_m=0.011, low_m=0.008, high_m=0.016, reason="", model=1)
        none = Prediction(chamfer_m=None, low_m=None, high_m=None, reason="nothing like it was in the fit", model=1)
        assert "is not known" not in _told(results, prediction=likely)
        assert "is not known: nothing like it was in the fit." in _told(results, prediction=none)
        part = results.of(EvaluationReport)[0]
        plot = part.report.plots[0].model_copy(update={"traits": traits, "prediction": likely})
        document = part.report.model_copy(update={"plots": (plot,)}).model_dump_json()
        (tmp_path / "eval" / "evaluation.json").write_text(document)
        text = checked(write_report(tmp_path / "eval").output.read_text()).text
        for told in ("height 0.42\u00a0m", "cover 31.0\u00a0%", "8.00 to 16.0\u00a0mm"):
            assert " ".join(told.split()) in text

    def test_of_flights_and_failures(self, season: Path) -> None:
        texts = " ".join(s.text + s.advice for s in summarise(read_results(season)))
        assert "no photograph at station 6 and station plot 7" in texts
        assert "No result of empty: no photographs in it." in texts
        assert "No result of maize-8 2026-06-30 and maize-8 2026-07-14: the photographs fell apart" in texts

    def test_charts_join_only_what_is_of_one_plot(self) -> None:
        grown = {"a": (1, 2, 3), "b": (1, None, 3), "c": (None, 9, None)}
        visits = [
            Visit(plot=f"{plot}{k}", date=f"2026-06-{day}", traits=TraitsEntry(height_m=height))
            for plot, heights in grown.items()
            for k in range(3)
            for day, height in zip((10, 11, 30), heights, strict=True)
            if height is not None
        ]
        (chart,) = charts(visits, "all plots")
        *plots, middle = chart.series
        assert [[y for _, y in each.points] for each in plots] == [[1, 2, 3]] * 3 + [[1, 3]] * 3
        assert [x - plots[0].points[0][0] for x, _ in plots[0].points] == [0, 1, 20]
        assert (middle.name, [y for _, y in middle.points]) == ("median of the 3 plots with every date", [1, 2, 3])
        assert [each.name for each in next(charts(visits[:9], "x")).series] == ["a0", "a1", "a2"]

    def test_of_plans(self, tmp_path: Path) -> None:
        write_run(tmp_path / "run")
        (part,) = read_results(tmp_path / "run").of(PlanRun)
        assert summarise(Results(tmp_path, (part,))) == ()
        run = replace(part.report, plan=None, outcome=None)
        unfinished = summarise(Results(tmp_path, (replace(part, report=run),)))
        assert [s.level for s in unfinished] == ["problem"]
        assert "40 of 40 trials" in unfinished[0].text


class TestViews:
    def test_distances_are_exact_both_ways(self, scored: Results) -> None:
        part = scored.of(EvaluationReport)[0]
        scene, note = plot_view(part, part.report.plots[0], scored)
        assert "completeness" in note
        ours, theirs = scene.points
        reference, cloud = (read_cloud(scored.root / p) for p in ("ref/cloud.ply", "eval/plot 7/cloud.ply"))
        np.testing.assert_allclose(ours.values, PointIndex(reference.points).nearest(cloud.points)[0], atol=1e-6)
        np.testing.assert_allclose(theirs.values, PointIndex(cloud.points).nearest(reference.points)[0], atol=1e-6)
        assert np.mean(ours.values) == pytest.approx(part.report.plots[0].accuracy_m, rel=1e-4)
        assert [layer.name for layer in scene.frusta] == ["Cameras, achieved", "Cameras, pose found wrong"]
        assert [len(layer.poses) for layer in scene.frusta] == [6, 1]

    def test_planned_cameras_are_shown_where_they_are_in_the_same_frame(self, scored: Results) -> None:
        write_run(scored.root / "plan", scored.root / "ref")
        write_run(scored.root / "other")
        results = read_results(scored.root)
        part = results.of(EvaluationReport)[0]
        scene, _ = plot_view(part, part.report.plots[0], results)
        assert [layer.name for layer in scene.frusta][2:] == ["Cameras, planned"]
        scenes = {plan.name: plan_view(plan, results)[0] for plan in results.of(PlanRun)}
        assert [layer.name for layer in scenes["plan"].points] == ["Reference", "Plants, as flights keep clear of them"]
        assert [layer.shown for layer in scenes["other"].points] == [True]

    def test_a_cloud_that_was_changed_is_not_shown(self, scored: Results) -> None:
        cloud = scored.root / "eval" / "plot 7" / "cloud.ply"
        cloud.write_bytes(cloud.read_bytes()[:-4] + b"\0\0\0\0")
        part = scored.of(EvaluationReport)[0]
        scene, note = plot_view(part, part.report.plots[0], scored)
        assert scene is None
        assert "was changed" in note

    def test_points_are_thinned_out_the_same_every_time(self, scored: Results) -> None:
        part = scored.of(EvaluationReport)[0]
        scene, _ = plot_view(part, part.report.plots[0], scored)
        (thin,), (again,) = (within_budget([scene], 1000) for _ in range(2))
        assert 990 <= points_of([thin]) <= 1000
        assert within_budget([scene], 10_000) == [scene]
        for layer, other, whole in zip(thin.points, again.points, scene.points, strict=True):
            np.testing.assert_array_equal(layer.points, other.points)
            rows = {tuple(p): v for p, v in zip(whole.points.tolist(), whole.values.tolist(), strict=True)}
            assert all(rows[tuple(p)] == v for p, v in zip(layer.points.tolist(), layer.values.tolist(), strict=True))


def test_other_plants_than_the_references_are_no_success(scored: Results) -> None:
    (found,) = scored.of(EvaluationReport)
    (plot,) = found.report.plots
    finding = Finding(subject="plot 7", code=OTHER_PLANTS, message="far off; check the plot", left_out=False)
    odd = replace(
        found,
        report=found.report.model_copy(
            update={"plots": (plot.model_copy(update={"findings": (finding,), "right": plot.images}),)}
        ),
    )
    said = summarise(replace(scored, found=(odd,)))
    assert ("problem", "plot 7: far off.", "Check the plot.") in [(s.level, s.text, s.advice) for s in said]
    assert verdict(scored, said).level == "problem"


def test_what_is_the_same_of_many_plots_is_said_once(tmp_path: Path) -> None:
    write_reference(tmp_path / "ref")
    write_evaluation(tmp_path / "eval", tmp_path / "ref", plots=tuple(f"p{k}" for k in range(30)), adherence=True)
    write_report(tmp_path)
    text = checked((tmp_path / "report.html").read_text()).text
    assert text.count("Fly these stations again:") == 5 + 26  # the others are folded
    assert "The same of 26 more" in text


def test_a_report_begins_with_its_figures_and_ends_with_the_next_step(tmp_path: Path) -> None:
    write_reference(tmp_path / "ref")
    write_evaluation(tmp_path / "eval", tmp_path / "ref", plots=("a", "b"))
    write_run(tmp_path / "plan")
    write_mission(tmp_path / "mission")
    said = {}
    for name in ("ref", "eval", "plan", "mission"):
        results = read_results(tmp_path / name)
        said[name] = verdict(results, ()).text, next_step(results)
    assert "1 reference from 6 of 8 photographs" in said["ref"][0]
    assert re.search(r"2 of 2 plots reconstructed \(chamfer distance [\d.]+ to [\d.]+ mm\)", said["eval"][0])
    assert "a plan of 7 views (4.10 ± 0.20 mm from its reference)" in said["plan"][0]
    assert re.search(r"1 mission of \d+ photographs \(\d+ plots?, [\d.]+ m, \d+:\d\d min\)", said["mission"][0])
    for name, command in (
        ("ref", "plan"),
        ("plan", "export-mission"),
        ("mission", "check-mission"),
        ("eval", "campaign"),
    ):
        assert f"fieldkit {command}" in said[name][1]
    assert next_step(read_results(tmp_path)) == ""


def _told(results: Results, **changed: object) -> str:
    part = results.of(EvaluationReport)[0]
    plot: PlotEvaluation = part.report.plots[0].model_copy(update=changed)
    report: EvaluationReport = part.report.model_copy(update={"plots": (plot,)})
    return " ".join(s.text + s.advice for s in summarise(Results(results.root, (replace(part, report=report),))))


def _empty(tmp_path: Path) -> Path:
    (tmp_path / "empty").mkdir()
    return tmp_path / "empty"
