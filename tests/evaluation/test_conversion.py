"""Reports made from a Reconstruction."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fieldkit.clouds import score
from fieldkit.errors import ReconstructionError
from fieldkit.evaluation.conversion import (
    failed_plot,
    known_centers,
    plot_evaluation,
    points_per_voxel,
    reference_report,
)
from fieldkit.geometry.geodesy import LocalFrame
from fieldkit.reconstruction.settings import ReconstructionSettings
from fieldkit.results.evaluation import distance_key
from fieldkit.results.traits import TRAITS
from tests.evaluation.examples import INTRINSICS, ORIGIN, plant_cloud, reconstruction, ring

SETTINGS = ReconstructionSettings()


class TestReference:
    def test_counts_and_figures(self) -> None:
        result = reconstruction()
        report = reference_report(result, SETTINGS)
        assert (report.images, report.registered, report.right, report.models) == (8, 7, 6, (7,))
        assert (report.method, report.metric_source, report.metric) == ("prior", "geo.txt", True)
        assert report.source == "plot 7"
        assert report.points == len(result.plants)
        assert report.scene_points == len(result.scene)
        assert report.reprojection_px == pytest.approx(0.5)
        assert report.track_length == pytest.approx(report.observations / result.sparse.model.num_points3D())
        assert report.features_per_image == pytest.approx(1035)
        assert [stage.cached for stage in report.times] == [2, 0]

    def test_images_and_cameras(self) -> None:
        report = reference_report(reconstruction(), SETTINGS)
        first, wrong, out = report.image_reports[0], report.image_reports[6], report.image_reports[7]
        assert first.center_m == pytest.approx((0.6, 0, 0.45))
        assert first.yaw_deg == pytest.approx(-90)
        assert first.pitch_deg == pytest.approx(-np.degrees(np.arctan2(0.25, 0.6)))
        assert (wrong.registered, wrong.right) == (True, False)
        assert wrong.center_m is not None
        assert (out.registered, out.right, out.reason, out.center_m) == (False, None, "no pair verified", None)
        assert out.known_center_m == pytest.approx(ring(8)["IMG_0008.jpg"].center)
        (camera,) = report.cameras
        assert (camera.params, camera.source, camera.photos) == (INTRINSICS.params, "camera.toml", 6)

    def test_bursts_say_how_far_leaves_swayed(self) -> None:
        example = reconstruction()
        capture = example.sparse.capture
        first = capture.photos[0]
        photos = (dataclasses.replace(first, burst=(first, capture.photos[7]), sway_px=2.0), *capture.photos[1:])
        sparse = dataclasses.replace(example.sparse, capture=dataclasses.replace(capture, photos=photos))
        moved = dataclasses.replace(example, sparse=sparse)
        report = reference_report(moved, SETTINGS)
        away = np.linalg.norm(np.array(report.image_reports[0].center_m) - example.volume.center)
        assert report.image_reports[0].burst == ("IMG_0001.jpg", "IMG_0008.jpg")
        assert report.sway_m == report.image_reports[0].sway_m == pytest.approx(2.0 * away / INTRINSICS.fx)
        assert "leaves swayed by 0.9" in next(f.message for f in report.findings if f.code == "leaves-swayed")
        assert reference_report(example, SETTINGS).sway_m is None

    def test_known_positions_in_another_georeference(self) -> None:
        """A capture's own origin need not be the reference's."""
        result = reconstruction()
        sparse = result.sparse
        centers = known_centers(sparse)
        moved = LocalFrame(ORIGIN.latitude_deg + 1e-4, ORIGIN.longitude_deg - 1e-4, 60.0, ORIGIN.datum)
        priors = {
            name: dataclasses.replace(prior, position=moved.to_local(*ORIGIN.to_geodetic(prior.position))[0])
            for name, prior in sparse.capture.priors.items()
        }
        capture = dataclasses.replace(sparse.capture, origin=moved, priors=priors)
        for name, center in known_centers(dataclasses.replace(sparse, capture=capture)).items():
            assert center == pytest.approx(centers[name], abs=1e-6)
        other = dataclasses.replace(sparse.capture, metric_source="EXIF GPS")
        assert known_centers(dataclasses.replace(sparse, capture=other)) == {}


class TestPlot:
    def test_keys_the_design_promises(self) -> None:
        reference = plant_cloud(seed=1)
        result = reconstruction()
        plot = plot_evaluation("plot 7", result, SETTINGS, score=score(reference, result.plants))
        found = plot.model_dump(mode="json")
        for key in ("images", "registered", "pose_rms_m", "chamfer_m", "accuracy_m", "completeness_m"):
            assert found[key] is not None
        assert list(found["f_score"]) == list(found["precision"]) == ["0.002", "0.005", "0.010", "0.020"]
        assert found["chamfer_m"] == pytest.approx(found["accuracy_m"] + found["completeness_m"])
        assert found["unregistered"] == {"no pair verified": 1, "wrong pose": 1}

    def test_failed(self) -> None:
        error = ReconstructionError("no model", path="plot 7", remedy="Take more photographs.")
        plot = failed_plot("plot 7", error, photographs=8)
        assert plot.error.model_dump() == {
            "type": "ReconstructionError",
            "message": "plot 7: no model",
            "remedy": "Take more photographs.",
        }
        assert (plot.images, plot.registered, plot.chamfer_m) == (8, 0, None)


class TestPointsPerVoxel:
    def test_a_grid(self) -> None:
        grid = np.stack(np.meshgrid(*[np.arange(10) * 0.1 + 0.01] * 3), axis=-1).reshape(-1, 3)
        assert points_per_voxel(grid, 0.2) == pytest.approx(8)
        assert points_per_voxel(grid, 100.0) == 1000
        assert points_per_voxel(grid[:0], 0.1) is None


@given(st.floats(1e-5, 10))
def test_distance_keys_lose_nothing(distance: float) -> None:
    key = distance_key(distance)
    assert float(key) == distance
    assert len(key.partition(".")[2]) >= 3


@pytest.mark.parametrize("distance", [0.0, -1.0, float("nan"), float("inf")])
def test_no_distance(distance: float) -> None:
    with pytest.raises(ValueError, match="positive"):
        distance_key(distance)


class TestPlants:
    def test_neither_without_a_scale(self) -> None:
        plot = plot_evaluation("p", reconstruction(metric=False), SETTINGS, score=None)
        assert set(plot.traits.unknown) == set(TRAITS)
        assert "scale" in plot.traits.unknown["height_m"]
        assert plot.prediction.chamfer_m is None
        assert "scale" in plot.prediction.reason
