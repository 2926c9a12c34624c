"""Cells that any reader of CSV understands."""

import csv
import io

import pytest

from fieldkit.documents.csv_text import csv_cell, csv_text, on_one_line

NAMES = [
    "a\nb", "a\r\nb", "a\tb", "x\u202egpj.exe", "a\u2028b", "a\x00b", "a\x85b", 'say "hi", he said', "Fl\udce4che",
    "ä",
]  # fmt: skip


@pytest.mark.parametrize("name", NAMES)
def test_no_name_breaks_a_row(name: str) -> None:
    text = csv_text(["plot", "value"], [[name, 1.5], ["last", None]])
    assert len(text.splitlines()) == 3
    text.encode("utf-8")
    rows = list(csv.reader(io.StringIO(text)))
    assert [row[1:] for row in rows] == [["value"], ["1.5"], [""]]
    assert rows[1][0] == on_one_line(name)


def test_what_is_written_out() -> None:
    assert on_one_line("a\nb\u202ec\t\udce4") == r"a\nb\u202ec\t\udce4"
    assert on_one_line("Ä 漢 \u00a0 🌽") == "Ä 漢 \u00a0 🌽"


def test_no_formula_is_left() -> None:
    for text in ("=1+1", "\n=1+1", "\t=1", "@x"):
        assert csv_cell(text).startswith("'")
