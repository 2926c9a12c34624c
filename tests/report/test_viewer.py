"""The 3D view's markup, without a browser."""

import json
import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fieldkit.arrays import FloatArray
from fieldkit.errors import InputError
from fieldkit.figures.content import FrustumLayer, LineLayer, PointLayer, ViewerScene
from fieldkit.figures.style import DISTANCE_RAMP, visible
from fieldkit.report.html import viewer
from tests.report.page_checks import Parsed
from tests.report.views import cameras, leaves, small_scene


def data_of(html: str) -> dict[str, object]:
    found = re.search(r'class="fk-view-data">(.*?)</script>', html, re.DOTALL)
    assert found
    data = json.loads(found[1])
    assert isinstance(data, dict)
    return data


def test_every_layer_has_its_switch() -> None:
    scene = small_scene()
    hidden = PointLayer("Hidden", leaves(10).points, shown=False)
    page = Parsed(
        viewer.viewer_html(ViewerScene("t", [*scene.points, hidden], scene.frusta, scene.lines), identifier="v")
    )
    switches = [a for tag, a in page.elements if tag == "input" and a["type"] == "checkbox"]
    assert [(a["data-group"], a["data-number"]) for a in switches] == [
        ("points", "0"),
        ("points", "1"),
        ("points", "2"),
        ("frusta", "0"),
        ("frusta", "1"),
        ("lines", "0"),
        ("names", "0"),
    ]
    assert ["checked" in a for a in switches] == [True, True, False, True, True, True, True]
    words = page.text
    for name in ("Capture", "6,000 points", "Reference", "Planned", "6 cameras", "Legs", "≥ 20 mm"):
        assert name in words


@given(st.text(max_size=60))
def test_any_name_stays_text(name: str) -> None:
    html = viewer.viewer_html(
        ViewerScene(
            name, [PointLayer(name, leaves(3).points)], [replace(cameras(name, "#112233", count=1), name=name)]
        ),
        identifier="v",
    )
    plain = viewer.viewer_html(
        ViewerScene("t", [PointLayer("p", leaves(3).points)], [cameras("c", "#112233", count=1)]), identifier="v"
    )
    assert [tag for tag, _ in Parsed(html).elements] == [tag for tag, _ in Parsed(plain).elements]
    frusta = data_of(html)["frusta"]
    assert isinstance(frusta, list)
    assert frusta[0]["labels"] == [visible(f"{name} 1")]


def test_the_first_view_shows_the_plants_not_the_strays() -> None:
    points = np.vstack([leaves().points, [[500.0, 0.0, 0.0]], [[np.nan, 0.0, 0.0]]]).astype(np.float32)
    focus = data_of(viewer.viewer_html(ViewerScene("t", [PointLayer("p", points)]), identifier="v"))["focus"]
    assert isinstance(focus, dict)
    assert np.abs(focus["outer"]).max() < 2
    assert focus["inner"] == focus["outer"]


def test_an_empty_scene_and_empty_layers_are_views() -> None:
    none = np.zeros((0, 3), dtype=np.float32)
    scene = ViewerScene(
        "t",
        [PointLayer("p", none)],
        [FrustumLayer("f", [], [], 0.5, 0.5, "#ffffff")],
        [LineLayer("l", [none], "#ffffff")],
    )
    for each in (scene, ViewerScene("t")):
        focus = data_of(viewer.viewer_html(each, identifier="v"))["focus"]
        assert isinstance(focus, dict)
        assert np.isfinite(focus["outer"]).all()


def test_distances_have_one_scale_of_colours_that_is_seen_on_light_and_dark() -> None:
    assert data_of(viewer.viewer_html(small_scene(), identifier="v"))["palette"] == list(DISTANCE_RAMP)
    assert all(color in viewer.viewer_style() for color in DISTANCE_RAMP)
    light, dark = luminances(["#f5f8f6"])[0], luminances(["#262d2b"])[0]
    for each in luminances(DISTANCE_RAMP):
        assert (light + 0.05) / (each + 0.05) > 1.3
        assert (each + 0.05) / (dark + 0.05) > 1.3


def luminances(colors: Sequence[str]) -> FloatArray:
    """Relative luminances of "#rrggbb" (WCAG 2.2)."""
    tones = np.array([[int(color[i : i + 2], 16) for i in (1, 3, 5)] for color in colors]) / 255
    linear = np.where(tones <= 0.04045, tones / 12.92, ((tones + 0.055) / 1.055) ** 2.4)
    return np.asarray(linear @ [0.2126, 0.7152, 0.0722])


def test_missing_script_is_an_error_with_a_remedy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(viewer, "_folder", lambda: tmp_path)
    with pytest.raises(InputError, match="3D view's script is missing") as caught:
        viewer.viewer_script()
    assert caught.value.path == tmp_path / "vendor" / viewer.BUNDLE
    assert "make setup" in caught.value.remedy


def test_script_and_style_can_stand_in_their_elements(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert "</style" not in viewer.viewer_style().lower()
    (tmp_path / "vendor").mkdir()
    (tmp_path / "vendor" / viewer.BUNDLE).write_text("a = '</Script><!--'", encoding="utf-8")
    monkeypatch.setattr(viewer, "_folder", lambda: tmp_path)
    assert viewer.viewer_script() == r"a = '\x3c/Script>\x3c!--'"
