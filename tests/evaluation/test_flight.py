"""A plot's part of a mapped flight: its photographs, its volume and its picture."""

import pickle
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from benchmarks.trial_flights import Survey, fly
from fieldkit.cache import StageCache
from fieldkit.clouds import Cloud, Volume
from fieldkit.evaluation.flight import (
    MOST_VIEWS,
    evaluate_flight,
    motion_onto,
    plot_views,
    plot_volume,
    row_outlines,
)
from fieldkit.evaluation.plot_photo import plot_photo
from fieldkit.geometry import Intrinsics, Pose, Similarity
from fieldkit.geometry.geodesy import LocalFrame
from fieldkit.geometry.pose import rotation_about_z
from fieldkit.reconstruction.colmap_model import model_points, model_poses
from fieldkit.results.finding import Finding
from fieldkit.results.frame import Plane
from fieldkit.results.traits import TraitsEntry
from fieldkit.runtime.context import Context
from fieldkit.runtime.progress import Advance, Silent
from fieldkit.scenes.renderer import RenderingError
from fieldkit.sites.site import SitePlot
from fieldkit_sim.surveys import Passes
from tests.evaluation.examples import reconstruction

CORNERS = ((1.0, 0.0), (3.0, 0.0), (3.0, 1.5), (1.0, 1.5))


def test_a_part_of_a_flight_says_nothing_of_the_others() -> None:
    whole = replace(
        reconstruction().sparse,
        findings=(
            Finding("notes.txt", "not-an-image", "is a text file", True),
            Finding("IMG_0002.jpg", "blurred", "is blurred"),
            Finding("IMG_0005.jpg", "blurred", "is blurred"),
            Finding("plot 7", "weakly-tied", "hangs together badly"),
        ),
    )
    names = ("IMG_0001.jpg", "IMG_0002.jpg", "IMG_0004.jpg")
    part = whole.of(names)
    assert part.capture.names == tuple(part.poses) == tuple(part.intrinsics) == names
    assert tuple(image.name for image in part.images) == part.capture.groups[0].photos == names
    assert set(part.capture.priors) == set(names)
    assert [finding.subject for finding in part.findings] == ["IMG_0002.jpg", "plot 7"]
    assert part.right == 3
    back = pickle.loads(pickle.dumps(part))  # as workers get it
    poses = model_poses(back.model)
    assert tuple(poses) == names
    np.testing.assert_allclose(poses[names[1]].center, whole.poses[names[1]].center, atol=1e-12)
    points = model_points(whole.model)  # each is seen in all photographs
    np.testing.assert_allclose(np.sort(model_points(back.model), axis=0), np.sort(points, axis=0), atol=1e-12)


def test_a_turned_flight_is_the_same_flight() -> None:
    found = reconstruction().sparse
    motion = Similarity(1.0, rotation_about_z(0.7), np.array([3.0, -1.0, 0.2]))
    turned = found.moved(motion)
    (name, pose), points = next(iter(found.poses.items())), model_points(found.model)
    camera = found.intrinsics[name]
    there = camera.project(turned.poses[name].to_camera(model_points(turned.model)))
    np.testing.assert_allclose(there, camera.project(pose.to_camera(points)), atol=1e-6)
    np.testing.assert_allclose(turned.frame.ground.heights(model_points(turned.model)), points[:, 2], atol=1e-9)
    source = found.frame.plot_from_source.inverse().apply(points)
    np.testing.assert_allclose(turned.frame.plot_from_source.apply(source), motion.apply(points), atol=1e-9)


def test_rows_lie_from_right_to_left_along_the_plots_own_heading() -> None:
    """In a frame whose x points to 120°, a plot headed 90° is turned by 30°."""
    ring = np.array([(0.0, 0.0, 0.0), (4.0, 0.0, 0.0), (4.0, 3.0, 0.0), (0.0, 3.0, 0.0)])
    corners = tuple(map(tuple, (ring @ rotation_about_z(np.radians(30.0)).T)[:, :2].tolist()))
    plot = SitePlot(latitude_deg=0.0, longitude_deg=0.0, length_m=4.0, width_m=3.0, row_spacing_m=0.74)
    rows = row_outlines(corners, plot, 120.0)
    assert len(rows) == 4
    first = np.column_stack([rows[0], np.zeros(4)]) @ rotation_about_z(np.radians(30.0))
    np.testing.assert_allclose((first.min(axis=0)[:2], first.max(axis=0)[:2]), ((0.0, 0.0), (4.0, 0.75)), atol=1e-9)
    assert row_outlines(corners, plot.model_copy(update={"row_spacing_m": None}), 120.0) == ()


class TestVolume:
    GROUND = Plane((-0.03, 0.0, np.sqrt(1.0 - 0.03**2)), 0.0, 0.01, 0.9, 0.03)
    """Rises by 3 % along x."""

    def points(self, high: float) -> np.ndarray:
        rng = np.random.default_rng(3)
        return self.GROUND.above(rng.uniform((0.9, 0.0), (3.2, 1.5), (200, 2))) + np.column_stack(
            [np.zeros((200, 2)), rng.uniform(0.0, high, 200)]
        )

    def test_holds_the_plot_from_below_its_ground_to_above_its_plants(self) -> None:
        beyond = self.points(9.0) + np.array([50.0, 0.0, 0.0])
        volume = plot_volume(CORNERS, np.concatenate([self.points(1.2), beyond]), self.GROUND)
        np.testing.assert_allclose((volume.lower[:2], volume.upper[:2]), ((0.7, -0.3), (3.3, 1.8)))
        assert volume.lower[2] < 0.03 - 0.05
        assert 1.2 + 0.09 < volume.upper[2] < 1.2 + 0.09 + 0.4  # the plot's, not the field's

    def test_where_no_point_tells_the_height_it_is_that_of_the_field(self) -> None:
        beyond = self.points(2.0) + np.array([50.0, 0.0, 1.5])
        assert plot_volume(CORNERS, beyond, self.GROUND).upper[2] > 2.0


