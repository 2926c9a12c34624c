"""Pixels and depths are where the camera model says."""

import gc
from collections.abc import Sequence
from dataclasses import replace
from threading import Thread

import numpy as np
import pytest
from shapely import Polygon

from fieldkit.arrays import ByteArray
from fieldkit.geometry import Intrinsics, Pose
from fieldkit.scenes.renderer import Renderer, RenderingError, smooth_edges
from fieldkit.scenes.scene import Mesh, Scene
from fieldkit_sim.faces import vertex_normals
from fieldkit_sim.simulation import ring

# A principal point off the middle, unequal focal lengths and odd sizes: what a symmetric camera would hide.
CAMERA = Intrinsics("PINHOLE", 641, 479, (612.0, 598.0, 300.25, 251.5))
POSE = Pose.from_yaw_pitch([0.4, -1.5, 1.1], -13.0, -31.0, 8.0)


def quads(centers: np.ndarray, half_m: float) -> Mesh:
    """Small white squares that face south and upwards, one at each centre."""
    right, up = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.6, 0.8])
    corners = np.array([-right - up, right - up, right + up, -right + up]) * half_m
    vertices = (centers[:, None] + corners).reshape(-1, 3).astype(np.float32)
    faces = np.concatenate([np.array([[0, 1, 2], [0, 2, 3]]) + 4 * i for i in range(len(centers))]).astype(np.int32)
    return Mesh("targets", vertices, faces, colors=np.ones((len(vertices), 3), np.float32))


def plane(half_m: float = 50.0) -> Mesh:
    """The ground z = 0 as two triangles."""
    corners = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], np.float32) * half_m
    return Mesh("plane", corners, np.array([[0, 1, 2], [0, 2, 3]], np.int32), colors=np.ones((4, 3), np.float32))


def test_squares_appear_where_the_camera_projects_them() -> None:
    rng = np.random.default_rng(2)
    centers = np.stack(np.meshgrid(np.linspace(-0.3, 0.8, 6), np.linspace(-0.2, 1.2, 5), indexing="ij"), -1)
    centers = np.column_stack([centers.reshape(-1, 2) + rng.uniform(-0.02, 0.02, (30, 2)), rng.uniform(0, 0.08, 30)])
    image = Renderer(Scene((quads(centers, 0.02),), background=(0.0, 0.0, 0.0))).photograph(POSE, CAMERA)
    v, u = np.mgrid[: CAMERA.height, : CAMERA.width] + 0.5
    errors = []
    for corners in quads(centers, 0.02).vertices.reshape(-1, 4, 3).astype(np.float64):
        polygon = Polygon(CAMERA.project(POSE.to_camera(corners)))
        left, top, right, bottom = polygon.buffer(2.0).bounds
        if min(left, top) < 0 or right > CAMERA.width or bottom > CAMERA.height:
            continue
        window = np.s_[int(top) : int(bottom) + 1, int(left) : int(right) + 1]
        weights = image[window][..., 0]
        middle = np.average([u[window], v[window]], axis=(1, 2), weights=np.broadcast_to(weights, (2, *weights.shape)))
        errors.append(middle - polygon.centroid.coords[0])
    assert len(errors) >= 15
    assert np.abs(errors).max() <= 0.1
    assert np.abs(np.mean(errors, axis=0)).max() <= 0.02  # no systematic shift of a part of a pixel


def test_depth_of_a_plane_is_the_rays_own_depth() -> None:
    with Renderer(Scene((plane(),))) as renderer:
        depth = renderer.depth(POSE, CAMERA).astype(np.float64)
        assert (renderer.depth(Pose.from_yaw_pitch([0, 0, 1.0], 0, 80), CAMERA) == 0).all()  # nothing is hit
    v, u = np.mgrid[: CAMERA.height, : CAMERA.width] + 0.5
    rays = np.stack([(u - CAMERA.cx) / CAMERA.fx, (v - CAMERA.cy) / CAMERA.fy, np.ones_like(u)], -1) @ POSE.rotation
    with np.errstate(divide="ignore"):
        expected = -POSE.center[2] / rays[..., 2]
    inside = (expected > 0) & (expected < 30.0)
    assert inside.mean() > 0.5
    np.testing.assert_allclose(depth[inside], expected[inside], rtol=1e-4)


def nearest_hit(triangles: np.ndarray, origin: np.ndarray, ray: np.ndarray) -> float:
    """Ray parameter of the first triangle (m, 3, 3) hit (Möller and Trumbore 1997)."""
    a, edge1, edge2 = triangles[:, 0], triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    p = np.cross(ray, edge2)
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = 1.0 / np.einsum("ij,ij->i", edge1, p)
        u = np.einsum("ij,ij->i", origin - a, p) * inverse
        q = np.cross(origin - a, edge1)
        v = (q @ ray) * inverse
        t = np.einsum("ij,ij->i", edge2, q) * inverse
        hit = (u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0)
    return float(t[hit].min())


