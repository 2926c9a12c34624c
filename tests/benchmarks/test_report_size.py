"""The study of reports' sizes, at a small size."""

from __future__ import annotations

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


@pytest.mark.slow
def test_sizes_and_times() -> None:
    result = report_size.study(counts=(2000, 20_000), progress=Silent())
    if result.skipped:
        pytest.skip(result.skipped)
    small, large = result.figures["pages"]
    assert [small["points"], large["points"]] == [2000, 20_000]
    assert large["file_bytes"] > small["file_bytes"] > small["script_bytes"]
    assert large["file_bytes"] - small["file_bytes"] < 18_000 * 12
    assert "SwiftShader" in small["renderer"]
    assert small["first_frame_s"] > 0
    assert len(result.tables[0].rows) == 2
