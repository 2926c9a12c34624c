"""A field of two plots with tables for plants: its heights, and an orthophoto of three drawn photographs."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from scipy import ndimage

from fieldkit.captures import read_image
from fieldkit.captures.model import Photo
from fieldkit.clouds import Cloud, write_cloud
from fieldkit.evaluation import field, orthophoto
from fieldkit.evaluation.rasters import CANOPY_FILE, SURFACE_FILE, Rasters
from fieldkit.evaluation.utm import Projection
from fieldkit.geometry import Intrinsics, Pose
from fieldkit.results.evaluation import CLOUD_FILE, FIELD_PICTURE, FileEntry, PlotEvaluation
from fieldkit.results.frame import FrameEntry
from fieldkit.results.traits import TraitsEntry
from fieldkit.runtime.context import Context
from fieldkit.scenes.renderer import Renderer
from fieldkit.scenes.scene import Mesh, Scene
from tests.evaluation.examples import reconstruction

rasterio = pytest.importorskip("rasterio")
pytest.importorskip("pyproj")
PIXEL_M = 0.01
CAMERA = Intrinsics.pinhole(400, 300, 300.0)
HIGH_M = 0.5
WEST, EAST = ((-1.6, -0.7), (-0.2, -0.7), (-0.2, 0.7), (-1.6, 0.7)), ((0.2, -0.7), (1.6, -0.7), (1.6, 0.7), (0.2, 0.7))
TABLES = ((-1.4, -0.5, -0.6, 0.3), (0.6, -0.3, 1.4, 0.5))
"""Low and high (x, y)."""
PEGS = [(-1.55, -0.65, 0.0), (-0.25, 0.65, 0.0), (0.25, 0.65, 0.0), (1.55, -0.65, 0.0), (-1.2, 0.0, HIGH_M)]
PEGS += [(1.25, 0.2, HIGH_M), (0.0, 1.3, 0.0), (2.1, 0.0, 0.0)]
POSES = [
    Pose.from_yaw_pitch((x, y, 4.0), yaw, -87.0) for x, y, yaw in ((-1.0, 0.1, 5.0), (0.1, 0.0, 0.0), (1.1, 0.0, 185.0))
]
FRAME = reconstruction().sparse.frame


def plate(low: tuple[float, float], high: tuple[float, float], z: float, grey: float) -> Mesh:
    (x, y), (x2, y2) = low, high
    corners = np.float32([(x, y, z), (x2, y, z), (x2, y2, z), (x, y2, z)])
    faces, colors = np.int32([(0, 1, 2), (0, 2, 3)]), np.full((4, 3), grey, np.float32)
    return Mesh(f"{low}{z}", corners, faces, colors=colors)


@pytest.fixture(scope="module")
def flight(tmp_path_factory: pytest.TempPathFactory):
    """The mapped flight; the middle photograph is darker than the others."""
    folder = tmp_path_factory.mktemp("flight")
    meshes = [plate((-9.0, -9.0), (9.0, 9.0), 0.0, 0.3), *(plate(t[:2], t[2:], HIGH_M, 0.4) for t in TABLES)]
    meshes += [plate((x - 0.04, y - 0.04), (x + 0.04, y + 0.04), z + 0.002, 0.9) for x, y, z in PEGS]
    photos = []
    with Renderer(Scene(tuple(meshes))) as renderer:
        for index, pose in enumerate(POSES):
            path = folder / f"IMG_{index}.png"
            picture = renderer.photograph(pose, CAMERA)
            Image.fromarray((picture * (0.8 if index == 1 else 1.0)).astype(np.uint8)).save(path)
            photos.append(Photo(path, path.name, 400, 300, "PNG", "0" * 64))
    sparse = reconstruction().sparse
    names = [photo.name for photo in photos]
    return replace(
        sparse,
        capture=replace(sparse.capture, photos=tuple(photos)),
        poses=dict(zip(names, POSES, strict=True)),
        intrinsics=dict.fromkeys(names, CAMERA),
    )


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[PlotEvaluation]]:
    """The evaluated plots, and the folder of their clouds. The western one's has points over the eastern one, too."""
    folder = tmp_path_factory.mktemp("field")
    frame = FrameEntry(
        plot_from_source=tuple(tuple(row) for row in FRAME.plot_from_source.matrix().tolist()),
        origin=FRAME.origin,
        crs_epsg=None,
        ground=FRAME.ground,
        notes=(),
    )
    plots = []
    for name, table in zip(("west", "east"), TABLES, strict=True):
        x, y = (np.arange(low, high, 0.006) for low, high in zip(table[:2], table[2:], strict=True))
        points = np.stack([*np.meshgrid(x, y), np.full((len(y), len(x)), HIGH_M)], axis=-1).reshape(-1, 3)
        beyond = np.array([(0.25, 0.1, 1.0), (-0.1, 0.1, 0.3)])
        (folder / name).mkdir()
        write_cloud(folder / name / CLOUD_FILE, Cloud(np.concatenate([points, beyond]) if name == "west" else points))
        entry = FileEntry(name=f"{name}/{CLOUD_FILE}", bytes=1, sha256="0" * 64)
        traits = TraitsEntry(unknown={"height_m": "pictures end"} if name == "west" else {}, height_m=None)
        plots.append(
            PlotEvaluation(name=name, images=3, seconds=1, cpu_seconds=1, frame=frame, files=(entry,), traits=traits)
        )
    return folder, plots


