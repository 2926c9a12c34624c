"""What is packed holds the 3D view; without it nothing is packed."""

import importlib.util
import shutil
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import pytest

from fieldkit.report.html import viewer

ROOT = Path(__file__).parents[2]
VENDOR = "fieldkit/report/html/vendor"


def hatch(root: Path, target: str, output: Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "hatchling", "build", "-t", target, "-d", str(output)]
    return subprocess.run(command, cwd=root, capture_output=True, text=True, check=False)


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    """What hatch needs of the repository, with the 3D view's own files."""
    root = tmp_path / "checkout"
    page = "fieldkit/report/html"
    for name in (
        "pyproject.toml",
        "README.md",
        "LICENSE",
        ".gitignore",
        "scripts/hatch_build.py",
        "scripts/build_viewer.sh",
        "fieldkit/version.py",
        f"{page}/viewer.py",
        f"{page}/web/viewer.css",
        f"{page}/web/viewer.js",
        f"{page}/web/package-lock.json",
    ):
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / name, root / name)
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    for name in project["tool"]["hatch"]["build"]["targets"]["wheel"]["force-include"]:
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        copy = shutil.copytree if (ROOT / name).is_dir() else shutil.copy
        copy(ROOT / name, root / name)
    return root


def with_view(root: Path) -> None:
    (root / VENDOR).mkdir()
    for name in (viewer.BUNDLE, viewer.LICENSE):
        (root / VENDOR / name).write_text(name, encoding="utf-8")


def test_nothing_is_packed_without_the_view(checkout: Path, tmp_path: Path) -> None:
    done = hatch(checkout, "wheel", tmp_path / "out")
    assert done.returncode != 0
    assert f"{VENDOR}/{viewer.BUNDLE} is missing" in done.stderr
    assert "scripts/build_viewer.sh" in done.stderr
    assert "Traceback" not in done.stderr


def test_wheel_holds_the_view_and_its_licence(checkout: Path, tmp_path: Path) -> None:
    with_view(checkout)
    done = hatch(checkout, "wheel", tmp_path / "out")
    assert done.returncode == 0, done.stderr
    (wheel,) = (tmp_path / "out").glob("*.whl")
    with zipfile.ZipFile(wheel) as archive:
        names = set(archive.namelist())
    assert {f"{VENDOR}/{viewer.BUNDLE}", f"{VENDOR}/{viewer.LICENSE}", "fieldkit/report/html/web/viewer.css"} <= names
    assert not {name for name in names if name.endswith((".js", ".json")) and "/web/" in name}


def test_lock_file_names_no_host_and_exact_versions() -> None:
    folder = ROOT / "fieldkit" / "report" / "html" / "web"
    lock = (folder / "package-lock.json").read_text(encoding="utf-8")
    assert "://" not in lock
    assert '"three": "0.' in lock
    assert "^" not in (folder / "package.json").read_text(encoding="utf-8")


def test_script_carries_the_licence_of_what_is_in_it() -> None:
    bundle = ROOT / VENDOR / viewer.BUNDLE
    if not bundle.is_file():
        pytest.skip("the 3D view is not built: make setup, with npm")
    script = viewer.viewer_script()
    licence = (ROOT / VENDOR / viewer.LICENSE).read_text(encoding="utf-8")
    assert "The MIT License" in licence
    assert licence.strip() in script
    for host in ("http://", "https://"):
        urls = {part.split('"')[0].split("`")[0].split("'")[0] for part in script.split(host)[1:]}
        assert all(url.startswith("www.w3.org/") for url in urls), urls  # names of XML's namespaces, not addresses


def test_a_checkout_without_the_view_can_be_installed_for_work(checkout: Path) -> None:
    spec = importlib.util.spec_from_file_location("hatch_build", ROOT / "scripts" / "hatch_build.py")
    assert spec
    assert spec.loader
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    hook = module.ViewerHook(str(checkout), {}, None, None, "", "wheel")
    hook.initialize("editable", {})
    with pytest.raises(SystemExit, match="is missing"):
        hook.initialize("standard", {})
