"""A season of a campaign: many simulated plots on several dates, evaluated by one command that is killed twice."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import psutil

from benchmarks.result import Cell, ResultTable, StudyResult
from benchmarks.season_plots import DATES, STATIONS, Flown, make_campaign, photograph
from fieldkit.campaign.reading import read_visits
from fieldkit.clouds import read_cloud, score
from fieldkit.errors import ReconstructionError
from fieldkit.runtime.executor import map_parallel
from fieldkit.runtime.progress import Progress

PLOTS = 40
_KILLED_AT = (1 / 3, 2 / 3)
_NOTE = (
    "One command, ended by SIGKILL when a third and when two thirds of the rows were there. Every plot has other "
    "plants, another heading, light and soil; poses are off by 5 cm and 1.2° per axis, geotags by 1.5 cm; leaves sway."
)


@dataclass(frozen=True)
class _Run:
    """One start of the command."""

    killed: bool
    rows_before: int
    rows_after: int
    wall_s: float
    memory_bytes: int


def run_season(
    plots: int = PLOTS,
    *,
    seed: int = 0,
    width_px: int = 2000,
    workers: int = 1,
    work: Path | None = None,
    progress: Progress,
) -> StudyResult:
    """Photograph ``plots`` plots on two dates, and evaluate all in one campaign, killed twice and resumed.

    Args:
        plots: 1 to 100, each with plants, heading, light and soil of its own.
        seed: of everything.
        width_px: of the photographs.
        work: keeps photographs and the campaign; None takes a temporary folder.
    """
    if work is None:
        with tempfile.TemporaryDirectory() as temporary:
            return run_season(
                plots, seed=seed, width_px=width_px, workers=workers, work=Path(temporary), progress=progress
            )
    flown = [Flown(plot, date, width_px, work, seed) for date in range(len(DATES)) for plot in range(plots)]
    missing = [each for each in flown if not each.truth.is_file()]
    with progress.stage("Photographs", len(missing)) as advance:
        map_parallel(photograph, missing, workers=workers, advance=advance)
    campaign = work / "season"
    if not campaign.exists():
        make_campaign(campaign, work, plots, width_px, seed)
    runs, twice = _run_to_the_end(campaign, work / "card", len(flown), workers, progress)
    rows = _rows(campaign)
    if len(rows) != len(flown):
        raise ReconstructionError(f"the table has {len(rows)} rows where {len(flown)} were flown", path=campaign)
    scores = {(each.name, each.date): _against_truth(campaign, each) for each in flown}
    return _result(rows, runs, twice, scores, plots, width_px)


def _run_to_the_end(
    campaign: Path, card: Path, expected: int, workers: int, progress: Progress
) -> tuple[list[_Run], int]:
    """Start the command until it ends by itself; returns the number of starts and of rows computed again."""
    runs, twice = [], 0
    limits: list[float | None] = [*(share * expected for share in _KILLED_AT), None]
    with progress.stage("The campaign", expected) as advance:
        for limit in limits:
            before = _rows(campaign)
            runs.append(_run(campaign, card, workers, limit, advance))
            after = _rows(campaign)
            twice += sum(after.get(key) != row for key, row in before.items())
    return runs, twice


def _run(campaign: Path, card: Path, workers: int, limit: float | None, advance: Any) -> _Run:
    command = [
        sys.executable,
        "-m",
        "fieldkit",
        "evaluate",
        str(card),
        "--campaign",
        str(campaign),
        "--workers",
        str(workers),
        "--json",
    ]
    begun, done = time.perf_counter(), len(_rows(campaign))
    first, memory = done, 0
    with (
        tempfile.TemporaryFile() as errors,
        subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=errors, start_new_session=True) as process,
    ):
        killed = False
        while process.poll() is None:
            memory = max(memory, _memory(process.pid))
            rows = len(_rows(campaign))
            if rows > done:
                advance(rows - done)
                done = rows
            if limit is not None and rows >= limit and not killed:
                # The command only: its workers must notice by themselves.
                os.kill(process.pid, signal.SIGKILL)
                killed = True
            time.sleep(0.5)
        if process.returncode not in (0, -signal.SIGKILL):
            errors.seek(0)
            raise ReconstructionError(
                f"fieldkit evaluate ended with {process.returncode}: {errors.read().decode(errors='replace')[-800:]}",
                path=campaign,
            )
    rows = len(_rows(campaign))
    advance(rows - done)
    return _Run(killed, first, rows, time.perf_counter() - begun, memory)


def _memory(pid: int) -> int:
    """Resident bytes of a process and its children; shared pages count for each."""
    try:
        parent = psutil.Process(pid)
        return sum(p.memory_info().rss for p in [parent, *parent.children(recursive=True)])
    except psutil.Error:
        return 0


def _rows(campaign: Path) -> dict[tuple[str, str], Mapping[str, Any]]:
    return {visit.key: visit.row() for visit in read_visits(campaign)}


def _against_truth(campaign: Path, each: Flown) -> float | None:
    """Chamfer distance of the visit's cloud to the true plants, metres; None without a cloud."""
    folder = campaign / "visits" / each.name / f"{DATES[each.date]:%Y-%m-%d}" / each.name
    if not (folder / "cloud.ply").is_file():
        return None
    return score(read_cloud(each.truth), read_cloud(folder / "cloud.ply")).chamfer.chamfer_m


