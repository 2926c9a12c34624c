"""Chosen photographs of recorded sets on plots of their kind: matches withheld, views missing, plants turned."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np

from benchmarks.result import Cell, ResultTable
from fieldkit.cache import StageCache
from fieldkit.planning.methods.subsets import Uniform
from fieldkit.planning.objective.fidelity import FidelityName
from fieldkit.planning.objective.objective import Objective
from fieldkit.planning.objective.recorded import RecordedSource, Rehearsal
from fieldkit.planning.run.folder import read_settings
from fieldkit.planning.run.run_setup import set_up_run
from fieldkit.planning.space.cameras import Cameras
from fieldkit.runtime.progress import Progress

WITHHELD = tuple(Rehearsal(0.0, 0.4, draw) for draw in (101, 102, 103))
"""60 % of all matches; searches use other draws."""
TURNED = tuple(Rehearsal(turn_deg) for turn_deg in (70.0, 160.0, 250.0))
_DRAWS, _PHASES = 3, 3
_Found = Sequence[tuple[float, int]]
"""Values in metres and right photographs."""


def rehearsed_table(
    title: str, run: Path, chosen: Mapping[str, Cameras], *, cache: StageCache, progress: Progress
) -> ResultTable:
    """A row per set of views, and per phase of even sets.

    Args:
        title: of the table.
        run: folder of a run that chose among the photographs for their kind.
        chosen: the photographs' cameras, by method.
        cache: of stages.
        progress: receives the stages.
    """
    opened = set_up_run(read_settings(run), run, cache=cache, progress=progress)
    objective = opened.objective.on(0)
    source = objective.source
    assert isinstance(source, RecordedSource)
    sets = dict(chosen)
    even = Uniform(opened.problem)
    for phase in range(_PHASES):
        if (trial := even.propose(phase, (), ())) is not None:
            sets[f"even, phase {phase}"] = trial.cameras

    def evaluate(cameras: Cameras, rehearsal: Rehearsal, fidelity: FidelityName) -> tuple[float, int]:
        there = Objective(source.rehearsing(rehearsal), objective.settings, seed=objective.seed)
        found = there.evaluate(cameras, fidelity=fidelity)
        return found.value_m, found.right

    rows: list[tuple[Cell, ...]] = []
    with progress.stage(title, len(sets)) as advance:
        for by, cameras in sets.items():
            found = situations(cameras, evaluate)
            rows.append((by, *(cell for name, each in found.items() for cell in _cells(each, name == "as it is"))))
            advance(1)
    columns = ["views"]
    for name in situations(next(iter(sets.values())), lambda *_: (0.0, 0)):
        columns += [f"{name}, mm>", "right>"]
    return ResultTable(title, tuple(columns), tuple(rows))


def situations(
    cameras: Cameras, evaluate: Callable[[Cameras, Rehearsal, FidelityName], tuple[float, int]]
) -> dict[str, _Found]:
    """Values of a set of views: unchanged, with matches withheld, without one and two views, with plants turned.

    Args:
        cameras: of the views.
        evaluate: gives value in metres and right photographs of a set under a rehearsal at a fidelity.
    """

    def without(count: int) -> list[Cameras]:
        left_out = [np.random.default_rng(k).choice(len(cameras), count, replace=False) for k in range(_DRAWS)]
        return [cameras.select(np.setdiff1d(np.arange(len(cameras)), out)) for out in left_out]

    same = Rehearsal()
    return {
        "as it is": [evaluate(cameras, same, "standard"), evaluate(cameras, same, "fine")],
        "60 % of matches withheld": [evaluate(cameras, each, "standard") for each in WITHHELD],
        "one view missing": [evaluate(each, same, "standard") for each in without(1)],
        "two views missing": [evaluate(each, same, "standard") for each in without(2)],
        "plants turned": [evaluate(cameras, each, "standard") for each in TURNED],
    }


def _cells(found: _Found, by_fidelity: bool) -> tuple[str, str]:
    values = [1000 * value for value, _ in found]
    text = f"{values[0]:.2f} ({values[1]:.2f})" if by_fidelity else f"{np.mean(values):.2f}"
    return text, ", ".join(str(right) for right in dict.fromkeys(right for _, right in found))
