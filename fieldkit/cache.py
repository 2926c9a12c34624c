"""Content-addressed cache of the stages' results: the key is a digest of everything a result depends on.

An entry is an uncompressed .npz, written under a temporary name and renamed, so that several processes may share one
cache and may be killed at any moment. Its CRCs and the digest of its members' names show damage; a damaged entry is
removed and computed again.
"""

from __future__ import annotations

import dataclasses
import enum
import errno
import hashlib
import os
import re
import secrets
import struct
import time
import warnings
import zipfile
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import IO, Any, NamedTuple

import numpy as np

from fieldkit.regular_files import check_regular, open_regular

_STAGE = re.compile(r"[a-z0-9][a-z0-9_-]*")
_KEY = re.compile(r"[0-9a-f]{8,128}")
_ABANDONED_AFTER_S = 3600.0
"""Age from which a half-written entry is abandoned, seconds."""


class CacheWarning(UserWarning):
    """The cache cannot be used; the run goes on without it."""


class Size(NamedTuple):
    """How many entries there are, of a stage or removed, and how large they are."""

    entries: int
    bytes: int


class _Entry(NamedTuple):
    stage: str
    path: Path
    bytes: int
    used: float


def digest(*parts: Any) -> str:
    """A hexadecimal digest (128 bit) of values, the same in every process and on every machine.

    Takes bytes, str, int, float, bool, None, enum members, NumPy scalars and arrays, and tuples, lists, sets, dicts
    and dataclasses of these. A value's type counts: 1, 1.0, True and "1" differ; a tuple and a list do not.
    Floats count by their shortest exact form, arrays by type, shape and bytes (whatever their memory layout and byte
    order), dataclasses by their class's name and fields.
    """
    state = hashlib.blake2b(digest_size=16)
    for part in parts:
        _feed(state, part)
    return state.hexdigest()


def default_cache_root() -> Path:
    """FIELDKIT_CACHE if it is set, else the system's folder for caches."""
    chosen = os.environ.get("FIELDKIT_CACHE")
    if chosen:
        return Path(chosen).expanduser()
    from platformdirs import user_cache_path

    return user_cache_path("fieldkit", appauthor=False)


class StageCache:
    """Arrays by stage and key, in files under ``root``; ``root`` None keeps nothing.

    A full disk or a folder that cannot be written to is no error: a `CacheWarning` is issued once, and the run goes
    on without writing more.
    """

    def __init__(self, root: Path | None) -> None:
        self.root = None if root is None else Path(root)
        self.problem: str | None = None

    def path(self, stage: str, key: str) -> Path:
        """The file of an entry, whether or not it exists."""
        if self.root is None:
            raise ValueError("this cache keeps nothing")
        if not _STAGE.fullmatch(stage) or not _KEY.fullmatch(key):
            raise ValueError(f"not a stage and a digest: {stage!r}, {key!r}")
        return self.root / stage / key[:2] / f"{key}.npz"

    def get(self, stage: str, key: str) -> dict[str, np.ndarray] | None:
        """The arrays kept under ``key``, or None. A damaged entry is removed and counts as missing."""
        if self.root is None:
            return None
        path = self.path(stage, key)
        try:
            check_regular(path)
        except OSError:
            return None
        try:
            with open_regular(path) as file, np.load(file, allow_pickle=False) as archive:
                arrays = {name: archive[name] for name in archive.files}
                if archive.zip is None or archive.zip.comment != _contents(arrays):
                    raise ValueError("an array is missing")
        except Exception:  # damage raises BadZipFile, ValueError, OSError, zlib.error, MemoryError …
            with suppress(OSError):
                path.unlink()
            return None
        with suppress(OSError):
            os.utime(path)  # pruning goes by last use
        return arrays

    def put(self, stage: str, key: str, arrays: dict[str, np.ndarray]) -> None:
        """Keep ``arrays`` (no object arrays) under ``key``; the last of several writers wins."""
        if self.root is None or self.problem is not None:
            return
        path = self.path(stage, key)
        partial = path.with_name(f"{key}.{secrets.token_hex(6)}.partial")
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            try:
                with partial.open("xb") as file:
                    _write_npz(file, arrays)
                partial.replace(path)
            except BaseException:
                with suppress(OSError):
                    partial.unlink()
                raise
        except OSError as error:
            self.problem = f"{error.strerror or error}"
            full = error.errno in (None, errno.ENOSPC, errno.EDQUOT)  # None: a short write of NumPy's
            warnings.warn(
                f"{self.root}: nothing more is kept in the cache ({self.problem}); the run goes on, but a repeated "
                f"one starts anew. {'`fieldkit cache prune` makes room; ' if full else ''}FIELDKIT_CACHE chooses "
                "another folder.",
                CacheWarning,
                stacklevel=2,
            )

    def kept(self, stage: str, key: str, make: Callable[[], dict[str, np.ndarray]]) -> dict[str, np.ndarray]:
        """The arrays kept under ``key``, or those that ``make`` gives, which are kept from then on."""
        arrays = self.get(stage, key)
        if arrays is None:
            arrays = make()
            self.put(stage, key, arrays)
        return arrays

    def sizes(self) -> dict[str, Size]:
        """Entries and bytes of every stage, by name."""
        sizes: dict[str, Size] = {}
        for entry in self._entries():
            before = sizes.get(entry.stage, Size(0, 0))
            sizes[entry.stage] = Size(before.entries + 1, before.bytes + entry.bytes)
        return dict(sorted(sizes.items()))

    def prune(self, *, max_bytes: int | None = None, older_than: float | None = None) -> Size:
        """Remove entries not used for ``older_than`` seconds, then the longest unused until ``max_bytes`` are left.

        Half-written files of killed runs are removed too.
        """
        self._remove_abandoned()
        entries = sorted(self._entries(), key=lambda entry: (entry.used, str(entry.path)))
        left = sum(entry.bytes for entry in entries)
        now = time.time()
        count = freed = 0
        for entry in entries:
            old = older_than is not None and now - entry.used > older_than
            surplus = max_bytes is not None and left > max_bytes
            if not (old or surplus):
                continue
            try:
                entry.path.unlink()
            except FileNotFoundError:
                continue
            left -= entry.bytes
            freed += entry.bytes
            count += 1
        self._remove_empty_folders()
        return Size(count, freed)

    def clear(self) -> Size:
        """Remove every entry; other files stay."""
        return self.prune(max_bytes=-1)

    def _folders(self) -> Iterator[tuple[str, Path]]:
        if self.root is None or not self.root.is_dir():
            return
        for stage in sorted(self.root.iterdir()):
            if stage.is_dir() and not stage.is_symlink() and _STAGE.fullmatch(stage.name):
                for folder in sorted(stage.iterdir()):
                    if folder.is_dir() and re.fullmatch(r"[0-9a-f]{2}", folder.name):
                        yield stage.name, folder

    def _entries(self) -> Iterator[_Entry]:
        for stage, folder in self._folders():
            for path in folder.glob("*.npz"):
                if path.name[:2] == folder.name and _KEY.fullmatch(path.stem):
                    with suppress(FileNotFoundError):  # another process may prune at the same time
                        status = path.stat()
                        yield _Entry(stage, path, status.st_size, status.st_mtime)

    def _remove_abandoned(self) -> None:
        before = time.time() - _ABANDONED_AFTER_S
        for _, folder in self._folders():
            for path in folder.glob("*.partial"):
                with suppress(OSError):
                    if path.stat().st_mtime < before:
                        path.unlink()

    def _remove_empty_folders(self) -> None:
        for _, folder in list(self._folders()):
            for place in (folder, folder.parent):
                with suppress(OSError):
                    place.rmdir()  # fails unless it is empty


