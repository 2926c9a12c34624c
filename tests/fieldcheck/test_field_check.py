"""Checks in the field, part by part: sharpness, exposure, placement, matches, the mission to fly again."""

import hashlib
import json
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fieldkit.captures import CameraGroup, Capture, Photo
from fieldkit.errors import UsageError
from fieldkit.fieldcheck.check import common_findings
from fieldkit.fieldcheck.model import CheckReport, StationCheck, finding_of
from fieldkit.fieldcheck.placement import Placed, Tags, angles_as_meant, axis_turn_deg, place_tags, read_tags
from fieldkit.fieldcheck.refly import write_refly
from fieldkit.fieldcheck.settings import CheckSettings
from fieldkit.fieldcheck.ties import Tie, TieGraph
from fieldkit.fieldcheck.verdicts import Connection, connect
from fieldkit.geometry import Pose
from fieldkit.geometry.geodesy import LocalFrame
from fieldkit.geometry.pose import rotation_from_vector
from fieldkit.geometry.priors import PosePrior
from fieldkit.geometry.stations import PoseArray
from fieldkit.missions.settings import MissionSettings
from fieldkit.reconstruction.cameras import CameraSet
from fieldkit.reconstruction.guided import relative_pose
from fieldkit.report.sections.loaded import FlownMission, read_results
from fieldkit.results.mission import load_mission
from fieldkit.results.plan import PlanPlants
from fieldkit.results.plan_file import plan_bytes, plan_from_poses
from fieldkit.routing.mission import Home
from fieldkit.sites.fitted import flown_plan
from fieldkit.sites.plot_plants import with_plant_height
from fieldkit.sites.site import Site, SitePlot
from fieldkit.sites.site_file import load_site

ROOT = Path(__file__).parents[2]


def stations(count: int = 13, seed: int = 0) -> list[Pose]:
    """An uneven ring that looks at the middle."""
    rng = np.random.default_rng(seed)
    poses = []
    for k in range(count):
        azimuth = 2 * np.pi * k / count + rng.normal() * 0.07
        radius, height = rng.uniform(1.25, 1.6), rng.uniform(0.9, 1.5)
        poses.append(Pose.look_at((radius * np.sin(azimuth), radius * np.cos(azimuth), height), (0.0, 0.0, 0.25)))
    return poses


def flown(poses: list[Pose], seed: int, position_m: float = 0.05, angle_deg: float = 1.2) -> list[Pose]:
    """Off the poses by Gaussian noise of at most three standard deviations: more of it may be what the check is right
    to blame.
    """
    rng = np.random.default_rng([seed, 1])

    def noise() -> np.ndarray:
        drawn = rng.normal(size=3)
        return drawn * min(1.0, 3.0 / float(np.linalg.norm(drawn)))

    return [
        Pose(rotation_from_vector(noise() * np.radians(angle_deg)) @ p.rotation, p.center + noise() * position_m)
        for p in poses
    ]


def capture_of(poses: list[Pose | None], origin: LocalFrame | None = None, *, angles: bool = True) -> Capture:
    photos, priors = [], {}
    for k, pose in enumerate(poses):
        name = f"{k}.jpg"
        photos.append(Photo(Path(name), name, 800, 600, "JPEG", f"{k:064x}"))
        if pose is not None:
            yaw, pitch, _ = pose.yaw_pitch_roll_deg()
            prior = PosePrior(pose.center, 0.05, source="test")
            priors[name] = prior.with_angles((yaw, pitch, None) if angles else None)
    names = tuple(photo.name for photo in photos)
    group = CameraGroup("camera", names, None, "self-calibrated", False)
    here = Path()
    return Capture(here, here, tuple(photos), (group,), (), priors, "test" if priors else None, origin)


class TestPlacement:
    @settings(max_examples=10)
    @given(
        seed=st.integers(0, 1000),
        east=st.floats(-3, 3),
        north=st.floats(-3, 3),
        up=st.floats(-20, 20),
        compass=st.floats(-8, 8),
        gone=st.integers(0, 12),
    )
    def test_a_common_offset_is_found_and_taken_out(self, seed, east, north, up, compass, gone) -> None:
        planned = stations(seed=seed)
        origin = LocalFrame(52.3, 10.4, 81.0, "ellipsoid")
        site = Site(
            home=Home(latitude_deg=52.3, longitude_deg=10.4, ellipsoid_m=81.0),
            plots=(SitePlot(latitude_deg=52.3, longitude_deg=10.4),),
        )
        shift = np.array([east, north, up])
        tagged: list[Pose | None] = []
        for k, pose in enumerate(flown(planned, seed)):
            yaw, pitch, _ = pose.yaw_pitch_roll_deg()
            if k != gone:
                tagged.append(Pose.from_yaw_pitch(pose.center + shift, yaw + compass, pitch))
        found = place_tags(capture_of(tagged, origin), plan_from_poses(planned), site, site.plots[0])
        assert found.station_of == dict(enumerate(k for k in range(13) if k != gone))
        assert found.shift_m == pytest.approx(shift, abs=0.12)
        assert found.turn_deg == pytest.approx(compass, abs=2.5)


