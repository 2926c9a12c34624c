"""Chosen photographs against a reference of those not chosen."""

from __future__ import annotations

import shutil
from collections.abc import Collection
from pathlib import Path

from benchmarks.planner_runs import Place
from fieldkit.cache import StageCache
from fieldkit.evaluation.reference import build_reference
from fieldkit.planning.objective.recorded import RecordedSource
from fieldkit.planning.run.folder import read_settings
from fieldkit.planning.run.run_setup import set_up_run
from fieldkit.runtime.context import Context
from fieldkit.runtime.progress import Progress

_REFERENCE = "rest-reference"


def value_against_rest(
    run: Path, place: Place, chosen: Collection[str], *, workers: int, cache: StageCache, progress: Progress
) -> float:
    """The value in metres at the fidelity of confirmations; the reference is kept in the run's folder.

    Args:
        run: folder of the choosing run.
        place: the recorded set.
        chosen: names of photographs.
    """
    reference = run / _REFERENCE
    if not reference.is_dir():
        rest = run / "rest"
        shutil.rmtree(rest, ignore_errors=True)
        shutil.copytree(place.plot.path, rest, ignore=lambda _, names: [name for name in names if name in chosen])
        table = (rest / "poses.csv").read_text(encoding="utf-8").splitlines()
        kept = [line for line in table if line.split(",", 1)[0] not in chosen]
        (rest / "poses.csv").write_text("\n".join(kept) + "\n", encoding="utf-8")
        build_reference(rest, reference, context=Context(cache, progress, workers), scene=False)
        shutil.rmtree(rest)
    plot = place.plot.model_copy(update={"reference_path": str(reference)})
    settings = read_settings(run).model_copy(update={"given": (plot,)})
    objective = set_up_run(settings, run, Context(cache, progress, workers)).objective.on(0)
    source = objective.source
    assert isinstance(source, RecordedSource)
    index = [k for k, view in enumerate(source.views) if view.name in chosen]
    return objective.evaluate(source.cameras(index), fidelity=settings.confirm_fidelity).value_m
