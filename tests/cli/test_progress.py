"""Progress: lines in a log, a rewritten line on a terminal, silence with --json."""

import os
import pty
import subprocess
import sys
import time

import pytest

from fieldkit.cli import progress
from fieldkit.cli.progress import Lines, with_usual_context
from fieldkit.runtime.context import Context

SCRIPT = """
import time
from fieldkit.cli.progress import open_progress
with open_progress(as_json=False) as progress:
    with progress.stage("features", 3) as advance:
        for _ in range(3):
            time.sleep(0.3)
            advance(1)
    progress.note("IMG_1 [blurred]")
    with progress.stage("mapping") as advance:
        pass
"""


def test_lines(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    now = 0.0
    monkeypatch.setattr(progress.time, "monotonic", lambda: now)
    lines = Lines()
    now = 10.0
    lines.beat()  # no stage is open
    with lines.stage("features", 10) as advance:
        now = 20.0
        lines.beat()  # nothing is done
        advance(4)
        now = 21.0
        lines.beat()  # only a second later: no line
        now = 30.0
        lines.beat()
        now = 41.0
        lines.beat()  # longer than expected
    lines.note("IMG_1 is blurred")
    with lines.stage("mapping"):
        now = 101.0
        lines.beat()
    assert capsys.readouterr().err.splitlines() == [
        "working … 10.0 s",
        "features …",
        "features: 0 of 10, 10.0 s so far",
        "features: 4 of 10, 5.0 s left",
        "features: 4 of 10, 31.0 s so far",
        "features: done in 31.0 s",
        "note: IMG_1 is blurred",
        "mapping …",
        "mapping: 1:00 min so far",
        "mapping: done in 1:00 min",
    ]


def test_no_stage_is_silent(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr(progress, "_LINE_EVERY_S", 0.6)
    with progress.open_progress(as_json=False) as shown, shown.stage("mapping"):
        time.sleep(1.5)
    assert capsys.readouterr().err.count(" so far\n") >= 2


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
    assert "░".encode() in text
    assert b"features: done in" in text
    assert b"IMG_1 [blurred]" in text


def test_a_verb_without_a_context_shows_its_progress(capsys: pytest.CaptureFixture[str]) -> None:
    def verb(plot: str, context: Context | None = None) -> str:
        assert context is not None
        with context.progress.stage(plot):
            return plot

    shown = with_usual_context(verb)
    assert (shown("plot_7"), shown("plot_8", Context())) == ("plot_7", "plot_8")
    lines = capsys.readouterr().err
    assert "plot_7" in lines
    assert "plot_8" not in lines
