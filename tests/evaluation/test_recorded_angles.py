"""Recorded angles read as orientations that were found without them say."""

from dataclasses import replace

import numpy as np
import pytest

from fieldkit.evaluation.recorded_angles import read_angles, without_angles
from fieldkit.geometry.pose import rotation_angle_deg, rotation_from_vector
from tests.reconstruction.mapping.test_angle_conventions import (
    MIXED_VIEWS,
    NADIR,
    OBLIQUE,
    Angles,
    capture,
    found,
    rotation,
)

BOUND_DEG = 27.0
EAST = rotation_from_vector((0.0, 0.0, np.radians(35.0)))


def from_nadir(angles: Angles) -> Angles:
    return angles[0], angles[1] + 90.0, angles[2]


def read_back(recorded: list[Angles], true: list[Angles], orientations: list[int] | None = None) -> list[float | None]:
    """How far each photograph's angles, as read, are from the true ones; None where they are not used."""
    given = capture(recorded)
    if orientations is not None:
        photos = tuple(replace(p, orientation=o) for p, o in zip(given.photos, orientations, strict=True))
        given = replace(given, photos=photos)
    told = {name: rotated @ EAST.T for name, rotated in found(true, 2.0).items()}
    reading = read_angles(given, told, EAST, BOUND_DEG)
    apart: list[float | None] = []
    for k, angles in enumerate(true):
        prior = reading.capture.priors[f"{k}.jpg"]
        if prior.yaw_deg is None or prior.pitch_deg is None:
            apart.append(None)
        else:
            read = (prior.yaw_deg, prior.pitch_deg, prior.roll_deg or 0.0)
            apart.append(rotation_angle_deg(rotation(read), rotation(angles)))
    return apart


@pytest.mark.parametrize("true", [NADIR, OBLIQUE, MIXED_VIEWS])
@pytest.mark.parametrize(
    "write",
    [
        lambda a: a,
        from_nadir,
        lambda a: (a[0], a[1], a[2] - 90.0),
    ],
)
def test_all_are_read_alike(true: list[Angles], write: object) -> None:
    apart = read_back([write(angles) for angles in true], true)
    assert max(a for a in apart if a is not None) < 1.0
    assert None not in apart


def test_orientations_of_exif_hold_for_photographs_nothing_tells_of() -> None:
    turned = [(a[0], a[1], 180.0 if k % 2 else 0.0) for k, a in enumerate(OBLIQUE)]
    given = capture(turned)
    photos = tuple(replace(p, orientation=3 if k % 2 else 1) for k, p in enumerate(given.photos))
    told = {name: r for name, r in found(OBLIQUE, 2.0).items() if name not in ("6.jpg", "7.jpg")}
    reading = read_angles(replace(given, photos=photos), told, np.eye(3), BOUND_DEG)
    rolls = [(p.roll_deg or 0.0) % 360.0 for p in reading.capture.priors.values()]
    assert rolls == [0.0] * 8


def test_half_and_half_is_a_mixture() -> None:
    recorded = [from_nadir(a) if k < 4 else a for k, a in enumerate(OBLIQUE)]
    apart = read_back(recorded, OBLIQUE)
    assert apart[:4] == [None] * 4
    assert None not in apart[4:]


def test_where_no_convention_fits_none_is_used() -> None:
    rng = np.random.default_rng(2)
    recorded = [(float(rng.uniform(0, 360)), float(rng.uniform(-90, 20)), 0.0) for _ in OBLIQUE]
    assert read_back(recorded, OBLIQUE) == [None] * 8


def test_two_photographs_tell_nothing() -> None:
    given = capture([from_nadir(a) for a in OBLIQUE])
    told = dict(list(found(OBLIQUE).items())[:2])
    assert read_angles(given, told, np.eye(3), BOUND_DEG).capture is given
    assert all(prior.yaw_deg is None for prior in without_angles(given).priors.values())
