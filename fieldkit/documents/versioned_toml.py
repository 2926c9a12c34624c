"""Vehicle profiles and site files: TOML of a format version, as models of pydantic's."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from fieldkit.documents.toml_file import one_line, read_toml
from fieldkit.documents.validation_sentence import validation_sentence
from fieldkit.errors import MetadataError

FORMAT = 1
Model = TypeVar("Model", bound=BaseModel)


def read_versioned(path: Path, noun: str, remedy: str, max_bytes: int) -> dict[str, Any]:
    """The TOML document that a file holds, its ``format`` checked and left out.

    Args:
        path, noun, remedy, max_bytes: as of `read_toml`.
    """
    document = read_toml(path, noun, remedy, max_bytes)
    _check_format(document.pop("format", None), path)
    return document


def validated_toml(model: type[Model], document: dict[str, Any], path: Path, remedy: str) -> Model:
    """The document of a file as a model of pydantic's; lists may become tuples, all else is strict."""
    try:
        return model.model_validate_json(json.dumps({"format": FORMAT, **document}, default=str))
    except ValidationError as error:
        raise MetadataError(sentence(error), path=path, remedy=remedy) from error
    except (ValueError, RecursionError) as error:
        raise MetadataError(f"cannot be understood: {one_line(error)}", path=path, remedy=remedy) from error


def sentence(error: ValidationError) -> str:
    """The first thing that pydantic found wrong as "plots 2.name: is missing", and how many more there are.

    Items of lists count from 1.
    """
    problems = error.errors(include_url=False, include_context=False)
    # A problem within a list item makes the list itself too short as well: what lies deepest is what a person wrote.
    outer = {problem["loc"][:k] for problem in problems for k in range(len(problem["loc"]))}
    problems = [problem for problem in problems if problem["loc"] not in outer]
    key = ""
    for part in problems[0]["loc"]:
        key += f" {part + 1}" if isinstance(part, int) else f".{part}" if key else str(part)
    key = key if len(key) <= 80 else f"{key[:80]}…"
    return validation_sentence(
        key, problems, {"extra_forbidden": "is not a key of this format", "model_type": "should be a table"}
    )


def _check_format(found: Any, path: Path) -> None:
    first_line = f"Put 'format = {FORMAT}' on its first line."
    if found is None:
        raise MetadataError("has no 'format'", path=path, remedy=first_line)
    if found != FORMAT or isinstance(found, bool):
        newer = isinstance(found, int) and found > FORMAT
        shown = repr(found) if isinstance(found, int | float) and abs(found) < 1e6 else "something else"
        remedy = "Install a newer fieldkit." if newer else first_line
        raise MetadataError(f"has format {shown}; this fieldkit reads {FORMAT}", path=path, remedy=remedy)
