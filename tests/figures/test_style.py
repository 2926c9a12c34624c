"""Figures as people read them."""

import pytest

from fieldkit.figures.style import decimal, format_length, format_nominal, format_seconds, millimetres, percent


@pytest.mark.parametrize(
    ("length", "text"),
    [
        (0.0004, "0.40 mm"),
        (0.00999, "9.99 mm"),
        (0.009996, "10.0 mm"),
        (0.0999, "0.10 m"),
        (0.27, "0.27 m"),
        (12.345, "12.3 m"),
        (1250.0, "1,250 m"),
        (-0.0021, "−2.10 mm"),
        (-0.0000001, "0.00 mm"),
        (None, "–"),
    ],
)
def test_lengths(length: float | None, text: str) -> None:
    assert format_length(length) == text


def test_lengths_that_were_chosen() -> None:
    chosen = (0.002, 0.05, 0.5, 2.0, 100.0)
    assert [format_nominal(x) for x in chosen] == ["2 mm", "50 mm", "0.5 m", "2 m", "100 m"]
    assert format_nominal(0.5, metric=False) == "0.5"


@pytest.mark.parametrize(
    ("seconds", "text"), [(8.34, "8.3 s"), (59.96, "1:00 min"), (125, "2:05 min"), (3725, "1:02:05 h")]
)
def test_seconds(seconds: float, text: str) -> None:
    assert format_seconds(seconds) == text


def test_numbers_without_units() -> None:
    assert [millimetres(v) for v in (0.00039, 0.00393, 0.0393, 0.393, -0.0021, -0.0000001, None)] == [
        "0.39",
        "3.93",
        "39.3",
        "393",
        "−2.10",
        "0.00",
        None,
    ]
    assert (decimal(12.3456), percent(0.99999), percent(1.0), percent(0.5, 0)) == ("12.35", "99.9", "100.0", "50")
