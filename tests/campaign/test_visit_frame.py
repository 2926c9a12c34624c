"""The frame, the volume and the ground of a visit."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fieldkit.campaign.evaluate_visit import (
    Settling,
    on_stations,
    place_visit,
    plan_aim,
    plan_volume,
    wanted_sidecars,
)
from fieldkit.campaign.reading import CampaignPlot
from fieldkit.captures.model import Capture
from fieldkit.captures.priors import priors_from_gps
from fieldkit.clouds.volume import Volume
from fieldkit.geometry import Pose, Similarity
from fieldkit.geometry.geodesy import LocalFrame
from fieldkit.geometry.priors import PosePrior, SourceFrame
from fieldkit.reconstruction.known_poses import known_poses
from fieldkit.reconstruction.pipeline import KnownPlot
from fieldkit.results.frame import Plane
from fieldkit.results.plan_file import plan_from_poses
from fieldkit.sites.plots_file import drawn_outline
from tests.campaign.examples import FIELD, PLAN, STATIONS, field, flown

PLOT = field(2, 2)[3]
GROUND = Plane((0.0, 0.0, 1.0), 0.0, 0.01, 0.5, 0.02)


def tagged(accuracy_m: float = 0.015) -> Capture:
    photos = tuple(shot.photo for shot in flown(PLOT, accuracy_m=accuracy_m))
    priors = priors_from_gps(photos)
    return Capture(Path("/x"), Path("/x"), photos, (), (), priors.priors, priors.metric_source, priors.origin)


def listed(shift: float = 0.0, *, tags: bool = True) -> Capture:
    """With a poses.csv of the plan's stations, moved by some metres."""
    found = tagged()
    photos = found.photos if tags else tuple(replace(photo, geotag=None) for photo in found.photos)
    priors = {
        photo.name: PosePrior(pose.center + shift, 0.01, source="poses.csv")
        for photo, pose in zip(photos, STATIONS, strict=True)
    }
    return replace(found, photos=photos, priors=priors, metric_source="poses.csv", origin=None)


def scene(rng: np.random.Generator, tilt: float = 0.0) -> np.ndarray:
    """Points of rough ground and of plants on it, plot frame."""
    ground = np.column_stack([rng.uniform(-1, 1, (4000, 2)), rng.normal(0, 0.004, 4000)])
    ground[:, 2] += tilt * ground[:, 0]
    plants = rng.uniform((-0.5, -0.2, 0.05), (0.5, 0.2, 0.7), (1000, 3))
    return np.vstack([ground, plants])


def test_gps_positions_come_into_the_plots_frame() -> None:
    capture = tagged()
    placed = place_visit(capture, PLOT, PLAN, None)
    assert placed.notes == ()
    known = known_poses(capture, placed.plot.source)
    found = np.array([known.by_name[photo.name].position for photo in capture.photos])
    expected = np.array([pose.center for pose in STATIONS])
    np.testing.assert_allclose(found[:, :2], expected[:, :2], atol=1e-4)
    np.testing.assert_allclose(found[:, 2] - found[0, 2], expected[:, 2] - expected[0, 2], atol=1e-4)
    for photo, pose in zip(capture.photos, STATIONS, strict=True):
        rotation = known.by_name[photo.name].rotation
        assert rotation is not None
        np.testing.assert_allclose(rotation, pose.rotation, atol=1e-6)


@pytest.mark.parametrize("tilt", [0.0, 0.06])
def test_the_ground_becomes_zero_at_the_origin(tilt: float) -> None:
    rng = np.random.default_rng(1)
    lifted = np.array([0.0, 0.0, 37.2])
    poses = {str(k): Pose(pose.rotation, pose.center + lifted) for k, pose in enumerate(STATIONS)}
    motion, ground = Settling(None, 1.3)(scene(rng, tilt) + lifted, poses)
    np.testing.assert_allclose(motion.translation, -lifted, atol=0.004)
    np.testing.assert_allclose(motion.rotation, np.eye(3))
    assert ground.normal[0] == pytest.approx(-tilt, abs=0.01)  # a slope stays one
    assert ground.heights(np.array([[0.5, 0.3, 0.5 * tilt]]))[0] == pytest.approx(0.0, abs=0.004)


def test_coarse_positions_are_put_where_the_plan_looks() -> None:
    rng = np.random.default_rng(1)
    off = np.array([2.3, -1.7, 37.2])
    poses = {str(k): Pose(pose.rotation, pose.center + off) for k, pose in enumerate(STATIONS)}
    aim, height = plan_aim(PLAN)
    motion, _ = Settling(aim, height)(scene(rng) + off, poses)
    np.testing.assert_allclose(motion.translation, -off, atol=0.005)
    placed = place_visit(tagged(3.0), PLOT, PLAN, None)
    assert "positions are good to 3.0 m only" in placed.notes[0]
    assert placed.at_origin
    assert not place_visit(tagged(0.015), PLOT, PLAN, None).at_origin


