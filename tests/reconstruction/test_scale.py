"""What decides the scale; positions that are coarser than the cameras' spread give none, and check no pose."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from scipy.spatial.distance import pdist

from fieldkit.cache import StageCache
from fieldkit.captures import read_capture
from fieldkit.geometry.similarity import fit_similarity
from fieldkit.reconstruction.markers import AGREE
from fieldkit.reconstruction.pipeline import KnownPlot, place
from fieldkit.reconstruction.result import SparseResult
from fieldkit.reconstruction.scale import LARGEST_SCALE_ERROR, scale_error, sigma_apart
from fieldkit.reconstruction.settings import ReconstructionSettings
from fieldkit.runtime.context import Context
from tests.reconstruction.test_unknown_focal_length import CENTERS, codes, ground, nadir, photographed

CODES = {"scale-uncertain", "positions-too-coarse"}


@pytest.fixture(scope="module")
def flight(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return photographed(tmp_path_factory.mktemp("coarse") / "flight", nadir(), equivalent=20)


def placed(flight: Path, positions: list, accuracy_m: float, plot: KnownPlot | None = None) -> SparseResult:
    lines = [f"{k}.jpg,{','.join(map(repr, map(float, p)))},{accuracy_m}" for k, p in enumerate(positions)]
    (flight / "poses.csv").write_text("\n".join(["image,x_m,y_m,z_m,accuracy_m", *lines]))
    capture = read_capture(flight)
    cache = StageCache(flight.parent / "cache")
    return place(capture, ReconstructionSettings(), [], Context(cache), plot)[0]


def has_no_scale(result: SparseResult) -> bool:
    return not result.frame.metric and result.frame.bound_m is None and {i.right for i in result.images} == {None}


def test_a_phones_accuracy_gives_no_scale(flight: Path) -> None:
    result = placed(flight, CENTERS, 40.0)
    assert has_no_scale(result)
    assert result.registered == len(CENTERS)
    assert codes(result) == ["positions-too-coarse", "lens-uncalibrated"]
    assert "good to 40 m" in result.findings[0].message
    assert "markers.toml" in result.findings[0].message


def test_positions_that_scatter_as_they_say_give_no_scale(flight: Path) -> None:
    """Their spread is that of their errors: six photographs within a metre, tagged by a receiver good to 5 m."""
    scattered = np.random.default_rng(3).normal(0.0, 5.0, (len(CENTERS), 3)) + 0.1 * np.array(CENTERS)
    result = placed(flight, scattered.tolist(), 5.0)
    assert has_no_scale(result)
    assert codes(result) == ["positions-too-coarse", "lens-uncalibrated"]


@pytest.mark.parametrize(("accuracy_m", "told"), [(0.05, set()), (1.0, {"scale-uncertain"})])
def test_positions_finer_than_the_spread_stay_metric(flight: Path, accuracy_m: float, told: set[str]) -> None:
    result = placed(flight, CENTERS, accuracy_m)
    assert result.frame.source == "poses.csv"
    assert result.right == len(CENTERS)
    assert {i.right for i in result.images} == {True}
    assert CODES & set(codes(result)) == told


def test_printed_markers_give_the_scale_where_positions_give_a_doubtful_one(tmp_path: Path) -> None:
    picture, side_m = ground().copy(), 1.6
    tag = cv2.aruco.generateImageMarker(cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11), 5, 160)
    picture[900:1100, 900:1100] = cv2.copyMakeBorder(tag[::-1], 20, 20, 20, 20, cv2.BORDER_CONSTANT, value=255)
    flight = photographed(tmp_path / "flight", nadir(), equivalent=20, picture=picture)
    stretched = (1.07 * np.array(CENTERS)).tolist()
    without = placed(flight, stretched, 1.0)
    assert CODES & set(codes(without)) == {"scale-uncertain"}
    (flight / "markers.toml").write_text(f'dictionary = "DICT_APRILTAG_36h11"\nside_m = {side_m}')
    result = placed(flight, stretched, 1.0)
    assert (result.frame.source, CODES & set(codes(result))) == ("poses.csv", set())
    assert result.frame.scale_error == AGREE
    assert pdist(result.centers) == pytest.approx(pdist(CENTERS), rel=0.01)
    (flight / "markers.toml").write_text('dictionary = "DICT_4X4_50"\nside_m = 1.0')
    assert pdist(placed(flight, stretched, 1.0).centers) == pytest.approx(pdist(without.centers))


@pytest.mark.parametrize(("count", "spread_m", "sigma_m"), [(20, 30.0, 3.0), (10, 0.25, 0.01)])
def test_the_scale_s_error_is_that_of_positions_over_their_spread(count: int, spread_m: float, sigma_m: float) -> None:
    rng = np.random.default_rng(2)
    true = rng.normal(0.0, spread_m, (count, 3))
    errors = []
    for _ in range(400):
        found = true + rng.normal(0.0, sigma_m, true.shape)
        errors.append(fit_similarity(true, found).scale - 1.0)
    assert scale_error(found, sigma_m) == pytest.approx(float(np.std(errors)), rel=0.15)


def test_positions_give_no_scale_where_their_errors_are_their_spread() -> None:
    rng = np.random.default_rng(4)
    told = []
    for count in (5, 8, 20, 100):
        for _ in range(50):
            shape, positions = rng.normal(0.0, 1.0, (count, 3)), rng.normal(0.0, 5.0, (count, 3))
            residuals = np.linalg.norm(fit_similarity(shape, positions).apply(shape) - positions, axis=1)
            told.append(scale_error(positions, sigma_apart(5.0, residuals)))
    assert min(told) > LARGEST_SCALE_ERROR
    assert scale_error(np.zeros((2, 3)), 0.01) == float("inf")
