"""The recorded back end, plots of its kind and its match graph, on the small plot's eight photographs."""

from dataclasses import replace
from itertools import permutations
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fieldkit.cache import StageCache
from fieldkit.captures import read_capture
from fieldkit.clouds import Cloud, Volume
from fieldkit.errors import MetadataError, UsageError
from fieldkit.geometry import Pose, Similarity
from fieldkit.geometry.priors import SourceFrame
from fieldkit.planning.objective.objective import FIDELITIES, Objective, ObjectiveSettings
from fieldkit.planning.objective.recorded import LEAST_KEPT, RecordedKind, RecordedSource, match_graph, recorded_views
from fieldkit.planning.space.cameras import Cameras, assign, view_angles_deg
from fieldkit.reconstruction.pipeline import KnownPlot
from fieldkit.reconstruction.settings import FeatureSettings
from fieldkit.reconstruction.stages import load_features
from fieldkit.runtime.context import Context
from fieldkit.runtime.progress import Silent
from fieldkit.scenes.simulate import CaptureNoise

SMALL_PLOT = Path(__file__).parents[2] / "data" / "small_plot"
VOLUME = Volume((-0.25, -0.25, 0.03), (0.25, 0.25, 0.45))
PLOT = KnownPlot(SourceFrame("poses.csv", None, Similarity.identity()), VOLUME, None)
RANDOM_CLOUD = Cloud(np.random.default_rng(0).uniform(VOLUME.lower, VOLUME.upper, (3000, 3)))


@pytest.fixture(scope="module")
def source(tmp_path_factory: pytest.TempPathFactory) -> RecordedSource:
    cache = StageCache(tmp_path_factory.mktemp("cache"))
    return RecordedSource(read_capture(SMALL_PLOT), PLOT, RANDOM_CLOUD, cache=cache)


poses = st.tuples(*[st.floats(-2, 2)] * 3, st.floats(-180, 179), st.floats(-89, 89))


@given(st.lists(poses, min_size=2, max_size=4), st.lists(poses, min_size=4, max_size=6), st.floats(0.1, 3))
def test_no_other_assignment_is_cheaper(wanted: list, there: list, distance: float) -> None:
    cameras = Cameras.from_vector(np.array(wanted).reshape(-1))
    views = Cameras.from_vector(np.array(there).reshape(-1))
    chosen = assign(cameras, views, distance)
    assert len(set(chosen.tolist())) == len(cameras)

    def cost(index: tuple[int, ...]) -> float:
        total = 0.0
        for k, j in enumerate(index):
            turn = np.arccos(np.clip(cameras.forward[k] @ views.forward[j], -1, 1))
            total += float(np.linalg.norm(cameras.positions[k] - views.positions[j])) + distance * float(turn)
        return total

    assert cost(tuple(chosen.tolist())) <= min(cost(p) for p in permutations(range(len(views)), len(cameras))) + 1e-9


def test_a_reference_of_the_same_photographs_lends_missing_orientations(source: RecordedSource) -> None:
    capture = source.capture
    bare = replace(capture, priors={n: p.with_angles(None) for n, p in capture.priors.items()})
    with pytest.raises(MetadataError, match="0 photographs only"):
        recorded_views(bare, PLOT)
    reconstructed = {view.name: view.pose for view in source.views}
    for ours, theirs in zip(recorded_views(bare, PLOT, reconstructed), source.views, strict=True):
        np.testing.assert_allclose(ours.pose.rotation, theirs.pose.rotation, atol=1e-9)
        assert ours.angle_sigma_deg > 0
    moved = {name: Pose(pose.rotation, pose.center + 1.0) for name, pose in reconstructed.items()}
    with pytest.raises(MetadataError, match="0 photographs only"):
        recorded_views(bare, PLOT, moved)  # other photographs of the same names


def test_recorded_cameras_stand_for_themselves(source: RecordedSource) -> None:
    assert len(source.views) == 8
    for index in ([0, 1, 2], [7, 3, 5, 1], list(range(8))):
        assert source.project(source.cameras(index)).tolist() == index
    near = source.cameras([2, 6])
    moved = Cameras(near.positions + 0.05, near.yaw_deg + 4.0, near.pitch_deg)
    assert source.project(moved).tolist() == [2, 6]


