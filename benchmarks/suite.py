"""Running studies one after the other, and writing their results."""

from __future__ import annotations

import json
import platform
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, TypeVar

from benchmarks.result import StudyResult
from fieldkit import __version__
from fieldkit.errors import UsageError
from fieldkit.files import atomic_folder, write_atomic
from fieldkit.runtime.machine import Spent, this_machine
from fieldkit.runtime.progress import Progress

Options = TypeVar("Options")
"""Options of a suite's studies."""
RESULT_FILE, TABLES_FILE = "results.json", "results.md"
_LIBRARIES = ("numpy", "scipy", "numba", "opencv-python-headless", "pycolmap", "point-cloud-utils")


def run_studies(
    output: Path,
    names: Sequence[str],
    known: Mapping[str, Callable[[Options, Progress], StudyResult]],
    default: Sequence[str],
    options: Options,
    *,
    progress: Progress,
    overwrite: bool = False,
) -> list[StudyResult]:
    """Run studies one after the other and write results.json, results.md and their pictures.

    Args:
        output: folder of the result.
        names: of studies, each run once; empty takes ``default``.
        known: studies by name.
        default: names of studies.
        options: for all of them.
        overwrite: replace an earlier result in ``output``.
    """
    chosen = list(dict.fromkeys(names)) or list(default)
    unknown = [name for name in chosen if name not in known]
    if unknown:
        raise UsageError(f"there is no study {unknown[0]!r}", remedy=f"Choose one of {', '.join(known)}.")
    with atomic_folder(output, overwrite=overwrite, marker=RESULT_FILE) as folder:
        results = []
        for name in chosen:
            spent = Spent.now()
            result = known[name](options, progress)
            result = replace(result, wall_s=spent.seconds, cpu_s=spent.cpu_seconds)
            if result.skipped:
                progress.note(f"{name}: {result.skipped}")
            for picture, data in result.pictures.items():
                write_atomic(folder / picture, data)
            results.append(result)
        write_atomic(folder / RESULT_FILE, json.dumps(report(results), indent=1, ensure_ascii=False) + "\n")
        write_atomic(folder / TABLES_FILE, "\n".join(result.markdown() for result in results))
    return results


def report(results: Sequence[StudyResult]) -> dict[str, Any]:
    """The content of results.json."""
    machine = this_machine()
    return {
        "fieldkit": __version__,
        "machine": {
            "cores": machine.cores,
            "memory_bytes": machine.memory_bytes,
            "architecture": platform.machine(),
            "system": platform.system(),
            "python": platform.python_version(),
        },
        "libraries": {name: found for name in _LIBRARIES if (found := _version(name)) is not None},
        "studies": {result.name: result.as_dict() for result in results},
    }


def _version(name: str) -> str | None:
    try:
        return version(name)
    except PackageNotFoundError:
        return None
