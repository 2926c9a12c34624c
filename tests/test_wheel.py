"""The wheel, built and installed as a person does: outside the checkout, in a path with umlauts, not as root."""

import configparser
import json
import os
import re
import shutil
import subprocess
import sys
import sysconfig
import tempfile
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

from fieldkit.results.plan_file import plan_from_poses, save_plan
from fieldkit_sim.simulation import ring

ROOT = Path(__file__).parents[1]
LIMIT_S = 3600


@dataclass(frozen=True)
class Installed:
    """An environment that holds the wheel and sees the dependencies of this one.

    Attributes:
        folder: where commands run; theirs.
        package: the installed package.
        python: of the environment.
        user: whom commands run as: nobody, where the tests run as root and nobody can start Python.
    """

    folder: Path
    package: Path
    python: Path
    user: str | None

    def run(self, *arguments: str, code: int = 0, script: str = "fieldkit") -> subprocess.CompletedProcess[str]:
        environment = {"PATH": os.environ["PATH"], "HOME": str(self.folder), "LANG": "C.UTF-8"}
        done = subprocess.run(
            [self.python.with_name(script), *arguments],
            cwd=self.folder,
            env=environment,
            capture_output=True,
            text=True,
            encoding="utf-8",
            check=False,
            timeout=LIMIT_S,
            user=self.user,
        )
        assert done.returncode == code, done.stderr
        assert "Traceback" not in done.stderr
        return done


@pytest.fixture(scope="module")
def installed() -> Iterator[Installed]:
    if not (ROOT / "fieldkit" / "report" / "html" / "vendor" / "viewer.min.js").is_file():
        pytest.skip("the 3D view is not built (scripts/build_viewer.sh), without which there is no wheel")
    # pytest's own folders are closed to other users.
    with tempfile.TemporaryDirectory(prefix="fieldkit ") as place:
        folder = Path(place) / "Prüfstand Süd"
        folder.mkdir()
        Path(place).chmod(0o755)
        base, user = _base_python(folder)
        _do(sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(folder / "dist"))
        _do(base, "-m", "venv", "--without-pip", str(folder / "venv"))
        python = folder / "venv" / "bin" / "python"
        (wheel,) = (folder / "dist").glob("*.whl")
        options = ("--no-deps", "--no-index", "--no-compile", "--quiet", "--disable-pip-version-check")
        _do(sys.executable, "-m", "pip", "--python", str(python), "install", *options, str(wheel))
        (packages,) = (folder / "venv" / "lib").glob("python*/site-packages")
        # Only now, or pip would take this environment's fieldkit for the installed one.
        (packages / "dependencies.pth").write_text(sysconfig.get_path("purelib"))
        work = folder / "Weizen 2026"
        work.mkdir(mode=0o777)
        if user is not None:
            shutil.chown(work, user)
        yield Installed(work, packages / "fieldkit", python, user)


def _base_python(place: Path) -> tuple[str, str | None]:
    """A Python of this version, and who runs it: nobody, where they may see ``place`` and the dependencies."""
    own = getattr(sys, "_base_executable", sys.executable)
    if os.geteuid() != 0:
        return own, None
    system = f"/usr/bin/python{sys.version_info.major}.{sys.version_info.minor}"
    for python in (own, system):
        try:
            looks = f"import os, venv; os.listdir({sysconfig.get_path('purelib')!r}); os.listdir({str(place)!r})"
            seen = [python, "-c", looks]
            if subprocess.run(seen, user="nobody", capture_output=True, check=False, cwd="/").returncode == 0:
                return python, "nobody"
        except (OSError, LookupError):
            continue
    return own, None


def _do(*command: str) -> None:
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def _tracked(*places: str) -> list[str]:
    command = ["git", "ls-files", "-z", "--", *places]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, encoding="utf-8", check=False)
    if done.returncode or not done.stdout:
        pytest.skip("not a git checkout")
    return done.stdout.strip("\0").split("\0")


