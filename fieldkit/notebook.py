"""Verbs for a notebook: folders in, a result out. All else has a default, and paths may be strings."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from fieldkit.evaluation.evaluate import evaluate_captures
from fieldkit.planning.methods.registry import METHODS, MethodEntry
from fieldkit.planning.run.plan_views import plan_views
from fieldkit.planning.run.request import search_settings
from fieldkit.reconstruction.settings import ReconstructionSettings
from fieldkit.results.evaluation import EvaluationReport
from fieldkit.results.plan import Plan
from fieldkit.results.plan_file import load_plan
from fieldkit.runtime.machine import usual_workers
from fieldkit.runtime.threads import limit_threads

_OF_RUN = ("cache", "progress", "overwrite", "scheduler", "watch", "expect")


def evaluate(
    captures: Path | str, output: Path | str | None = None, *, reference: Path | str | None = None,
    workers: int | None = None, **more: Any,
) -> EvaluationReport:  # fmt: skip
    """Reconstruct photographs of one or many plots and score them.

    Args:
        captures: a folder of photographs, or a folder of such folders.
        output: folder to keep clouds, tables and pictures in; None keeps the report alone.
        reference: what `build_reference` wrote, or a cloud; None gives figures that need none.
        workers: processes; None takes as many as cores and memory allow.
        more: arguments of `evaluate_captures`, and fields of `ReconstructionSettings` (fidelity, mask …).

    Raises:
        FieldkitError: as `evaluate_captures`.

    Example:
        >>> result = fieldkit.evaluate("flight_7", fidelity="draft")
        >>> result.traits.to_dataframe()
    """
    limit_threads()
    fields = ReconstructionSettings.__dataclass_fields__
    chosen = {name: more.pop(name) for name in tuple(more) if name in fields}
    settings = more.pop("settings", None) or ReconstructionSettings(**chosen)
    with _folder(output) as folder:
        return evaluate_captures(
            captures, folder, settings, reference=reference, workers=workers or usual_workers(), **more
        )


def plan(
    output: Path | str | None = None,
    *,
    workers: int | None = None,
    methods: Mapping[str, MethodEntry] = METHODS,
    **more: Any,
) -> Plan:
    """Find the best camera poses, as `fieldkit plan` does.

    Args:
        output: the plan's folder; None keeps the plan alone.
        workers: processes; None takes as many as cores and memory allow.
        methods: by name; other planners plug in here.
        more: arguments of `search_settings` (scene, reference, cameras …) and of `plan_views`.

    Raises:
        FieldkitError: as both of these.

    Example:
        >>> plan = fieldkit.plan(scene="case-1", cameras=10)
        >>> plan.stations[0]
    """
    limit_threads()
    workers = workers or usual_workers()
    run = {name: more.pop(name) for name in _OF_RUN if name in more}
    with _folder(output) as folder:
        plan_views(
            folder, search_settings(workers=workers, methods=methods, **more), workers=workers, methods=methods, **run
        )
        return load_plan(folder)


@contextmanager
def _folder(output: Path | str | None) -> Iterator[Path]:
    if output is not None:
        yield Path(output)
        return
    with TemporaryDirectory(prefix="fieldkit-") as folder:
        yield Path(folder) / "result"
