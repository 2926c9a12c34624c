"""TOML files that people write: vehicle profiles and site files."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from fieldkit import safe_toml
from fieldkit.errors import MetadataError

FORMAT = 1
Model = TypeVar("Model", bound=BaseModel)


def read_toml(path: Path, noun: str, remedy: str, max_bytes: int) -> dict[str, Any]:
    """The TOML document that a file holds, its ``format`` checked and left out.

    Args:
        path: to read; UTF-8.
        noun: what the file is, for its errors: "vehicle profile", "site file".
        remedy: of every error that has no better one.
        max_bytes: a larger file is refused unread.

    Raises:
        MetadataError: it is missing, unreadable, too large, no TOML, or of another format version.
    """
    try:
        with path.open("rb") as file:
            data = file.read(max_bytes + 1)
        if len(data) > max_bytes:
            raise MetadataError(f"is far too large for a {noun}", path=path, remedy=remedy)
        text = data.decode("utf-8-sig")
    except FileNotFoundError as error:
        raise MetadataError(f"there is no such {noun}", path=path, remedy=remedy) from error
    except OSError as error:
        raise MetadataError(f"cannot be read: {error.strerror}", path=path, remedy="Check its permissions.") from error
    except UnicodeDecodeError as error:
        raise MetadataError("is not text in UTF-8", path=path, remedy="Save it as UTF-8.") from error
    except ValueError as error:  # a NUL in the path
        raise MetadataError(f"is no path of a {noun}", path=path, remedy=remedy) from error
    try:
        document = safe_toml.loads(text)
    except (ValueError, RecursionError) as error:  # ValueError: also integers with thousands of digits
        raise MetadataError(f"is not TOML: {_line(error)}", path=path, remedy=remedy) from error
    _check_format(document.pop("format", None), path)
    return document


def validated_toml(model: type[Model], document: dict[str, Any], path: Path, remedy: str) -> Model:
    """The document of a file as a model of pydantic's; lists may become tuples, all else is strict.

    Raises:
        MetadataError: a key is missing, unknown or wrong; the first problem is named by its key as the file has it,
            and counted are the others.
    """
    try:
        return model.model_validate_json(json.dumps({"format": FORMAT, **document}, default=str))
    except ValidationError as error:
        raise MetadataError(sentence(error), path=path, remedy=remedy) from error
    except (ValueError, RecursionError) as error:
        raise MetadataError(f"cannot be understood: {_line(error)}", path=path, remedy=remedy) from error


def sentence(error: ValidationError) -> str:
    """The first thing that pydantic found wrong as "plots 2.name: is missing", and how many more there are.

    Items of lists count from 1.
    """
    problems = error.errors(include_url=False, include_context=False)
    # A problem within a list item makes the list itself too short as well: what lies deepest is what a person wrote.
    outer = {problem["loc"][:k] for problem in problems for k in range(len(problem["loc"]))}
    problems = [problem for problem in problems if problem["loc"] not in outer]
    first = problems[0]
    key = ""
    for part in first["loc"]:
        key += f" {part + 1}" if isinstance(part, int) else f".{part}" if key else str(part)
    key = key if len(key) <= 80 else f"{key[:80]}…"
    match first["type"]:
        case "missing":
            problem = "is missing"
        case "extra_forbidden":
            problem = "is not a key of this format"
        case "model_type":
            problem = "should be a table"
        case _:
            problem = first["msg"].removeprefix("Value error, ")
            problem = problem[:1].lower() + problem[1:]
    more = f" (and {len(problems) - 1} more)" if len(problems) > 1 else ""
    return f"{key}: {problem}{more}" if key else f"{problem}{more}"


def _check_format(found: Any, path: Path) -> None:
    first_line = f"Put 'format = {FORMAT}' on its first line."
    if found is None:
        raise MetadataError("has no 'format'", path=path, remedy=first_line)
    if found != FORMAT or isinstance(found, bool):
        newer = isinstance(found, int) and found > FORMAT
        shown = repr(found) if isinstance(found, int | float) and abs(found) < 1e6 else "something else"
        remedy = "Install a newer fieldkit." if newer else first_line
        raise MetadataError(f"has format {shown}; this fieldkit reads {FORMAT}", path=path, remedy=remedy)


def _line(error: BaseException) -> str:
    """The message of an error, as one short line."""
    text = "brackets without end" if isinstance(error, RecursionError) else str(error).partition("\n")[0]
    return text if len(text) <= 200 else f"{text[:200]}…"