def test_an_evaluation_uses_the_chosen_photographs_and_the_cache(source: RecordedSource) -> None:
    objective = Objective(source, ObjectiveSettings("standard"))
    first = objective.evaluate(source.cameras([5, 4, 6, 3]))
    assert first.views == ("IMG_0006.jpg", "IMG_0005.jpg", "IMG_0007.jpg", "IMG_0004.jpg")
    assert len(first.views) == 4
    kept = source.cache.sizes()
    assert (kept["features"].entries, kept["views"].entries) == (8, 4)  # the photographs' own, and the ground's
    assert not {"models", "depth"} & set(kept)
    again = objective.evaluate(source.cameras([3, 4, 5, 6]))  # the same set in another order
    assert source.cache.sizes() == kept
    assert (again.value_m, again.cloud_digest) == (first.value_m, first.cloud_digest)
    assert first.right == 4
    assert first.points > 100


def test_pairs_that_another_set_matched_are_not_matched_again(source: RecordedSource, tmp_path: Path) -> None:
    objective = Objective(source, ObjectiveSettings("draft"))
    objective.evaluate(source.cameras([0, 1, 2]))
    objective.evaluate(source.cameras([1, 2, 3]))
    kept = source.cache.sizes()["guided"].entries
    warm = objective.evaluate(source.cameras([0, 1, 2, 3]))
    assert source.cache.sizes()["guided"].entries == kept > 0  # the first and the last look too differently
    fresh = RecordedSource(source.capture, PLOT, RANDOM_CLOUD, cache=StageCache(tmp_path))
    cold = Objective(fresh, ObjectiveSettings("draft")).evaluate(fresh.cameras([0, 1, 2, 3]))
    assert (cold.value_m, cold.cloud_digest, cold.right) == (warm.value_m, warm.cloud_digest, warm.right)


def test_noise_moves_the_commands_and_not_the_photographs(source: RecordedSource) -> None:
    noisy = RecordedSource(
        source.capture,
        PLOT,
        RANDOM_CLOUD,
        cache=source.cache,
        noise=CaptureNoise(position_m=0.02, angle_deg=1.0, image_sigma=0.0),
    )
    subset = noisy._subset(np.array([1, 2, 3]), seed=5)
    assert [p.sha256 for p in subset.photos] == [p.sha256 for p in source.capture.photos[1:4]]
    priors = [subset.priors[name] for name in subset.names]
    shift = np.array([p.position for p in priors]) - source.cameras([1, 2, 3]).positions
    assert 0.005 < np.linalg.norm(shift, axis=1).mean() < 0.08
    assert priors[0].position_sigma_m == pytest.approx(np.hypot(0.003, 0.02))
    # A view's noise is its own, whatever it stands beside.
    alone = noisy._subset(np.array([3]), seed=5)
    assert np.array_equal(alone.priors[alone.names[0]].position, priors[2].position)
    with pytest.raises(UsageError, match="image noise"):
        RecordedSource(source.capture, PLOT, RANDOM_CLOUD, cache=source.cache, noise=CaptureNoise())


def test_plot_0_is_the_plot_as_it_was_recorded(source: RecordedSource) -> None:
    kind, matches = RecordedKind(source, seed=0), np.arange(64.0).reshape(8, 8)
    plot = kind.plot(0, matches)
    np.testing.assert_array_equal(plot.reference.points, source.cloud.points)
    np.testing.assert_array_equal(plot.matches, matches)
    assert kind.plot(3, None).matches is None


def test_a_turned_plant_is_seen_as_turned_cameras_see_it(source: RecordedSource) -> None:
    kind = RecordedKind(source, seed=1)
    numbers = [k for k in range(1, 6) if kind.rehearsal(k).turn_deg]
    assert numbers
    for number in numbers:
        turn = kind.rehearsal(number).turn_deg
        turned = source.cameras().turned(source.middle, -turn)
        for camera, other in zip(source.cameras().poses(), turned.poses(), strict=True):
            np.testing.assert_allclose(
                camera.to_camera(kind.plot(number, None).reference.points),
                other.to_camera(source.cloud.points),
                atol=1e-9,
            )


