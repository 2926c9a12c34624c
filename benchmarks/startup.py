"""The time of help texts, against importing Typer and Rich."""

from __future__ import annotations

import statistics
import subprocess
import sys
import time

from benchmarks.result import ResultTable, StudyResult
from fieldkit.runtime.progress import Progress

LIMIT = 2.5
_FIELDKIT = "import sys; from fieldkit.cli.main import main; sys.exit(main())"
COMMANDS: dict[str, list[str]] = {
    'python -c "import typer, rich"': ["-c", "import typer, rich"],
    "fieldkit --help": ["-c", _FIELDKIT, "--help"],
    "fieldkit reference --help": ["-c", _FIELDKIT, "reference", "--help"],
}


def run_startup(rounds: int = 15, *, progress: Progress) -> StudyResult:
    """Median wall times of interleaved runs."""
    wall, cpu = time.perf_counter(), time.process_time()
    times = measure(rounds, progress)
    medians = {name: statistics.median(found) for name, found in times.items()}
    base = next(iter(medians.values()))
    rows = tuple((name, f"{1000 * value:.0f}", f"{value / base:.2f}") for name, value in medians.items())
    return StudyResult(
        name="help",
        title="Help",
        tables=(ResultTable(f"Wall time, median of {rounds}", ("command", "ms>", "ratio>"), rows),),
        notes=(f"The runs alternate. The limit is a ratio of {LIMIT:g}.",),
        figures={"medians_s": medians, "times_s": times, "ratios": {name: v / base for name, v in medians.items()}},
        wall_s=time.perf_counter() - wall,
        cpu_s=time.process_time() - cpu,
    )


def measure(rounds: int, progress: Progress) -> dict[str, list[float]]:
    """Wall seconds of every command, one after the other in each round, after one uncounted round."""
    times: dict[str, list[float]] = {name: [] for name in COMMANDS}
    with progress.stage("Help", rounds + 1) as advance:
        for number in range(rounds + 1):
            for name, arguments in COMMANDS.items():
                start = time.perf_counter()
                subprocess.run([sys.executable, *arguments], stdout=subprocess.DEVNULL, check=True)
                if number:
                    times[name].append(time.perf_counter() - start)
            advance(1)
    return times
