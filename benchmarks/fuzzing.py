"""Files changed at random and read again: anything but a result or a FieldkitError is a defect."""

from __future__ import annotations

import io
import os
import signal
import sys
import time
import traceback
import warnings
import zipfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import FrameType
from typing import Any

import numpy as np

from fieldkit.errors import FieldkitError

LIMIT_S = 5.0
"""Of CPU time: a longer reading is a hang."""
_TOKENS = (
    b"", b"0", b"-1", b"1e999", b"NaN", b"nan", b"inf", b"-Infinity", b"null", b"true", b"[]", b"{}", b'""', b"9" * 40,
    b"1" + b"0" * 400, b"-0.0", b"\x00", b"\xff\xfe", "\ufeff".encode(), b"\r\n", b"\t", b",", b'"', b"<", b">", b"&",
    b"<!DOCTYPE a [<!ENTITY b 'c'>]>", b"&b;", b"../../../outside", b"/outside", b"[" * 3000, b"{\"a\":" * 500,
    b"4294967296", b"-2147483649", b"90.0000001", b"180.0000001", b"1e-320", "−".encode(), "°".encode(),
)  # fmt: skip
_DIGITS = frozenset(b"0123456789.-+eE")


@dataclass(frozen=True)
class Target:
    """A reader to fuzz."""

    suffix: str
    """Of the files, with its dot."""
    seeds: Sequence[bytes]
    """Good files' contents."""
    read: Callable[[Path], Any]
    """Reads a file; raises FieldkitError if it cannot be used."""


@dataclass(frozen=True)
class Fuzzed:
    """The result of fuzzing a target."""

    files: int
    """That were read."""
    accepted: int
    """Of these, those that were read without an error."""
    refused: int
    """Those that ended in a FieldkitError."""
    defects: Mapping[str, int]
    """Traces of other exceptions, one of each kind, with their numbers."""
    hangs: int
    """Readings of more than `LIMIT_S`."""
    slowest_s: float
    """The slowest reading."""
    written: tuple[str, ...]
    """Files that were written or removed while reading."""


def mutate(seeds: Sequence[bytes], rng: np.random.Generator) -> bytes:
    """One of the seeds with one to four changes: bits, bytes, numbers, tokens, lengths, pieces of another seed."""
    data = seeds[int(rng.integers(len(seeds)))]
    if data[:2] == b"PK" and rng.random() < 0.7:
        return _rezipped(data, rng)
    for _ in range(int(rng.integers(1, 5))):
        if rng.random() < 0.1:
            a, b = _span(other := seeds[int(rng.integers(len(seeds)))], rng)
            place = int(rng.integers(len(data) + 1))
            data = data[:place] + other[a:b] + data[place:]
        else:
            data = _changed(data, rng)
    return data


def fuzz(target: Target, count: int, folder: Path, seed: int) -> Fuzzed:
    """Read ``count`` changed files.

    Args:
        target: reads them.
        count: files.
        folder: empty; they are written there, one after the other.
        seed: of the changes.
    """
    rng = np.random.default_rng(seed)
    file = folder / f"file{target.suffix}"
    accepted = refused = hangs = 0
    slowest = 0.0
    defects: dict[str, int] = {}
    with _written() as written, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for _ in range(count):
            file.write_bytes(mutate(target.seeds, rng))
            written.clear_of(file)
            began = time.process_time()
            try:
                with _time_limit():
                    target.read(file)
                accepted += 1
            except FieldkitError:
                refused += 1
            except _HangError:
                hangs += 1
            except Exception as error:
                trace = traceback.extract_tb(error.__traceback__)[-1]
                kind = f"{type(error).__name__}: {str(error)[:120]} ({Path(trace.filename).name}:{trace.lineno})"
                defects[kind] = defects.get(kind, 0) + 1
            slowest = max(slowest, time.process_time() - began)
    return Fuzzed(count, accepted, refused, defects, hangs, slowest, tuple(sorted(written.paths)))


def _flip(data: bytes, rng: np.random.Generator) -> bytes:
    changed = bytearray(data)
    for _ in range(int(rng.integers(1, 9))):
        if changed:
            changed[int(rng.integers(len(changed)))] = int(rng.integers(256))
    return bytes(changed)


