"""Writing results so that a killed run, a full disk or a second run never leaves a partial result."""

from __future__ import annotations

import ctypes
import errno
import hashlib
import os
import secrets
import shutil
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from fieldkit.errors import MetadataError, StorageError, UsageError
from fieldkit.regular_files import is_other_than_file

try:
    import fcntl
except ImportError:  # Windows has no locks that take folders: there it is as on a disk without locks
    HAS_LOCKS = False
else:
    HAS_LOCKS = True

_REMEDIES = {
    errno.ENOSPC: "Free some space there, or write to another disk.",
    errno.EDQUOT: "Your disk quota is used up: free some space, or write to another disk.",
    errno.EFBIG: "The file would be larger than this disk or account allows: write to another disk.",
    errno.EACCES: "Choose a folder you may write to, or change its permissions.",
    errno.EPERM: "Choose a folder you may write to, or change its permissions.",
    errno.EROFS: "The disk is mounted read-only: write to another one.",
    errno.ENAMETOOLONG: "Use a shorter name.",
    errno.ENOTDIR: "A part of the path is a file: choose another path.",
    errno.EEXIST: "Something is in the way there: choose another path.",
    errno.EIO: "The disk reports an error: check it, or write to another one.",
}
_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
_PARTIAL = ".partial"
_AT_FDCWD = -100
"""AT_FDCWD of fcntl.h: paths are relative to the working folder."""
_RENAME_EXCHANGE = 2
"""RENAME_EXCHANGE of renameat2(2)."""


def open_folder(path: Path) -> int | None:
    """A descriptor of a folder, to lock or sync it; None on Windows, which opens none."""
    return None if os.name == "nt" else os.open(path, os.O_RDONLY)


def lock(descriptor: int, *, shared: bool = False, wait: bool = False) -> None:
    """Lock an open file or folder until it is closed or the process ends, perhaps beside other shared locks."""
    if not HAS_LOCKS:
        raise OSError(errno.ENOSYS, os.strerror(errno.ENOSYS))
    fcntl.flock(descriptor, (fcntl.LOCK_SH if shared else fcntl.LOCK_EX) | (0 if wait else fcntl.LOCK_NB))


@contextmanager
def storage_errors(path: Path) -> Iterator[None]:
    """Turn the operating system's refusals to write at ``path`` into errors with a remedy.

    A full disk is always reported. Errors such as EACCES are reported only for ``path`` itself, its parents or its
    content, so that an unreadable input is not blamed on the output.
    """
    path = Path(path)
    try:
        yield
    except OSError as error:
        code = _errno(error)
        if code in _FULL or (code in _REMEDIES and _concerns(error, path)):
            assert code is not None
            raise StorageError(f"cannot write: {os.strerror(code)}", path=path, remedy=_REMEDIES[code]) from error
        raise


def check_writable(path: Path) -> None:
    """Make sure that a file can be created in ``path`` or, if it does not exist, in its nearest parent."""
    folder = _absolute(path)
    while not os.path.lexists(folder) and folder != folder.parent:
        folder = folder.parent
    with storage_errors(folder):
        if not folder.is_dir():
            raise NotADirectoryError(errno.ENOTDIR, os.strerror(errno.ENOTDIR), str(folder))
        # Permission bits are unreliable for root, on network disks and on read-only mounts: try it.
        try:
            with tempfile.TemporaryFile(dir=folder) as file:
                file.write(b"\0")
        except FileNotFoundError as error:  # such as in /proc, which takes no files
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(folder)) from error


def file_beside(name: Path, owner: Path) -> Path | None:
    """A file named in another file: in that file's folder or below, unless the path is absolute.

    ``name`` is as written in ``owner``.

    Returns:
        The file, with links followed unless the path is absolute; None if it leads out of the folder.
    """
    if name.is_absolute():
        return name
    folder = owner.absolute().parent.resolve()
    found = (folder / name).resolve()
    return found if found.is_relative_to(folder) else None


def named_file(name: str | Path, owner: Path, key: str, *, what: str) -> Path:
    """As `file_beside`; a MetadataError where the path cannot be followed or leads out of the folder.

    Args:
        name: path as written there.
        owner: the file that names it.
        key: of that file, for the message.
        what: the owner is, for the message: "site file", "scene".
    """
    text = str(name)
    if not text or "\0" in text or len(text) > 1000:
        raise MetadataError(f"{key}: is not a path", path=owner, remedy=f"Name a file beside the {what}.")
    try:
        found = file_beside(Path(name), owner)
    except (OSError, RuntimeError, ValueError) as reason:  # links in a circle
        raise MetadataError(
            f"{key}: {name} cannot be followed", path=owner, remedy="Check the links there."
        ) from reason
    if found is None:
        remedy = f"Copy the file into the {what}'s folder, or give its absolute path."
        raise MetadataError(f"{key}: {name} leads out of the {what}'s folder", path=owner, remedy=remedy)
    return found