def graph_of(true: list[Pose], seed: int) -> TieGraph:
    """Ties as photographs of these poses give them: neighbours on the ring, a degree and a tenth off."""
    rng = np.random.default_rng([seed, 2])
    ties, count = {}, len(true)
    for k in range(count):
        i, j = sorted((k, (k + 1) % count))
        rotation, translation = relative_pose(true[i], true[j])
        rotation = rotation_from_vector(rng.normal(size=3) * np.radians(0.6)) @ rotation
        translation = translation / np.linalg.norm(translation) + rng.normal(size=3) * 0.02
        ties[i, j] = Tie(60, rotation, translation / np.linalg.norm(translation))
    return TieGraph(ties, (), CameraSet((), (), (), (), ()))


Angles = tuple[float, float, float]


class TestAngles:
    @pytest.mark.parametrize(
        "write",
        [
            lambda a: (a[0], a[1] + 90.0, a[2]),  # Metashape, Pix4D
            lambda a: (a[0], -a[1], a[2]),
            lambda a: (-a[0], a[1], a[2]),
        ],
    )
    def test_another_convention_of_all_is_read_and_told_once(self, write: Callable[[Angles], Angles]) -> None:
        planned = stations(seed=3)
        true, plan = flown(planned, 3), plan_from_poses(planned)
        capture = capture_of(list(true))
        priors = {
            f"{k}.jpg": capture.priors[f"{k}.jpg"].with_angles(write(pose.yaw_pitch_roll_deg()))
            for k, pose in enumerate(true)
        }
        capture, (told,) = angles_as_meant(replace(capture, priors=priors), plan, None, None)
        placed = place_tags(capture, plan)
        assert placed.station_of == {k: k for k in range(13)}
        assert told.code == "angles-read-otherwise"
        turned = [
            axis_turn_deg(placed.tags.poses.yaws[k], placed.tags.poses.pitches[k], s.yaw_deg, s.pitch_deg)
            for k, s in enumerate(plan.stations)
        ]
        assert max(turned) < 8.0


class TestShift:
    @pytest.mark.parametrize(("north_m", "there"), [(3.9, True), (2.0, False), (-4.0, False)])
    def test_to_another_plot_names_it(self, north_m: float, there: bool) -> None:
        latitudes = (50.0, 50.0 + 4.0 / 111_229.0)
        plots = [SitePlot(name=n, latitude_deg=lat, longitude_deg=6.0) for n, lat in zip("AB", latitudes, strict=True)]
        site = Site(name="trial", home=Home(latitude_deg=50.0, longitude_deg=6.0, amsl_m=90.0), plots=tuple(plots))
        tags = Tags((), PoseArray.of([]), np.zeros(0), 0.03)
        shift = np.array([0.0, north_m, 0.0])  # across the row, which leads east
        (found,) = common_findings(Placed(tags, "site", shift_m=shift), CheckSettings(), site, plots[0])
        assert found.code == ("other-plot" if there else "shifted")
        assert ("--plot B" in found.remedy) is there


@pytest.mark.parametrize("height_m", [1.3, None])
def test_a_plan_is_checked_and_flown_again_as_it_was_fitted_to_the_plot(tmp_path: Path, height_m: float | None) -> None:
    """The export fits it to the plot's plants, or the tallest known and 30 %: the plan's own stations would send good
    photographs back.
    """
    poses = [Pose(p.rotation, p.center + np.array([0.0, 0.0, 1.5])) for p in stations()]
    plants = PlanPlants(points_m=((-0.5, -0.5, 1.0), (0.5, 0.5, 1.0)), cell_m=0.05)
    plan = plan_from_poses(poses).model_copy(update={"plant_height_m": 1.0, "plants": plants})
    plot = SitePlot(name="B2", latitude_deg=50.0, longitude_deg=6.0, plant_height_m=1.3)
    home = Home(latitude_deg=50.0, longitude_deg=6.0, amsl_m=90.0)
    other = SitePlot(name="A1", latitude_deg=50.001, longitude_deg=6.0, plant_height_m=1.0)
    flown = plot.model_copy(update={"plant_height_m": height_m})
    site = Site(name="trial", home=home, plots=(flown,), neighbours=(other,))
    fitted = flown_plan(plan, plot)
    assert fitted.stations[3].position_m[2] > plan.stations[3].position_m[2] + 0.1
    assert flown_plan(plan, plot, fit=False) is plan
    files = write_refly([3], plan, "px4-gimbal", site, tmp_path / "again.plan", MissionSettings(burst=5))
    (flight,) = load_mission(files[1]).flights
    (station,) = flight.shots
    assert flight.photographs == 5
    assert station.station == 3
    assert station.height_m == pytest.approx(fitted.stations[3].position_m[2], abs=0.01)