def _cut(data: bytes, rng: np.random.Generator) -> bytes:
    return data[: int(rng.integers(len(data) + 1))]


def _without(data: bytes, rng: np.random.Generator) -> bytes:
    a, b = _span(data, rng)
    return data[:a] + data[b:]


def _twice(data: bytes, rng: np.random.Generator) -> bytes:
    a, b = _span(data, rng)
    return data[:b] + data[a:b] * int(rng.integers(1, 4)) + data[b:]


def _token(data: bytes, rng: np.random.Generator) -> bytes:
    place = int(rng.integers(len(data) + 1))
    return data[:place] + _TOKENS[int(rng.integers(len(_TOKENS)))] + data[place:]


def _number(data: bytes, rng: np.random.Generator) -> bytes:
    """Replace a number of a text format by something else."""
    if not data:
        return data
    place = int(rng.integers(len(data)))
    for k in range(place, min(place + 400, len(data))):
        if data[k] in _DIGITS:
            end = k
            while end < len(data) and data[end] in _DIGITS:
                end += 1
            return data[:k] + _TOKENS[int(rng.integers(len(_TOKENS)))] + data[end:]
    return data


def _digit(data: bytes, rng: np.random.Generator) -> bytes:
    """Change one digit, so that the number stays valid."""
    places = np.flatnonzero((np.frombuffer(data, np.uint8) >= 48) & (np.frombuffer(data, np.uint8) <= 57))
    if not len(places):
        return data
    place = int(rng.choice(places))
    return data[:place] + str(int(rng.integers(10))).encode() + data[place + 1 :]


_CHANGES = (_flip, _cut, _without, _twice, _token, _number, _number, _digit, _digit, _digit, _digit)


def _changed(data: bytes, rng: np.random.Generator) -> bytes:
    return _CHANGES[int(rng.integers(len(_CHANGES)))](data, rng)


def _span(data: bytes, rng: np.random.Generator) -> tuple[int, int]:
    a = int(rng.integers(len(data) + 1))
    return a, min(len(data), a + int(rng.integers(1, 200)))


def _rezipped(data: bytes, rng: np.random.Generator) -> bytes:
    """A zip file with changed members, packed again so that the archive's checks pass."""
    out = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(data)) as source, zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as target:
        for info in source.infolist():
            content = source.read(info)
            for _ in range(int(rng.integers(0, 4))):
                content = _changed(content, rng)
            name = info.filename if rng.random() < 0.95 else "../" * int(rng.integers(3)) + "outside"
            if rng.random() < 0.02:
                content = bytes(64 << 20)  # a bomb: 64 MB of zeros in 64 kB
            target.writestr(name, content)
    return out.getvalue()


class _HangError(BaseException):
    """A BaseException, so that no reader catches it."""


def _stop(_: int, __: FrameType | None) -> None:
    raise _HangError


@contextmanager
def _time_limit() -> Iterator[None]:
    before = signal.signal(signal.SIGPROF, _stop)
    signal.setitimer(signal.ITIMER_PROF, LIMIT_S)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)


class _Written:
    """Paths that this process opened for writing, made or removed since the hook was switched on."""

    def __init__(self) -> None:
        self.paths: set[str] = set()
        self.on = False

    def hook(self, event: str, arguments: tuple[Any, ...]) -> None:
        if not self.on or event not in _WRITING:
            return
        if event == "open":
            path, _, flags = arguments
            if not isinstance(flags, int) or not flags & (os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC):
                return
            self.paths.add(os.fsdecode(path) if isinstance(path, str | bytes) else str(path))
        else:
            self.paths.add(f"{event} {arguments[0]}")

    def clear_of(self, file: Path) -> None:
        """Forget the file to read, which the fuzzer itself wrote."""
        self.paths.discard(str(file))


_WRITING = frozenset({"open", "os.mkdir", "os.remove", "os.rename", "os.rmdir", "os.link", "os.symlink", "os.truncate"})


@contextmanager
def _written() -> Iterator[_Written]:
    written = _Written()
    sys.addaudithook(written.hook)  # cannot be removed, only switched off
    written.on = True
    try:
        yield written
    finally:
        written.on = False
