"""A planning run's folder: search.json before the start, evaluations.jsonl during the run, the results at the end."""

from __future__ import annotations

import os
import time
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, BinaryIO, Literal

import numpy as np
from pydantic import Field, JsonValue, ValidationError

from fieldkit.documents.file_bytes import file_bytes
from fieldkit.documents.json_file import first_problem, read_json_object, validated
from fieldkit.errors import MetadataError, UsageError, about
from fieldkit.files import atomic_folder, lock, storage_errors, write_atomic
from fieldkit.planning.objective.evaluation import Evaluation
from fieldkit.planning.problem import Trial
from fieldkit.planning.settings import SearchSettings
from fieldkit.planning.space.cameras import Cameras
from fieldkit.regular_files import is_other_than_file, open_regular
from fieldkit.results.fields import Count, Length
from fieldkit.results.plan_file import SETTINGS_FILE
from fieldkit.vocabulary import SearchFidelity

if TYPE_CHECKING:
    from fieldkit.planning.run.loop import Job

LOG_FILE = "evaluations.jsonl"
_MAX_BYTES = 1 << 20
"""Largest run.json that is read, bytes."""
_MOST_LOG_BYTES = 1 << 30
"""Largest log that is read, bytes."""
_REMEDY = "Give the folder of a run of `fieldkit plan`."
Stage = Literal["search", "confirmation"]
Row = tuple[float, float, float, float, float]


class LogEntry(Evaluation):
    """One line of evaluations.jsonl: one finished evaluation of a trial."""

    number: Count
    """Of the trial, from 0."""
    stage: Stage
    """A trial of the search, or a finalist at a fresh seed."""
    origin: str
    seed: Count
    """Of the photographs' noise."""
    fidelity: SearchFidelity
    plot: Count = 0
    """Number of the photographed plot; 0 is the plan's own."""
    cameras: Annotated[tuple[Row, ...], Field(min_length=1)]
    """x, y, z in metres, yaw and pitch in degrees, plot frame."""
    proposal_cpu_s: Length
    """Of the method, to propose the trial."""
    finished_s: Length
    """Since the run began, without interruptions."""
    notes: dict[str, JsonValue]
    """The method's: the drawn model, its weights, and others."""

    @property
    def trial(self) -> Trial:
        """The trial, bit for bit as it was proposed, with its result."""
        cameras, value_m = Cameras.from_vector(np.array(self.cameras)), self.value_m if self.measured else np.nan
        return Trial(self.number, cameras, self.origin, self.notes, plot=self.plot, value_m=value_m)


class RunFolder:
    """An open run folder, locked by this process.

    Attributes:
        path: of the folder.
        settings: of the run.
        entries: the entries of evaluations.jsonl, in its order.
    """

    def __init__(self, path: Path, settings: SearchSettings, entries: Sequence[LogEntry], file: BinaryIO) -> None:
        self.path, self.settings, self.entries, self._file = path, settings, list(entries), file
        self._before, self._start = max((entry.finished_s for entry in entries), default=0.0), time.monotonic()

    @property
    def seconds(self) -> float:
        """Since the run began, without interruptions."""
        return self._before + time.monotonic() - self._start

    def log(
        self, trial: Trial, job: Job, evaluation: Evaluation, stage: Stage, *, proposal_cpu_s: float = 0.0
    ) -> LogEntry:
        """Append an evaluation to the log and sync it to the disk."""
        entry = LogEntry(
            **evaluation.model_dump(),
            number=trial.number,
            stage=stage,
            origin=trial.origin,
            seed=self.settings.seed if job.seed is None else job.seed,
            fidelity=job.fidelity or self.settings.fidelity,
            plot=job.plot,
            cameras=tuple((x, y, z, yaw, pitch) for x, y, z, yaw, pitch in trial.cameras.rows().tolist()),
            proposal_cpu_s=proposal_cpu_s,
            finished_s=self.seconds,
            notes=dict(trial.notes),
        )
        with storage_errors(self.path / LOG_FILE):
            self._file.write(entry.model_dump_json().encode() + b"\n")
            self._file.flush()
            os.fsync(self._file.fileno())
        self.entries.append(entry)
        return entry

    def save_settings(self, settings: SearchSettings) -> None:
        """Replace search.json. Raises StorageError."""
        write_atomic(self.path / SETTINGS_FILE, settings.model_dump_json(indent=2) + "\n")
        self.settings = settings


@contextmanager
def create_run(path: Path, settings: SearchSettings, *, overwrite: bool = False) -> Iterator[RunFolder]:
    """A new run folder with its settings and an empty log."""
    with suppress(OSError), open_regular(path / LOG_FILE) as file:
        _lock(file, path)
    with atomic_folder(path, overwrite=overwrite, marker=SETTINGS_FILE) as folder:
        write_atomic(folder / SETTINGS_FILE, settings.model_dump_json(indent=2) + "\n")
        write_atomic(folder / LOG_FILE, b"")
    with open_run(path) as run:
        yield run


@contextmanager
def open_run(path: Path) -> Iterator[RunFolder]:
    """An existing run folder. A last line that was cut off is removed: its evaluation did not finish."""
    settings = read_settings(path)
    log = path / LOG_FILE
    if is_other_than_file(log):
        raise MetadataError("is not a regular file", path=log, remedy=_REMEDY)
    with storage_errors(log), log.open("a+b") as file:
        _lock(file, path)
        file.seek(0)
        content = file.read()
        whole = content[: content.rfind(b"\n") + 1]
        entries = _parsed(log, whole)
        if len(whole) < len(content):
            file.truncate(len(whole))
        yield RunFolder(path, settings, entries, file)


def read_settings(path: Path) -> SearchSettings:
    """search.json of a run folder."""
    file = path / SETTINGS_FILE
    with about(file, _REMEDY):
        return validated(SearchSettings, read_json_object(file, noun="run", max_bytes=_MAX_BYTES))


def read_log(path: Path) -> list[LogEntry]:
    """evaluations.jsonl of a run folder, without a last line that is still being written."""
    log = path / LOG_FILE
    with about(log, _REMEDY):
        content = file_bytes(log, _MOST_LOG_BYTES, noun="run")
    return _parsed(log, content[: content.rfind(b"\n") + 1])


def searched(entries: Iterable[LogEntry]) -> list[LogEntry]:
    """The search's entries of a log, by number."""
    return sorted((entry for entry in entries if entry.stage == "search"), key=lambda entry: entry.number)


def _parsed(log: Path, content: bytes) -> list[LogEntry]:
    entries = []
    for number, line in enumerate(content.splitlines(), 1):
        try:
            entries.append(LogEntry.model_validate_json(line))
        except ValidationError as error:
            raise MetadataError(
                f"line {number}: {first_problem(error)}", path=log, remedy="Remove that line; --resume does it again."
            ) from error
    return entries


def _lock(file: BinaryIO, path: Path) -> None:
    try:
        lock(file.fileno())
    except BlockingIOError as error:
        raise UsageError(
            "another process is planning in this folder", path=path, remedy="Wait for it, or stop it."
        ) from error
    except OSError:
        return  # a file system without locks
