"""Which folders are plots, and an evaluation of many plots, of which some fail."""

import os
import shutil
from pathlib import Path

import pytest

from fieldkit.captures import Capture, read_capture
from fieldkit.evaluation.evaluate import AllFailedError, evaluate, find_plots
from fieldkit.results.report_files import load_evaluation_report
from fieldkit.runtime.context import Context

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
    with pytest.raises(AllFailedError, match="none of 2 plots was reconstructed; plot 1: a bug in fieldkit"):
        evaluate(day, tmp_path / "out", context=Context())
    report = load_evaluation_report(tmp_path / "out")
    first, second = (plot.error for plot in report.plots)
    assert "ZeroDivisionError" in first.message
    assert "--debug" in first.remedy
    assert second.type != first.type
    with pytest.raises(ZeroDivisionError):  # alone, it is told with its traceback
        evaluate(day / "plot 1", tmp_path / "out 1", context=Context())


def photograph(path: Path) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes((PHOTOGRAPHS / "IMG_0001.jpg").read_bytes())


def test_a_folder_of_photographs_is_one_plot(tmp_path: Path) -> None:
    photograph(tmp_path / "field" / "a.jpg")
    photograph(tmp_path / "field" / "later" / "b.jpg")
    assert find_plots(tmp_path / "field") == ([("field", tmp_path / "field")], [])


def test_subfolders_are_plots_in_natural_order_and_empty_ones_are_named(tmp_path: Path) -> None:
    for name in ("plot 10", "plot 9"):
        photograph(tmp_path / name / "images" / "a.jpg")
    (tmp_path / "plot 2").mkdir()
    (tmp_path / ".hidden").mkdir()
    plots, passed_over = find_plots(tmp_path)
    assert [name for name, _ in plots] == ["plot 9", "plot 10"]
    assert passed_over == ["plot 2"]


def test_folders_of_one_card_are_one_plot(tmp_path: Path) -> None:
    for name in ("100MEDIA", "101MEDIA"):
        photograph(tmp_path / "flight" / name / "DJI_0001.JPG")
    assert find_plots(tmp_path / "flight") == ([("flight", tmp_path / "flight")], [])
    photograph(tmp_path / "other" / "a.jpg")
    assert [name for name, _ in find_plots(tmp_path)[0]] == ["flight", "other"]
    photograph(tmp_path / "flight" / "plot 3" / "a.jpg")
    assert [name for name, _ in find_plots(tmp_path / "flight")[0]] == ["100MEDIA", "101MEDIA", "plot 3"]


def test_names_that_are_no_utf_8_are_written_out(tmp_path: Path) -> None:
    for name in ("plot 1", os.fsdecode(b"Fl\xe4che")):
        try:
            photograph(tmp_path / name / "a.jpg")
        except OSError:
            pytest.skip("this file system takes names in UTF-8 only")
    (tmp_path / os.fsdecode(b"l\xe9er")).mkdir()
    plots, passed_over = find_plots(tmp_path)
    assert sorted(name for name, _ in plots) == [r"Fl\udce4che", "plot 1"]
    assert passed_over == [r"l\udce9er"]
