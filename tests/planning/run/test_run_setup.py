"""From what a person names to a problem."""

from __future__ import annotations

from pathlib import Path

import pytest

from fieldkit.cache import StageCache
from fieldkit.errors import UsageError
from fieldkit.planning.run.request import search_settings
from fieldkit.planning.run.run_setup import set_up_run
from fieldkit.runtime.progress import Silent


def test_a_scene_of_fieldkits_own_is_planned_on_by_its_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    settings = search_settings(scene=Path("demo"), cameras=4)
    assert settings.path == "demo"  # on any machine
    monkeypatch.chdir(tmp_path)
    setup = set_up_run(settings, tmp_path, cache=StageCache(None), progress=Silent())
    assert setup.problem.count == 4
    assert len(setup.problem.envelope.plants) > 100
    assert setup.problem.contains(setup.problem.sample(0))
    assert not setup.problem.blind
    assert not setup.problem.exact  # photographs are taken anew at every seed
    blind = search_settings(scene=Path("demo"), cameras=4, mapping="incremental")
    assert set_up_run(blind, tmp_path, cache=StageCache(None), progress=Silent()).problem.blind


def test_a_scene_that_is_no_longer_the_same_is_refused(tmp_path: Path) -> None:
    settings = search_settings(scene=Path("demo"), cameras=4)
    other = settings.model_copy(update={"path": "case-1"})
    with pytest.raises(UsageError, match="has changed"):
        set_up_run(other, tmp_path, cache=StageCache(None), progress=Silent())
    gone = settings.model_copy(update={"path": str(tmp_path / "gone.toml")})
    with pytest.raises(UsageError, match="gone"):
        set_up_run(gone, tmp_path, cache=StageCache(None), progress=Silent())
