"""The score of patterns and their search, over two layers of leaves."""

import numpy as np
import pytest
import shapely

import fieldkit.planning.patterns.search as searching
from fieldkit.clouds.canopy import rectangle
from fieldkit.clouds.cloud import Cloud
from fieldkit.planning.patterns.block import Block
from fieldkit.planning.patterns.objective import PatternEvaluation, TraitErrors, trait_errors, traits
from fieldkit.planning.patterns.score import PatternScore
from fieldkit.planning.patterns.search import PatternSearch
from fieldkit.planning.patterns.space import PatternSpace
from fieldkit.planning.run.flyable import flight_noise
from fieldkit.results.pattern import Look, Pattern
from fieldkit.scenes.description import SceneDescription
from fieldkit.scenes.scene import Scene
from fieldkit.vehicles.vehicle_file import load_vehicle

VEHICLE = load_vehicle("dji-mavic-3-enterprise")
CAMERA = VEHICLE.camera.without_distortion()
FIELD = shapely.box(0.0, 0.0, 19.0, 15.0)


def plate(low: tuple[float, float], high: tuple[float, float], z: float) -> np.ndarray:
    """Two triangles."""
    (a, b), (c, d) = low, high
    return np.array([[(a, b, z), (c, b, z), (c, d, z)], [(a, b, z), (c, d, z), (a, d, z)]])


def points_on(low: tuple[float, float], high: tuple[float, float], z: float) -> np.ndarray:
    x, y = np.meshgrid(np.arange(low[0], high[0], 0.02), np.arange(low[1], high[1], 0.02))
    return np.column_stack([x.ravel(), y.ravel(), np.full(x.size, z)])


@pytest.fixture(scope="module")
def block() -> Block:
    """Low leaves along the edge that faces south, half of them below a roof of high ones."""
    low, roof = ((-0.6, -0.6), (0.6, -0.1), 0.3), ((-0.6, -0.3), (0.6, 0.6), 1.0)
    points = np.vstack([points_on(*low), points_on(*roof)])
    normals = np.tile([0.0, 0.0, 1.0], (len(points), 1)).astype(np.float32)
    triangles = np.concatenate([plate(*low), plate(*roof)])
    outline = rectangle((-0.6, -0.6), (0.6, 0.6))
    return Block(SceneDescription(), Scene(()), outline, Cloud(points, None, normals), points, triangles)


@pytest.fixture(scope="module")
def score(block: Block) -> PatternScore:
    return PatternScore.of(block)


def test_neighbours_hide_what_is_below_them_from_above_and_not_from_the_side(score: PatternScore) -> None:
    noise = flight_noise(VEHICLE)
    down, north, south = (
        score.expect(Pattern((Look(heading, pitch),), 8.0, 1.0, 2.0), CAMERA, noise)
        for heading, pitch in ((0.0, -90.0), (270.0, -55.0), (90.0, -55.0))
    )
    # Rows run to the east: 270° from them is north, from where the photographs look below the roof.
    assert north.gap_m < 0.7 * down.gap_m
    assert north.gap_m < 0.7 * south.gap_m
    assert north.cover <= down.cover


def test_sparse_photographs_show_less(score: PatternScore) -> None:
    near, far = (
        score.expect(Pattern((Look(0.0, -90.0),), 8.0, along, 2.5), CAMERA, flight_noise(VEHICLE))
        for along in (1.0, 4.5)
    )
    assert near.gap_m + near.noise_m < far.gap_m + far.noise_m


def test_the_surface_itself_has_its_traits(block: Block) -> None:
    same = traits(block.surface, 0.02)
    assert trait_errors(same, same, block) == TraitErrors(height_m=0.0, cover=0.0, volume=0.0)
    roof = block.surface[block.surface[:, 2] > 0.5]
    errors = trait_errors(traits(roof, 0.02), same, block)
    assert errors.height_m < 0.01
    assert errors.cover == pytest.approx(0.25, abs=0.03)


def test_evaluations_correct_what_the_score_expects(score: PatternScore, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(searching, "_SAMPLED", 16)
    monkeypatch.setattr(searching, "_NEAR", 6)
    search = PatternSearch(PatternSpace(VEHICLE, 1.0), FIELD, 90.0, [score], flight_noise(VEHICLE))
    codes = search.explore()
    front = search.front(codes)
    values = [each.worth.value_m for _, each in front]
    assert values == sorted(values, reverse=True)
    assert [each.minutes for _, each in front] == sorted(each.minutes for _, each in front)
    errors = TraitErrors(height_m=0.05, cover=0.08, volume=0.2)
    for code, each in front[:3]:
        twice = PatternEvaluation(value_m=2.0 * each.worth.value_m, photographs=12, errors=errors)
        search.evaluated.append((code, 0, twice))
    corrected = {code.tobytes(): each.worth for code, each in search.front(codes)}
    again = corrected[front[0][0].tobytes()]
    assert again.value_m == pytest.approx(2.0 * values[0], rel=0.3)
    assert again.height_m == pytest.approx(0.05, abs=0.02)
    assert again.evaluations == 1
