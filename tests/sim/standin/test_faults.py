"""Bad links."""

import pytest

from fieldkit.errors import UsageError
from fieldkit_sim.standin.faults import Channel, Faults


def test_shares_and_the_order_are_kept_the_same_at_a_seed() -> None:
    packets = [k.to_bytes(2, "big") for k in range(20_000)]
    channels = [Channel(Faults(loss=0.2, duplicate=0.1, seed=4), 0) for _ in range(2)]
    for channel in channels:
        for packet in packets:
            channel.put(packet, 0.0)
    channel = channels[0]
    assert channel.lost == pytest.approx(4000, rel=0.05)
    assert channel.doubled == pytest.approx(1600, rel=0.1)
    arrived = channel.arrived(0.0)
    assert len(arrived) == 20_000 - channel.lost + channel.doubled
    assert arrived == sorted(arrived) == channels[1].arrived(0.0)
    assert channel.arrived(1.0) == []


@pytest.mark.parametrize(
    "arguments",
    [{"loss": 1.1}, {"duplicate": float("nan")}],
)
def test_errors(arguments: dict[str, float]) -> None:
    with pytest.raises(UsageError):
        Faults(**arguments)
