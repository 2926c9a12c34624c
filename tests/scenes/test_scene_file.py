"""Scene files say all that a description can, and nothing else."""

import re
import subprocess
import sys
import tempfile
from dataclasses import fields, replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fieldkit.documents.toml_file import toml_text
from fieldkit.errors import MetadataError
from fieldkit.geometry import Intrinsics
from fieldkit.scenes.camera_effects import CameraEffects
from fieldkit.scenes.description import Bounds, SceneDescription, build, scene_digest
from fieldkit.scenes.plot_description import MaizeDescription, MeshPlantDescription, PlotDescription, SoilDescription
from fieldkit.scenes.recorded import RecordedSurface
from fieldkit.scenes.scene import Light
from fieldkit.scenes.scene_file import read_scene, scene_text, write_scene
from fieldkit.scenes.simulate import CaptureNoise

ROOT = Path(__file__).parents[2]
FOLDER = tempfile.TemporaryDirectory()
HERE = Path(FOLDER.name) / "here.toml"

small = st.floats(-2, 2)
positive = st.floats(0.1, 3)
texts = st.text(st.characters(exclude_categories=["Cs"]), max_size=20)
maize = st.builds(
    MaizeDescription,
    seed=st.integers(0, 2**31),
    x_m=small,
    y_m=small,
    yaw_deg=st.floats(-360, 360),
    scale=st.floats(0.5, 2),
)
scenes = st.builds(
    SceneDescription,
    plot=st.builds(
        PlotDescription,
        st.lists(maize, max_size=4).map(tuple),
        st.builds(SoilDescription, seed=st.integers(0, 99), contrast=st.floats(0, 1)),
        st.builds(Light, sun_color=st.tuples(positive, positive, positive)),
    ),
    name=texts.filter(bool),
    notes=texts,
    bounds=st.builds(
        Bounds, st.tuples(st.floats(-9, -1), st.floats(-9, -1), st.just(0.0)), st.tuples(positive, positive, positive)
    ),
    camera=st.builds(Intrinsics.pinhole, st.integers(1, 9000), st.integers(1, 9000), st.floats(1, 9000)),
    camera_effects=st.builds(CameraEffects, defocus_px=st.floats(0, 4), jpeg_quality=st.integers(1, 100)),
    noise=st.builds(CaptureNoise, position_m=st.floats(0, 1), image_sigma=st.floats(0, 9)),
)


def scene_of(text: str) -> SceneDescription:
    HERE.write_bytes(text.encode())
    return read_scene(HERE)


@given(scene=scenes, complete=st.booleans())
def test_round_trip(scene: SceneDescription, complete: bool) -> None:
    text = scene_text(scene, complete=complete)
    assert scene_of(text) == scene
    assert scene_text(scene_of(text), complete=complete) == text


plain = st.one_of(
    texts, st.booleans(), st.integers(-(2**63), 2**63 - 1), st.floats(allow_nan=False, allow_infinity=False)
)
json_like = st.one_of(plain, st.lists(plain, max_size=3), st.dictionaries(texts, plain, max_size=3))


