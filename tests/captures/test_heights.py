"""Which height counts, by stated accuracy and for all photographs together."""

from dataclasses import replace

import pytest

from fieldkit.captures.heights import Heights, choose_heights
from fieldkit.captures.model import GeoTag

TRUE = {f"{k}.jpg": 100.0 + 0.1 * (k % 3) for k in range(8)}
"""Absolute heights; take-off is at 60 m."""


def tags(**kinds: GeoTag) -> dict[str, GeoTag]:
    """Tags at TRUE: of the kind ``k``, but photograph 3 of the kind ``k3`` where that is given."""
    return {
        name: replace(
            kind,
            altitude_m=None if kind.altitude_m is None else height + kind.altitude_m,
            relative_altitude_m=None if kind.relative_altitude_m is None else height - 60.0 + kind.relative_altitude_m,
        )
        for index, (name, height) in enumerate(TRUE.items())
        for kind in (kinds.get(f"k{index}", kinds["k"]),)
    }


def tag(altitude: float | None = 0.0, relative: float | None = 0.0, **more: object) -> GeoTag:
    """A tag whose altitudes are off by these."""
    return replace(GeoTag(52.0, 13.0, altitude, "sea level", relative), **more)


RTK = tag(datum="ellipsoid", rtk=True, horizontal_accuracy_m=0.013, vertical_accuracy_m=0.027)
PLAIN = tag(47.3)
"""A receiver without RTK, 47.3 m off as sea level is from the ellipsoid."""


def codes(heights: Heights) -> list[str]:
    return [finding.code for finding in heights.findings]


@pytest.mark.parametrize("dropped", [(3, 5, 7), (0, 1, 2, 3, 4, 5), (7,), (1, 2, 3, 4, 5, 6, 7)])
def test_where_rtk_drops_heights_above_take_off_bridge_the_datums(dropped: tuple[int, ...]) -> None:
    chosen = choose_heights(tags(k=RTK, **{f"k{k}": PLAIN for k in dropped}))
    assert chosen.heights == pytest.approx(TRUE)
    assert (chosen.source, chosen.datum) == ("RTK altitude, else relative altitude", "ellipsoid")
    assert codes(chosen) == ["heights-joined"]
    assert chosen.accuracies_m["3.jpg"] == (0.3 if 3 in dropped else 0.03)


def test_between_two_take_offs_a_height_is_not_guessed() -> None:
    late = replace(RTK, relative_altitude_m=-10.0)
    chosen = choose_heights(
        tags(k=RTK, k3=PLAIN, k4=late, k5=replace(PLAIN, relative_altitude_m=-10.0), k6=late, k7=late)
    )
    assert "3.jpg" not in chosen.heights
    assert chosen.heights["5.jpg"] == pytest.approx(TRUE["5.jpg"])
    assert codes(chosen) == ["heights-joined", "no-altitude"]


def test_without_relative_heights_the_datum_of_most_counts() -> None:
    rtk, plain = replace(RTK, relative_altitude_m=None), replace(PLAIN, relative_altitude_m=None)
    chosen = choose_heights(tags(k=rtk, k3=plain))
    assert set(TRUE) - set(chosen.heights) == {"3.jpg"}
    assert codes(chosen) == ["no-altitude"]
    chosen = choose_heights(tags(k=plain, k3=rtk))
    assert set(TRUE) - set(chosen.heights) == {"3.jpg"}
    assert chosen.datum == "sea level"


@pytest.mark.parametrize("horizontal", [0.02, 0.25])
def test_post_processed_heights_are_better_than_a_drifting_barometer(horizontal: float) -> None:
    drifting = {f"k{k}": tag(0.0, 0.1 * k, horizontal_accuracy_m=horizontal) for k in range(8)}
    chosen = choose_heights(tags(k=tag(), **drifting))
    assert chosen.heights == pytest.approx(TRUE)
    assert (chosen.source, chosen.findings) == ("absolute altitude", ())
    assert set(chosen.accuracies_m.values()) == {max(0.03, horizontal)}


def test_datums_that_differ_without_rtk_are_bridged_too() -> None:
    chosen = choose_heights(tags(k=tag(), k1=tag(47.3, datum="ellipsoid")))
    assert chosen.heights == pytest.approx(TRUE)
    assert (chosen.source, chosen.datum, codes(chosen)) == ("relative altitude", "sea level", ["heights-joined"])


def absolute(*values: float, **more: object) -> dict[str, GeoTag]:
    return {f"{k}.jpg": tag(value, None, **more) for k, value in enumerate(values)}


@pytest.mark.parametrize(
    ("values", "believed"),
    [
        ((198.6, -198.5, 198.4), False),
        ((-3.0, 4.0, 2.0), True),  # a coast
        ((-30.0, 60.0, 5.0), True),
        ((-198.0, -197.0), True),
    ],
)
def test_altitudes_that_differ_by_their_sign_alone_are_not_used(values: tuple[float, ...], believed: bool) -> None:
    chosen = choose_heights(absolute(*values))
    assert tuple(chosen.heights.values()) == (values if believed else ())
    assert codes(chosen)[:1] == ([] if believed else ["altitude-sign"])


def test_an_altitude_of_zero_among_others_is_none() -> None:
    chosen = choose_heights(absolute(120.0, 0.0, 121.0))
    assert list(chosen.heights) == ["0.jpg", "2.jpg"]
    assert codes(chosen) == ["altitude-zero", "no-altitude"]
    assert list(choose_heights(absolute(0.4, 0.0, -0.3)).heights.values()) == [0.4, 0.0, -0.3]


def test_altitudes_of_zero_in_all_photographs_are_no_sea_level() -> None:
    chosen = choose_heights(absolute(0.0, 0.0, 0.0))
    assert (chosen.source, chosen.datum, codes(chosen)) == ("one height for all", "unknown", ["altitude-zero"])
    assert set(chosen.heights.values()) == {0.0}
    relative = {n: replace(t, relative_altitude_m=30.0 + k) for k, (n, t) in enumerate(absolute(0.0, 0.0, 0.0).items())}
    chosen = choose_heights(relative)
    assert (chosen.source, chosen.datum, list(chosen.heights.values())) == (
        "relative altitude",
        "unknown",
        [30.0, 31.0, 32.0],
    )
