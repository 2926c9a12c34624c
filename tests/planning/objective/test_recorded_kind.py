"""Plots of a recorded plot's kind, on the small plot's eight photographs."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fieldkit.cache import StageCache
from fieldkit.captures import read_capture
from fieldkit.planning.objective.objective import FIDELITIES, ObjectiveSettings, PlotsObjective
from fieldkit.planning.objective.recorded import LEAST_KEPT, RecordedKind, RecordedSource, Rehearsal
from fieldkit.reconstruction.features import FeatureSettings
from fieldkit.reconstruction.stages import load_features
from fieldkit.runtime.context import Context
from fieldkit.runtime.progress import Silent
from tests.planning.objective.test_recorded import PLOT, RANDOM_CLOUD, SMALL_PLOT


@pytest.fixture(scope="module")
def source(tmp_path_factory: pytest.TempPathFactory) -> RecordedSource:
    cache = StageCache(tmp_path_factory.mktemp("cache"))
    return RecordedSource(read_capture(SMALL_PLOT), PLOT, RANDOM_CLOUD, cache=cache)


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
                camera.to_camera(kind.plot(number, None).reference.points), other.to_camera(source.cloud.points),
                atol=1e-9,
            )  # fmt: skip


def test_matches_go_with_the_photographs_that_stand_for_the_turned_views(source: RecordedSource) -> None:
    kind, matches = RecordedKind(source, seed=1), np.random.default_rng(0).uniform(0, 100, (8, 8))
    rehearsal = kind.rehearsal(1)
    assert LEAST_KEPT <= rehearsal.kept <= 1.0
    index = source.project(source.cameras().turned(source.middle, -rehearsal.turn_deg))
    found = kind.plot(1, matches).matches
    assert found is not None
    np.testing.assert_allclose(found, rehearsal.kept * matches[np.ix_(index, index)])
    with source.rehearsing(rehearsal).photograph(
        source.cameras([0, 2, 5]), FIDELITIES["draft"], 0, Silent()
    ) as shot:  # fmt: skip
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


def test_an_objective_rehearses_its_plot(source: RecordedSource) -> None:
    plots = PlotsObjective(RecordedKind(source, seed=1), ObjectiveSettings("draft"))
    plots.prepare()
    cameras = source.cameras()
    found = {plot: plots.on(plot).evaluate(cameras) for plot in (0, 1)}
    assert found[0].cloud_digest != found[1].cloud_digest
    again = source.rehearsing(Rehearsal())
    assert again.reference is source.reference
    plots.close()
