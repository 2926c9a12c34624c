"""fieldkit cache."""

import json
import os
import time
from pathlib import Path

import numpy as np
import pytest

from fieldkit.cache import StageCache, digest
from fieldkit.cli.main import main


@pytest.fixture
def root(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A cache of ten entries, entry i used last i days ago."""
    monkeypatch.setenv("FIELDKIT_CACHE", str(tmp_path))
    cache = StageCache(tmp_path)
    for days in range(10):
        cache.put("features" if days < 4 else "depth", digest(days), {"x": np.zeros(1000)})
        used = time.time() - 86400 * days
        os.utime(cache.path("features" if days < 4 else "depth", digest(days)), (used, used))
    return tmp_path


def output(capsys: pytest.CaptureFixture[str], *arguments: str) -> dict:
    assert main(["cache", *arguments, "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def test_show_prune_and_clear(root: Path, capsys: pytest.CaptureFixture[str]) -> None:
    shown = output(capsys, "show")
    assert shown["folder"] == str(root)
    assert shown["stages"]["features"]["entries"] == 4
    assert shown["bytes"] == sum(stage["bytes"] for stage in shown["stages"].values())
    assert main(["cache"]) == 0  # the same without a word
    people = capsys.readouterr()
    assert people.err == ""
    assert "features" in people.out
    assert output(capsys, "prune", "--older-than", "3.5")["removed_entries"] == 6
    assert output(capsys, "show")["stages"].keys() == {"features"}
    assert output(capsys, "prune", "--max-size", "20KiB")["bytes"] <= 20 << 10
    assert output(capsys, "clear")["bytes"] == 0
    assert main(["cache", "clear"]) == 0
    assert "removed 0 entries" in capsys.readouterr().out
