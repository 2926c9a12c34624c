"""Plants from mesh files."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from PIL import Image

from fieldkit.errors import SceneError
from fieldkit.scenes.plot_description import MeshPlantDescription, PlotDescription, SoilDescription
from fieldkit.scenes.sampling import sample_visible
from fieldkit_sim.mesh_plant import build_mesh_plant
from fieldkit_sim.plot import build_scene


def stick(height: float = 0.6) -> trimesh.Trimesh:
    """A cone that stands on the origin, z up."""
    return trimesh.creation.cone(radius=0.1 * height, height=height, sections=24)


@pytest.mark.parametrize(
    ("suffix", "up", "turn", "units"),
    [
        ("obj", "z", None, 1),
        ("glb", "z", None, 1),  # GLB's own convention is y up; trimesh writes coordinates as they are
        ("stl", "x", (0, -1, 0), 1000),
        ("ply", "y", (1, 0, 0), 1000),
    ],
)
def test_every_format_gives_the_same_plant(tmp_path: Path, suffix: str, up: Any, turn: Any, units: int) -> None:
    shape = stick(0.6 * units)
    if turn:
        shape.apply_transform(trimesh.transformations.rotation_matrix(-np.pi / 2, turn))
    shape.export(tmp_path / f"a.{suffix}")
    plant = MeshPlantDescription(tmp_path / f"a.{suffix}", x_m=0.3, y_m=-0.2, scale=0.5, unit_m=1 / units, up=up)
    mesh = build_mesh_plant(plant, 0.04)
    assert mesh.plant
    lowest, highest = mesh.vertices[:, 2].argmin(), mesh.vertices[:, 2].argmax()
    np.testing.assert_allclose(mesh.vertices[highest], (0.3, -0.2, 0.34), atol=0.002)
    assert mesh.vertices[lowest, 2] == pytest.approx(0.04, abs=1e-4)
    assert (mesh.colors[:, 1] > mesh.colors[:, 2]).mean() > 0.95  # a leaf's green
    assert mesh.colors.std(axis=0).min() > 0.01
    assert len(mesh.faces) > 10_000  # fine enough to carry it


def test_colours_and_textures_are_kept_and_plants_turn_clockwise(tmp_path: Path) -> None:
    quad = trimesh.Trimesh([(0, 0, 0), (0.3, 0, 0), (0.3, 0, 0.3), (0, 0, 0.3)], [(0, 1, 2), (0, 2, 3)], process=False)
    quad.visual.vertex_colors = (200, 10, 30, 255)
    quad.export(tmp_path / "a.ply")
    kept = build_mesh_plant(MeshPlantDescription(tmp_path / "a.ply"))
    np.testing.assert_allclose(255 * kept.colors, [(200, 10, 30)] * 4, atol=1)
    image = Image.new("RGB", (8, 8), (10, 120, 40))
    image.putpixel((0, 0), (255, 0, 0))  # the upper left corner: u = 0, v = 1
    quad.visual = trimesh.visual.TextureVisuals(uv=[(0, 0), (1, 0), (1, 1), (0, 1)], image=image)
    quad.export(tmp_path / "a.glb")
    mesh = build_mesh_plant(MeshPlantDescription(tmp_path / "a.glb", yaw_deg=90))
    corner = mesh.uv[(mesh.vertices[:, 2] > 0.29) & (mesh.vertices[:, 1] > mesh.vertices[:, 1].max() - 0.01)][0]
    np.testing.assert_allclose(corner, (0, 1), atol=1e-6)  # x has become -y
    assert tuple(mesh.texture[0, 0]) == (255, 0, 0)


def test_what_is_no_plant_is_refused(tmp_path: Path) -> None:
    def refused(content: bytes, message: str, suffix: str = "ply") -> None:
        file = tmp_path / f"a.{suffix}"
        file.write_bytes(content)
        with pytest.raises(SceneError, match=message) as caught:
            build_mesh_plant(MeshPlantDescription(file))
        assert caught.value.path == file

    for suffix in ("ply", "glb", "stl", "obj"):
        for content in (b"", b"\x00" * 200, b"ply\nformat ascii 1.0\nelement vertex 99999999999\n"):
            refused(content, "cannot be read as a mesh|no triangles", suffix)
    refused(trimesh.PointCloud(np.eye(3)).export(file_type="ply"), "no triangles")
    refused(stick(600.0).export(file_type="ply"), "600 m high")
    refused(stick().export(file_type="ply"), "is not one of .obj", "zip")


def test_a_real_sorghum_plant(data_folder: Path) -> None:
    plant = MeshPlantDescription(data_folder / "meshes" / "sorghum_mccormick2_mesh.ply", unit_m=0.001, color="leaf")
    soil = SoilDescription(core_m=0.5, spacing_m=0.02, texture_px=256, stones=10, residues=5)
    scene = build_scene(PlotDescription((plant,), soil))
    (mesh,) = scene.plants
    assert len(mesh.faces) == 63_742
    assert (mesh.colors[:, 1] > mesh.colors[:, 2]).mean() > 0.95  # painted: the file's colours are labels
    assert np.ptp(mesh.vertices[:, 2]) == pytest.approx(0.7326, abs=0.001)
    assert len(sample_visible(scene, (20_000,))[0]) > 8_000
