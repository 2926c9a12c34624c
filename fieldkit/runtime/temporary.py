"""One temporary folder for a run and its workers, which goes whatever ends the run."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from fieldkit.files import locked_folder, remove_if_abandoned

_PREFIX = "fieldkit-run-"
_VARIABLES = ("TMPDIR", "TEMP", "TMP")


@contextmanager
def temporary_folder() -> Iterator[None]:
    """Put what this process and its children write into temporary folders into one, removed at the end.

    Workers that are killed cannot tidy up after themselves, nor can a run: folders of runs that no longer live are
    removed first (a lock shows whether their maker lives). Where no temporary folder can be made nothing changes.
    """
    with suppress(OSError):
        for other in Path(tempfile.gettempdir()).glob(f"{_PREFIX}*"):
            if not other.is_symlink():
                remove_if_abandoned(other)
    try:
        folder, held = locked_folder(lambda: Path(tempfile.mkdtemp(prefix=_PREFIX)))
    except OSError:
        yield
        return
    environment, default = {name: os.environ.get(name) for name in _VARIABLES}, tempfile.tempdir
    os.environ.update(dict.fromkeys(_VARIABLES, str(folder)))
    tempfile.tempdir = str(folder)
    try:
        yield
    finally:
        tempfile.tempdir = default
        for name, value in environment.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value
        shutil.rmtree(folder, ignore_errors=True)
        if held is not None:
            os.close(held)
