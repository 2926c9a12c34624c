"""Files beside the code, in a repository and in an installed package."""

import shutil
import tomllib
from pathlib import Path

from fieldkit.runtime import shipped
from fieldkit.runtime.shipped import shipped_folder, shipped_page
from fieldkit.vehicles.vehicle_file import load_vehicle, vehicles_folder

ROOT = Path(__file__).parents[2]


def test_the_wheel_puts_every_folder_where_an_installed_package_looks(tmp_path, monkeypatch) -> None:
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text())
    included = settings["tool"]["hatch"]["build"]["targets"]["wheel"]["force-include"]
    for source, target in included.items():
        assert shipped_folder(source) == shipped_page(source) == ROOT / source
        if (ROOT / source).is_file():
            (tmp_path / target).parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(ROOT / source, tmp_path / target)
            continue
        shutil.copytree(ROOT / source, tmp_path / target, ignore=shutil.ignore_patterns("*.tlog", "*.BIN", "*.bin"))
    monkeypatch.setattr(shipped, "__file__", str(tmp_path / "fieldkit" / "runtime" / "shipped.py"))
    for source, target in included.items():
        assert shipped_folder(source) == shipped_page(source) == tmp_path / target
    assert vehicles_folder() == tmp_path / "fieldkit" / "shipped" / "missions" / "vehicles"
    assert load_vehicle("fixed-gimbal").mount.pitch_deg == (-45.0, -45.0)
