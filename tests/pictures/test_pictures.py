"""The overview, the cost plot and the picture of a plan."""

import io
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure
from PIL import Image

from benchmarks.scaling import Cost, draw_cost_plot
from fieldkit.clouds import Cloud
from fieldkit.errors import CaptureError
from fieldkit.evaluation.conversion import failed_plot, plot_evaluation, reference_report
from fieldkit.pictures.mission import draw_plan
from fieldkit.pictures.overview import draw_overview, write_overview
from fieldkit.pictures.panels import drawable, nice_length
from fieldkit.reconstruction.settings import ReconstructionSettings
from fieldkit.results.evaluation import WeakestMode
from fieldkit.results.finding import WEAKLY_TIED, Finding
from tests.evaluation.examples import reconstruction

SETTINGS = ReconstructionSettings()


def pixels(figure: Figure) -> np.ndarray:
    picture = io.BytesIO()
    figure.savefig(picture, format="png")
    return np.asarray(Image.open(picture).convert("RGB"))


def size_of(path: Path) -> tuple[int, int]:
    with Image.open(path) as picture:
        return picture.size


def texts(figure: Figure) -> str:
    drawn = [text.get_text() for text in figure.texts]
    drawn += [axes.get_title(loc="left") for axes in figure.axes]
    drawn += [text.get_text() for legend in figure.legends for text in legend.get_texts()]
    return "\n".join(drawn)


class TestOverview:
    def test_what_it_says_and_shows(self, tmp_path: Path) -> None:
        result = reconstruction()
        report = reference_report(result, SETTINGS, seconds=1, cpu_seconds=1)
        figure = draw_overview(report, result.plants)
        said = texts(figure)
        for part in (
            "plot 7: reference",
            "From above",
            "registered (6)",
            "registered but wrong (1)",
            "not registered (1)",
            "7 of 8 (88 %)",
            "3.00 mm RMS",
            "0.40 mm per pixel",
        ):
            assert part in said
        assert len(figure.axes) == 5
        picture = pixels(figure).astype(int)
        greens = (picture[..., 1] > picture[..., 0] + 40) & (picture[..., 1] > picture[..., 2] + 40)
        assert np.count_nonzero(greens) > 5000
        write_overview(tmp_path / "overview.png", report, result.plants)
        assert size_of(tmp_path / "overview.png") == (2250, 1500)

    def test_how_loose_photographs_could_lie(self) -> None:
        result = reconstruction()
        report = reference_report(result, SETTINGS, seconds=1, cpu_seconds=1)
        names = tuple(image.name for image in report.image_reports if image.center_m is not None)[:2]
        weakest = WeakestMode(photographs=names, sigma_m=0.004, moves_m=((0.01, 0.0, 0.0), (0.0, 0.008, 0.0)))
        told = (Finding("plot 7", WEAKLY_TIED, "weakly tied"),)
        loose = report.model_copy(update={"weakest": weakest, "findings": told})
        firm = report.model_copy(update={"weakest": weakest})
        drawn = [
            [text.get_text() for axes in draw_overview(r, result.plants).axes for text in axes.texts]
            for r in (loose, firm)
        ]
        said = ["ringed: could lie 9.06 mm off" in " ".join(each) for each in drawn]
        assert said == [True, False]
        starts, moves = loose.loose_moves
        assert starts.shape == moves.shape == (2, 3)

    def test_the_same_bytes_each_time(self, tmp_path: Path) -> None:
        result = reconstruction()
        report = reference_report(result, SETTINGS, seconds=1, cpu_seconds=1)
        for name in ("a.png", "b.png"):
            write_overview(tmp_path / name, report, result.plants)
        assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()

    @pytest.mark.parametrize(
        "cloud",
        [
            Cloud.empty(),
            Cloud(np.zeros((1, 3))),
            Cloud(np.tile([0.1, 0.2, 0.3], (50, 1))),
            Cloud(np.column_stack([np.linspace(0, 8, 500), np.zeros(500), np.zeros(500)])),
        ],
        ids=["empty", "one", "spot", "line"],
    )
    def test_odd_clouds(self, cloud: Cloud) -> None:
        result = reconstruction(cloud=cloud, metric=False, scene=False)
        figure = draw_overview(reference_report(result, SETTINGS, seconds=1, cpu_seconds=1), cloud)
        assert pixels(figure).shape == (1500, 2250, 3)
        assert "lengths are not metres" in texts(figure)

    def test_names_in_any_script(self) -> None:
        """Neither a warning for a missing glyph nor an attempt at mathematics."""
        result = reconstruction()
        plot = plot_evaluation("样地 $x^2 $", result, SETTINGS, score=None, seconds=1, cpu_seconds=1)
        figure = draw_overview(plot, result.plants)
        assert "□□ $x^2 $" in texts(figure)
        pixels(figure)

    def test_a_failed_plot(self) -> None:
        failed = failed_plot("p", CaptureError("none"), seconds=0, cpu_seconds=0)
        with pytest.raises(ValueError, match="nothing to show"):
            draw_overview(failed, Cloud.empty())


class TestCost:
    COSTS = (
        Cost("standard", 79, 160.0, 3 << 30),
        Cost("standard", 10, 20.0, 1 << 30),
        Cost("draft", 10, 9.0, 1 << 29),
    )

    def test_lines_in_order_of_images(self, tmp_path: Path) -> None:
        figure = draw_cost_plot(self.COSTS, memory_limit_bytes=4 << 30)
        seconds, memory = figure.axes
        assert seconds.lines[0].get_xydata().tolist() == [[10, 20], [79, 160]]
        assert memory.lines[0].get_xydata().tolist() == [[10, 1], [79, 3]]
        assert memory.lines[-1].get_ydata()[0] == 4
        figure.savefig(tmp_path / "cost.png")
        assert size_of(tmp_path / "cost.png") == (1500, 600)


@pytest.mark.parametrize(
    ("length", "nice"), [(1.0, 1.0), (0.99, 0.5), (0.3, 0.2), (0.05, 0.05), (7.3, 5.0), (0.00021, 0.0002)]
)
def test_nice_lengths(length: float, nice: float) -> None:
    assert nice_length(length) == pytest.approx(nice)


def test_drawable() -> None:
    assert drawable("Feld 样\n7") == "Feld □ 7"
    assert "□" not in drawable("größer – × ° −")


def test_a_plan_shows_its_cameras_and_the_views_that_were_left() -> None:
    plants = Cloud(np.random.default_rng(0).uniform(0, 0.5, (50, 3)))
    positions = np.array([[1.0, 0.0, 1.0], [0.0, 1.0, 1.2], [-1.0, 0.0, 0.8]])
    others = np.array([[0.5, 2.0, 1.0], [-2.0, 0.3, 1.0]])
    figure = draw_plan("plan", positions, -positions / np.linalg.norm(positions, axis=1)[:, None], plants, others)
    above = figure.axes[0]
    assert [text.get_text() for text in above.texts if text.get_text().isdigit()] == ["1", "2", "3"]
    drawn = [np.array(line.get_xydata()) for line in above.lines]
    assert any(np.allclose(points, others[:, :2]) for points in drawn if points.shape == (2, 2))
    low, high = above.get_xlim()
    assert low < -2.0 < 1.0 < high