def test_depth_agrees_with_ray_casting_of_the_plants(renderer: Renderer, small_scene: Scene) -> None:

    pose, camera = Pose.look_at([0.6, -0.8, 0.7], [0.1, 0.0, 0.2]), Intrinsics.pinhole(160, 120, 150.0)
    depth = renderer.depth(pose, camera)
    rng = np.random.default_rng(0)
    rows, columns = rng.integers(0, 120, 60), rng.integers(0, 160, 60)
    triangles = np.concatenate([m.vertices[m.faces] for m in small_scene.meshes]).astype(np.float64)
    pixels = np.column_stack([columns + 0.5, rows + 0.5, np.ones(60)])
    rays = (pixels @ np.linalg.inv(camera.matrix()).T) @ pose.rotation  # of length 1 along the optical axis
    expected = np.array([nearest_hit(triangles, pose.center, ray) for ray in rays])
    far = expected > 50.0  # the sky's dome and the horizon
    assert far.sum() < 30
    wrong = (np.abs(depth[rows, columns] - expected) > 1e-3 * expected) & ~far
    assert wrong.sum() <= 1  # a ray along an edge may go either way


def test_the_same_view_twice_is_the_same_bytes_and_a_new_renderer_agrees(renderer, small_scene) -> None:
    first = renderer.photograph(POSE, CAMERA)
    renderer.photograph(Pose.look_at([1.0, 1.0, 1.0], [0.0, 0.0, 0.0]), CAMERA.scaled(320, 240), samples=0)
    assert np.array_equal(first, renderer.photograph(POSE, CAMERA))
    with Renderer(small_scene) as another:
        image, depth = another.photograph(POSE, CAMERA), another.depth(POSE, CAMERA)
    assert np.array_equal(image, first)
    assert np.array_equal(depth, renderer.depth(POSE, CAMERA))


def test_sun_shade_and_gloss() -> None:
    """A lit surface is brighter in the sun than in the shade, and its far side shows what shines through."""
    ground = plane()
    normals = vertex_normals(ground.vertices, ground.faces)
    levels = {}
    for name, shading in (("sun", (1, 1, 0, 0)), ("shade", (0, 1, 0, 0)), ("dark", (0, 0, 0, 0))):
        lit = Mesh("g", ground.vertices, ground.faces, normals, shading=np.tile(np.float32(shading), (4, 1)))
        with Renderer(Scene((lit,))) as renderer:
            levels[name] = int(renderer.photograph(Pose.from_yaw_pitch([0, 0, 2.0], 0, -90), CAMERA)[240, 300, 1])
    assert levels["sun"] > levels["shade"] + 40
    assert levels["shade"] > 80
    assert levels["dark"] == 0


def test_distortion_is_refused(renderer: Renderer) -> None:
    with pytest.raises(ValueError, match="distortion"):
        renderer.photograph(POSE, Intrinsics("SIMPLE_RADIAL", 64, 48, (50.0, 32.0, 24.0, 0.1)))


def test_a_machine_that_cannot_render_gets_a_remedy(monkeypatch: pytest.MonkeyPatch) -> None:
    for name, value in (("EGL_DEVICE_ID", "99"), ("PYOPENGL_PLATFORM", "nonsense")):
        monkeypatch.setenv(name, value)
        with pytest.raises(RenderingError, match="cannot start") as caught:
            Renderer(Scene((plane(),)))
        assert "libegl1" in (caught.value.remedy or "")


@pytest.mark.parametrize("elsewhere", [False, True])
def test_a_closed_or_forgotten_renderer_takes_no_other_with_it(elsewhere: bool, renderer: Renderer) -> None:
    closed = Renderer(Scene((plane(),)))
    forgotten = [Renderer(Scene((plane(),)))]
    forgotten[0].photograph(POSE, CAMERA)
    for _ in range(2):
        closed.close()
    with pytest.raises(RenderingError):
        closed.photograph(POSE, CAMERA)
    if elsewhere:  # in a thread where its context, being current in this one, cannot be made current
        ender = Thread(target=forgotten.clear)
        ender.start()
        ender.join()
    forgotten.clear()
    gc.collect()
    assert renderer.photograph(POSE, CAMERA).shape == (CAMERA.height, CAMERA.width, 3)


