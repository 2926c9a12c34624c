"""Traits of a plot, and why they cannot be had."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from fieldkit.clouds import Cloud, Volume
from fieldkit.clouds.canopy import rectangle, seam_cells
from fieldkit.evaluation.traits import (
    AREA_ERROR,
    HEIGHT_ERROR_M,
    OF_FLIGHTS,
    STILL_SCATTER_PX,
    PlotOutline,
    outline_of,
    plot_traits,
    seen_share,
)
from fieldkit.geometry import Pose
from fieldkit.reconstruction.gaps import Cover
from fieldkit.reconstruction.result import Reconstruction
from fieldkit.reconstruction.settings import ReconstructionSettings
from fieldkit.reconstruction.silhouettes import Outline
from fieldkit.results.finding import Finding
from fieldkit.results.traits import TRAITS, TraitsEntry
from tests.evaluation.examples import reconstruction

SETTINGS = ReconstructionSettings()
COUNTS = {"plants", "row_gaps"}
OF_HEIGHT = {"height_m", "height_p95_m", "height_p99_m", "canopy_volume_m3"}
PLOT = PlotOutline(rectangle((-0.2, -0.2), (0.2, 0.2)))
OF_FLIGHT = PlotOutline(rectangle((-0.3, -0.3), (0.3, 0.3)), of_flight=True)


@pytest.fixture(autouse=True)
def six_suffice(monkeypatch: pytest.MonkeyPatch) -> None:
    """As many as count in the example, at its 45° and less than a metre about the plot."""
    monkeypatch.setattr("fieldkit.evaluation.traits.LEAST_PHOTOGRAPHS", 6)
    monkeypatch.setattr("fieldkit.evaluation.traits._MATCH_DEG", (3.0, 100.0))


def leaf(z: float = 0.15, side: float = 0.1, count: int = 20_000) -> Cloud:
    """A level square leaf about the origin."""
    rng = np.random.default_rng(0)
    xy = rng.uniform(-side / 2, side / 2, (count, 2))
    return Cloud(np.column_stack([xy, np.full(count, z)]))


def found(cloud: Cloud | None = None, **frame: Any) -> Reconstruction:
    example = reconstruction(cloud=leaf() if cloud is None else cloud)
    return replace(example, sparse=replace(example.sparse, frame=replace(example.sparse.frame, **frame)))


def traits(result: Reconstruction, outline: PlotOutline = PLOT) -> TraitsEntry:
    return plot_traits(result, result.plants, outline)[0]


class TestValues:
    def test_of_a_leaf(self) -> None:
        result = found()
        told = traits(result)
        pixel = result.pixel_m
        assert set(told.unknown) == COUNTS  # one leaf is no plant
        assert told.plot_area_m2 == pytest.approx(0.16)
        assert told.height_m == pytest.approx(0.15, abs=1e-6)
        inner = 0.1 - (2.0 * seam_cells(pixel) - 1.0) * pixel  # less the seam, but for the half cell that the grid adds
        assert told.covered_area_m2 == pytest.approx(inner**2, rel=0.03)
        assert told.cover_percent == pytest.approx(100 * told.covered_area_m2 / 0.16)
        assert told.canopy_volume_m3 == pytest.approx(0.15 * told.covered_area_m2, rel=1e-4)
        assert told.height_error_m == pytest.approx(HEIGHT_ERROR_M, rel=0.01)
        assert told.height_p95_m == told.height_p99_m == pytest.approx(0.15, abs=1e-6)
        assert told.lai == pytest.approx(1.25 * 0.01 / 0.16, rel=0.15)  # without a hole, which photographs leave
        assert told.cover_error_percent is not None
        assert told.cover_error_percent == pytest.approx(AREA_ERROR * told.cover_percent, rel=0.1)

    @pytest.mark.parametrize(("metres", "height", "area"), [(0.0, 1.0, 1.0), (0.004, 2.0, 1.0), (0.010, 5.0, 2.0)])
    def test_errors_grow_with_what_depths_scatter_beyond_still_leaves(
        self, metres: float, height: float, area: float
    ) -> None:
        result = found()
        scatter_px = float(np.hypot(STILL_SCATTER_PX, metres / result.pixel_m))
        told = traits(replace(result, scatter_px=scatter_px))
        assert told.height_error_m == pytest.approx(height * HEIGHT_ERROR_M, rel=0.02)
        assert told.height_error_below_m == pytest.approx(HEIGHT_ERROR_M, rel=0.02)  # clouds lack tips
        assert told.height_p95_error_m == pytest.approx(area * 0.035, rel=0.02)
        assert told.covered_area_error_m2 == pytest.approx(area * AREA_ERROR * told.covered_area_m2, rel=0.02)

    @pytest.mark.parametrize("filled", [False, True])
    def test_edges_of_swaying_leaves_that_fill_their_outlines_are_taken_off_as_of_still_ones(
        self, filled: bool
    ) -> None:
        still = found()
        swaying = replace(still, scatter_px=float(np.hypot(STILL_SCATTER_PX, 3.0)))
        cameras = [
            (still.sparse.intrinsics[name].without_distortion(), pose) for name, pose in still.sparse.poses.items()
        ]
        shown = [Outline(np.full((of.height, of.width), not filled), of, pose) for of, pose in cameras]
        area_m2 = plot_traits(swaying, swaying.plants, PLOT, shown)[0].covered_area_m2
        as_still = traits(still).covered_area_m2
        assert area_m2 == as_still if filled else area_m2 > 1.03 * as_still

    def test_flights_lose_edges_that_sway_and_take_the_seam_off_leaves(self) -> None:
        still = found(leaf(side=0.3, count=180_000))
        swaying = replace(still, scatter_px=float(np.hypot(STILL_SCATTER_PX, 4.0)))
        areas = [traits(result, OF_FLIGHT).covered_area_m2 for result in (still, swaying)]
        sides = [float(np.sqrt(area)) for area in areas if area is not None]
        assert sides[0] == pytest.approx(0.3 - 2 * 1.93 * still.pixel_m, abs=1.5 * still.pixel_m)
        assert sides[1] - sides[0] == pytest.approx(2 * 0.155 * 4.0 * still.pixel_m, rel=0.25)

    def test_leaves_that_clouds_of_tall_plants_lack_are_lower_ones(self, monkeypatch: pytest.MonkeyPatch) -> None:
        points = leaf(side=0.3, count=180_000).points
        slope = found(Cloud(points + np.outer(0.2 * points[:, 0], (0.0, 0.0, 1.0))))  # 0.12 to 0.18 m high
        whole = traits(slope, OF_FLIGHT)
        monkeypatch.setattr("fieldkit.evaluation.traits.OF_FLIGHTS", replace(OF_FLIGHTS, tallest_m=0.1))
        covers = Cover(0.4, 0.0), Cover(0.6, 0.0), Cover(0.4, 0.15), None
        told, lost, unsure, alone = (traits(slope, replace(OF_FLIGHT, cover=cover)) for cover in covers)
        more = told.covered_area_m2 / whole.covered_area_m2
        assert told.canopy_volume_m3 == pytest.approx((0.5 + 0.5 * more) * whole.canopy_volume_m3)
        assert whole.height_p95_m - told.height_p95_m == pytest.approx(0.05 * (more - 1.0) * 0.06, abs=0.0005)
        assert told.canopy_volume_error_m3 > whole.canopy_volume_error_m3
        assert told.cover_error_percent == pytest.approx(10.0 * np.sqrt(0.4 * 0.6), rel=0.02)
        assert unsure.cover_error_percent == pytest.approx(15.0, rel=0.02)
        assert set(told.unknown) - COUNTS == {"height_m", "lai"}
        assert set(lost.unknown) - COUNTS == OF_HEIGHT | {"lai"}
        assert "higher than 0.1 m" in alone.unknown["cover_percent"]

    def test_of_low_plants_gaps_tell_the_cover_where_the_cloud_tells_it_worse(self) -> None:
        outline = replace(OF_FLIGHT, cover=Cover(0.2, 0.12))
        still = found(leaf(side=0.3, count=180_000))
        swaying = replace(still, scatter_px=float(np.hypot(STILL_SCATTER_PX, 20.0)))
        assert traits(still, outline) == traits(still, OF_FLIGHT)
        assert traits(swaying, outline).cover_percent == pytest.approx(20.0)

    def test_tops_are_less_sure_where_all_photographs_of_a_flight_look_aside(self) -> None:
        aside = found(leaf(side=0.3, count=180_000))
        one = {next(iter(aside.sparse.poses)): Pose.from_yaw_pitch((0.0, 0.0, 2.0), 0.0, -90.0)}
        down = replace(aside, sparse=replace(aside.sparse, poses=aside.sparse.poses | one))
        less, sure = (traits(result, OF_FLIGHT) for result in (aside, down))
        assert less.height_p99_error_m > sure.height_p99_error_m
        assert less.height_p95_error_m == pytest.approx(sure.height_p95_error_m, rel=0.02)

    def test_an_area_known_worse_than_its_own_size_is_not_given(self) -> None:
        result = found()
        told = traits(replace(result, scatter_px=0.12 / result.pixel_m))
        assert set(told.unknown) - COUNTS == {"cover_percent", "covered_area_m2", "canopy_volume_m3", "lai"}
        assert told.unknown["cover_percent"].startswith("its error would be")
        assert told.height_m is not None

    def test_no_trait_depends_on_how_far_beyond_the_plants_the_plot_reaches(self) -> None:
        tight, wide = (
            traits(found(), PlotOutline(rectangle((-side, -side), (side, side)))).model_dump(exclude={"unknown"})
            for side in (0.12, 0.25)
        )
        for name in ("height_m", "height_p95_m", "height_p99_m", "covered_area_m2", "canopy_volume_m3"):
            assert tight[name] == wide[name]
        for name in ("cover_percent", "lai", "cover_error_percent"):  # shares of the plot
            assert tight[name] * 0.24**2 == pytest.approx(wide[name] * 0.5**2)

    def test_a_doubtful_scale_is_in_the_errors(self) -> None:
        sure, doubtful = traits(found()), traits(found(rms_m=0.08))
        assert doubtful.height_error_m > 1.005 * sure.height_error_m
        assert doubtful.canopy_volume_error_m3 / sure.canopy_volume_error_m3 > 2

    def test_a_doubtful_ground_is_in_heights_and_volume_alone(self) -> None:
        sure, doubtful = traits(found()), traits(found(ground_sigma_m=0.01))
        assert doubtful.height_error_m == pytest.approx(np.hypot(HEIGHT_ERROR_M, 0.01645), rel=0.01)
        assert doubtful.height_error_below_m == pytest.approx(doubtful.height_error_m, rel=0.01)
        of_ground = np.sqrt(doubtful.canopy_volume_error_m3**2 - sure.canopy_volume_error_m3**2)
        assert of_ground == pytest.approx(0.01645 * sure.covered_area_m2, rel=0.01)
        assert doubtful.cover_error_percent == sure.cover_error_percent


class TestRefusals:
    def test_without_an_outline_there_is_no_cover_but_an_area(self) -> None:
        told = traits(found(), PlotOutline())
        assert set(told.unknown) == {"cover_percent", "lai", *COUNTS}
        assert "--bounds" in told.unknown["cover_percent"]
        assert told.cover_percent is None
        assert told.covered_area_m2 is not None
        assert told.plot_area_m2 is None

    @pytest.mark.parametrize(
        ("frame", "findings", "why"),
        [
            (None, (), ""),
            ({"rms_m": 0.5}, (), "the scale is known to"),
            ({"ground": None}, (), "no ground"),
            ({}, (Finding("p", "few-plant-points", "few"),), "few"),
        ],
    )
    def test_without_a_sound_scale_ground_or_plants_there_is_nothing(self, frame, findings, why) -> None:
        result = reconstruction(metric=False) if frame is None else found(**frame)
        told = traits(replace(result, sparse=replace(result.sparse, findings=(*result.sparse.findings, *findings))))
        assert set(told.unknown) == set(TRAITS)
        assert why in told.unknown["height_m"]
        assert why in told.unknown["covered_area_m2"]

    @pytest.mark.parametrize("code", ["height-undetermined", "volume-cuts-plants", "steep-ground"])
    def test_findings_that_forbid_heights(self, code: str) -> None:
        result = found()
        result = replace(result, sparse=replace(result.sparse, findings=(Finding("p", code, "what is wrong"),)))
        told = traits(result)
        wrong = {trait for trait, why in told.unknown.items() if why == "what is wrong"}
        assert wrong == OF_HEIGHT
        assert told.covered_area_m2 is not None

    def test_ground_too_doubtful_for_so_low_plants(self) -> None:
        told = traits(found(ground_sigma_m=0.02))
        assert set(told.unknown) == {*OF_HEIGHT, *COUNTS}
        assert "± 0.03 m only" in told.unknown["height_m"]

    def test_a_plot_that_is_not_wholly_in_the_pictures(self) -> None:
        told = traits(found(), PlotOutline(rectangle((-4.0, -4.0), (4.0, 4.0))))
        assert set(told.unknown) == set(TRAITS) - {"height_m"}
        assert "% of the plot is in the picture" in told.unknown["cover_percent"]
        assert told.height_m is not None

    def test_leaves_that_hide_one_another(self) -> None:
        layers = [leaf(z, 0.4, 60_000).points for z in np.linspace(0.05, 0.25, 5)]
        told = traits(found(Cloud(np.concatenate(layers))))
        assert set(told.unknown) == {"lai", *COUNTS}
        assert "leaves hide one another" in told.unknown["lai"]

    def test_photographs_too_far_apart_to_be_matched(self) -> None:
        result = found()
        names = list(result.sparse.poses)
        far = {name: result.sparse.poses[names[k % 2 * 3]] for k, name in enumerate(names)}  # 135° apart
        told = traits(replace(result, sparse=replace(result.sparse, poses=far)))
        assert set(told.unknown) == set(TRAITS)
        assert "two others near enough" in told.unknown["cover_percent"]

    def test_plants_higher_than_the_pictures(self) -> None:
        """What was reconstructed ends where the pictures do: the plants may go on."""
        told = traits(found(leaf(0.85, 0.6)), replace(OF_FLIGHT, of_flight=False))
        assert set(told.unknown) >= OF_HEIGHT
        assert "the pictures end" in told.unknown["height_m"]


def test_seen_by_two() -> None:
    sparse = reconstruction().sparse
    assert seen_share(sparse, np.zeros((1, 3))) == 1.0
    assert seen_share(sparse, np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 50.0]])) == 0.5


def test_the_outline_is_that_of_the_bounds() -> None:
    bounds = Volume((-1.0, -2.0, 0.0), (1.0, 2.0, 1.0))
    given = {"bounds": {"lower": [0.0, 0.0, 0.0], "upper": [3.0, 1.0, 2.0]}}
    assert outline_of(ReconstructionSettings(bounds=bounds), given).corners == rectangle((-1.0, -2.0), (1.0, 2.0))
    assert outline_of(SETTINGS, given).corners == rectangle((0.0, 0.0), (3.0, 1.0))
    assert outline_of(SETTINGS, {"bounds": None}).corners is None