class TestConnection:
    def joined(
        self, again: set[int], cut: set[tuple[int, int]] | None = None, tags: list[Pose] | None = None
    ) -> Connection:
        planned = stations()
        plan, graph = plan_from_poses(planned), graph_of(planned, 0)
        graph = replace(graph, ties={p: t for p, t in graph.ties.items() if p not in (cut or set())})
        placed = replace(place_tags(capture_of(list(planned)), plan), tags=read_tags(capture_of(list(tags or planned))))
        return connect(plan, graph, placed, again)

    def test_groups_are_told(self) -> None:
        found = self.joined(set(), {(2, 3), (8, 9)})
        assert found.components == (7, 6)
        assert [f.code for f in found.findings] == ["disconnected"]

    def test_a_good_photograph_beside_a_gap_is_not_sent_back(self) -> None:
        found = self.joined({3}, {(3, 4), (4, 5)})
        assert found.lonely == frozenset()
        assert found.beside_gaps == {4}

    def test_one_without_matches_beside_near_neighbours_is_named(self) -> None:
        found = self.joined(set(), {(3, 4), (4, 5)})
        assert found.lonely == {4}

    def test_those_whose_tags_were_exchanged_are_named(self) -> None:
        tags = stations()
        tags[4], tags[9] = tags[9], tags[4]
        assert self.joined(set(), tags=tags).lonely == {4, 9}


class TestReport:
    @pytest.mark.parametrize(
        ("code", "station", "verdict", "said"),
        [
            ("other-plot", None, "fly again", "All lie there. Do it."),  # nothing is to be flown again
            ("other-plot", None, "fine", "All lie there. Do it."),
            ("shifted", None, "fine", "All lie there. Do it. It will do."),
            ("displaced", 0, "fly again", r"Hardly a photograph .* is this its plan\? Fly station 1 again."),
        ],
    )
    def test_that_all_were_taken_elsewhere_is_said_first(self, code: str, station: int | None, verdict, said) -> None:
        found = finding_of(code, station, "", "all lie there", "Do it.")
        report = CheckReport("plot", 1, (StationCheck(0, verdict=verdict),), (found,))
        assert re.fullmatch(said, report.summary())
        assert report.ok == (code == "shifted")


class TestRefly:
    site = with_plant_height(load_site(ROOT / "missions" / "sites" / "example.toml"), None, 0.9)

    def test_stations_keep_their_numbers(self, tmp_path: Path) -> None:
        plan = plan_from_poses([Pose(p.rotation, p.center + np.array([0.0, 0.0, 1.5])) for p in stations()])
        files = write_refly([9, 4], plan, "px4-gimbal", self.site, tmp_path / "again.plan", MissionSettings())
        assert [file.name for file in files] == ["again.plan", "again.mission.json", "again.geojson"]
        features = json.loads(files[2].read_text("utf-8"))["features"]
        flown = {f["properties"]["station"] for f in features if f["properties"].get("kind") == "station"}
        assert flown == {5, 10}  # as the plan's picture numbers them
        # What `export-mission` writes of itself, so that a report shows it.
        record = load_mission(files[1])
        assert {station.station for flight in record.flights for station in flight.shots} == {4, 9}
        assert record.plots[0].plan.sha256 == hashlib.sha256(plan_bytes(plan)).hexdigest()  # the whole plan's
        assert {entry.name for entry in record.files} == {"again.plan", "again.geojson"}
        assert record.name.endswith(", again")
        shown = read_results(tmp_path)
        assert [each.report.record for each in shown.of(FlownMission)] == [record]
        with pytest.raises(UsageError, match="exists already"):
            write_refly([4], plan, "px4-gimbal", self.site, tmp_path / "again.plan", MissionSettings())