def test_poses_in_the_plot_frame_are_told_by_the_stations() -> None:
    assert on_stations(listed(), PLAN)
    assert not on_stations(listed(3.0), PLAN)
    assert wanted_sidecars(listed(), PLAN, None) == frozenset()
    assert wanted_sidecars(listed(3.0), PLAN, None) == {"poses.csv"}
    assert wanted_sidecars(listed(3.0, tags=False), PLAN, None) == frozenset()
    placed = place_visit(listed(), PLOT, PLAN, None)
    assert placed.plot.source.source == "poses.csv"
    nowhere = place_visit(listed(3.0, tags=False), PLOT, PLAN, None)
    assert nowhere.plot is None
    assert "not known" in nowhere.notes[0]
    unknown = place_visit(replace(tagged(), metric_source=None, origin=None, priors={}), PLOT, PLAN, None)
    assert unknown.plot is None


def test_a_reference_of_its_own_fixes_frame_and_volume() -> None:
    volume = Volume((-1, -1, 0), (1, 1, 1))
    relative = KnownPlot(SourceFrame("poses.csv", None, Similarity.identity()), volume, GROUND)
    assert place_visit(listed(), PLOT, PLAN, relative).plot is relative
    assert wanted_sidecars(listed(3.0), PLAN, relative) == frozenset()
    origin = LocalFrame(FIELD.latitude_deg, FIELD.longitude_deg, 81.0, "ellipsoid")
    earthly = KnownPlot(SourceFrame("EXIF GPS", origin, Similarity.identity()), volume, GROUND)
    assert wanted_sidecars(listed(), PLAN, earthly) == {"poses.csv"}
    placed = place_visit(tagged(), PLOT, PLAN, earthly)
    assert placed.plot.volume is volume
    assert placed.plot.settle is not None


def test_the_volume_holds_the_plants_and_leaves_room_to_grow() -> None:
    found = plan_volume(PLAN)
    assert found.contains(np.array([[-0.5, -0.2, 0.1], [0.5, 0.2, 0.7], [0.0, 0.0, 1.0]])).all()
    assert found.upper[2] == pytest.approx(0.7 + 0.05 + 0.35)
    assert found.upper[0] == pytest.approx(0.5 + 0.15 + 0.05)
    bare = plan_volume(plan_from_poses(STATIONS))
    assert bare.contains(np.array([[0.0, 0.0, 0.0], [0.5, 0.5, 0.5]])).all()
    nadir = plan_volume(plan_from_poses([Pose.from_yaw_pitch((x, 0.0, 2.0), 0.0, -90.0) for x in (-1.0, 0.0, 1.0)]))
    assert nadir.contains(np.array([[0.0, 0.0, 0.5]])).all()


class TestOutline:
    """A plot's polygon, in the frame that a visit is reconstructed in."""

    CORNERS = ((-1.5, -0.75), (1.5, -0.75), (1.5, 0.75), (-1.5, 0.75))

    def drawn(self, heading_deg: float = 30.0) -> CampaignPlot:
        """A plot of 3 by 1.5 m along its rows, drawn as a polygon."""
        heading = np.radians(heading_deg)
        along, left = np.array([np.sin(heading), np.cos(heading)]), np.array([-np.cos(heading), np.sin(heading)])
        east_north = np.array([x * along + y * left for x, y in self.CORNERS])
        own = LocalFrame(PLOT.latitude_deg, PLOT.longitude_deg)
        latitude, longitude, _ = own.to_geodetic(np.column_stack([east_north, np.zeros(4)]))
        shape = tuple(zip(latitude.tolist(), longitude.tolist(), strict=True))
        return PLOT.model_copy(update={"row_heading_deg": heading_deg, "shape": shape})

    def test_of_a_polygon_with_positions_by_gps(self) -> None:
        placed = place_visit(tagged(), self.drawn(), PLAN, None)
        assert placed.outline.corners is not None
        np.testing.assert_allclose(placed.outline.corners, self.CORNERS, atol=1e-4)
        np.testing.assert_allclose(placed.plot.volume.lower[:2], (-1.5, -0.75), atol=1e-4)
        np.testing.assert_allclose(placed.plot.volume.upper[:2], (1.5, 0.75), atol=1e-4)
        assert placed.plot.volume.upper[2] == plan_volume(PLAN).upper[2]

    def test_of_a_length_and_a_width(self) -> None:
        plot = PLOT.model_copy(update={"row_heading_deg": 200.0, "shape": None, "length_m": 3.0, "width_m": 1.5})
        placed = place_visit(listed(tags=False), plot, PLAN, None)
        np.testing.assert_allclose(placed.outline.corners, self.CORNERS, atol=1e-4)

    def test_in_the_frame_of_a_reference(self) -> None:
        """The reference's frame is east and north about a place of its own."""
        place = LocalFrame(PLOT.latitude_deg + 1e-5, PLOT.longitude_deg, 80.0, "ellipsoid")
        turned = SourceFrame("EXIF GPS", place, Similarity.identity())
        corners = drawn_outline(plot := self.drawn(90.0), plot.shape, turned)
        np.testing.assert_allclose(corners, np.array(self.CORNERS) - (0.0, 1.113), atol=2e-3)

    def test_cannot_be_placed_by_coarse_positions(self) -> None:
        placed = place_visit(tagged(3.0), self.drawn(), PLAN, None)
        assert placed.outline.corners is None
        assert "good to 3.0 m only" in placed.outline.reason
