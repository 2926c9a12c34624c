"""The picture of plants told apart shows each in its colour, with its number."""

from __future__ import annotations

import numpy as np

from fieldkit.clouds import Cloud
from fieldkit.pictures.plants_apart import draw_plants_apart
from fieldkit.scenes.plants_apart import PlantsApart

CLOUD = Cloud(np.random.default_rng(0).uniform(0, 0.5, (300, 3)))


def colours(figure_axes: object) -> set[tuple[int, ...]]:
    (image,) = figure_axes.images  # type: ignore[attr-defined]
    drawn = np.asarray(image.get_array())
    hues = drawn[drawn[..., 3] > 0][:, :3].astype(int)
    return {tuple(np.argsort(hue, kind="stable")) for hue in hues if np.ptp(hue) > 40}


def test_a_colour_and_a_number_for_each_plant() -> None:
    numbers = np.repeat(np.int32([1, 2, 0]), 100)
    apart = PlantsApart(numbers, np.array([(0.1, 0.1, 0.0), (0.4, 0.4, 0.0)]), 0.93)
    figure = draw_plants_apart("a plot", CLOUD, apart)
    assert "2 plants, 93%" in figure.texts[0].get_text()
    for axes in figure.axes:
        assert [text.get_text() for text in axes.texts if text.get_text().isdigit()] == ["1", "2"]
        assert len(colours(axes)) == 2  # blue and red; what is no plant's is grey


def test_the_reason_where_they_were_not_told_apart() -> None:
    apart = PlantsApart(np.zeros(300, np.int32), np.zeros((0, 3)), 0.0, "their feet touch")
    figure = draw_plants_apart("a plot", CLOUD, apart)
    assert "not told apart: their feet touch" in figure.texts[0].get_text()
    assert not colours(figure.axes[0])
