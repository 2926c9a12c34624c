"""Conventions of recorded angles, told by orientations that were found without them."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from fieldkit.captures.model import Capture, Photo
from fieldkit.geometry import Pose
from fieldkit.geometry.pose import rotation_angle_deg, rotation_from_vector
from fieldkit.geometry.priors import PosePrior
from fieldkit.reconstruction.mapping.angle_conventions import Convention, find_convention, look_odd

BOUND_DEG = 27.0
NADIR = [(43.0 + 3 * (k % 3) + 180 * (k // 4), -89.9, 0.0) for k in range(8)]
OBLIQUE = [(45.0 * k, -50.0 + k, 0.0) for k in range(8)]
MIXED_VIEWS = NADIR[:4] + OBLIQUE[:4]

Angles = tuple[float, float, float]
Write = Callable[[Angles], Angles]


def rotation(angles: Angles) -> np.ndarray:
    return np.array(Pose.from_yaw_pitch(np.zeros(3), *angles).rotation)


def capture(recorded: list[Angles], flight: list[float | None] | None = None) -> Capture:
    names = [f"{k}.jpg" for k in range(len(recorded))]
    flight = flight or [None] * len(names)
    photos = [Photo(Path(n), n, 100, 100, "JPEG", n, flight_yaw_deg=yaw) for n, yaw in zip(names, flight, strict=True)]
    priors = {n: PosePrior().with_angles(a) for n, a in zip(names, recorded, strict=True)}
    return Capture(Path(), Path(), tuple(photos), (), (), priors)


def found(true: list[Angles], noise_deg: float = 4.0) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(0)
    return {
        f"{k}.jpg": rotation_from_vector(np.radians(rng.normal(0, noise_deg / 1.7, 3))) @ rotation(angles)
        for k, angles in enumerate(true)
    }


def told(true: list[Angles], recorded: list[Angles], **more: list[float | None]) -> Convention:
    convention = find_convention(capture(recorded, **more), found(true), np.eye(3), BOUND_DEG)
    assert convention is not None
    return convention


def from_nadir(angles: Angles) -> Angles:
    """As Metashape and Pix4D write them: pitch 0 straight down."""
    return angles[0], angles[1] + 90.0, angles[2]


@pytest.mark.parametrize("true", [NADIR, OBLIQUE, MIXED_VIEWS])
@pytest.mark.parametrize(
    ("write", "name"),
    [
        (lambda a: a, ""),
        (from_nadir, "pitch 0 is straight down"),
        (lambda a: (a[0], -a[1], a[2]), "pitch counts downwards"),
        (lambda a: (a[0] + 180.0, a[1], a[2]), "yaw is off by 180°"),
        (lambda a: (-a[0], a[1], a[2]), "yaw counts anticlockwise"),
        (lambda a: (90.0 - a[0], a[1] + 90.0, a[2]), None),
    ],
)
def test_all_photographs_together_tell_the_convention(true: list[Angles], write: Write, name: str | None) -> None:
    convention = told(true, [write(angles) for angles in true])
    assert convention.kind == ("recorded" if name == "" else "other")
    if name is not None and true is not NADIR:
        assert convention.name == name
    for k, angles in enumerate(true):
        assert rotation_angle_deg(convention.rotations[f"{k}.jpg"], rotation(angles)) < BOUND_DEG


def test_the_aircrafts_heading_is_tried() -> None:
    aircraft: list[float | None] = [37.0 * k for k in range(8)]
    true = [(37.0 * k, -50.0 - k, 0.0) for k in range(8)]
    convention = told(true, [(200.0 - 70.0 * k, a[1], a[2]) for k, a in enumerate(true)], flight=aircraft)
    assert convention.name == "the heading is the aircraft's"
    from_nose = [(20.0 * (-1) ** k, a[1], a[2]) for k, a in enumerate(true)]
    true = [((aircraft[k] or 0.0) + a[0], a[1], a[2]) for k, a in enumerate(from_nose)]
    assert told(true, from_nose, flight=aircraft).name == "yaw counts from the aircraft's nose"


@pytest.mark.parametrize("others", [3, 4, 5])
def test_a_mixture_is_none(others: int) -> None:
    recorded = [from_nadir(a) if k < others else a for k, a in enumerate(OBLIQUE)]
    convention = told(OBLIQUE, recorded)
    assert (convention.kind, convention.name) == ("mixed", "pitch 0 is straight down")
    assert convention.agreeing == tuple(f"{k}.jpg" for k in range(others, 8))


def test_a_single_wrong_one_changes_nothing() -> None:
    recorded = [(a[0] + 180.0, a[1], a[2]) if k == 2 else a for k, a in enumerate(OBLIQUE)]
    convention = told(OBLIQUE, recorded)
    assert (convention.kind, len(convention.agreeing)) == ("recorded", 7)


def test_the_frame_may_be_turned() -> None:
    turn = rotation_from_vector((0.0, 0.0, np.radians(70.0)))
    turned = {name: matrix @ turn.T for name, matrix in found(OBLIQUE).items()}
    convention = find_convention(capture([from_nadir(a) for a in OBLIQUE]), turned, turn, BOUND_DEG)
    assert convention.name == "pitch 0 is straight down"
    assert rotation_angle_deg(convention.rotations["3.jpg"], turned["3.jpg"]) < BOUND_DEG


@pytest.mark.parametrize(
    ("angles", "odd"),
    [
        (NADIR, False),
        (OBLIQUE, False),
        ([from_nadir(a) for a in NADIR], True),
        ([from_nadir(a) for a in OBLIQUE], True),
        ([(a[0], -a[1], a[2]) for a in OBLIQUE], True),
        ([(a[0], a[1], 180.0) for a in OBLIQUE], True),
        (NADIR[:6] + [from_nadir(a) for a in NADIR[6:]], True),
        ([(a[0], -25.0, 0.0) for a in OBLIQUE], False),
    ],
)
def test_what_looks_odd(angles: list[Angles], odd: bool) -> None:
    assert look_odd({str(k): rotation(each) for k, each in enumerate(angles)}) is odd