@pytest.fixture(scope="module")
def files(flight, results) -> Path:
    folder, plots = results
    field.write_field(folder, flight, {"west": WEST, "east": EAST}, plots, Rasters(PIXEL_M), Context())
    return folder


def cell(file, x: float, y: float, z: float = 0.0) -> tuple[float, float]:
    """Row and column of a place of the plot frame; the middle of the first cell has (0, 0)."""
    east, north, _ = Projection(FRAME).to_utm(np.array([x, y, z]))
    west, north_edge = file.bounds.left, file.bounds.top
    return (north_edge - north) / PIXEL_M - 0.5, (east - west) / PIXEL_M - 0.5


def test_heights_of_the_whole_field(files: Path) -> None:
    with rasterio.open(files / CANOPY_FILE) as canopy, rasterio.open(files / SURFACE_FILE) as surface:
        assert canopy.tags(ns="IMAGE_STRUCTURE")["LAYOUT"] == "COG"
        assert canopy.descriptions == ("canopy height, m, AT LEAST: west: pictures end",)
        heights, surfaces = (file.read(1, masked=True).filled(np.nan) for file in (canopy, surface))
        for (x, y), height in {
            (-1.0, 0.0): HIGH_M,
            (1.0, 0.0): HIGH_M,
            (-1.5, 0.6): 0.0,
            (0.25, 0.1): 0.0,  # hangs over another plot
            (-0.1, 0.1): 0.3,
            (0.0, -0.5): np.nan,
            (2.3, 0.0): np.nan,
        }.items():
            at = tuple(round(k) for k in cell(canopy, x, y))
            assert heights[at] == pytest.approx(height, abs=1e-5, nan_ok=True)
            assert surfaces[at] == pytest.approx(FRAME.origin.altitude_m + 1.2 + height, abs=1e-3, nan_ok=True)


def test_places_are_right_to_a_pixel(files: Path) -> None:
    with rasterio.open(files / orthophoto.ORTHOPHOTO_FILE) as file:
        assert file.tags(ns="IMAGE_STRUCTURE")["LAYOUT"] == "COG"
        assert file.res == (PIXEL_M, PIXEL_M)
        grey = file.read(1)
        for peg in PEGS:
            row, column = cell(file, *peg)
            top, left = round(row) - 12, round(column) - 12
            seen = grey[top : top + 25, left : left + 25] > 150
            middle = np.add(ndimage.center_of_mass(seen), (top, left))
            assert np.hypot(*(middle - (row, column))) < 1.0, peg
            assert seen.sum() == pytest.approx(64, abs=20)


def test_photographs_are_equally_bright(files: Path) -> None:
    with rasterio.open(files / orthophoto.ORTHOPHOTO_FILE) as file:
        grey, shown = file.read(1), file.dataset_mask() > 0
    assert not shown[0, 0]  # a corner beyond the field
    soil = grey[shown & (grey < 90)]
    assert np.ptp(np.quantile(soil, [0.02, 0.98])) <= 3


def test_windows_give_what_one_piece_gives(flight, files: Path, results, tmp_path: Path, monkeypatch) -> None:
    """And each plot is of the one photograph that shows all of it, whose centre is not the nearest everywhere."""
    shown = []

    def seams(cameras, places: np.ndarray, owner: np.ndarray) -> np.ndarray:
        squares = original(cameras, places, owner)
        shown.extend([set(squares[owner == plot].tolist()) for plot in (-1, 0, 1, 2)])
        return squares

    original = orthophoto.seams
    monkeypatch.setattr(orthophoto, "seams", seams)
    monkeypatch.setattr(orthophoto, "_TILE", 3)
    for name in ("west", "east"):
        (tmp_path / name).symlink_to(files / name)
    field.write_field(tmp_path, flight, {"west": WEST, "east": EAST}, results[1], Rasters(PIXEL_M), Context())
    with rasterio.open(files / orthophoto.ORTHOPHOTO_FILE) as one, rasterio.open(tmp_path / one.name) as other:
        np.testing.assert_array_equal(one.read(), other.read())
    beyond, rest, west, east = shown
    assert beyond == {-1}
    assert len(west) == len(east) == 1
    assert west != east
    assert rest == {0, 1, 2}


def test_the_picture_is_small(files: Path) -> None:
    assert max(read_image(files / FIELD_PICTURE).shape) <= 2000
