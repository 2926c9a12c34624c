"""Vehicle profiles."""

import re
from dataclasses import MISSING, fields
from pathlib import Path

import numpy as np
import pytest
from pydantic import BaseModel

from benchmarks.fuzzing import Target, fuzz
from fieldkit.errors import MetadataError
from fieldkit.geometry import Intrinsics
from fieldkit.routing.mission import Home
from fieldkit.vehicles.vehicle import Battery, Mount, Speeds, Trigger, Vehicle
from fieldkit.vehicles.vehicle_file import find_vehicle, load_vehicle, vehicle_names, vehicles_folder

ROOT = Path(__file__).parents[2]
README = (ROOT / "missions" / "README.md").read_text(encoding="utf-8")
TEXT = (ROOT / "missions" / "vehicles" / "ardupilot-pitch.toml").read_text(encoding="utf-8")


def check_table(section: str, model: type[BaseModel] | type[Intrinsics] | type[Home]) -> None:
    """That a key table of missions/README.md has all keys of a model with their defaults, and no others."""
    part = README.partition(f"### {section}\n")[2].partition("\n#")[0]
    if not issubclass(model, BaseModel):
        expected = {field.name: "needed" if field.default is MISSING else "none" for field in fields(model)}
    else:
        expected = {}
        for name, field in model.model_fields.items():
            alias, default = field.validation_alias, field.default
            shown = {"()": "[]", "None": "none", "(0.0, 0.0)": "[0.0, 0.0]"}.get(str(default), str(default))
            shown = f'`"{default}"`' if isinstance(default, str) else shown
            expected[alias if isinstance(alias, str) else name] = "needed" if field.is_required() else shown
    assert dict(re.findall(r"^\| `(\w+)` \| (.+?) \|", part, re.MULTILINE)) == expected


def write(folder: Path, text: str) -> Path:
    path = folder / "mine.toml"
    path.write_text(text, "utf-8")
    return path


def test_what_is_shipped() -> None:
    assert {"ardupilot-pitch", "ardupilot-pan", "px4-gimbal", "dji-mavic-3-enterprise", "fixed-gimbal"} < set(
        vehicle_names()
    )
    vehicles = {name: load_vehicle(name) for name in vehicle_names()}
    assert sum(vehicle.dialect == "dji" for vehicle in vehicles.values()) == 2
    assert {vehicle.mount.kind for vehicle in vehicles.values()} == {"pitch", "pitch-yaw", "fixed"}
    for name, vehicle in vehicles.items():
        assert re.search(r"[Mm]easured|specification|[Rr]ead", vehicle.checked), name
        assert "stimates" in vehicle.checked, name
        camera = vehicle.camera
        across = np.degrees(2 * np.arctan(camera.width / 2 / camera.fx))
        assert 40 < across < 90, name
        off = 20.0 if camera.distorted else 0.0  # a calibrated one
        assert abs(camera.cx - camera.width / 2) <= off >= abs(camera.cy - camera.height / 2), name
        assert f"| `{name}` |" in README, name
    assert vehicles["ardupilot-pitch"].battery.usable_s == pytest.approx(1080 * 0.75)
    assert [vehicles[f"dji-{name}"].mass_kg for name in ("mavic-3-enterprise", "mini-4-pro")] == [0.915, 0.249]


@pytest.mark.parametrize(
    ("section", "model"),
    [
        ("At the top", Vehicle),
        ("`[mount]`", Mount),
        ("`[trigger]`", Trigger),
        ("`[camera]`", Intrinsics),
        ("`[speeds]`", Speeds),
        ("`[battery]`", Battery),
    ],
)
def test_the_readme_lists_the_keys(section: str, model: type[BaseModel] | type[Intrinsics]) -> None:
    check_table(section, model)


def test_by_name_by_path_and_near_misses(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    own = write(tmp_path, TEXT.replace("ArduCopter quad", "My quad"))
    assert load_vehicle(own).title.startswith("My quad")
    assert find_vehicle("px4-gimbal") == find_vehicle("px4-gimbal.toml") == vehicles_folder() / "px4-gimbal.toml"
    monkeypatch.chdir(tmp_path)
    own.rename(tmp_path / "px4-gimbal")
    assert load_vehicle("px4-gimbal").title.startswith("My quad")
    with pytest.raises(MetadataError, match="no such vehicle profile") as caught:
        find_vehicle("ardupilot-pich")
    assert caught.value.remedy == "Did you mean ardupilot-pitch?"
    for name in ("???", "x" * 5000, "a\0b", ""):
        with pytest.raises(MetadataError) as caught:
            load_vehicle(name)
        assert "dji-mavic-3-enterprise" in caught.value.remedy


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("format = 1", "", "has no 'format'"),
        ("format = 1", "format = 2", "has format 2; this fieldkit reads 1"),
        ('title = "', 'titel = "', "title: is missing"),
        ("max_items = 650", "max_item = 650", "max_item: is not a key of this format"),
        ("max_items = 650", "max_items = 650.5", "max_items: "),
        ("max_items = 650", 'max_items = "650"', "max_items: should be a number and is the text"),
        ("cruise_mps = 2.0", "cruise_mps = nan", "speeds.cruise_mps: "),
        ("cruise_mps = 2.0", "cruise_mps = 1e-300", "speeds.cruise_mps: input should be greater"),
        ("cruise_mps = 2.0", "cruise_mps = 2024-01-01", "speeds.cruise_mps: "),
        ("reserve = 0.25", "reserve = 1", "battery.reserve: input should be less than 1"),
        ('dialect = "ardupilot"', 'dialect = "ardupliot"', "dialect: input should be 'ardupilot', 'px4' or 'dji'"),
        ("[-90.0, 30.0]", "[30.0, -90.0]", "mount: the lowest angle comes first"),
        ("[-90.0, 30.0]", "[-95.0, 30.0]", "mount.pitch_deg 1: "),
        ('kind = "pitch"', 'kind = "fixed"', "mount: a fixed mount has one pitch: give it twice"),
        ('"SIMPLE_RADIAL"', '"FISHEYE"', "camera: camera model 'FISHEYE'"),
        ("[battery]", "[batery]", "battery: is missing"),
        ("[battery]", "[battery]\nx = " + "9" * 5000, "is not TOML"),
        ("[battery]", "# " + "x" * 300_000, "far too large"),
    ],
)
def test_errors(tmp_path: Path, old: str, new: str, message: str) -> None:
    assert old in TEXT
    path = write(tmp_path, TEXT.replace(old, new))
    with pytest.raises(MetadataError, match=re.escape(message)) as caught:
        load_vehicle(path)
    assert caught.value.path == path
    assert caught.value.remedy


def test_changed_at_random(tmp_path: Path) -> None:
    seeds = [path.read_bytes() for path in sorted(vehicles_folder().glob("*.toml"))]
    found = fuzz(Target(".toml", seeds, load_vehicle), 250, tmp_path, seed=5)
    assert not found.defects
    assert not found.written
    assert found.hangs == 0
    assert found.refused > 30