def _write_npz(file: IO[bytes], arrays: dict[str, np.ndarray]) -> None:
    # np.savez would take an array named "file" as its argument, and writes the time of day into the file.
    with zipfile.ZipFile(file, "w", zipfile.ZIP_STORED) as archive:
        for name, array in arrays.items():
            with archive.open(zipfile.ZipInfo(f"{name}.npy"), "w", force_zip64=True) as member:
                np.lib.format.write_array(member, np.asanyarray(array), allow_pickle=False)
        archive.comment = _contents(arrays)


def _contents(arrays: dict[str, np.ndarray]) -> bytes:
    # A zip's CRCs cover each member but not the list of members: one damaged byte there can drop the last one.
    return digest(set(arrays)).encode()


def _feed(state: Any, value: Any) -> None:
    """Add a value as tag, length and content, so that no two different values give the same bytes."""
    match value:
        case None:
            _add(state, b"none", b"")
        case enum.Enum():
            _add(state, b"enum", f"{type(value).__qualname__}.{value.name}".encode())
        case bool() | np.bool_():
            _add(state, b"bool", b"1" if value else b"0")
        case int():
            _add(state, b"int", str(int(value)).encode())
        case float():
            _add(state, b"float", repr(float(value)).encode())
        case str():
            _add(state, b"str", value.encode("utf-8", "surrogatepass"))
        case bytes() | bytearray() | memoryview():
            _add(state, b"bytes", bytes(value))
        case np.ndarray() | np.generic():
            _feed_array(state, np.asarray(value))
        case tuple() | list():
            _add(state, b"sequence", struct.pack("<Q", len(value)))
            for item in value:
                _feed(state, item)
        case set() | frozenset():
            _feed_sorted(state, b"set", [digest(item) for item in value])
        case dict():
            _feed_sorted(state, b"dict", [digest(key) + digest(item) for key, item in value.items()])
        case _ if dataclasses.is_dataclass(value) and not isinstance(value, type):
            _add(state, b"dataclass", type(value).__qualname__.encode())
            fields = dataclasses.fields(value)
            _feed(state, {field.name: getattr(value, field.name) for field in fields})
        case _:
            raise TypeError(f"a {type(value).__qualname__} has no stable digest")


def _feed_array(state: Any, array: np.ndarray) -> None:
    if array.dtype.hasobject:
        raise TypeError("an array of Python objects has no stable digest")
    ordered = np.ascontiguousarray(array, dtype=array.dtype.newbyteorder("<"))
    _add(state, b"array", f"{np.lib.format.dtype_to_descr(ordered.dtype)}{array.shape}".encode())
    _add(state, b"data", ordered.reshape(-1).view(np.uint8).data)


def _feed_sorted(state: Any, tag: bytes, items: list[str]) -> None:
    _add(state, tag, "".join(sorted(items)).encode())


def _add(state: Any, tag: bytes, content: bytes | memoryview) -> None:
    state.update(struct.pack("<BQ", len(tag), len(content)) + tag)
    state.update(content)
