"""Meshes are drawn in the scene's order, so that surfaces that touch look the same in every process."""

import numpy as np

from fieldkit.geometry import Intrinsics, Pose
from fieldkit.scenes.renderer import Renderer
from fieldkit.scenes.scene import Mesh, Scene

COLORS = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 0], [0, 1, 1], [1, 0, 1], [1, 1, 1], [0, 0, 0]], np.float32)


def square(color: np.ndarray) -> Mesh:
    """The same square for every colour, under the same name."""
    corners = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], np.float32)
    return Mesh("square", corners, np.array([[0, 1, 2], [0, 2, 3]], np.int32), colors=np.tile(color, (4, 1)))


def test_of_coincident_surfaces_one_wins_by_its_place_in_the_scene() -> None:
    pose, camera = Pose.from_yaw_pitch((0.0, 0.0, 2.0), 0.0, -90.0), Intrinsics.pinhole(16, 16, 40.0)

    def middle(meshes: list[Mesh]) -> tuple[int, ...]:
        with Renderer(Scene(tuple(meshes))) as renderer:
            return tuple(renderer.photograph(pose, camera)[8, 8])

    alone = [middle([square(color)]) for color in COLORS]
    assert len(set(alone)) == len(COLORS)
    winners = set()
    for shift in range(len(COLORS)):
        order = np.roll(np.arange(len(COLORS)), shift)
        winners.add(int(np.flatnonzero(order == alone.index(middle([square(COLORS[i]) for i in order])))[0]))
    assert len(winners) == 1
