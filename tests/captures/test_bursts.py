"""Which photographs are a burst, and what a burst counts as."""

from dataclasses import replace
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import pytest

from fieldkit.captures import CameraGroup, Capture, Photo
from fieldkit.captures.bursts import by_station, find_bursts
from fieldkit.geometry.priors import PosePrior

START = datetime(2026, 6, 18, 10, 30, 0, 120_000)


def capture(*shots: tuple[float, float], sigma: float = 0.02, whole: bool = False) -> Capture:
    """Photographs p0.jpg … at seconds and metres east, looking north."""
    photos, priors = [], {}
    for i, (second, east) in enumerate(shots):
        taken = START + timedelta(seconds=second)
        taken = taken.replace(microsecond=0) if whole else taken
        photos.append(Photo(Path(f"p{i}.jpg"), f"p{i}.jpg", 200, 150, "JPEG", f"{i:064x}", captured_at=taken))
        prior = PosePrior(np.array([east, 0.0, 2.0]), sigma, source="EXIF GPS")
        priors[f"p{i}.jpg"] = prior.with_angles((359.0 if i % 2 else 1.0, -40.0, None))
    group = CameraGroup("camera", tuple(photo.name for photo in photos), None, "self-calibrated", False)
    return Capture(Path("f"), Path("f"), tuple(photos), (group,), (), priors, "EXIF GPS")


def names(found: Capture) -> list[str]:
    return ["".join(photo.name[1] for photo in burst) for burst in find_bursts(found)]


def test_photographs_within_seconds_from_one_place_are_a_burst() -> None:
    hovering = [(0.0, 0.0), (0.7, 0.01), (1.4, -0.02), (6.4, 1.5), (7.1, 1.51), (12.0, 3.0)]
    assert names(capture(*hovering)) == ["012", "34"]


def test_a_next_station_within_seconds_is_another_one() -> None:
    assert names(capture((0.0, 0.0), (0.7, 0.0), (2.0, 0.8), (2.7, 0.8))) == ["01", "23"]


@pytest.mark.parametrize("speed", [2.0, 0.4, 0.12, 0.06])
def test_who_flies_past_takes_no_burst(speed: float) -> None:
    assert names(capture(*((0.7 * i, 0.7 * speed * i) for i in range(9)))) == []


def test_a_shutter_pressed_twice_is_no_burst() -> None:
    assert names(capture((0.0, 0.0), (0.7, 0.0), (9.0, 2.0), (18.0, 4.0))) == []


def test_clocks_of_whole_seconds_and_receivers_without_corrections_are_allowed_for() -> None:
    assert names(capture((0.0, 0.0), (3.6, 0.0))) == []
    assert names(capture((0.0, 0.0), (3.6, 0.0), whole=True)) == ["01"]
    assert names(capture((0.0, 0.0), (0.7, 0.3), sigma=3.0)) == ["01"]


def test_without_a_time_a_place_or_the_same_camera_and_direction_there_is_none() -> None:
    found = capture((0.0, 0.0), (0.7, 0.0))
    first, second = found.photos
    assert names(replace(found, photos=(first, replace(second, captured_at=None)))) == []
    assert names(replace(found, priors={"p0.jpg": found.priors["p0.jpg"]})) == []
    turned = found.priors["p1.jpg"].with_angles((40.0, -40.0, None))
    assert names(replace(found, priors={**found.priors, "p1.jpg": turned})) == []
    (group,) = found.groups
    apart = (replace(group, photos=("p0.jpg",)), replace(group, key="other", photos=("p1.jpg",)))
    assert names(replace(found, groups=apart)) == []


def test_a_burst_counts_as_one_photograph_at_its_mean_pose() -> None:
    found = by_station(capture((0.0, 0.0), (0.7, 0.03), (1.4, 0.03), (9.0, 2.0)))
    assert found.names == found.groups[0].photos == tuple(found.priors) == ("p0.jpg", "p3.jpg")
    assert [photo.name for photo in found.photos[0].burst] == ["p0.jpg", "p1.jpg", "p2.jpg"]
    assert found.photos[1].burst == ()
    prior = found.priors["p0.jpg"]
    assert prior.position is not None
    np.testing.assert_allclose(prior.position, np.array([0.02, 0.0, 2.0]))
    assert prior.yaw_deg == pytest.approx(1.0 - 2.0 / 3.0)  # 1°, 359° and 1°
    assert (prior.pitch_deg, prior.position_sigma_m) == (-40.0, 0.02)
    assert [f.code for f in found.findings] == ["bursts"]
    assert "3 photographs" in found.findings[0].message
