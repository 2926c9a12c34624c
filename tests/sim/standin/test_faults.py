"""Bad links."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fieldkit.errors import UsageError
from fieldkit_sim.standin.faults import Channel, Faults


def test_a_perfect_link_keeps_everything_in_order() -> None:
    channel = Channel(Faults(), 0)
    packets = [bytes([k]) for k in range(50)]
    for k, packet in enumerate(packets):
        channel.put(packet, k * 0.1)
    assert channel.arrived(100.0) == packets
    assert channel.arrived(100.0) == []


def test_shares_are_kept() -> None:
    channel = Channel(Faults(loss=0.2, duplicate=0.1, seed=4), 0)
    for _ in range(20_000):
        channel.put(b"x", 0.0)
    assert channel.lost == pytest.approx(4000, rel=0.05)
    assert channel.doubled == pytest.approx(1600, rel=0.1)
    assert len(channel.arrived(0.0)) == 20_000 - channel.lost + channel.doubled


@given(st.floats(0, 1), st.floats(0, 1), st.floats(0, 5), st.integers(0, 1000))
def test_the_same_seed_is_the_same_link(loss: float, duplicate: float, delay_s: float, seed: int) -> None:
    def run() -> list[bytes]:
        channel = Channel(Faults(loss, duplicate, delay_s, seed), 1)
        for k in range(30):
            channel.put(bytes([k]), k * 0.01)
        return channel.arrived(1000.0)

    assert run() == run()


@pytest.mark.parametrize(
    "arguments",
    [{"loss": 1.1}, {"loss": -0.1}, {"duplicate": float("nan")}, {"delay_s": -1.0}, {"delay_s": float("inf")}],
)
def test_errors(arguments: dict[str, float]) -> None:
    with pytest.raises(UsageError):
        Faults(**arguments)