def test_it_holds_every_file_of_the_package(installed: Installed) -> None:
    """And of what lies beside it, as they are in the checkout, and nothing else than that and the built 3D view."""
    build = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["tool"]["hatch"]["build"]["targets"]["wheel"]
    sources = ("fieldkit/report/html/web/",)  # of the 3D view, which is built of them
    wanted = {name: name for name in _tracked("fieldkit")}
    for source, target in build["force-include"].items():
        wanted |= {target + name.removeprefix(source): name for name in _tracked(source)}
    place = installed.package.parent
    held = {path.relative_to(place).as_posix() for path in installed.package.rglob("*") if path.is_file()}
    held -= {name for name in held if "/__pycache__/" in name}
    assert sorted(name for name in wanted.keys() - held if not name.startswith(sources)) == []
    assert {Path(name).parent.name for name in held - wanted.keys()} == {"vendor"}
    kept = (name for name in held & wanted.keys() if (ROOT / wanted[name]).is_file())
    assert [name for name in kept if (place / name).read_bytes() != (ROOT / wanted[name]).read_bytes()] == []


def test_it_holds_every_place_that_the_code_names(installed: Installed) -> None:
    named = {
        name
        for file in installed.package.rglob("*.py")
        for name in re.findall(r"shipped_(?:folder|page)\([\"'](.+?)[\"']\)", file.read_text("utf-8"))
    }
    assert {"docs/install.md", "sim/scenes"} <= named
    assert [name for name in sorted(named) if not (installed.package / "shipped" / name).exists()] == []


def test_every_console_script_starts(installed: Installed) -> None:
    (declared,) = installed.package.parent.glob("fieldkit-*.dist-info/entry_points.txt")
    scripts = configparser.ConfigParser()
    scripts.read(declared, encoding="utf-8")
    for script in scripts["console_scripts"]:
        assert "Usage:" in installed.run("--help", script=script).stdout
    assert list(scripts["console_scripts"]) == ["fieldkit"]


def test_a_mission(installed: Installed) -> None:
    """With the profile, the site and the plots that come along."""
    save_plan(installed.folder / "kreis.json", plan_from_poses(ring(4, 1.5, 1.8)))
    site = installed.package / "shipped" / "missions" / "sites" / "example.toml"
    options = "--vehicle ardupilot-pitch --plant-height 0.5 --adjust --no-picture -o süd-kreis.plan --json"
    written = json.loads(installed.run("export-mission", "kreis.json", "--site", str(site), *options.split()).stdout)
    assert written
    assert (installed.folder / "süd-kreis.plan").is_file()
    assert (installed.folder / "süd-kreis.geojson").is_file()
    where = subprocess.run(
        [installed.python, "-c", "import fieldkit; print(fieldkit.__file__)"],
        cwd=installed.folder,
        capture_output=True,
        encoding="utf-8",
        check=True,
        env={"PYTHONUTF8": "1"},
    ).stdout
    assert Path(where.strip()).parent.samefile(installed.package)  # and not the checkout


def test_a_machine_is_looked_at(installed: Installed) -> None:
    found = json.loads(installed.run("doctor", "--json").stdout)
    versions = next(check for check in found["checks"] if check["name"] == "packages")["values"]["versions"]
    assert "numpy" in versions
    assert "torch" not in versions


def test_messages_name_pages_that_are_there(installed: Installed) -> None:
    shipped = installed.package / "shipped"
    said = installed.run("scene", "new", "-o", "feld.toml", "--overwrite").stdout
    assert f"{shipped / 'sim' / 'README.md'} explains its keys" in said
    (installed.folder / "leer.toml").write_text("format = 1\n")
    said = installed.run("plan", "--scene", "demo", "--vehicle", "leer.toml", "-o", "plan", code=3).stderr
    assert str(shipped / "missions" / "README.md") in said
    for page in ("sim/README.md", "missions/README.md", "docs/install.md", "docs/campaigns.md"):
        assert (shipped / page).is_file()


def test_the_demo(installed: Installed) -> None:
    installed.run("demo", "-o", "Vorführung")
    assert (installed.folder / "Vorführung" / "report.html").is_file()
