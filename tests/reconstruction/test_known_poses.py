from pathlib import Path

import numpy as np
import pytest

from fieldkit.captures.model import Capture
from fieldkit.errors import ReconstructionError
from fieldkit.geometry import Pose, Similarity
from fieldkit.geometry.geodesy import LocalFrame
from fieldkit.geometry.pose import rotation_angle_deg, rotation_from_vector
from fieldkit.geometry.priors import PosePrior, SourceFrame
from fieldkit.reconstruction.known_poses import known_poses


def _capture(priors: dict[str, PosePrior], source: str | None, origin: LocalFrame | None = None) -> Capture:
    here = Path("plot")
    return Capture(here, here, (), (), (), priors, source, origin)


def _priors(offset: float = 0.0) -> dict[str, PosePrior]:
    places = {k: PosePrior(np.array([offset + k, 2.0 * k, 1.0]), 0.01, angle_sigma_deg=2.0) for k in range(4)}
    return {f"{k}.jpg": prior.with_angles((30.0 * k, -40.0, None)) for k, prior in places.items()}


def test_small_coordinates_stay_and_large_ones_are_shifted() -> None:
    near, far = known_poses(_capture(_priors(), "poses.csv")), known_poses(_capture(_priors(500_000.0), "poses.csv"))
    assert near.by_name["2.jpg"].position == pytest.approx([2.0, 4.0, 1.0])
    moved = far.by_name["2.jpg"].position
    assert moved is not None
    assert np.abs(moved).max() < 10.0
    back = far.frame.from_source.inverse().apply(moved)
    assert back == pytest.approx([500_002.0, 4.0, 1.0])


def test_a_reference_s_frame_takes_positions_and_orientations_along() -> None:
    turn = Similarity(1.0, rotation_from_vector([0.0, 0.0, np.pi / 2]), np.array([1.0, 0.0, -1.0]))
    within = SourceFrame("poses.csv", None, turn)
    known = known_poses(_capture(_priors(), "poses.csv"), within)
    assert known.frame is within
    wanted = turn.apply_pose(Pose.from_yaw_pitch([1.0, 2.0, 1.0], 30.0, -40.0))
    found = known.by_name["1.jpg"]
    assert found.position == pytest.approx(wanted.center)
    assert found.rotation is not None
    assert rotation_angle_deg(found.rotation, wanted.rotation) < 1e-6


def test_another_origin_on_earth_is_taken_into_account() -> None:
    own, other = LocalFrame(50.0, 6.0, 100.0, "ellipsoid"), LocalFrame(50.001, 6.0, 100.0, "ellipsoid")
    within = SourceFrame("EXIF GPS", other, Similarity.identity())
    known = known_poses(_capture(_priors(), "EXIF GPS", own), within)
    position = known.by_name["0.jpg"].position
    assert position[1] == pytest.approx(-111.2, abs=0.2)


def test_frames_that_are_not_related_are_refused() -> None:
    within = SourceFrame("EXIF GPS", LocalFrame(50.0, 6.0), Similarity.identity())
    with pytest.raises(ReconstructionError, match=r"poses\.csv.*EXIF GPS"):
        known_poses(_capture(_priors(), "poses.csv"), within)


def test_heights_above_sea_level_and_above_the_ellipsoid_are_not_mixed() -> None:
    sea, ellipsoid, unknown = (LocalFrame(50.0, 6.0, 100.0, datum) for datum in ("sea level", "ellipsoid", "unknown"))
    within = SourceFrame("EXIF GPS", ellipsoid, Similarity.identity())
    with pytest.raises(
        ReconstructionError, match="flight log are above sea level, the reference's above the ellipsoid"
    ):
        known_poses(_capture(_priors(), "flight log", sea), within)
    assert known_poses(_capture(_priors(), "flight log", unknown), within).frame is within
