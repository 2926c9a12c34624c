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
from fieldkit_sim import mesh_plant
from fieldkit_sim.mesh_plant import build_mesh_plant
from fieldkit_sim.plot import build_scene


def stick(height: float = 0.6, **options: object) -> trimesh.Trimesh:
    """A cone that stands on the origin, z up."""
    mesh = trimesh.creation.cone(radius=0.1 * height, height=height, sections=24)
    for name, value in options.items():
        setattr(mesh.visual, name, value)
    return mesh


@pytest.mark.parametrize("suffix", ["obj", "ply", "glb"])
def test_every_format_gives_the_same_plant(tmp_path: Path, suffix: str) -> None:
    stick().export(tmp_path / f"a.{suffix}")
    # a trap for readers of GLB, whose own convention is y up: trimesh writes the coordinates as they are
    mesh = build_mesh_plant(MeshPlantDescription(tmp_path / f"a.{suffix}", x_m=0.3, y_m=-0.2, scale=0.5), 0.04)
    assert mesh.plant
    lower, upper = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    np.testing.assert_allclose((lower + upper)[:2] / 2, (0.3, -0.2), atol=0.002)
    assert lower[2] == pytest.approx(0.04, abs=1e-5)
    assert upper[2] == pytest.approx(0.34, abs=1e-5)
    assert (mesh.colors[:, 1] > mesh.colors[:, 2]).mean() > 0.95  # a leaf's green
    assert mesh.colors.std(axis=0).min() > 0.01
    assert len(mesh.faces) > 10_000  # fine enough to carry it


def test_up_and_unit(tmp_path: Path) -> None:
    for up, turn in (("y", [1, 0, 0]), ("x", [0, -1, 0])):
        lying = stick(600.0)
        lying.apply_transform(trimesh.transformations.rotation_matrix(-np.pi / 2, turn))
        lying.export(tmp_path / f"{up}.ply")
        plant = MeshPlantDescription(tmp_path / f"{up}.ply", up=up, unit_m=0.001)
        mesh = build_mesh_plant(plant)
        assert np.ptp(mesh.vertices[:, 2]) == pytest.approx(0.6, abs=1e-4)
        top = mesh.vertices[mesh.vertices[:, 2].argmax()]
        np.testing.assert_allclose(top[:2], 0, atol=0.002)
        fine = build_mesh_plant(MeshPlantDescription(tmp_path / f"{up}.ply", up=up, unit_m=0.001, yaw_deg=90))
        np.testing.assert_allclose(fine.vertices[:, 0], mesh.vertices[:, 1], atol=1e-5)


def test_the_files_colours_are_kept(tmp_path: Path) -> None:
    mesh = stick()
    mesh.visual.vertex_colors = np.tile([200, 10, 30, 255], (len(mesh.vertices), 1)).astype(np.uint8)
    mesh.export(tmp_path / "a.ply")
    kept = build_mesh_plant(MeshPlantDescription(tmp_path / "a.ply"))
    np.testing.assert_allclose(kept.colors, np.tile(np.array([200, 10, 30]) / 255, (len(kept.colors), 1)), atol=0.01)
    painted = build_mesh_plant(MeshPlantDescription(tmp_path / "a.ply", color="leaf"))
    assert painted.colors[:, 1].mean() > painted.colors[:, 0].mean()


def test_a_texture_is_kept(tmp_path: Path) -> None:
    quad = trimesh.Trimesh([(0, 0, 0), (0.3, 0, 0), (0.3, 0, 0.3), (0, 0, 0.3)], [(0, 1, 2), (0, 2, 3)], process=False)
    image = Image.new("RGB", (8, 8), (10, 120, 40))
    image.putpixel((0, 0), (255, 0, 0))  # the upper left corner: u = 0, v = 1
    quad.visual = trimesh.visual.TextureVisuals(uv=[(0, 0), (1, 0), (1, 1), (0, 1)], image=image)
    quad.export(tmp_path / "a.glb")
    mesh = build_mesh_plant(MeshPlantDescription(tmp_path / "a.glb"))
    corner = mesh.uv[(mesh.vertices[:, 2] > 0.29) & (mesh.vertices[:, 0] < mesh.vertices[:, 0].min() + 0.01)][0]
    np.testing.assert_allclose(corner, (0, 1), atol=1e-6)
    assert tuple(mesh.texture[0, 0]) == (255, 0, 0)


def test_broken_files(tmp_path: Path) -> None:
    for suffix in ("ply", "glb", "stl", "obj"):
        stick().export(tmp_path / f"a.{suffix}")
        whole = (tmp_path / f"a.{suffix}").read_bytes()
        for content in (b"", b"\x00" * 200, whole[:60], b"ply\nformat ascii 1.0\nelement vertex 99999999999\n"):
            (tmp_path / f"a.{suffix}").write_bytes(content)
            with pytest.raises(SceneError) as caught:
                build_mesh_plant(MeshPlantDescription(tmp_path / f"a.{suffix}"))
            assert caught.value.path == tmp_path / f"a.{suffix}"
            assert caught.value.remedy


def test_what_is_no_plant_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "a.ply"

    def refused(shape: Any, message: str) -> None:
        shape.export(file)
        with pytest.raises(SceneError, match=message):
            build_mesh_plant(MeshPlantDescription(file))

    refused(trimesh.PointCloud(np.random.default_rng(0).random((50, 3))), "no triangles")
    refused(stick(600.0), "600 m high")
    monkeypatch.setattr(mesh_plant, "MAX_TRIANGLES", 10)
    refused(stick(), "triangles; up to 10 are drawn")


def test_a_real_sorghum_plant(data_folder: Path) -> None:
    file = data_folder / "meshes" / "sorghum_mccormick2_mesh.ply"
    plant = MeshPlantDescription(file, unit_m=0.001, color="leaf")
    mesh = build_mesh_plant(plant)
    assert len(mesh.faces) == 63_742
    assert np.ptp(mesh.vertices[:, 2]) == pytest.approx(0.7326, abs=0.001)
    soil = SoilDescription(core_m=0.5, spacing_m=0.02, texture_px=256, stones=10, residues=5)
    scene = build_scene(PlotDescription((plant,), soil))
    truth = sample_visible(scene, (20_000,))[0]
    assert len(truth) > 8_000
