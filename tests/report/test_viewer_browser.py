"""The 3D view in a browser: what people see and do."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest

from fieldkit.errors import InputError
from fieldkit.figures.content import ViewerScene
from tests.browser import changed, colors_in, opened, picture
from tests.report.views import leaves, page_of, small_scene

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Locator, Page

READY = '.fk-view[data-state="ready"]'
EYE = "document.querySelector('.fk-view').fieldkitView.camera.position.toArray()"
_SPOTS = """() => {
    const view = document.querySelector(".fk-view").fieldkitView;
    const box = view.renderer.domElement.getBoundingClientRect();
    return view.layers.frusta.map((layer) => layer.userData.cameras.map(({ WHERE }) => {
        const p = WHERE.clone().project(view.camera);
        return { x: 0.5 * (p.x + 1) * box.width, y: 0.5 * (1 - p.y) * box.height };
    }));
}"""
AT, PLACES = _SPOTS.replace("WHERE", "at"), _SPOTS.replace("WHERE", "middle")


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Path]:
    """Writes a page of scenes and gives its file."""
    folder = tmp_path_factory.mktemp("pages")

    def write(name: str, *scenes: ViewerScene, gap_px: int = 0) -> Path:
        file = folder / f"{name}.html"
        try:
            file.write_text(page_of(*scenes, gap_px=gap_px), encoding="utf-8")
        except InputError as error:
            pytest.skip(f"{error} {error.remedy}")
        return file

    return write


@pytest.fixture(scope="module")
def small(written: Callable[..., Path]) -> Path:
    return written("small", small_scene())


@contextmanager
def ready(browser: Browser, file: Path, **options: object) -> Iterator[tuple[Page, Locator]]:
    """The page and its stage when the first frame has been drawn."""
    with opened(browser, file, **{"height": 520, **options}) as page:
        page.wait_for_selector(READY)
        yield page, page.locator(".fk-view-stage")


def settled(page: Page) -> None:
    """Wait until the view has drawn what was asked for, and that is on the screen."""
    page.evaluate("() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")


def test_points_arrive_where_they_were(browser: Browser, written: Callable[..., Path]) -> None:
    layer = leaves(500)
    with ready(browser, written("few", ViewerScene("t", [layer]))) as (page, _):
        found = page.evaluate(
            """() => {
                const cloud = document.querySelector(".fk-view").fieldkitView.layers.points[0];
                const { layer, arrays } = cloud.userData;
                return {
                    layer, positions: [...arrays.positions], colors: [...arrays.colors], values: [...arrays.values],
                };
            }"""
        )
    grid = np.array(found["positions"]).reshape(-1, 4)[:, :3]
    points = grid * found["layer"]["step"] + found["layer"]["origin"]
    colors = np.array(found["colors"]).reshape(-1, 4)[:, :3]
    distances = np.linalg.norm(points[:, None] - layer.points[None], axis=2)
    match = distances.argmin(axis=1)
    assert sorted(match) == list(range(500))
    assert np.abs(points - layer.points[match]).max() <= 0.51 * found["layer"]["step"]
    np.testing.assert_array_equal(colors, layer.colors[match])
    expected = np.clip(layer.values[match] / layer.limit, 0, 1) * 254
    np.testing.assert_allclose(found["values"], expected, atol=0.51)


@pytest.mark.parametrize("width", [1280, 390])
def test_something_is_seen_in_light_and_dark(browser: Browser, small: Path, width: int) -> None:
    grounds = []
    for dark in (False, True):
        with ready(browser, small, width=width, dark=dark) as (page, stage):
            image = picture(stage)
            assert colors_in(image) > 300
            assert page.evaluate("document.documentElement.scrollWidth") <= width
            grounds.append(image[20, image.shape[1] // 2].mean())
    assert grounds[0] > 200
    assert grounds[1] < 60


def test_switches_point_size_and_colours_change_the_picture(browser: Browser, small: Path) -> None:
    with ready(browser, small) as (page, stage):
        before = picture(stage)
        for switch in page.locator(".fk-view-switch input").all():
            switch.uncheck()
            settled(page)
            assert changed(before, picture(stage)) > 100
            switch.check()
        settled(page)
        assert changed(before, picture(stage)) == 0
        size = page.locator(".fk-view-size input")
        size.fill("8")
        settled(page)
        large = picture(stage)
        assert changed(before, large) > 1000
        page.locator(".fk-view-coloring select").select_option("colors")
        settled(page)
        assert changed(large, picture(stage)) > 1000


def test_keys_turn_zoom_and_reset(browser: Browser, small: Path) -> None:
    with ready(browser, small) as (page, stage):
        first = page.evaluate(EYE)
        stage.focus()
        for key in ("ArrowLeft", "ArrowUp", "+"):
            before = page.evaluate(EYE)
            page.keyboard.press(key)
            assert not np.allclose(page.evaluate(EYE), before)
        turned = page.evaluate(EYE)
        assert np.linalg.norm(turned) < np.linalg.norm(first)
        assert turned[2] / np.linalg.norm(turned) > first[2] / np.linalg.norm(first)  # the eye goes up
        page.keyboard.press("0")
        np.testing.assert_allclose(page.evaluate(EYE), first, atol=1e-9)
        page.keyboard.press("Tab")
        before = page.evaluate(EYE)
        page.keyboard.press("ArrowLeft")  # now of the next control
        assert page.evaluate(EYE) == before


@pytest.mark.parametrize("north", [None, (0.6, 0.8)])
def test_from_above_the_view_is_a_map(browser, written, north) -> None:
    scene = replace(small_scene(), north=north)
    with ready(browser, written(f"north-{north is None}", scene)) as (page, stage):
        length = page.locator(".fk-view-length")
        assert not length.is_visible()
        page.get_by_role("button", name="From above").click()
        settled(page)
        spots = page.evaluate(
            """() => {
                const view = document.querySelector(".fk-view").fieldkitView;
                const { clientWidth: width, clientHeight: height } = view.stage;
                const place = (at) => view.camera.position.clone().set(...at);
                return [[0.4, -0.3, 0], [0.4, -0.3, 0.9], [1.4, -0.3, 0], [0.4, 0.7, 0]].map((at) => {
                    const p = place(at.map((value, axis) => value - view.center[axis])).project(view.camera);
                    return [0.5 * (p.x + 1) * width, 0.5 * (1 - p.y) * height];
                });
            }"""
        )
        low, high, to_x, to_y = map(np.array, spots)
        assert np.abs(low - high).max() < 0.05  # one pixel, whatever the height
        metre = np.linalg.norm(to_x - low)
        assert np.isclose(np.linalg.norm(to_y - low), metre, rtol=1e-3)
        up = north or (0.0, 1.0)
        np.testing.assert_allclose(up[0] * (to_x - low) + up[1] * (to_y - low), [0.0, -metre], atol=0.05)
        text, box = length.inner_text(), length.bounding_box()
        assert box
        unit = {"mm": 0.001, "cm": 0.01, "m": 1.0}[text.split()[1]]
        assert box["width"] == pytest.approx(float(text.split()[0]) * unit * metre, abs=0.6)
        before = page.evaluate(EYE)
        page.mouse.move(300, 200)
        page.mouse.down()
        page.mouse.move(340, 200, steps=2)
        page.mouse.up()
        moved = np.subtract(page.evaluate(EYE), before)
        assert np.linalg.norm(moved) == pytest.approx(40 / metre, rel=0.05)  # a drag moves the map, and turns nothing
        assert abs(moved[2]) < 1e-3
        stage.focus()
        page.keyboard.press("+")
        settled(page)
        assert float(length.inner_text().split()[0]) * unit <= float(text.split()[0]) * unit


def test_stations_bear_their_numbers_and_plots_their_names(browser: Browser, small: Path) -> None:
    with ready(browser, small) as (page, stage):
        outer = stage.bounding_box()
        assert outer
        for button in ("Reset view", "From above"):
            page.get_by_role("button", name=button).click()
            settled(page)
            places = page.evaluate(AT)[0]
            shown = page.locator(".fk-view-number:visible").all()
            assert len(shown) >= 5  # those in front of one another share a place
            for each in shown:
                at, box = places[int(each.inner_text()) - 1], each.bounding_box()
                assert box
                assert box["x"] + box["width"] / 2 - outer["x"] - 1 == pytest.approx(at["x"], abs=1.5)
                assert 0 <= at["y"] - (box["y"] + box["height"] - outer["y"] - 1) < 9  # just above it
            assert page.locator(".fk-view-place:visible").all_inner_texts() == ["Plot 7"]
        page.get_by_label("Names and numbers").uncheck()
        settled(page)
        assert page.locator(".fk-view-names span:visible").count() == 0


def test_many_views_start_when_they_come_near_and_make_way(browser: Browser, written: Callable[..., Path]) -> None:
    scenes = [ViewerScene(f"Plot {i}", [leaves(300, seed=i)]) for i in range(20)]  # more than a page has contexts
    with ready(browser, written("many", *scenes, gap_px=900)) as (page, _):
        figures = page.locator(".fk-view")
        before = picture(page.locator(".fk-view-stage").first)
        assert figures.last.get_attribute("data-state") == "waiting"
        for i in range(20):
            figures.nth(i).scroll_into_view_if_needed()
            page.wait_for_selector(f'#view-{i}[data-state="ready"]')
        assert page.locator(".fk-view-stage canvas").count() <= 8
        assert figures.first.get_attribute("data-state") == "waiting"
        page.evaluate("scrollTo(0, 0)")
        page.wait_for_selector('#view-0[data-state="ready"]')
        settled(page)
        assert changed(before, picture(page.locator(".fk-view-stage").first)) == 0