@pytest.mark.parametrize(("height_m", "more"), [(8.0, False), (2.5, True)])
def test_near_photographs_that_show_parts_of_a_plot_are_more(height_m: float, more: bool) -> None:
    camera, volume = Intrinsics.pinhole(4000, 3000, 2950.0), Volume((0.7, -0.3, -0.1), (5.3, 1.8, 1.3))
    x, y = np.meshgrid(np.arange(0.0, 6.0, 0.5), np.arange(-1.0, 3.0, 0.5))
    places = [(a, b, height_m) for a, b in zip(x.ravel(), y.ravel(), strict=True)]
    poses = {f"{k:04d}.jpg": Pose.from_yaw_pitch(place, 0.0, -80.0) for k, place in enumerate(places)}
    flight = replace(reconstruction().sparse, poses=poses, intrinsics=dict.fromkeys(poses, camera))
    assert (len(plot_views(flight, volume)) > MOST_VIEWS) == more


def test_the_picture_of_a_plot_is_where_it_is_largest(tmp_path: Path) -> None:
    """A red plot on grey soil, from two heights and from where half of it is out of the picture."""
    found, camera = reconstruction(), Intrinsics.pinhole(400, 300, 300.0)
    poses = {"low.png": (2.0, 0.75, 4.0), "high.png": (2.0, 0.75, 8.0), "half.png": (3.6, 0.75, 2.5)}
    views = {name: Pose.from_yaw_pitch(center, 0.0, -90.0) for name, center in poses.items()}
    photos = []
    for name, pose in views.items():
        image = np.full((300, 400, 3), 90, np.uint8)
        corners = camera.project(pose.to_camera(np.column_stack([CORNERS, np.zeros(4)])))
        cv2.fillConvexPoly(image, corners.astype(np.int32), (0, 0, 200))
        cv2.imwrite(str(tmp_path / name), image)
        photo = found.sparse.capture.photos[0]
        photos.append(replace(photo, path=tmp_path / name, name=name, width=400, height=300))
    sparse = replace(
        found.sparse,
        capture=replace(found.sparse.capture, photos=tuple(photos)),
        poses=views,
        intrinsics=dict.fromkeys(views, camera),
    )
    low = replace(found, sparse=sparse, plants=Cloud(np.array([[2.0, 0.7, 0.05]])))
    picture = cv2.imdecode(np.frombuffer(plot_photo(low, CORNERS), np.uint8), cv2.IMREAD_COLOR)
    assert picture.shape[1] == pytest.approx(2.0 / 4.0 * 300.0 * 1.1, abs=8)
    assert (picture[..., 2] > 150).mean() > 0.75


def test_flights_of_two_days_meet_at_their_places_on_earth() -> None:
    sparse = reconstruction().sparse
    here = LocalFrame(52.2960, 10.4370, 81.0, "ellipsoid")
    latitude, longitude, altitude = here.to_geodetic(np.array([(40.0, -25.0, 1.5)]))
    there = LocalFrame(float(latitude[0]), float(longitude[0]), float(altitude[0]), "ellipsoid")
    turn = Similarity(1.0, rotation_about_z(0.3), np.array([0.0, 2.0, 0.0]))
    today = replace(sparse, frame=replace(sparse.frame, origin=here, plot_from_source=turn))
    before = replace(sparse, frame=replace(sparse.frame, origin=there, plot_from_source=Similarity.identity()))
    places = np.array([(0.0, 0.0, 0.0), (3.0, -7.0, 0.4)])
    expected = turn.apply(places + np.array([40.0, -25.0, 1.5]))
    np.testing.assert_allclose(motion_onto(before, today).apply(places), expected, atol=1e-4)


class _Killed(Silent):
    """Ends the run when the first plot is done; keeps what is told."""

    def __init__(self, kills: bool) -> None:
        self.kills, self.notes = kills, list[str]()

    @contextmanager
    def stage(
        self, name: str, total: int | None = None, *, weights: Sequence[float] | None = None
    ) -> Iterator[Advance]:
        def advance(steps: int) -> None:
            if self.kills and name == "Plots":
                raise KeyboardInterrupt

        yield advance

    def note(self, message: str) -> None:
        self.notes.append(message)


@pytest.mark.slow
def test_a_killed_flight_goes_on_and_ends_the_same(tmp_path: Path) -> None:
    passes = Passes(4.0, -75.0, (0.0, 180.0), 0.6, 0.5)
    survey = Survey((passes,), ranges=1, columns=2, camera=Intrinsics.pinhole(1200, 900, 1000.0))
    try:
        flight = fly(tmp_path / "flight", 3, "V4", survey, Silent())
    except RenderingError as error:
        pytest.skip(f"no picture can be rendered here: {error}")

    def evaluated(cache: str, progress: _Killed) -> list[TraitsEntry | None]:
        context = Context(StageCache(tmp_path / cache), progress)
        report = evaluate_flight(flight.photographs, flight.plots, tmp_path / "out", None, context, overwrite=True)
        return [plot.traits for plot in report.plots]

    with pytest.raises(KeyboardInterrupt):
        evaluated("kept", _Killed(True))
    assert not (tmp_path / "out").exists()
    first, again = _Killed(False), _Killed(False)
    whole, resumed = evaluated("fresh", first), evaluated("kept", again)
    assert resumed == whole
    assert len(whole) == 2
    assert not any("kept" in note for note in first.notes)
    assert any("kept" in note for note in again.notes)
