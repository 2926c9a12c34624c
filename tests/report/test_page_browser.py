"""A report of everything in headless Chromium: it opens without complaint, fits the screen, and no name comes alive."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from fieldkit.report.write_report import write_report
from tests.browser import colors_in, opened, picture
from tests.report.sections.examples import SECTIONS, SHOWN, write_everything, write_flight

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("report")
    write_everything(root / "season")
    return write_report(root / "season", root / "season.html").output


@pytest.fixture(scope="module", params=[(1280, False), (390, True)], ids=str)
def page(request: pytest.FixtureRequest, browser: Browser, report: Path) -> Iterator[Page]:
    """The report at one width, light or dark; in the end there must have been no complaint and no request."""
    width, dark = request.param
    with opened(browser, report, width=width, dark=dark) as found:
        yield found


def test_every_section_is_there_with_its_heading(page: Page) -> None:
    assert page.title() == "Report: season"
    for name in SECTIONS:
        assert page.locator(f"section#{name} > h2").is_visible()


def test_the_page_never_scrolls_sideways_but_tables_do(page: Page) -> None:
    page.evaluate("document.querySelectorAll('details').forEach((d) => { d.open = true; })")
    assert page.evaluate("document.documentElement.scrollWidth") <= page.viewport_size["width"]
    wide = page.evaluate(
        "[...document.querySelectorAll('.scroll')].filter((e) => e.scrollWidth > e.clientWidth).length"
    )
    assert wide > 0
    # Where rows are stacked, sentences are read without scrolling.
    assert page.evaluate(
        "innerWidth > 576 || [...document.querySelectorAll('.stacked')].every((e) => e.scrollWidth <= e.clientWidth)"
    )
    outside = page.evaluate(
        "[...document.querySelectorAll('main *')].filter((e) => !e.closest('.scroll, .fk-view, svg')"
        " && e.getBoundingClientRect().right > innerWidth + 1).map((e) => e.outerHTML.slice(0, 90))"
    )
    assert outside == []


def test_hostile_names_are_text(page: Page) -> None:
    assert page.title() != "owned"
    assert page.evaluate("document.querySelectorAll('img[src=x], [onerror], main script:not([type])').length") == 0
    assert SHOWN in page.locator("#reference-1 > h2").inner_text()


def test_text_can_be_read_against_its_ground(page: Page) -> None:
    contrasts = page.evaluate(
        """() => {
          const light = (c) => { const v = c / 255; return v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4; };
          const luminance = (text) => {
            const [r, g, b] = text.match(/[\\d.]+/g).map(Number);
            return 0.2126 * light(r) + 0.7152 * light(g) + 0.0722 * light(b);
          };
          const ground = luminance(getComputedStyle(document.body).backgroundColor);
          const names = ["p", ".advice", ".faint", "a", "th", "td", ".mark", ".level", ".meaning", "summary"];
          return names.map((name) => {
            const ink = luminance(getComputedStyle(document.querySelector("main " + name + ", nav " + name)).color);
            return [name, (Math.max(ink, ground) + 0.05) / (Math.min(ink, ground) + 0.05)];
          });
        }"""
    )
    assert [(name, value) for name, value in contrasts if value < 4.5] == []


def test_views_draw(page: Page) -> None:
    view = page.locator("#view-1")
    view.scroll_into_view_if_needed()
    page.locator("#view-1[data-state=ready]").wait_for()
    assert colors_in(picture(view.locator(".fk-view-stage"))) > 50


def test_figure_and_date_of_the_map_can_be_chosen(page: Page) -> None:
    groups = page.locator("figure.map g.choice:has(.plot)")

    def shown() -> list[str | None]:
        found = [groups.nth(k) for k in range(groups.count()) if groups.nth(k).is_visible()]
        return [group.locator(".plot").first.get_attribute("aria-label") for group in found]

    assert shown() == ["maize-1, 2026-07-14, height: 0.8 m"]
    page.get_by_role("radio", name="2026-06-30").check()
    assert shown() == ["maize-1, 2026-06-30, height: 0.6 m"]
    page.get_by_role("radio", name="chamfer distance", exact=True).check()
    assert shown() == ["maize-1, 2026-06-30, chamfer distance: 8 mm"]
    page.get_by_role("radio", name="2026-07-14").check()
    assert shown() == ["maize-1, 2026-07-14, chamfer distance: 10 mm"]


def test_a_plot_of_the_map_leads_to_its_own_part(page: Page) -> None:
    page.evaluate("document.querySelectorAll('details').forEach((d) => { d.open = false; })")
    page.locator("figure.map g.choice:not(.hidden) a.plot").first.click()
    part = page.locator("details:has(#campaign-1-plot-1)")
    assert part.evaluate("(e) => e.open")
    assert "maize-1 over the dates" in part.inner_text()


@pytest.mark.parametrize("width", [1280, 390])
def test_a_plot_of_a_flights_map_leads_to_its_photograph(browser: Browser, tmp_path: Path, width: int) -> None:
    write_flight(tmp_path / "scores")
    with opened(browser, write_report(tmp_path / "scores").output, width=width) as found:
        assert found.evaluate("document.documentElement.scrollWidth") <= width
        field = picture(found.locator(".map svg image"))
        red = (field[..., 0] > 200) & (field[..., 1] < 60)
        assert red[-25:-5, 5:25].all()
        assert not red[: len(red) // 2].any()
        found.locator("figure.map g.choice:not(.hidden) a.plot").nth(1).click()
        row = found.locator("tr:has(#evaluation-1-plot-2)")
        assert row.evaluate("(e) => e.getBoundingClientRect().top < innerHeight")
        assert row.locator("img").evaluate("(e) => e.naturalWidth") == 320
        row.get_by_role("link", name="119").click()
        assert found.locator("details:has(#evaluation-1-plot-2-more)").evaluate("(e) => e.open")


def test_it_prints_on_white_and_few_pages(page: Page) -> None:
    page.evaluate("document.querySelectorAll('details').forEach((d) => { d.open = false; })")
    page.emulate_media(media="print", color_scheme="light")
    assert page.evaluate("getComputedStyle(document.body).backgroundColor") == "rgb(255, 255, 255)"
    assert not page.locator("nav").is_visible()
    page.set_viewport_size({"width": 700, "height": 1000})  # A4 without its margins
    assert page.evaluate("document.documentElement.scrollWidth") <= 700
    assert not page.locator("#view-1").is_visible()
    assert len(re.findall(rb"/Type\s*/Page\b", page.pdf(format="A4"))) <= 10


def test_it_reads_without_scripts(browser: Browser, report: Path) -> None:
    context = browser.new_context(java_script_enabled=False, offline=True)
    try:
        found = context.new_page()
        found.goto(report.absolute().as_uri())
        for name in SECTIONS:
            assert found.locator(f"section#{name} > h2").is_visible()
        assert "needs a browser with JavaScript" in found.locator("#view-1").inner_text()
    finally:
        context.close()
