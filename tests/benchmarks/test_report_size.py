"""The study of reports' sizes, at a small size."""

import pytest

from benchmarks import headless, report_size
from benchmarks.headless import NoBrowserError
from fieldkit.runtime.progress import Silent


def test_without_a_browser_it_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(headless, "NAMES", ("no-such-browser",))
    with pytest.raises(NoBrowserError, match="no-such-browser"):
        headless.find_chromium()
    result = report_size.study(counts=(1000,), progress=Silent())
    assert "no-such-browser" in result.skipped or "3D view's script is missing" in result.skipped
