"""The exceptions that fieldkit raises on purpose, and their exit codes.

FieldkitError
├── UsageError            2   the call itself is wrong (flags, an existing result)
├── InputError            3   a file or folder given cannot be used as it is
│   ├── CaptureError      3   photographs
│   ├── MetadataError     3   poses.csv, geo.txt, camera files, reference.json, vehicle profiles, missions, logs …
│   ├── SceneError        3   scene files and what they name
│   ├── CloudError        3   point-cloud files
│   │   └── EmptyCloudError
│   └── StorageError      3   no permission, no space left
├── ReconstructionError   4   the photographs are readable but do not reconstruct
├── MissionError          5   a mission is unsafe, or the vehicle cannot fly it
└── LinkError             6   the vehicle cannot be reached, or does not do what it was asked
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

EXIT_OK = 0
"""Exit code of a command that did what was asked."""
EXIT_INTERRUPTED = 130
"""Exit code after Ctrl-C: 128 and SIGINT's number, as shells have it."""


class FieldkitError(Exception):
    """A problem a person can act on.

    Args:
        message: what is wrong, in one sentence.
        path: the file or folder concerned.
        remedy: what to do about it, in one sentence.
    """

    exit_code = 1
    findings: tuple[Any, ...] = ()
    """What else was noticed up to then (`fieldkit.results.finding.Finding`)."""

    def __init__(self, message: str, *, path: Path | str | None = None, remedy: str = "") -> None:
        super().__init__(message)
        self.message = message
        self.path = None if path is None else Path(path)
        self.remedy = remedy

    @property
    def problem(self) -> str:
        """The message after the path."""
        return self.message if self.path is None else f"{self.path}: {self.message}"

    def __str__(self) -> str:
        """The problem and the remedy: all that a script or a notebook shows."""
        return f"{self.problem.removesuffix('.')}. {self.remedy}" if self.remedy else self.problem


@contextmanager
def about(path: Path, remedy: str = "") -> Iterator[None]:
    """Errors within that name no file are of this one, with this remedy where they have none."""
    try:
        yield
    except FieldkitError as error:
        if error.path is None:
            error.path, error.remedy = path, error.remedy or remedy
        raise


class UsageError(FieldkitError):
    """The call is wrong; nothing was read or written."""

    exit_code = 2


class InputError(FieldkitError):
    """A given file or folder cannot be used as it is."""

    exit_code = 3


class CaptureError(InputError):
    """A folder of photographs cannot be used."""


class MetadataError(InputError):
    """A sidecar or result file is missing, malformed or contradicts the photographs."""


class SceneError(InputError):
    """A scene file, or a mesh or cloud it names, is missing, malformed or does not fit."""


class CloudError(InputError):
    """A point-cloud file cannot be read or written."""


class EmptyCloudError(CloudError):
    """A cloud has no points where at least one is needed."""


class StorageError(InputError):
    """A place to write to is not writable or is full."""


class ReconstructionError(FieldkitError):
    """The photographs were read, but no usable model came out of them.

    Args:
        message: see `FieldkitError`.
        path: see `FieldkitError`.
        remedy: see `FieldkitError`.
        registered: number of photographs with a pose nonetheless.
        right: number of these whose pose agrees with what is known.
        models: number of the mapper's models.
    """

    exit_code = 4

    def __init__(
        self,
        message: str,
        *,
        path: Path | str | None = None,
        remedy: str = "",
        registered: int = 0,
        right: int = 0,
        models: int = 0,
    ) -> None:
        super().__init__(message, path=path, remedy=remedy)
        self.registered, self.right, self.models = registered, right, models


class MissionError(FieldkitError):
    """A mission is unsafe, or the vehicle cannot fly it."""

    exit_code = 5


class LinkError(FieldkitError):
    """The vehicle cannot be reached, or does not do what it was asked; the message says what state it is in."""

    exit_code = 6
