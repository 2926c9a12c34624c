"""The scenes that come with fieldkit are what the paper says."""

import importlib.util
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fieldkit.errors import SceneError
from fieldkit.scenes.description import SceneDescription
from fieldkit.scenes.library import find_scene, scene_names, scene_reference, scenes_folder
from fieldkit.scenes.scene_file import read_scene, scene_text
from fieldkit_sim.generator import Layout, new_scene, plots_of_kind

ROOT = Path(__file__).parents[2]
CASES = {"case-1": 3, "case-2": 5, "case-3": 6}


def scene(name: str) -> SceneDescription:
    return read_scene(find_scene(name))


def test_test_cases_are_the_papers_changes_of_its_cases() -> None:
    assert {name: len(scene(name).plot.plants) for name in CASES} == CASES
    for number in (1, 2, 3):
        base, test = scene(f"case-{number}"), scene(f"test-case-{number}")
        assert replace(test.plot, plants=()) == replace(base.plot, plants=())
        for a, b in zip(base.plot.plants, test.plot.plants, strict=True):
            assert replace(b, yaw_deg=a.yaw_deg, scale=a.scale) == a
            assert (b.yaw_deg, b.scale) != (a.yaw_deg, a.scale)
            assert 0.9 <= b.scale <= 1.1
    for number, name in ((4, "case-1"), (5, "case-3")):
        whole, fewer = scene(name).plot, scene(f"test-case-{number}").plot
        assert len(fewer.plants) == len(whole.plants) - 1
        assert set(fewer.plants) < set(whole.plants)
        assert replace(fewer, plants=()) == replace(whole, plants=())


def test_tuning_scenes_are_others() -> None:
    tuning = [name for name in scene_names() if name.startswith("tuning-")]
    assert len(tuning) >= 6
    seeds = {name: {plant.seed for plant in scene(name).plot.plants} for name in scene_names()}
    for name in tuning:
        assert all(not seeds[name] & other for key, other in seeds.items() if key != name)


def test_files_schema_and_tables_are_what_the_script_writes() -> None:
    spec = importlib.util.spec_from_file_location("make_scenes", ROOT / "scripts" / "make_scenes.py")
    script = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(script)
    written: dict[str, SceneDescription] = script.scenes()
    assert sorted(written) == scene_names()
    for name, description in written.items():
        assert scene_text(description) == (scenes_folder() / f"{name}.toml").read_text()
    guide = (ROOT / "sim" / "README.md").read_text()
    assert script.guide_with_tables(guide) == guide
    assert (ROOT / "docs" / "schemas" / "scene.schema.json").read_text() == script.scene_schema()


def test_names_paths_and_folders(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert find_scene("case-1") == find_scene("case-1.toml") == scenes_folder() / "case-1.toml"
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "scene.toml").write_text("format = 1\n")
    assert find_scene(tmp_path / "mine") == tmp_path / "mine" / "scene.toml"
    monkeypatch.chdir(tmp_path)
    Path("case-1.toml").write_text("format = 1\n")
    assert find_scene("case-1.toml") == Path("case-1.toml")
    with pytest.raises(SceneError) as caught:
        find_scene("cas-2")
    assert caught.value.remedy == "Did you mean case-2?"
    for file, reference in ((find_scene("case-1"), Path("case-1")), (tmp_path / "case-1.toml",) * 2):
        assert scene_reference(file) == reference


@pytest.mark.parametrize("layout", ["rows", "grid", "random"])
@pytest.mark.parametrize("count", [1, 7, 13])
def test_new_scenes(layout: Layout, count: int) -> None:
    made = new_scene(count, 5, layout=layout)
    assert made == new_scene(count, 5, layout=layout)
    assert made != new_scene(count, 6, layout=layout)
    places = np.array([(p.x_m, p.y_m) for p in made.plot.plants])
    assert len({p.seed for p in made.plot.plants}) == count
    assert (places > np.array(made.bounds.lower_m[:2]) + 0.5).all()
    assert (places < np.array(made.bounds.upper_m[:2]) - 0.5).all()
    if count > 1:
        apart = np.linalg.norm(places[:, None] - places[None], axis=2)[~np.eye(count, dtype=bool)]
        assert apart.min() > 0.1
    assert made.plot.light.sun[1] < 0  # in the south
    assert np.linalg.norm(made.plot.light.sun) == pytest.approx(1.0, abs=1e-3)


def test_plots_of_a_kind_differ_in_what_plots_of_a_trial_differ_in() -> None:
    base = new_scene(3, 9)
    plots = plots_of_kind(base, 24, 5)
    assert plots == plots_of_kind(base, 24, 5)
    assert plots[:7] == plots_of_kind(base, 7, 5)
    assert plots[0] != plots_of_kind(base, 1, 6)[0]
    places = {(p.x_m, p.y_m): p for p in base.plot.plants}
    assert {len(made.plot.plants) for made in plots} == {2, 3}
    same = [{p.seed for p in made.plot.plants} <= {p.seed for p in base.plot.plants} for made in plots]
    assert 6 <= sum(same) <= 18
    for made in plots:
        for plant in made.plot.plants:
            assert plant.stage == places[plant.x_m, plant.y_m].stage
            assert 0.9 <= plant.scale <= 1.1
        assert (made.camera, made.bounds) == (base.camera, base.bounds)
    for few in ({made.plot.light.sun for made in plots}, {made.plot.soil.seed for made in plots}):
        assert len(few) == 24
    alone = new_scene(1, 9)
    assert all(len(made.plot.plants) == 1 for made in plots_of_kind(alone, 12, 5))