def test_matches_go_with_the_photographs_that_stand_for_the_turned_views(source: RecordedSource) -> None:
    kind, matches = RecordedKind(source, seed=1), np.random.default_rng(0).uniform(0, 100, (8, 8))
    rehearsal = kind.rehearsal(1)
    assert LEAST_KEPT <= rehearsal.kept <= 1.0
    index = source.project(source.cameras().turned(source.middle, -rehearsal.turn_deg))
    found = kind.plot(1, matches).matches
    assert found is not None
    np.testing.assert_allclose(found, rehearsal.kept * matches[np.ix_(index, index)])
    with source.rehearsing(rehearsal).photograph(source.cameras([0, 2, 5]), FIDELITIES["draft"], 0, Silent()) as shot:
        assert shot.views == tuple(source.views[index[k]].name for k in (0, 2, 5))
        assert shot.features.kept == pytest.approx(np.sqrt(rehearsal.kept))


def test_views_that_do_not_go_all_round_are_not_turned(source: RecordedSource, tmp_path: Path) -> None:
    azimuth = np.arctan2(*(source.cameras().positions - source.middle)[:, 1::-1].T)
    near = [source.views[k].name for k in np.argsort(azimuth)[:3]]
    capture = replace(
        source.capture,
        photos=tuple(p for p in source.capture.photos if p.name in near),
        priors={n: p for n, p in source.capture.priors.items() if n in near},
        groups=tuple(replace(g, photos=tuple(n for n in g.photos if n in near)) for g in source.capture.groups),
    )
    arc = RecordedKind(RecordedSource(capture, PLOT, RANDOM_CLOUD, cache=StageCache(tmp_path)), seed=0)
    found = [arc.rehearsal(k) for k in range(1, 9)]
    assert any(each.turn_deg == 0.0 for each in found)
    assert len({each.kept for each in found}) == 8


def test_a_share_of_the_features_is_withheld(tmp_path: Path) -> None:
    capture, cache, whole = read_capture(SMALL_PLOT), StageCache(tmp_path), FeatureSettings(max_features=500)
    photos = capture.photos[:2]
    every = load_features(photos, whole, context=Context(cache))
    some = load_features(photos, replace(whole, kept=0.6, draw=1), context=Context(cache))
    other = load_features(photos, replace(whole, kept=0.6, draw=2), context=Context(cache))
    for a, b, c in zip(every, some, other, strict=True):
        assert b.cached
        assert 0.5 < len(b.features) / len(a.features) < 0.7
        assert len({a.key, b.key, c.key}) == 3
        assert {row.tobytes() for row in b.features.keypoints} < {row.tobytes() for row in a.features.keypoints}
        assert b.features.keypoints.tobytes() != c.features.keypoints.tobytes()


FEATURES = FIDELITIES["draft"].features


def test_neighbours_match_and_strangers_do_not(tmp_path: Path) -> None:
    source = RecordedSource(read_capture(SMALL_PLOT), PLOT, RANDOM_CLOUD, cache=StageCache(tmp_path))
    counted = match_graph(source, FEATURES, Context())
    np.testing.assert_array_equal(counted, counted.T)
    assert not np.diag(counted).any()
    centers = np.array([view.pose.center for view in source.views])
    angles = view_angles_deg(centers, np.array(PLOT.volume.center))
    assert not counted[angles > 60.0].any()
    neighbours = counted[angles < 40.0][counted[angles < 40.0] > 0]
    assert len(neighbours) == 2 * len(counted)
    assert np.median(neighbours) > 50
    elsewhere = RecordedSource(source.capture, PLOT, RANDOM_CLOUD, cache=StageCache(tmp_path / "other"))
    np.testing.assert_array_equal(match_graph(elsewhere, FEATURES, Context(workers=2)), counted)
