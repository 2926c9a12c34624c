"""Content on a terminal: nothing is lost where it is narrow, and no name steers it."""

import io

from rich.console import Console

from fieldkit.figures.content import (
    Charts,
    Column,
    Details,
    KeyFigure,
    KeyFigures,
    Mark,
    Paragraph,
    Picture,
    Statement,
    Statements,
    Table,
    Terms,
)
from fieldkit.figures.terminal import MOST_ROWS, rendered

HOSTILE = "[bold]\x1b[2J\u202egnp"


def shown(*blocks, width: int = 80) -> str:
    console = Console(file=io.StringIO(), width=width, color_system=None)
    for each in rendered(blocks):
        console.print(each)
    return console.file.getvalue()


def test_names_are_text_and_steer_nothing() -> None:
    table = Table(HOSTILE, (Column("plot"), Column(HOSTILE, True)), ((HOSTILE, HOSTILE),), HOSTILE)
    blocks = (
        table,
        Terms(((HOSTILE, HOSTILE),)),
        KeyFigures((KeyFigure(HOSTILE, HOSTILE, HOSTILE),)),
        Paragraph(HOSTILE),
        Statements((Statement("note", HOSTILE, HOSTILE),)),
        Details(HOSTILE, (Paragraph(HOSTILE),)),
    )
    text = shown(*blocks, width=120)
    assert text.count("[bold]\\x1b[2J\\u202egnp") == 15
    assert not {"\x1b", "\u202e"} & set(text)


def test_details_and_pictures_are_for_wide_pages() -> None:
    picture = Picture(b"", 1, 1, "leaf")
    columns = (Column("photograph"), Column("leaf", detail=True), Column("position residual, mm", short="off, mm"))
    text = shown(Table("t", columns, (("a.jpg", picture, None),)), Charts(()))
    assert "leaf" not in text
    assert "position residual" not in text
    assert [line.split() for line in text.splitlines()[2:]] == [
        ["photograph", "off,", "mm"],
        ["─" * 19],
        ["a.jpg", "–"],
        [],
    ]


def test_numbers_are_whole_and_their_labels_wrap() -> None:
    columns = (Column("plot"), Column("known positions RMS, mm", True), Column("state"))
    rows = (("a plot with a long name", "1,234.5", Mark("problem", "failed")),)
    text = shown(Table("t", columns, rows), width=40)
    assert "1,234.5  failed" in text
    assert [line.split() for line in text.splitlines()[2:6]] == [
        ["known"],
        ["positions"],
        ["RMS"],
        ["plot", "mm", "state"],
    ]


def test_a_name_is_said_once_and_long_tables_are_cut() -> None:
    rows = tuple((f"plot {k // 2}", f"{k}") for k in range(MOST_ROWS + 5))
    text = shown(Table("t", (Column("plot"), Column("k", True)), rows, "The note."))
    assert text.count("plot 3") == 1
    assert "and 5 more" in text
    assert "The note." in text