def _result(
    rows: Mapping[tuple[str, str], Mapping[str, Any]],
    runs: Sequence[_Run],
    twice: int,
    scores: Mapping[tuple[str, int], float | None],
    plots: int,
    width_px: int,
) -> StudyResult:
    visits = list(rows.values())
    costs = np.array([row["cpu_s"] for row in visits])
    reached = np.array([value for value in scores.values() if value is not None]) * 1000.0
    failed = [row for row in visits if row["error"]]
    predicted = []
    for (plot, date), value in scores.items():
        row = rows[plot, f"{DATES[date]:%Y-%m-%d}"]
        if value is not None and row["predicted_low_m"] is not None:
            predicted.append((row["predicted_chamfer_m"], row["predicted_low_m"], row["predicted_high_m"], value))
    within = sum(low <= value <= high for _, low, high, value in predicted)
    figures: list[tuple[Cell, ...]] = [
        ("visits in the table, of those flown", f"{len(rows)} of {len(scores)}"),
        ("visits with an error", len(failed)),
        ("photographs used, of those taken", f"{sum(r['right'] for r in visits)} of {len(scores) * STATIONS}"),
        ("CPU s per visit: median, most", f"{np.median(costs):.1f}, {costs.max():.1f}"),
        ("most memory of the command and its workers, GB", f"{max(run.memory_bytes for run in runs) / 1e9:.2f}"),
        ("starts of the command, killed", f"{len(runs)}, {sum(run.killed for run in runs)}"),
        ("rows that were computed again", twice),
        (
            "to the true plants, mm: median, least, most",
            ", ".join(f"{v:.1f}" for v in (np.median(reached), reached.min(), reached.max())),
        ),
        ("with a prediction; truth within its interval", f"{len(predicted)}; {within}"),
    ]
    table = ResultTable(
        f"{plots} plots on {len(DATES)} dates, {STATIONS} photographs of {width_px} pixels each",
        ("what", "figure"),
        tuple(figures),
    )
    return StudyResult(
        name="season",
        title="A campaign, killed twice",
        tables=(table,),
        notes=(_NOTE,),
        figures={
            "runs": [vars(run) for run in runs],
            "cpu_s": costs.tolist(),
            "chamfer_m": {f"{plot} {DATES[date]:%Y-%m-%d}": value for (plot, date), value in scores.items()},
            "predicted": predicted,
            "errors": [row["error"] for row in failed],
        },
    )
