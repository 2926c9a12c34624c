"""An evaluation of many plots, of which some fail."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from fieldkit.cache import StageCache
from fieldkit.captures import Capture, read_capture
from fieldkit.errors import StorageError
from fieldkit.evaluation.evaluate import evaluate_captures
from fieldkit.results.report_files import load_evaluation_report
from fieldkit.runtime.progress import Silent

PHOTOGRAPHS = Path(__file__).parents[1] / "data" / "small_plot"


def plots(folder: Path, *names: str) -> Path:
    for name in names:
        (folder / name).mkdir(parents=True)
        shutil.copy(PHOTOGRAPHS / "IMG_0001.jpg", folder / name)
    return folder


def test_an_error_that_nobody_foresaw_is_its_plots(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    day = plots(tmp_path / "day", "plot 1", "plot 2")

    def read(folder: Path, **_: object) -> Capture:
        if folder.name == "plot 1":
            raise ZeroDivisionError("division by zero")
        return read_capture(folder)

    monkeypatch.setattr("fieldkit.evaluation.evaluate.read_capture", read)
    evaluate_captures(day, tmp_path / "out", cache=StageCache(None), progress=Silent())
    report = load_evaluation_report(tmp_path / "out")
    first, second = (plot.error for plot in report.plots)
    assert first is not None
    assert "ZeroDivisionError" in first.message
    assert "--debug" in first.remedy
    assert second is not None
    assert second.type != first.type
    with pytest.raises(ZeroDivisionError):  # alone, it is told with its traceback
        evaluate_captures(day / "plot 1", tmp_path / "out 1", cache=StageCache(None), progress=Silent())


def test_no_space_is_nobodys_plot(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    day = plots(tmp_path / "day", "plot 1", "plot 2")

    def read(folder: Path, **_: object) -> Capture:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("fieldkit.evaluation.evaluate.read_capture", read)
    with pytest.raises(StorageError):
        evaluate_captures(day, tmp_path / "out", cache=StageCache(None), progress=Silent())
    assert not (tmp_path / "out").exists()
