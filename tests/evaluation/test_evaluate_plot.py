"""A cloud moved onto a reference: scaled as far as its photographs' positions leave its scale in doubt."""

from dataclasses import replace

import numpy as np
import pytest

from fieldkit.clouds import Cloud, Volume, score
from fieldkit.evaluation.evaluate_plot import _other_plants, _refined, scale_doubt
from fieldkit.reconstruction.result import Reconstruction
from fieldkit.results.finding import Finding
from tests.evaluation.examples import leaves, reconstruction


def found_with(cloud: Cloud, rms_m: float | None) -> Reconstruction:
    example = reconstruction(cloud=cloud)
    sparse = replace(example.sparse, frame=replace(example.sparse.frame, rms_m=rms_m, ground=None))
    return replace(example, sparse=sparse, volume=Volume((-2.0, -2.0, -1.0), (2.0, 2.0, 2.0)))


def test_the_doubt_goes_with_the_positions_errors_and_the_base() -> None:
    found = found_with(leaves(0, noise_m=0.0), 0.02).sparse
    centers = np.array([pose.center for pose in found.poses.values()])
    spread = np.sqrt(((centers - centers.mean(axis=0)) ** 2).sum())
    assert scale_doubt(found) == pytest.approx(0.02 / spread)
    wider = {name: replace(pose, center=2.0 * pose.center) for name, pose in found.poses.items()}
    assert scale_doubt(replace(found, poses=wider)) == pytest.approx(0.01 / spread)
    assert scale_doubt(replace(found, frame=replace(found.frame, rms_m=None))) == 0.0
    assert scale_doubt(replace(found, poses=dict(list(found.poses.items())[:2]))) == 0.0
    # A plot that three of a flight's photographs show has the scale of the flight.
    assert scale_doubt(found.of(list(found.poses)[:3])) == scale_doubt(found)


@pytest.mark.parametrize(("scale", "rms_m", "scaled"), [(1.01, 0.03, True), (1.01, 0.003, False), (1.01, None, False)])
def test_plants_of_another_size_are_not_scaled_away(scale: float, rms_m: float | None, scaled: bool) -> None:
    reference = leaves(0, noise_m=0.0)
    middle = reference.points.mean(axis=0)
    cloud = Cloud(middle + scale * (reference.points - middle) + [0.004, -0.003, 0.002], reference.colors)
    moved, correction, _ = _refined(found_with(cloud, rms_m), reference, "plot", of_reference=True)
    assert correction.scale == pytest.approx(1.0 / scale if scaled else 1.0, abs=0.002)
    error = np.linalg.norm(moved.points - reference.points, axis=1).mean()
    assert (error < 0.001) == scaled


def test_other_plants_are_not_scored_without_a_word() -> None:
    reference = leaves(0, noise_m=0.0)
    sparse, moved = leaves(0, noise_m=0.01, points=300), Cloud(reference.points[:, [1, 0, 2]] + [0.2, 0.0, 0.1])
    firm = reconstruction().sparse
    loose = replace(firm, images=tuple(image.model_copy(update={"right": None}) for image in firm.images))
    lagging = replace(firm, findings=(Finding("plot", "positions-lag", "all lie behind"),))
    assert _other_plants("plot", score(reference, sparse), reference, firm) == []
    for capture, code in ((firm, "other-plants"), (loose, "far-from-reference"), (lagging, "far-from-reference")):
        (finding,) = _other_plants("plot", score(reference, moved), reference, capture)
        assert finding.code == code
    far, correction, findings = _refined(
        found_with(Cloud(reference.points + np.array([5.0, 0.0, 0.0])), None), reference, "plot", of_reference=True
    )
    assert [each.code for each in findings] == ["refinement-not-converged"]
    assert "0 % of the cloud is within" in findings[0].message
    assert correction is None  # it is scored where it lies
    np.testing.assert_array_equal(far.points, reference.points + np.array([5.0, 0.0, 0.0]))
