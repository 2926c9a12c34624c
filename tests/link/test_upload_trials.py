"""Many uploads over bad links; the full count is in the benchmark."""

from pathlib import Path

import pytest

from benchmarks.upload_trials import cut_trials, upload_trials
from fieldkit.missions.items import MissionItem


def test_five_percent(sitl: Path, flown: tuple[MissionItem, ...]) -> None:
    done = upload_trials(2, 0.05, 7, items=flown, recording=sitl / "probe_items.tlog", speed=16.0)
    assert (done.count, done.succeeded, done.identical) == (2, 2, 2)
    assert done.failures == ()
    assert 0.02 < done.lost / done.packets < 0.09


@pytest.mark.slow
def test_twenty_percent(sitl: Path, flown: tuple[MissionItem, ...]) -> None:
    done = upload_trials(4, 0.2, 7, items=flown, recording=sitl / "probe_items.tlog", speed=16.0)
    assert (done.succeeded, done.identical) == (4, 4)
    assert 0.15 < done.lost / done.packets < 0.25


@pytest.mark.slow
def test_cut_links(sitl: Path, flown: tuple[MissionItem, ...]) -> None:
    done = cut_trials(6, 3, items=flown, recording=sitl / "probe_items.tlog")
    assert (done.count, done.whole, done.untrue, done.failures) == (6, 6, 0, ())
    assert done.reported["UNKNOWN"] >= 3
