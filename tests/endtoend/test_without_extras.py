"""Without the extra `search` everything works but the searches, which say what is missing."""

import json
import os
import pkgutil
import subprocess
import sys
from importlib.machinery import PathFinder
from pathlib import Path

import pytest

import fieldkit
from tests.cli.test_scene_commands import TINY
from tests.endtoend.commands import CommandLine

ROOT = Path(__file__).parents[2]
HIDE = """
from importlib.machinery import PathFinder
hidden = ("torch", "gpytorch", "botorch", "linear_operator")
find = PathFinder.find_spec
PathFinder.find_spec = lambda name, *more: None if name.partition(".")[0] in hidden else find(name, *more)
"""
IMPORT_ALL = """
import importlib, json, sys
failed = []
for name in sys.argv[1:]:
    try:
        importlib.import_module(name)
    except ModuleNotFoundError:
        failed.append(name)
print(json.dumps(failed))
"""


@pytest.fixture(autouse=True)
def without_torch(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """This process, and those that it starts, cannot import PyTorch."""
    for name in [*sys.modules]:
        if name.partition(".")[0] in ("torch", "gpytorch", "botorch", "linear_operator"):
            monkeypatch.delitem(sys.modules, name)
    monkeypatch.setattr(PathFinder, "find_spec", PathFinder.find_spec)  # put back at the end
    exec(HIDE, {})
    (tmp_path / "hide").mkdir()
    (tmp_path / "hide" / "sitecustomize.py").write_text(HIDE)
    monkeypatch.setenv("PYOPENGL_PLATFORM", "egl")
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(tmp_path / "hide"), str(ROOT)]))


def modules() -> list[str]:
    found = pkgutil.walk_packages(fieldkit.__path__, "fieldkit.")
    return [module.name for module in found if not module.name.endswith("__main__")]


def test_only_searches_import_it() -> None:
    done = subprocess.run([sys.executable, "-c", IMPORT_ALL, *modules()], capture_output=True, text=True, check=True)
    assert set(json.loads(done.stdout)) == {
        "fieldkit.planning.methods.bosfm",
        "fieldkit.planning.patterns.search",
        "fieldkit.planning.surrogate.ensemble",
    }


@pytest.mark.parametrize("method", [["--method", "field"], ["--method", "bosfm"], ["--for", "this-plot"]])
def test_a_search_says_what_is_missing_before_it_begins(line: CommandLine, method: list[str]) -> None:
    (line.folder / "tiny.toml").write_text(TINY)
    done = line.run("plan", "--scene", "tiny.toml", *method, "-o", "plan", "--json", code=2)
    assert "needs PyTorch and BoTorch, which are not installed" in done.error["message"]
    assert "pip install 'fieldkit[search]'" in done.error["remedy"]
    assert "uv pip install torch --torch-backend=cpu" in done.error["remedy"]
    assert not (line.folder / "plan").exists()
