"""Still pictures of 3D views: everything at its place, to one scale, with names and north."""

from io import BytesIO

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from fieldkit.figures.drawings import FrustumLayer, LineLayer, PlaceName, PointLayer, ViewerScene
from fieldkit.geometry import Pose
from fieldkit.report.sections.stills import still

BLUE = "#3b7dd8"


def pixels(scene: ViewerScene) -> NDArray[np.int64]:
    picture = still(scene)
    assert picture.description.startswith(scene.title)
    with Image.open(BytesIO(picture.data)) as image:
        paper = Image.new("RGBA", image.size, "white")
        found = np.asarray(Image.alpha_composite(paper, image.convert("RGBA")).convert("RGB")).astype(np.int64)
    assert found.shape[:2] == (picture.height, picture.width)
    return found


def box_of(mask: NDArray[np.bool_]) -> tuple[int, int, int, int]:
    rows, columns = np.nonzero(mask)
    return int(columns.min()), int(rows.min()), int(columns.max()), int(rows.max())


def plants(*more: tuple[float, float, float]) -> PointLayer:
    """Points over a box of 1 × 0.5 × 0.8 m, and some more."""
    points = np.random.default_rng(0).uniform((-0.5, -0.25, 0.0), (0.5, 0.25, 0.8), (20_000, 3))
    points = np.concatenate([points, np.array(more).reshape(-1, 3)])
    return PointLayer("p", points.astype(np.float32), np.full((len(points), 3), (60, 160, 60), dtype=np.uint8))


def flight(*names: str) -> ViewerScene:
    centers = ((2.0, 0.0, 1.0), (6.0, 3.0, 1.0))
    poses = [Pose.from_yaw_pitch(np.array(center), 0.0, -45.0) for center in centers]
    cameras = FrustumLayer("c", poses, ["one", "two"], 0.5, 0.4, BLUE, numbers=["1", "2"])
    way = LineLayer("w", [np.array([[0, 0, 3], *centers], dtype=np.float32)], "#d9812b")
    places = [PlaceName(name, (3.0 * k, 1.0, 0.0)) for k, name in enumerate(names)]
    return ViewerScene("Flight", frusta=[cameras], lines=[way], places=places, north=(0.0, 1.0), subject="cameras")


def test_front_and_top_have_one_scale() -> None:
    image = pixels(ViewerScene("t", [plants()]))
    green = (image[:, :, 1] - image[:, :, 0] > 40) & (image[:, :, 1] > 60)
    empty = ~green.any(axis=0)
    middle = int(np.nonzero(empty[box_of(green)[0] : box_of(green)[2]])[0].mean()) + box_of(green)[0]
    left, _, right, _ = box_of(green[:, :middle])
    below, above, beyond, bottom = box_of(green[:, middle:])
    assert right - left == pytest.approx(beyond - below, abs=3)  # a metre each
    assert bottom - above == pytest.approx(0.5 * (right - left), abs=4)


def test_a_weed_far_out_does_not_make_the_plants_small() -> None:
    alone, beside = (still(ViewerScene("t", [layer])) for layer in (plants(), plants((9.0, 9.0, 0.0))))
    assert beside.width < 1.5 * alone.width


def test_names_stand_on_a_cloud_only_from_above() -> None:
    bare, named = (pixels(ViewerScene("p", [plants()], places=places)) for places in ((), (PlaceName("1", (0, 0, 0)),)))
    assert bare.shape == named.shape
    changed = np.abs(bare - named).max(axis=2) > 120
    assert changed.any()
    assert box_of(changed)[0] > bare.shape[1] / 2


def test_cameras_stand_at_their_places_and_bear_names() -> None:
    bare, named = pixels(flight()), pixels(flight("Südfeld 1", "home"))
    assert bare.shape[1] > named.shape[1]  # without places from the front, too
    blue = (named[:, :, 2] > 180) & (named[:, :, 0] < 110)
    left, _, right, _ = box_of(blue)
    first, second = blue[:, : (left + right) // 2], blue[:, (left + right) // 2 :]
    (x, y), (u, v) = ([int(part.mean()) for part in np.nonzero(half)[::-1]] for half in (first, second))
    scale = (u + (left + right) // 2 - x) / 4.0
    assert (y - v) / 3.0 == pytest.approx(scale, rel=0.03)  # north is up
    dark = named.max(axis=2) < 140
    for text_x, text_y in ((x, y - 9), (x + (3.0 - 2.0) * scale, y - scale)):  # station 1, and home
        around = dark[int(text_y) - 8 : int(text_y) + 8, int(text_x) - 12 : int(text_x) + 12]
        assert around.sum() > 5