@given(st.dictionaries(st.sampled_from([*(f.name for f in fields(SceneDescription)), "x"]), json_like))
def test_anything_else_is_an_error_for_people(document: dict[str, object]) -> None:
    try:
        text = "format = 1\n" + toml_text(document)
    except (TypeError, ValueError):
        return
    try:
        scene_of(text)
    except MetadataError as caught:
        error = caught
    else:
        return
    assert error.exit_code == 3
    assert error.path == HERE
    assert error.remedy


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "has no 'format'"),
        ("format = true", "has format True"),
        ("format = 1\nx = 1", "x: is not a key of this format"),
        ("format = 1\n[plot]\nextent = 2", "plot.extent: is not a key of this format"),
        ("format = 1\n[[plot.plants]]\nseed = 1\n[[plot.plants]]\nseed = 'a'", "plot.plants 2.maize.seed: should be a"),
        ("format = 1\n[[plot.plants]]\nkind = 'rye'", "plot.plants 1: input tag 'rye' found using 'kind' does not"),
        ("format = 1\n[plot]\nplants = ['maize']", "plot.plants 1: should be a table"),
        ("format = 1\n[camera_effects]\njpeg_quality = 0", "camera_effects.jpeg_quality: input should be greater"),
        ("format = 1\n[plot.soil]\ncore_m = nan", "plot.soil.core_m: input should be a finite number"),
        ("format = 1\n[plot.soil]\nseed = 1979-05-27", "plot.soil.seed: should be a number"),
        ("format = 1\n[bounds]\nlower_m = [9, 9, 9]", "bounds: the lower corner"),
        ("format = 1\nplot = 3", "plot: should be a table"),
    ],
)
def test_errors_name_the_key(text: str, message: str) -> None:
    with pytest.raises(MetadataError, match=re.escape(message)) as caught:
        scene_of(text)
    assert "pydantic" not in str(caught.value)


def test_files_lie_in_the_scenes_folder_or_are_named_by_an_absolute_path(tmp_path: Path) -> None:
    folder = tmp_path / "inside"
    (folder / "meshes").mkdir(parents=True)
    for name in ("inside/meshes/a.ply", "outside.ply"):
        (tmp_path / name).write_text("ply")

    def scene(named: str) -> SceneDescription:
        (folder / "scene.toml").write_text(f"format = 1\n[[plot.plants]]\nfile = '{named}'\n")
        return read_scene(folder / "scene.toml")

    for named, file in (("meshes/a.ply", folder / "meshes" / "a.ply"), (f"{tmp_path}/outside.ply",) * 2):
        (plant,) = scene(named).plot.plants
        assert isinstance(plant, MeshPlantDescription)
        assert plant.file == Path(file).resolve()
    for named, message in (("../outside.ply", "../outside.ply leads out of the scene's"), ("b.ply", "there is no ")):
        with pytest.raises(MetadataError, match=re.escape(f"plot.plants 1.file: {message}")) as caught:
            scene(named)
        assert caught.value.path == folder / "scene.toml"
    inside = scene("meshes/a.ply")
    write_scene(folder / "other.toml", inside)
    assert 'file = "meshes/a.ply"' in (folder / "other.toml").read_text()
    write_scene(tmp_path / "out" / "scene.toml", inside)
    for path in (folder / "other.toml", tmp_path / "out" / "scene.toml"):
        assert read_scene(path).plot == inside.plot


def test_a_scene_is_recorded_or_grown() -> None:
    surface = RecordedSurface(Path("a.ply"), Path("b.ply"), 0.001, 0.001)
    with pytest.raises(ValueError, match="either"):
        SceneDescription(PlotDescription((MaizeDescription(1),)), recorded=surface)


@pytest.mark.slow
def test_the_same_file_is_the_same_scene_in_another_process(tmp_path: Path, small_plot: PlotDescription) -> None:
    plants = (*small_plot.plants[:1],)
    file = tmp_path / "scene.toml"
    write_scene(file, SceneDescription(replace(small_plot, plants=plants)))
    script = (
        "import sys; from pathlib import Path; from fieldkit.scenes.scene_file import read_scene; "
        "from fieldkit.scenes.description import build, scene_digest; "
        "print(scene_digest(build(read_scene(Path(sys.argv[1])))))"
    )
    found = [
        subprocess.run([sys.executable, "-c", script, str(file)], capture_output=True, text=True, check=True).stdout
        for _ in range(2)
    ]
    assert found[0] == found[1] == scene_digest(build(read_scene(file))) + "\n"
    other = replace(small_plot, plants=(replace(plants[0], yaw_deg=1.0),))
    assert scene_digest(build(SceneDescription(other))) + "\n" != found[0]
