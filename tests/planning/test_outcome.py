"""What a run ends with."""

from __future__ import annotations

from pathlib import Path

import pytest

from fieldkit.errors import UsageError
from fieldkit.planning.asked import search_settings
from fieldkit.planning.outcome import run_schemas

SCHEMAS = Path(__file__).parents[2] / "docs" / "schemas"


def test_the_schemas_are_those_in_the_documentation() -> None:
    """Else: run scripts/make_scenes.py."""
    for name, text in run_schemas().items():
        assert (SCHEMAS / name).read_text("utf-8") == text


def test_settings_without_a_command_line() -> None:
    settings = search_settings(scene=Path("case-1"), cameras=12, preset="paper", noise={"wind_m": 0.01}, workers=3)
    assert (settings.source.name, settings.cameras, settings.method, settings.lag) == ("case-1.toml", 12, "bosfm", 4)
    assert settings.noise.wind_m == 0.01
    with pytest.raises(UsageError, match="plan on what"):
        search_settings()
    with pytest.raises(UsageError, match="cameras"):
        search_settings(scene=Path("case-1"), cameras=1)
