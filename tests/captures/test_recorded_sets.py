"""The recorded image sets: real EXIF, real quality."""

from pathlib import Path

import numpy as np
import pytest

from fieldkit.captures import Capture, read_capture
from fieldkit.geometry.geodesy import utm_epsg_of


@pytest.fixture(scope="module", params=["arabidopsis_rig", "basil_rig", "drone_trees"])
def recorded(request: pytest.FixtureRequest, data_folder: Path) -> Capture:
    return read_capture(data_folder / request.param)


def test_rigs(data_folder: Path) -> None:
    for name, count, size in (("arabidopsis_rig", 60, (1440, 1080)), ("basil_rig", 79, (2304, 1296))):
        capture = read_capture(data_folder / name)
        assert len(capture.photos) == len(capture.priors) == count
        assert {(photo.width, photo.height) for photo in capture.photos} == {size}
        assert (capture.metric_source, capture.origin, capture.findings) == ("poses.csv", None, ())
        assert [group.source for group in capture.groups] == ["self-calibrated"]
        assert {prior.position_sigma_m for prior in capture.priors.values()} <= {0.004, 0.005}


def test_drone(data_folder: Path) -> None:
    capture = read_capture(data_folder / "drone_trees")
    assert len(capture.photos) == 18
    assert (capture.metric_source, utm_epsg_of(capture.origin), capture.height_source) == (
        "EXIF GPS",
        32615,
        "relative altitude",
    )
    assert capture.findings == ()
    (group,) = capture.groups
    assert (group.source, group.fixed) == ("EXIF", False)
    # 20 mm equivalent on a 4:3 sensor, cropped to 16:9: 924 px at 1600 px width.
    assert group.intrinsics.fx * 1600 / 2000 == pytest.approx(924.5, abs=1)
    photo = capture.photos[0]
    assert (photo.make, photo.model, photo.pitch_deg) == ("DJI", "FC300S", -89.9)
    assert photo.geotag.relative_altitude_m == pytest.approx(39.8)
    positions = np.array([prior.position for prior in capture.priors.values()], dtype=float)
    np.testing.assert_allclose(np.ptp(positions[:, :2], axis=0), [84.3, 84.1], atol=0.1)
    assert np.ptp(positions[:, 2]) < 1.0
