"""A page as HTML: what is in it, and that nothing that people write into it comes alive."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fieldkit.figures.content import (
    Block,
    Charts,
    Column,
    Curve,
    Details,
    FrustumLayer,
    KeyFigure,
    KeyFigures,
    LineChart,
    LineLayer,
    Link,
    MappedPlot,
    Mark,
    Measure,
    Page,
    Paragraph,
    Picture,
    PlotMap,
    PointLayer,
    Section,
    Statement,
    Statements,
    Table,
    Terms,
    View3D,
    ViewerScene,
)
from fieldkit.figures.style import unbroken, visible
from fieldkit.geometry import Pose
from fieldkit.report.html.document import render
from tests.report.page_checks import Parsed, checked


def every_block(text: str) -> tuple[Block, ...]:
    """A block of each kind, with the same text wherever text can be."""
    chart = LineChart(
        text,
        text,
        text,
        text,
        (Curve(text, ((0.0, 1.0), (2.0, 3.0))), Curve(text, ((0.0, 9.0),), "band")),
        x_ticks=((0.0, text), (2.0, text)),
    )
    plots = (MappedPlot(text, ((0.0, 0.0), (5.0, 0.0), (5.0, 3.0))), MappedPlot("b", ((9.0, 9.0),)))
    measure = Measure(text, text, {text: {text: 1.5}, "later": {"b": 2.0}}, {"later": {text: text}})
    plot_map = PlotMap(text, plots, (measure, measure), {text: "folded", "b": "c"})
    scene = ViewerScene(
        text,
        (PointLayer(text, np.zeros((2, 3), np.float32)),),
        (FrustumLayer(text, [Pose.from_yaw_pitch((0, 0, 1), 0, 0)], [text], 0.5, 0.4, "#336699"),),
        (LineLayer(text, [np.zeros((2, 3), np.float32)], "#993366"),),
    )
    picture = Picture(b"\xff\xd8\xff\xd9", 4, 3, text or "a photograph")
    return (
        Statements((Statement("good", text, text), Statement("problem", text))),
        Paragraph(text),
        KeyFigures((KeyFigure(text, text, text),)),
        Terms(((text, text),)),
        Table(
            text,
            (Column(text), Column(text, True), Column(text)),
            ((text, None, picture), (Link(text, "c"), "1", Mark("note", text))),
            text,
        ),
        Charts((chart,)),
        plot_map,
        Details(text, (Paragraph(text), View3D("view-1", scene, text)), anchor="folded"),
    )


def page_of(text: str) -> Page:
    return Page(text, text, (Section("first", text, every_block(text)), Section("b-2", "b", ()), Section("c", "c", ())))


def tags(page: Parsed) -> list[str]:
    """Without the labels of a map, which long names do not get."""
    return [tag for tag, _ in page.elements if tag != "text"]


def test_every_block_is_shown_and_the_page_is_whole() -> None:
    parsed = checked(render(page_of("Plot 7")))
    assert parsed.text.count("Plot 7") > 40
    links = [a["href"] for a in parsed.all("a")]
    assert links[:4] == ["#content", "#first", "#b-2", "#c"]
    assert set(links[4:]) == {"#folded", "#c"}
    assert len(parsed.all("caption")) == len(parsed.all("table")) == 1
    assert len(parsed.raw["script"]) == 2  # the page's own and the view's


def test_without_a_view_the_library_for_it_is_left_out() -> None:
    html = render(Page("t", "s", (Section("a", "A", (Paragraph("p"),)),)))
    parsed = checked(html)
    assert len(parsed.raw["script"]) == len(parsed.raw["style"]) == 1
    assert len(html) < 40_000
    assert "nav" not in [tag for tag, _ in parsed.elements]


HIDDEN = set("\x00\u200e\u200f\u202a\u202b\u202c\u202d\u202e\u2066\u2067\u2068\u2069")
HOSTILE = [
    "</script><script>alert(1)</script>", "</style><img src=x onerror=alert(1)>", "' onmouseover='alert(1)", "<!--",
    "]]>", "{{ 7 * 7 }}", "{% raw %}", "&lt;b&gt;", "javascript:alert(1)", "\ud800", "url(http://x/)", "a" * 9000,
]  # fmt: skip


@pytest.mark.parametrize("text", HOSTILE)
def test_hostile_texts_are_inert(text: str) -> None:
    plain, parsed = checked(render(page_of("x"))), checked(render(page_of(text)))
    assert tags(parsed) == tags(plain)
    assert parsed.raw["script"] == plain.raw["script"]
    assert "7 * 7" in parsed.text or text != "{{ 7 * 7 }}"


@given(st.text(st.characters(codec=None), min_size=1, max_size=60) | st.text("<>\"'&/-=!;{}%script", min_size=1))
def test_no_text_makes_an_element(text: str) -> None:
    plain, parsed = checked(render(page_of("x"))), checked(render(page_of(text)))
    assert tags(parsed) == tags(plain)
    html = render(page_of(text))
    html.encode("utf-8")
    assert not set(html.partition("<script")[0]) & HIDDEN


@given(st.text(st.characters(codec=None), max_size=200))
def test_what_is_visible_stays_and_what_is_not_is_written_out(text: str) -> None:
    shown = visible(text)
    assert visible(shown) == shown
    shown.encode("utf-8")  # no half of a surrogate is left
    assert not set(shown) & {chr(c) for c in (*range(9), *range(11, 32), 0x7F, 0x202E, 0x2067, 0xFEFF)}
    if text.isascii() and text.isprintable():
        assert shown == text


def test_invisible_characters() -> None:
    assert visible("a\u202eb\x1b[0m\tc\n") == "a\\u202eb\\x1b[0m\tc\n"
    assert visible("ירושלים 7") == "ירושלים 7"
    assert len(visible("x" * 100_000)) == 600
    assert unbroken("4.5 mm ± 0.2 mm, 94 % of 10 mines") == "4.5\u00a0mm ±\u00a00.2\u00a0mm, 94\u00a0% of 10 mines"
