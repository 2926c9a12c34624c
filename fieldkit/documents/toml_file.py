"""Reading TOML files that people write: how large they may be, how they are decoded, and what is said of mistakes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from fieldkit.documents import safe_toml
from fieldkit.documents.file_bytes import decoded, file_bytes
from fieldkit.errors import InputError, MetadataError

MOST_CHARACTERS = 16 << 20
"""Of any TOML text; the parser takes some seconds for so many."""
_MOST_SHOWN = 200


def read_toml(
    path: Path,
    noun: str,
    remedy: str,
    max_bytes: int,
    *,
    missing: str | None = None,
    error: type[InputError] = MetadataError,
) -> dict[str, Any]:
    """The document of a TOML file in UTF-8, with or without a byte order mark.

    Args:
        noun: what the file is, for its errors: "site file", "scene file".
        path, remedy, max_bytes, missing, error: as of `file_bytes`.
    """
    data = file_bytes(path, remedy, max_bytes, noun=noun, name=noun, missing=missing, error=error)
    return toml_document(decoded(data, path, error=error), path, remedy, error=error)


def toml_document(
    text: str, path: Path | None, remedy: str, *, error: type[InputError] = MetadataError
) -> dict[str, Any]:
    """The document of a TOML text.

    Args:
        text: a byte order mark in front of it is left out.
        path: for the error.
        remedy: of the error.
        error: what is raised.
    """
    if len(text) > MOST_CHARACTERS:
        raise error(f"is far too large: more than {MOST_CHARACTERS:,} characters", path=path, remedy=remedy)
    try:
        return safe_toml.loads(text.removeprefix("\ufeff"))
    except (ValueError, RecursionError) as caught:  # ValueError: also integers with thousands of digits
        raise error(f"is not TOML: {one_line(caught)}", path=path, remedy=remedy) from caught


def one_line(error: BaseException) -> str:
    """What an error of a parser says, as one short line."""
    text = "brackets without end" if isinstance(error, RecursionError) else str(error).partition("\n")[0]
    return text if len(text) <= _MOST_SHOWN else f"{text[:_MOST_SHOWN]}…"
