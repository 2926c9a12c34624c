"""Whatever is given in the place of something else is called by its name."""

from pathlib import Path

import pytest

from fieldkit.documents.mistaken import look_like_degrees, look_swapped, nearest, refuse_other
from fieldkit.errors import MetadataError
from fieldkit.scenes.library import scenes_folder
from fieldkit.vehicles.vehicle_file import vehicles_folder

KINDS = ("plan", "reference", "evaluation", "campaign", "site file", "scene file", "vehicle profile", "mission")


def given(folder: Path) -> dict[str, Path]:
    """One of each kind, by what it is."""
    for name, files in {
        "plan": ["plan.json", "search.json", "plan.png"],
        "reference": ["reference.json", "overview.png"],
        "evaluation": ["evaluation.json"],
        "campaign": ["campaign.toml", "plan.json"],
        "folder of photographs": ["A1/IMG_1.JPG"],
    }.items():
        for file in files:
            (folder / name / file).parent.mkdir(parents=True, exist_ok=True)
            (folder / name / file).touch()
    (folder / "field.toml").write_text("format = 1\n[home]\nlatitude_deg = 50.0\n")
    (folder / "m.waypoints").touch()
    (folder / "cloud.laz").touch()
    return {
        **{entry.name: entry for entry in folder.iterdir() if entry.is_dir()},
        "site file": folder / "field.toml",
        "mission": folder / "m.waypoints",
        "point cloud": folder / "cloud.laz",
        "vehicle profile": vehicles_folder() / "px4-gimbal.toml",
        "scene file": scenes_folder() / "case-1.toml",
    }


@pytest.mark.parametrize("noun", KINDS)
def test_every_swap_is_named_and_nothing_right_refused(noun: str, tmp_path: Path) -> None:
    for kind, path in given(tmp_path).items():
        if kind == noun:
            refuse_other(path, noun)
            continue
        with pytest.raises(MetadataError, match=rf"is an? {kind}, not an? {noun}$"):
            refuse_other(path, noun)


def test_the_folder_of_a_missing_result_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    reference = given(tmp_path)["reference"]
    with pytest.raises(MetadataError, match="is a reference, not a plan") as caught:
        refuse_other(reference / "plan.json", "plan")
    assert caught.value.path == reference
    monkeypatch.chdir(reference)
    refuse_other(Path("plan.json"), "plan")  # nobody gave the folder


def test_what_cannot_be_told_is_left_to_its_reader(tmp_path: Path) -> None:
    (tmp_path / "broken.toml").write_bytes(b"\xff [")
    for name in ("nowhere", "broken.toml", "a\0b", ""):
        refuse_other(tmp_path / name, "plan")


def test_swapped_coordinates_are_told_apart_from_wrong_ones() -> None:
    assert look_swapped(100.0, 20.0)
    assert not look_swapped(100.0, 200.0)
    home = (50.9, 6.4)
    assert look_swapped(6.4001, 50.9, home, 5000.0)
    assert not look_swapped(6.4001, 50.9, (50.9, 7.4), 5000.0)
    assert not look_swapped(float("nan"), 50.9, home, 5000.0)


def test_degrees_and_names_that_nearly_match() -> None:
    assert look_like_degrees([6.4, 6.5], [50.9, 50.8])
    assert not look_like_degrees([6.4, 380.0], [50.9, 50.8])
    assert nearest("plant_heigth_m", ["plant_height_m", "row_spacing_m"]) == "plant_height_m"
    assert nearest("anything", ["plant_height_m"]) is None
