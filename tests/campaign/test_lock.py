"""One run at a time."""

from __future__ import annotations

import subprocess
import sys
import textwrap
import threading
import time
from pathlib import Path

import pytest

from fieldkit.campaign.run import campaign_lock
from fieldkit.errors import UsageError

LIMIT_S = 120.0


def test_a_second_run_refuses_or_waits(tmp_path: Path) -> None:
    said: list[str] = []
    done = threading.Event()

    def second() -> None:
        with campaign_lock(tmp_path, wait=True, note=said.append):
            done.set()

    with campaign_lock(tmp_path, wait=True, note=said.append):
        with pytest.raises(UsageError, match="another run works in this campaign"):
            with campaign_lock(tmp_path, wait=False, note=said.append):
                pass
        thread = threading.Thread(target=second)
        thread.start()
        give_up = time.monotonic() + LIMIT_S
        while not said and time.monotonic() < give_up:
            time.sleep(0.01)
        assert said[0].startswith("waiting: another run works in this campaign")
        assert not done.is_set()
    thread.join(LIMIT_S)
    assert done.is_set()
    assert len(said) == 1


def test_a_killed_run_leaves_no_lock(tmp_path: Path) -> None:
    script = textwrap.dedent("""
        import sys, time
        from pathlib import Path
        from fieldkit.campaign.run import campaign_lock
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
