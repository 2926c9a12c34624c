"""Progress: lines in a log, bars on a terminal, silence with --json."""

import os
import pty
import subprocess
import sys

import pytest

from fieldkit.cli import progress
from fieldkit.cli.progress import Lines

SCRIPT = """
from fieldkit.cli.progress import open_progress
with open_progress(as_json=False) as progress:
    with progress.stage("features", 3) as advance:
        for _ in range(3):
            advance(1)
    progress.note("IMG_1 [blurred]")
    with progress.stage("mapping") as advance:
        pass
"""


def test_lines(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    seconds = iter([0.0, 11.0, 12.0, 22.0, 90.0])
    monkeypatch.setattr(progress.time, "monotonic", lambda: next(seconds))
    lines = Lines()
    with lines.stage("features", 10) as advance:
        advance(5)
        advance(1)  # only a second later: no line
        advance(3)
    lines.note("IMG_1 is blurred")
    assert capsys.readouterr().err.splitlines() == [
        "features …",
        "features: 5 of 10, 11.0 s left",
        "features: 9 of 10, 2.4 s left",
        "features: done in 1:30 min",
        "note: IMG_1 is blurred",
    ]


def test_a_failed_stage_is_not_called_done(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(ZeroDivisionError), Lines().stage("features"):
        _ = 1 / 0
    assert capsys.readouterr().err == "features …\n"


def test_bars_on_a_terminal() -> None:
    main_end, terminal = pty.openpty()
    environment = {**os.environ, "TERM": "xterm", "COLUMNS": "80"}
    with subprocess.Popen([sys.executable, "-c", SCRIPT], stderr=terminal, env=environment) as process:
        os.close(terminal)
        text = b""
        while True:
            try:
                chunk = os.read(main_end, 65536)
            except OSError:  # Linux's way to say that the other end is closed
                break
            if not chunk:
                break
            text += chunk
    os.close(main_end)
    assert process.returncode == 0
    assert b"features" in text
    assert b"3/3" in text
    assert b"IMG_1 [blurred]" in text