def test_an_economical_drawing_has_its_own_depth_and_other_pixels(renderer: Renderer) -> None:
    for pose in (POSE, Pose.look_at([1.0, 1.0, 1.0], [0.0, 0.0, 0.0])):
        image, depth = renderer.drawn(pose, CAMERA, depth=True, economy=True)
        usual, same = renderer.drawn(pose, CAMERA, depth=True, economy=False)
        np.testing.assert_array_equal(depth, same)
        assert (image != usual).any()
        np.testing.assert_array_equal(image, renderer.drawn(pose, CAMERA, depth=False, economy=True)[0])


@pytest.mark.parametrize("width", [1, 3, 250])
def test_textures_of_any_width(width: int) -> None:
    corners = np.array([[-0.5, -0.5, 0], [0.5, -0.5, 0], [0.5, 0.5, 0], [-0.5, 0.5, 0]], np.float32)
    faces = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    texture = np.full((7, width, 3), (255, 0, 0), np.uint8)
    square = Mesh("square", corners, faces, uv=corners[:, :2] + 0.5, texture=texture)
    down = Pose.from_yaw_pitch([0.0, 0.0, 2.0], 0.0, -90.0)
    with Renderer(Scene((square,), background=(0.0, 0.0, 1.0))) as renderer:
        image = renderer.photograph(down, Intrinsics.pinhole(64, 64, 64.0), samples=0)
    assert set(map(tuple, image.reshape(-1, 3).tolist())) == {(255, 0, 0), (0, 0, 255)}


def test_of_coincident_surfaces_one_wins_by_its_place_in_the_scene() -> None:
    pose, camera = Pose.from_yaw_pitch((0.0, 0.0, 2.0), 0.0, -90.0), Intrinsics.pinhole(16, 16, 40.0)
    colors = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 0]], np.float32)

    def middle(order: Sequence[int]) -> tuple[int, ...]:
        meshes = tuple(replace(plane(1.0), colors=np.tile(colors[i], (4, 1))) for i in order)
        with Renderer(Scene(meshes)) as renderer:
            return tuple(renderer.photograph(pose, camera)[8, 8])

    alone = [middle([i]) for i in range(4)]
    assert len(set(alone)) == 4
    orders = [np.roll(np.arange(4), shift).tolist() for shift in range(4)]
    assert len({order.index(alone.index(middle(order))) for order in orders}) == 1


# Edges smoothed after the fact: nearer to four samples per pixel than one is, and nothing else changed.


def half_plane(slope: float, samples: int) -> ByteArray:
    """(60, 80, 3): bright below a line of that slope, each pixel the mean of its samples² points."""
    y, x = (np.mgrid[: 60 * samples, : 80 * samples] + 0.5) / samples
    covered = (y > 12.3 + slope * x).reshape(60, samples, 80, samples).mean((1, 3))
    return np.repeat(np.rint(40 + 160 * covered)[..., None], 3, axis=2).astype(np.uint8)


@pytest.mark.parametrize("slope", [0.08, 0.55])
@pytest.mark.parametrize("transposed", [False, True])
def test_a_straight_edge_comes_near_its_true_coverage(slope: float, transposed: bool) -> None:
    stairs, truth = half_plane(slope, 1), half_plane(slope, 16)
    if transposed:
        stairs, truth = np.ascontiguousarray(stairs.swapaxes(0, 1)), truth.swapaxes(0, 1)
    smooth = smooth_edges(stairs)
    inner = (slice(3, -3), slice(3, -3))
    before = np.abs(stairs[inner].astype(float) - truth[inner]).sum()
    after = np.abs(smooth[inner].astype(float) - truth[inner]).sum()
    assert after < 0.6 * before


def test_what_has_no_edges_stays_as_it_is() -> None:
    ramp = np.repeat((np.arange(120, dtype=np.uint8) * 2)[None, :, None], 60, axis=0).repeat(3, axis=2)
    np.testing.assert_array_equal(smooth_edges(ramp), ramp)
    dim = np.random.default_rng(3).integers(90, 98, (50, 60, 3)).astype(np.uint8)
    np.testing.assert_array_equal(smooth_edges(dim), dim)


def test_a_rendered_plant_lies_nearer_to_many_samples(renderer: Renderer) -> None:
    camera = Intrinsics.pinhole(400, 300, 340.0)
    pose = ring(1, 1.0, 0.8)[0]
    large = renderer.photograph(pose, camera.scaled(1600, 1200)).astype(np.float64)
    truth = large.reshape(300, 4, 400, 4, 3).mean((1, 3))
    single = renderer.photograph(pose, camera, samples=0)

    def error(image: ByteArray) -> float:
        return float(np.sqrt(((image - truth) ** 2).mean()))

    assert error(smooth_edges(single)) < 0.9 * error(single)
