"""One run at a time, and workers that are watched."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import textwrap
import threading
import time
from pathlib import Path

import psutil
import pytest

from fieldkit.campaign.lock import campaign_lock
from fieldkit.campaign.workers import each_in_workers
from fieldkit.errors import UsageError

LIMIT_S = 120.0


def job(number: int) -> tuple[int, int]:
    if number == 3:
        os.kill(os.getpid(), signal.SIGKILL)
    if number == 4:
        os._exit(7)
    return os.getpid(), number * number


def test_a_second_run_refuses_or_waits(tmp_path: Path) -> None:
    said: list[str] = []
    done = threading.Event()

    def second() -> None:
        with campaign_lock(tmp_path, wait=True, note=said.append):
            done.set()

    with campaign_lock(tmp_path, wait=True, note=said.append):
        with pytest.raises(UsageError, match=f"another run works in this campaign .process {os.getpid()}, since"):
            with campaign_lock(tmp_path, wait=False, note=said.append):
                pass
        thread = threading.Thread(target=second)
        thread.start()
        give_up = time.monotonic() + LIMIT_S
        while not said and time.monotonic() < give_up:
            time.sleep(0.01)
        assert said[0].startswith("waiting: another run works in this campaign (process")
        assert not done.is_set()
    thread.join(LIMIT_S)
    assert done.is_set()
    assert len(said) == 1
    assert (tmp_path / ".lock").read_bytes() == b""


def test_a_killed_run_leaves_no_lock(tmp_path: Path) -> None:
    script = textwrap.dedent("""
        import sys, time
        from pathlib import Path
        from fieldkit.campaign.lock import campaign_lock
        with campaign_lock(Path(sys.argv[1]), wait=False, note=print):
            print("held", flush=True)
            time.sleep(600)
    """)
    process = subprocess.Popen([sys.executable, "-c", script, str(tmp_path)], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    assert process.stdout.readline() == "held\n"
    with pytest.raises(UsageError), campaign_lock(tmp_path, wait=False, note=print):
        pass
    process.kill()
    process.communicate()
    with campaign_lock(tmp_path, wait=False, note=print):
        pass


@pytest.mark.slow
def test_a_worker_that_dies_costs_its_job_only() -> None:
    done = list(each_in_workers(job, [1, 2, 3, 4, 5], workers=2))
    assert sorted(each.job for each in done) == [1, 2, 3, 4, 5]
    by_job = {each.job: each for each in done}
    for number in (1, 2, 5):
        result = by_job[number].result
        assert result is not None
        assert result[1] == number * number
    assert by_job[3].death == "its process was ended by SIGKILL (out of memory?)"
    assert by_job[4].death == "its process ended with exit code 7"


@pytest.mark.slow
def test_workers_end_with_their_run(tmp_path: Path) -> None:
    """A run that is killed takes its workers with it, busy or not."""
    module = tmp_path / "sleeping.py"
    module.write_text(
        textwrap.dedent("""
        import os, sys, time
        from pathlib import Path
        from fieldkit.campaign.workers import each_in_workers

        def job(folder):
            (Path(folder) / str(os.getpid())).touch()
            time.sleep(600)

        if __name__ == "__main__":
            list(each_in_workers(job, [sys.argv[1]] * 2, workers=2))
    """)
    )
    started = tmp_path / "started"
    started.mkdir()
    process = subprocess.Popen([sys.executable, str(module), str(started)])
    give_up = time.monotonic() + LIMIT_S
    while len(list(started.iterdir())) < 2 and time.monotonic() < give_up:
        time.sleep(0.05)
    workers = [int(path.name) for path in started.iterdir()]
    assert len(workers) == 2
    process.kill()
    process.wait()
    while any(psutil.pid_exists(pid) for pid in workers) and time.monotonic() < give_up:
        time.sleep(0.05)
    assert not any(psutil.pid_exists(pid) for pid in workers)
