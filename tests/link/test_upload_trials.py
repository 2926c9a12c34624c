"""Many uploads over bad links; the full count is in the benchmark."""

from pathlib import Path

from benchmarks.upload_trials import upload_trials
from fieldkit.missions.items import MissionItem


def test_five_percent(sitl: Path, flown: tuple[MissionItem, ...]) -> None:
    done = upload_trials(2, 0.05, 7, items=flown, recording=sitl / "probe_items.tlog", speed=16.0)
    assert (done.count, done.succeeded, done.identical) == (2, 2, 2)
    assert done.failures == ()
    assert 0.02 < done.lost / done.packets < 0.09