def write_atomic(path: Path, data: bytes | str) -> None:
    """Write a file under a temporary name, sync it and rename it to ``path``; text is written as UTF-8."""
    path = _absolute(path)
    content = data.encode("utf-8") if isinstance(data, str) else data
    partial = _partial_name(path)
    with storage_errors(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        if is_other_than_file(path):
            remedy = "Choose another path; only files are replaced."
            raise StorageError("cannot write: what is there is not a regular file", path=path, remedy=remedy)
        try:
            with partial.open("xb") as file:
                file.write(content)
                file.flush()
                os.fsync(file.fileno())
            partial.replace(path)
        except BaseException:
            with suppress(OSError):
                partial.unlink()
            raise
        _sync(path.parent)


@contextmanager
def atomic_folder(target: Path, *, overwrite: bool = False, marker: str | None = None) -> Iterator[Path]:
    """A temporary folder beside ``target`` that takes its name when the block ends without an error.

    An empty folder at ``target`` counts as absent. Leftovers of killed runs beside ``target`` are removed.

    Args:
        target: the result's folder.
        overwrite: replace an existing result; it stays in place until the new one is complete.
        marker: name of a file in every such result. An existing folder without it is never replaced.
    """
    target = _absolute(target)
    _check_target(target, overwrite, marker)

    def made() -> Path:
        partial.mkdir()
        return partial

    with storage_errors(target):
        target.parent.mkdir(parents=True, exist_ok=True)
        _remove_abandoned(target)
        partial, held = _partial_name(target), None
        try:
            _, held = locked_folder(made)
            _check_alone(partial, target)
            yield partial
            _sync_tree(partial)
            _move_into_place(partial, target, overwrite)
            _sync(target.parent)
        except BaseException as error:
            shutil.rmtree(partial, ignore_errors=True)
            if isinstance(error, StorageError) and error.path is not None and error.path.is_relative_to(partial):
                error.path = target / error.path.relative_to(partial)  # the path that people know
            raise
        finally:
            if held is not None:
                os.close(held)


def _absolute(path: Path) -> Path:
    # Path.resolve would follow links, and the result must stay at the given path.
    return Path(os.path.abspath(Path(path).expanduser()))  # noqa: PTH100


def _errno(error: OSError) -> int | None:
    # NumPy reports a short write without an errno: "1000 requested and 12 written".
    if error.errno is None and "requested and" in str(error) and "written" in str(error):
        return errno.ENOSPC
    return error.errno


def _concerns(error: OSError, path: Path) -> bool:
    names = [name for name in (error.filename, error.filename2) if name is not None]
    if not names:
        return True
    target = _absolute(path)
    for name in names:
        if not isinstance(name, str | bytes | os.PathLike):
            return True  # a file descriptor
        place = _absolute(Path(os.fsdecode(name)))
        line = (place, *place.parents)
        temporary = any(part.name.endswith(_PARTIAL) and part.parent == target.parent for part in line)
        if temporary or place in target.parents or target in line:
            return True
    return False


def _partial_name(path: Path) -> Path:
    return path.with_name(f"{_partial_start(path)}{secrets.token_hex(3)}{_PARTIAL}")


def _partial_start(path: Path) -> str:
    """What a path's partial names begin with; the digest tells apart long names that are cut to the same."""
    return f".{path.name[:40]}.{hashlib.sha256(os.fsencode(path.name)).hexdigest()[:6]}"


def _check_target(target: Path, overwrite: bool, marker: str | None) -> None:
    if not os.path.lexists(target):
        return
    if not target.is_dir() or target.is_symlink():
        raise UsageError("exists and is not a folder", path=target, remedy="Choose another name for the result.")
    with storage_errors(target):
        held = {entry.name for entry in target.iterdir()}
    if not held:
        return
    if not overwrite:
        raise UsageError(
            "the result exists already", path=target, remedy="Give --overwrite to replace it, or choose another folder."
        )
    here = Path.cwd()
    if target == here or target in here.parents or target == Path.home() or os.path.ismount(target):
        raise UsageError("will not replace this folder", path=target, remedy="Choose a folder of the result's own.")
    if marker is not None and marker not in held:
        raise UsageError(
            f"holds no {marker}, so it is not a result that --overwrite may replace",
            path=target,
            remedy="Choose another folder.",
        )


def locked_folder(make: Callable[[], Path]) -> tuple[Path, int | None]:
    """A folder that ``make`` makes, and a descriptor whose lock shows that this process lives, None where none can."""
    while True:
        folder = make()
        try:
            descriptor = open_folder(folder)
        except FileNotFoundError:
            continue  # another run removed it before it was opened
        if descriptor is None:
            return folder, None
        with suppress(OSError):  # a file system without locks, where no folder counts as abandoned
            lock(descriptor)
        if folder.exists():
            return folder, descriptor
        os.close(descriptor)  # another run removed it before it was locked


def _check_alone(partial: Path, target: Path) -> None:
    """Refuse to go on beside another living run for the same target; that one does not notice."""
    start = _partial_start(target)
    for other in target.parent.iterdir():
        named = other.name.startswith(start) and other.name.endswith(_PARTIAL) and other != partial
        if named and other.is_dir() and _is_locked(other):
            raise UsageError(
                "another run is writing this result", path=target, remedy="Let it end, or choose another folder."
            )


def _is_locked(place: Path) -> bool:
    with suppress(OSError), _opened(place) as descriptor:  # it is gone, or a file system without locks
        try:
            lock(descriptor, shared=True)
        except BlockingIOError:
            return True
    return False


@contextmanager
def _opened(place: Path) -> Iterator[int]:
    """A folder's descriptor; an OSError where the system gives none."""
    descriptor = open_folder(place)
    if descriptor is None:
        raise OSError(errno.ENOSYS, os.strerror(errno.ENOSYS))
    try:
        yield descriptor
    finally:
        os.close(descriptor)


def remove_if_abandoned(place: Path) -> None:
    """Remove a hidden folder of `atomic_folder` whose maker no longer lives; one that is locked stays."""
    with suppress(OSError), _opened(place) as descriptor:
        lock(descriptor)
        shutil.rmtree(place, ignore_errors=True)


def _remove_abandoned(target: Path) -> None:
    prefix = f".{target.name[:40]}."
    for place in target.parent.iterdir():
        if not (place.name.startswith(prefix) and place.name.endswith(_PARTIAL) and place.is_dir()):
            continue
        if len(place.name) != len(prefix) + 12 + len(_PARTIAL):
            continue
        remove_if_abandoned(place)


def _move_into_place(partial: Path, target: Path, overwrite: bool) -> None:
    try:
        partial.rename(target)
    except OSError as error:
        if error.errno not in (errno.ENOTEMPTY, errno.EEXIST):
            raise
        with suppress(OSError):
            target.rmdir()  # an empty folder, which Windows does not rename onto
            partial.rename(target)
            return
        if not overwrite:
            raise UsageError(
                "another run wrote this result meanwhile", path=target, remedy="Choose another folder."
            ) from error
        if not _exchange(partial, target):
            aside = _partial_name(target)
            target.rename(aside)
            partial.rename(target)
            partial = aside
        shutil.rmtree(partial, ignore_errors=True)


def _exchange(a: Path, b: Path) -> bool:
    """Swap two folders in one step (Linux renameat2); False if the system cannot."""
    try:
        renameat2 = ctypes.CDLL(None, use_errno=True).renameat2
    except (OSError, AttributeError, TypeError):  # macOS, Windows
        return False
    status = renameat2(_AT_FDCWD, os.fsencode(a), _AT_FDCWD, os.fsencode(b), ctypes.c_uint(_RENAME_EXCHANGE))
    return int(status) == 0


def _sync(path: Path) -> None:
    descriptor = open_folder(path)
    if descriptor is None:
        return
    try:
        with suppress(OSError):  # some network disks refuse to sync a folder
            os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _sync_tree(folder: Path) -> None:
    for root, _, files in os.walk(folder):
        for name in files:
            path = Path(root) / name
            if path.is_file() and not path.is_symlink():
                descriptor = os.open(path, os.O_RDWR if os.name == "nt" else os.O_RDONLY)
                try:
                    os.fsync(descriptor)  # a full disk may show only here
                finally:
                    os.close(descriptor)
        _sync(Path(root))
