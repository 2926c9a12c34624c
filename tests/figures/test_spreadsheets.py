"""plots.csv and traits.csv."""

import csv
import io

import pytest

from fieldkit.documents.csv_text import on_one_line
from fieldkit.figures.spreadsheets import TABLE_COLUMNS, plot_row, plot_rows, plots_csv, trait_row, traits_csv
from fieldkit.results.traits import TraitsEntry, reasons_in_words
from tests.figures.terminal.test_results import FAILED, TRAITS, report, scored


class TestCsv:
    def test_rows(self) -> None:
        evaluation = report(scored("a"), FAILED)
        first, second = csv.DictReader(plots_csv(evaluation).splitlines())
        plot = evaluation.plots[0]
        assert list(first) == list(plot_row(plot, ["0.002", "0.005", "0.010", "0.020"]))
        assert float(first["chamfer_m"]) == plot.chamfer_m
        assert float(first["f_score_0.005"]) == plot.f_score["0.005"]
        assert (first["registered"], first["metric"], first["error"]) == ("7", "true", "")
        assert (second["plot"], second["chamfer_m"], second["error"]) == ("[plot] 8", "", "no photographs")

    @pytest.mark.parametrize("name", ["=1+1", "\t=1"])
    def test_names_are_no_formulas(self, name: str) -> None:
        (row,) = csv.DictReader(io.StringIO(plots_csv(report(scored(name)))))
        assert row["plot"] == "'" + on_one_line(name)

    @pytest.mark.parametrize("name", ['a,"b', "a\nb", "größe 样地"])
    def test_any_name_comes_back_on_one_line(self, name: str) -> None:
        text = plots_csv(report(scored(name)))
        assert len(text.splitlines()) == 2
        (row,) = csv.DictReader(io.StringIO(text, newline=""))
        assert row["plot"] == on_one_line(name)


def test_a_row_per_plot() -> None:
    plots = [scored("a").model_copy(update={"traits": TRAITS, "date": "2026-06-18"}), FAILED]
    first, second = csv.DictReader(traits_csv(plot_rows(plots)).splitlines())
    assert tuple(first) == TABLE_COLUMNS
    assert (first["plot"], first["date"], first["no_trait"]) == ("a", "2026-06-18", "")
    assert (first["height_m"], first["height_error_m"], first["cover_percent"]) == ("0.81", "0.03", "16.0")
    assert (second["plot"], second["height_m"], second["no_trait"]) == ("[plot] 8", "", "no photographs")


def test_why_a_trait_is_missing() -> None:
    told = TraitsEntry(unknown={"canopy_volume_m3": "no ground", "height_m": "no ground", "cover_percent": "dark"})
    (row,) = csv.DictReader(io.StringIO(traits_csv([trait_row("p", None, told)])))
    assert row["no_trait"] == "height_m, canopy_volume_m3: no ground; cover_percent: dark"
    assert row["date"] == row["height_m"] == ""
    assert reasons_in_words({}) == ""
