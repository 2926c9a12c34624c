"""Sim3: composition, inverses and the least-squares fit."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fieldkit.geometry import Pose, Similarity
from fieldkit.geometry.pose import rotation_angle_deg, rotation_from_vector
from fieldkit.geometry.similarity import fit_similarity

coordinates = st.tuples(*[st.floats(-100, 100)] * 3)
vectors = st.tuples(*[st.floats(-3, 3)] * 3)


@st.composite
def similarities(draw: st.DrawFn) -> Similarity:
    return Similarity(draw(st.floats(0.01, 100)), rotation_from_vector(draw(vectors)), np.array(draw(coordinates)))


@given(similarities(), coordinates)
def test_inverse_undoes(similarity: Similarity, point: tuple[float, float, float]) -> None:
    np.testing.assert_allclose(similarity.inverse().apply(similarity.apply(point)), point, atol=1e-6)


@given(similarities(), similarities(), coordinates)
def test_composition(second: Similarity, first: Similarity, point: tuple[float, float, float]) -> None:
    np.testing.assert_allclose(second.after(first).apply(point), second.apply(first.apply(point)), rtol=1e-9, atol=1e-6)


@given(similarities(), coordinates, st.floats(-180, 180), st.floats(-89, 89), coordinates)
def test_a_moved_camera_sees_a_moved_point_in_the_same_direction(similarity, center, yaw, pitch, point) -> None:
    pose = Pose.from_yaw_pitch(center, yaw, pitch)
    moved = similarity.apply_pose(pose)
    seen = pose.to_camera(np.array([point]))[0]
    np.testing.assert_allclose(
        moved.to_camera(similarity.apply([point]))[0], similarity.scale * seen, rtol=1e-7, atol=1e-5
    )


@given(similarities(), st.integers(3, 30), st.integers(0, 2**32 - 1))
def test_fit_recovers_an_exact_similarity(truth: Similarity, count: int, seed: int) -> None:
    source = np.random.default_rng(seed).normal(size=(count, 3))
    fitted = fit_similarity(source, truth.apply(source))
    assert fitted.scale == pytest.approx(truth.scale, rel=1e-6)
    assert rotation_angle_deg(fitted.rotation, truth.rotation) < 1e-3
    np.testing.assert_allclose(fitted.apply(source), truth.apply(source), atol=1e-6 * max(1.0, truth.scale))


def test_fit_works_for_a_flat_circle_of_cameras_and_never_mirrors() -> None:
    angles = np.linspace(0, 2 * np.pi, 20, endpoint=False)
    circle = np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=1)
    mirrored = circle * [1, 1, -1]
    fitted = fit_similarity(circle, mirrored)
    assert np.linalg.det(fitted.rotation) == pytest.approx(1.0)
    np.testing.assert_allclose(fitted.apply(circle), mirrored, atol=1e-9)


def test_points_on_a_line_and_too_few_points_are_refused() -> None:
    line = np.outer(np.arange(5.0), [1.0, 2.0, 3.0])
    with pytest.raises(ValueError, match="line"):
        fit_similarity(line, line)
    with pytest.raises(ValueError, match="3 pairs"):
        fit_similarity(line[:2], line[:2])


def test_a_sheared_or_mirrored_matrix_is_refused() -> None:
    for matrix in (np.diag([1.0, 1.0, 2.0, 1.0]), np.diag([1.0, 1.0, -1.0, 1.0])):
        with pytest.raises(ValueError, match="not a similarity"):
            Similarity.from_matrix(matrix)
