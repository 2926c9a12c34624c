"""Verbs for a notebook or a script: folders in, a result out. All else has a default, and progress is shown."""

from __future__ import annotations

import inspect
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from fieldkit.cli.progress import open_progress
from fieldkit.documents.mistaken import check_names
from fieldkit.errors import ReconstructionError
from fieldkit.evaluation.evaluate import evaluate_captures, find_plots
from fieldkit.reconstruction.settings import ReconstructionSettings
from fieldkit.results.evaluation import EvaluationReport
from fieldkit.runtime.executor import lacks_main_guard
from fieldkit.runtime.machine import usual_workers
from fieldkit.runtime.progress import Progress
from fieldkit.runtime.threads import limit_threads


def evaluate(
    captures: Path | str, output: Path | str | None = None, *, reference: Path | str | None = None,
    workers: int | None = None, progress: Progress | None = None, **more: Any,
) -> EvaluationReport:  # fmt: skip
    """Reconstruct photographs of one or many plots and score them.

    Args:
        captures: a folder of photographs, or a folder of such folders.
        output: folder to keep clouds, tables and pictures in; None keeps the report alone.
        reference: what `build_reference` wrote, or a cloud; None gives figures that need none.
        workers: processes; None takes as many as cores and memory allow, and none for a single folder in a script
            without a main guard.
        progress: None shows it on stderr, or below the notebook's cell.
        more: arguments of `evaluate_captures`, and fields of `ReconstructionSettings` (fidelity, mask …).

    Raises:
        FieldkitError: as `evaluate_captures`.
        ReconstructionError: no plot was reconstructed; ``output`` says why.

    Example:
        >>> result = fieldkit.evaluate("flight_7", fidelity="draft")
        >>> result.traits.to_dataframe()
    """
    limit_threads()
    fields = ReconstructionSettings.__dataclass_fields__
    check_names("evaluate", more, [*inspect.signature(evaluate_captures).parameters, *fields])
    chosen = {name: more.pop(name) for name in tuple(more) if name in fields}
    settings = more.pop("settings", None) or ReconstructionSettings(**chosen)
    if workers is None:
        alone = lacks_main_guard() and len(find_plots(Path(captures))[0]) == 1
        workers = 1 if alone else usual_workers()
    with _folder(output) as folder, _shown(progress) as shown:
        report = evaluate_captures(
            captures, folder, settings, reference=reference, workers=workers, progress=shown, **more
        )
    first = report.plots[0]
    if report.failed == len(report.plots) and first.error is not None:
        raise ReconstructionError(first.error.message, remedy=first.error.remedy)
    return report


@contextmanager
def _folder(output: Path | str | None) -> Iterator[Path]:
    if output is not None:
        yield Path(output)
        return
    with TemporaryDirectory(prefix="fieldkit-") as folder:
        yield Path(folder) / "result"


@contextmanager
def _shown(progress: Progress | None) -> Iterator[Progress]:
    if progress is not None:
        yield progress
        return
    with open_progress(as_json=False) as lines:
        yield lines
