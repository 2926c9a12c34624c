"""The overview, the cost plot and the picture of a plan."""

import io
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure
from PIL import Image

from benchmarks.scaling import Cost, draw_cost_plot
from fieldkit.clouds import Cloud, write_cloud
from fieldkit.evaluation.conversion import plot_evaluation, reference_report
from fieldkit.pictures.mission import draw_plan
from fieldkit.pictures.overview import draw_overview, write_overviews
from fieldkit.pictures.panels import FRONT, SIDE, TOP, Window, draw_points, drawable, eye_dome_shade, nice_length
from fieldkit.planning.space.cameras import Cameras
from fieldkit.reconstruction.settings import ReconstructionSettings
from fieldkit.results.plan_file import plan_from_poses
from fieldkit.results.report_files import describe_files
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
        report = reference_report(result, SETTINGS)
        figure = draw_overview(report, result.plants)
        said = texts(figure)
        for part in ("plot 7: reference", "registered (6)", "registered but wrong (1)", "not registered (1)"):
            assert part in said
        assert len(figure.axes) == 4
        picture = pixels(figure).astype(int)
        greens = (picture[..., 1] > picture[..., 0] + 40) & (picture[..., 1] > picture[..., 2] + 40)
        assert np.count_nonzero(greens) > 5000
        write_cloud(tmp_path / "cloud.ply", result.plants)
        report = report.model_copy(update={"files": describe_files(tmp_path, ["cloud.ply"])})
        write_overviews(tmp_path, report)
        first = (tmp_path / "overview.png").read_bytes()
        write_overviews(tmp_path, report)
        assert (tmp_path / "overview.png").read_bytes() == first

    @pytest.mark.parametrize(
        "cloud",
        [Cloud.empty(), Cloud(np.zeros((1, 3))), Cloud(np.column_stack([np.linspace(0, 8, 99), *np.zeros((2, 99))]))],
        ids=["empty", "one", "line"],
    )
    def test_odd_clouds_and_names_in_any_script(self, cloud: Cloud) -> None:
        """Neither a warning for a missing glyph nor an attempt at mathematics."""
        result = reconstruction(cloud=cloud, metric=False, scene=False)
        plot = plot_evaluation("样地 $x^2 $", result, SETTINGS, score=None)
        figure = draw_overview(plot, cloud)
        assert pixels(figure).shape == (840, 2250, 3)
        assert "□□ $x^2 $" in texts(figure)


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


@pytest.mark.parametrize(("length", "nice"), [(1.0, 1.0), (0.99, 0.5), (0.3, 0.2), (0.00021, 0.0002)])
def test_nice_lengths(length: float, nice: float) -> None:
    assert nice_length(length) == pytest.approx(nice)


def test_drawable() -> None:
    assert drawable("Feld 样\n7") == "Feld □ 7"
    assert "□" not in drawable("größer – × ° −")


def test_a_plan_shows_its_cameras() -> None:
    positions = np.array([[1.0, 0.0, 1.0], [0.0, 1.0, 1.2], [-1.0, 0.0, 0.8]])
    plan = plan_from_poses(Cameras.aimed(positions, (0.0, 0.0, 0.2)).poses())
    above = draw_plan("plan", plan).axes[0]
    assert [text.get_text() for text in above.texts if text.get_text().isdigit()] == ["1", "2", "3"]
    low, high = above.get_xlim()
    assert low < -1.0 < 1.0 < high


WINDOW = Window(-1.0, 1.0, -0.5, 0.5, 200, 100)
RED, BLUE = (200, 0, 0), (0, 0, 200)


def draw(points: list[tuple[float, float, float]], colors: list[tuple[int, int, int]], direction=FRONT) -> np.ndarray:
    return draw_points(np.array(points, dtype=float), np.array(colors, dtype=np.uint8), direction, WINDOW)


def test_a_point_lies_where_it_should() -> None:
    picture = draw([(0.5, 7.0, 0.25)], [RED])
    assert picture.shape == (100, 200, 4)
    rows, columns = np.nonzero(picture[..., 3])
    assert (rows.mean(), columns.mean()) == (25, 150)
    assert tuple(picture[25, 150]) == (*RED, 255)


@pytest.mark.parametrize(
    ("direction", "near", "far"),
    [(FRONT, (0, -1, 0), (0, 1, 0)), (SIDE, (1, 0, 0), (-1, 0, 0)), (TOP, (0, 0, 1), (0, 0, -1))],
)
@pytest.mark.parametrize("swap", [False, True])
def test_the_nearer_point_hides_the_other(direction, near, far, swap: bool) -> None:
    points, colors = ([far, near], [BLUE, RED]) if swap else ([near, far], [RED, BLUE])
    picture = draw(points, colors, direction)
    assert tuple(picture[50, 100, :3]) == RED


def test_points_outside_are_left_out() -> None:
    assert not draw([(1.5, 0, 0), (0, 0, -0.6)], [RED, RED])[..., 3].any()
    assert draw([(-1.0, 0, 0.4999)], [RED])[0, 0, 3] == 255


def test_behind_an_edge_it_is_dark() -> None:
    nearness = np.zeros((9, 10))
    nearness[:, 5:] = 1.0
    shade = eye_dome_shade(nearness)
    assert (shade[:, 4] < 0.9).all()
    assert (shade[:, 5:] == 1).all()
    assert (shade[:, :3] == 1).all()
