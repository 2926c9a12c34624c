"""traits.csv."""

from __future__ import annotations

import csv
import io
from pathlib import Path

from fieldkit.figures.spreadsheets import TABLE_COLUMNS, plot_rows, trait_row, traits_csv, write_traits_csv
from fieldkit.results.traits import TraitsEntry, error_column, reasons_in_words
from tests.figures.terminal.test_results import FAILED, TRAITS, scored


def test_a_row_per_plot(tmp_path: Path) -> None:
    plots = [scored("a").model_copy(update={"traits": TRAITS, "date": "2026-06-18"}), FAILED]
    write_traits_csv(tmp_path / "traits.csv", plot_rows(plots))
    first, second = csv.DictReader((tmp_path / "traits.csv").read_text("utf-8").splitlines())
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


def test_every_trait_has_an_error() -> None:
    assert error_column("height_m") == "height_error_m"
    assert error_column("covered_area_m2") in TABLE_COLUMNS
