"""Photographs matched to triggers: by time and place, with some missing, some extra and a clock that is wrong."""

import math
from dataclasses import replace

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from fieldkit.flightlogs import Matches, Place, Stamp, Trigger, match
from fieldkit.flightlogs.model import bursts_of

HOME = (50.865, 6.4473)
M_NORTH, M_EAST = 1.0 / 111_240.0, 1.0 / 70_370.0


def flown(intervals: list[float], ring_m: float = 2.5, plot_m: float = 30.0) -> list[Trigger]:
    """Triggers on rings of 13 about plots that lie in a row."""
    triggers, time = [], 1_795_000_000.0
    for k, interval in enumerate(intervals):
        time += interval
        angle = 2 * math.pi * (k % 13) / 13
        place = Place(
            HOME[0] + ring_m * math.cos(angle) * M_NORTH,
            HOME[1] + (ring_m * math.sin(angle) + plot_m * (k // 13)) * M_EAST,
            100.0,
            2.0,
        )
        triggers.append(Trigger(time - 1_794_999_000.0, time, k + 1, place, None, None, None, None, "test"))
    return triggers


def photograph(
    trigger: Trigger, name: str, *, offset: float, noise: tuple[float, float, float], whole: bool, gps: bool
) -> Stamp:
    time = trigger.utc_s + offset + noise[0]
    stamp = Stamp(name, float(math.floor(time)) if whole else time)
    if not gps:
        return stamp
    return replace(
        stamp,
        latitude_deg=trigger.place.latitude_deg + noise[1] * M_NORTH,
        longitude_deg=trigger.place.longitude_deg + noise[2] * M_EAST,
    )


def photographs(
    triggers: list[Trigger],
    *without: int,
    offset: float = 0.0,
    noise: tuple[float, float, float] = (0.0, 0.0, 0.0),
    whole: bool = False,
    gps: bool = False,
) -> list[Stamp]:
    """A photograph of each trigger but some, named by it."""
    return [
        photograph(t, f"P{k}", offset=offset, noise=noise, whole=whole, gps=gps)
        for k, t in enumerate(triggers)
        if k not in without
    ]


def own(found: Matches) -> bool:
    """Whether every photograph that is matched is matched with its own trigger."""
    return all(pair.photograph == f"P{pair.trigger}" for pair in found.pairs)


def matched(found: Matches) -> list[int]:
    """The triggers that photographs are matched with, each with its own."""
    assert own(found)
    return [pair.trigger for pair in found.pairs]


def series(count: int, seed: int, low: float = 4.0, high: float = 14.0) -> list[float]:
    return list(np.random.default_rng(seed).uniform(low, high, count))


@given(
    seed=st.integers(0, 10_000),
    plots=st.integers(1, 3),
    drop=st.integers(0, 12),
    extra=st.floats(-20.0, 1.0),
    offset=st.floats(-50_000, 50_000),
    drift=st.floats(-1e-4, 1e-4),
    kind=st.sampled_from([(False, False), (True, True), (False, True)]),
)
def test_one_missing_and_one_extra_anywhere(seed, plots, drop, extra, offset, drift, kind) -> None:
    """Fractions of seconds, or whole ones with GPS (5 cm): every photograph finds its own trigger."""
    whole, gps = kind
    rng = np.random.default_rng(seed)
    triggers = flown(series(13 * plots, seed))
    start = triggers[0].time_s
    stamps = []
    for k, trigger in enumerate(triggers):
        if k == drop:
            continue
        noise = (float(rng.normal(0, 0.03)), float(rng.normal(0, 0.05)), float(rng.normal(0, 0.05)))
        clock = offset + drift * (trigger.time_s - start)
        stamps.append(photograph(trigger, f"P{k}", offset=clock, noise=noise, whole=whole, gps=gps))
    # The extra lies between two triggers or before the first, at least 2 s from any.
    at = int(rng.integers(len(triggers)))
    lone = photograph(
        triggers[at], "X", offset=offset - 2.0 + min(extra, -0.5), noise=(0, 30.0, 9.0), whole=whole, gps=gps
    )
    apart = min(abs((t.utc_s or 0.0) + offset - (lone.time_s or 0.0)) for t in triggers)
    if apart > 1.7:
        stamps.append(lone)
    rng.shuffle(stamps)
    found = match(stamps, triggers)
    assert own(found)
    assert not found.ambiguous
    assert len(found.pairs) == 13 * plots - 1
    assert found.triggers == (drop,)
    assert found.photographs == (("X",) if apart > 1.7 else ())
    # Whole seconds are cut off, half a second in the mean; the drift fitted to them adds about 0.1 s (one sigma).
    assert abs(found.offset_s - offset) < (0.5 + 4 * 0.1 if whole else 0.1)


def test_places_decide_where_times_cannot() -> None:
    triggers = flown([9.0] * 13)
    stamps = photographs(triggers, 0, 12, offset=30.3, noise=(0, 0.02, -0.02), whole=True, gps=True)
    found = match(stamps, triggers)
    assert matched(found) == list(range(1, 12))
    assert found.triggers == (0, 12)


def test_two_plots_flown_alike_in_one_log() -> None:
    """The photographs of the second plot only; the first has the same rhythm, so only places tell."""
    rhythm = series(13, 3)
    triggers = flown([*rhythm, *rhythm])
    with_gps = photographs(triggers, *range(13), offset=12.0, noise=(0.01, 0.5, -0.5), whole=True, gps=True)
    found = match(with_gps, triggers)
    assert matched(found) == list(range(13, 26))
    without = [replace(s, latitude_deg=None, longitude_deg=None) for s in with_gps]
    assert not match(without, triggers).pairs
    assert match(without, triggers).ambiguous


def test_bursts_in_whole_seconds_are_matched_in_their_order() -> None:
    stations = flown(series(9, 4))
    triggers = [
        replace(t, time_s=t.time_s + 0.7 * k, utc_s=(t.utc_s or 0.0) + 0.7 * k) for t in stations for k in range(5)
    ]
    found = match(photographs(triggers, offset=7200.2, whole=True), triggers)
    assert len(found.pairs) == 45
    assert own(found)
    # A flight of single photographs with an odd second trigger has no bursts: which one it was is not guessed.
    odd = [stations[0], *triggers[1:2], *stations[1:]]
    assert bursts_of(odd).tolist() == list(range(10))
    assert bursts_of(triggers).tolist() == [s for s in range(9) for _ in range(5)]
    assert bursts_of([]).tolist() == []


def test_nothing_to_go_by() -> None:
    triggers = flown(series(5, 1))
    found = match([Stamp("a"), Stamp("b")], triggers)
    assert not found.pairs
    assert found.photographs == ("a", "b")
    assert "neither when nor where" in found.remarks[0]
    assert match([], triggers).triggers == (0, 1, 2, 3, 4)
    assert match([Stamp("a", 3.0)], []).photographs == ("a",)
