"""One place says which results a change of the engine invalidates."""

import ast
from pathlib import Path

import pytest

import fieldkit.reconstruction
from fieldkit.reconstruction.versions import STAGES

FOLDER = Path(fieldkit.reconstruction.__file__).parent
FILES = sorted(path for path in FOLDER.rglob("*.py") if path.name != "versions.py")
CACHED = ("bursts", "quality", "features", "learned", "pairs", "guided", "learned", "mapping", "views", "depth")
"""Stages that are kept in the cache."""


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.relative_to(FOLDER).as_posix())
def test_no_stage_has_a_version_of_its_own(file: Path) -> None:
    for node in ast.walk(ast.parse(file.read_text("utf-8"))):
        if isinstance(node, ast.Assign) and isinstance(node.value, ast.Constant):
            names = [target.id for target in node.targets if isinstance(target, ast.Name)]
            assert not [name for name in names if "VERSION" in name], "put it into versions.py"


def test_every_cached_stage_has_its_version_in_its_keys() -> None:
    used = set()
    for file in FILES:
        for node in ast.walk(ast.parse(file.read_text("utf-8"))):
            if isinstance(node, ast.Subscript) and isinstance(node.value, ast.Name) and node.value.id == "STAGES":
                assert isinstance(node.slice, ast.Constant)
                used.add(node.slice.value)
    assert used == set(CACHED)
    assert used <= set(STAGES)
