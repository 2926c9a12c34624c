"""fieldkit doctor, and what it rests on."""

import json
import tomllib
from pathlib import Path

import pytest

from fieldkit import doctor
from fieldkit.cli.main import main
from fieldkit.doctor import Check

ROOT = Path(__file__).parents[2]


def test_this_machine(capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("FIELDKIT_CACHE", str(tmp_path))
    code = main(["doctor", "--json"])
    answer = json.loads(capsys.readouterr().out)
    checks = {check["name"]: check for check in answer["checks"]}
    assert list(checks) == ["python", "packages", "optional packages", "renderer", "cores and memory", "cache"]
    assert code == (3 if answer["status"] == "fail" else 0)
    assert checks["packages"]["status"] == "ok", checks["packages"]
    assert checks["cache"]["values"]["writable"]
    for check in answer["checks"]:
        assert check["status"] == "ok" or check["remedy"]


def test_table_for_people(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    checks = [Check("cores", "warn", "1 [of 2]", "Everything works."), Check("renderer", "fail", "no EGL")]
    monkeypatch.setattr(doctor, "diagnose", lambda: iter(checks))
    assert main(["doctor"]) == 3
    output = capsys.readouterr()
    assert output.err == ""
    for text in ("warn", "fail", "1 [of 2]", "→ Everything works."):
        assert text in output.out


@pytest.mark.parametrize(
    ("module", "code", "check", "words"),
    [
        ("pyrender", "import os, signal; os.kill(os.getpid(), signal.SIGSEGV)", doctor.check_renderer, "SIGSEGV"),
        ("cv2", "raise ImportError('libGL.so.1 is missing')", doctor.check_packages, "headless: ImportError: libGL"),
        ("cv2", "import os; os.abort()", doctor.check_packages, "opencv-python-headless: the process was ended by SIG"),
    ],
)
def test_broken_libraries_are_named(monkeypatch, tmp_path: Path, module, code, check, words) -> None:
    """Also a driver that ends the process is reported, not suffered."""
    (tmp_path / f"{module}.py").write_text(code)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path), prepend=":")
    assert check().status == "fail"
    assert words in check().detail


def test_no_display(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYOPENGL_PLATFORM", "egl")
    monkeypatch.setenv("EGL_DEVICE_ID", "99")
    assert doctor.check_renderer().status == "fail"
    assert "libegl1" in doctor.check_renderer().remedy


def test_extras(monkeypatch: pytest.MonkeyPatch) -> None:
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]["optional-dependencies"]
    versions = doctor.check_optional_packages().values["versions"]
    of = (*doctor._EXTRAS, "learned")
    assert set(versions) == {line.split(">")[0] for extra in of for line in extras[extra]}
    monkeypatch.setattr(doctor, "_installed", lambda name: None if name in {"torch", "rasterio"} else "1")
    remedy = doctor.check_optional_packages().remedy
    assert "rasters and coordinate systems: pip install 'fieldkit[geo]'" in remedy
    assert "uv pip install torch --torch-backend=cpu" in remedy
    assert "cluster" not in remedy


def test_a_cache_without_space(small_disk: Path, unwritable: Path) -> None:
    assert "prune" in doctor.check_cache(small_disk).remedy
    assert "FIELDKIT_CACHE" in doctor.check_cache(unwritable / "fieldkit").remedy
