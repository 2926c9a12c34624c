"""JSON files that fieldkit writes and reads back, and the text of their schemas."""

from __future__ import annotations

import json
import math
import re
from contextlib import suppress
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from fieldkit.documents.file_bytes import file_bytes
from fieldkit.documents.mistaken import refuse_other
from fieldkit.documents.validation_sentence import validation_sentence
from fieldkit.errors import InputError, MetadataError, about

Model = TypeVar("Model", bound=BaseModel)
_TRUE_VERSION = re.compile(rb'"version"\s*:\s*true')  # pydantic takes it for 1


def read_json_object(file: Path, *, noun: str, max_bytes: int) -> dict[str, Any]:
    """The JSON object that a file holds; the arguments are those of `file_bytes`."""
    data = file_bytes(file, max_bytes, noun=noun)
    try:
        document = json.loads(data)
    except UnicodeDecodeError as error:
        raise MetadataError("is not text in UTF-8") from error
    except json.JSONDecodeError as error:
        why = f"line {error.lineno}: {error.msg}" if data.strip() else "it is empty"
        raise MetadataError(f"is not JSON: {why}") from error
    except (RecursionError, ValueError) as error:  # brackets without end; integers with thousands of digits
        raise MetadataError(f"is not JSON that a {noun} could hold") from error
    if not isinstance(document, dict):
        raise MetadataError("is not a JSON object")
    return document


def read_kind(file: Path, kind: str, *, max_bytes: int) -> dict[str, Any]:
    """The JSON object of a file that fieldkit wrote, whose "kind" says what it is."""
    refuse_other(file, kind)
    document = read_json_object(file, noun=kind, max_bytes=max_bytes)
    if document.get("kind") != kind:
        was = f'its "kind" is {document["kind"]!r}' if "kind" in document else 'it has no "kind"'
        raise MetadataError(f"is not a fieldkit {kind}: {was}")
    return document


def check_version(document: dict[str, Any], known: int) -> None:
    """Raises MetadataError: the document of a file is of another version of its format than the one that is known."""
    version = document.get("version")
    if version != known or isinstance(version, bool):
        newer = isinstance(version, int) and version > known
        remedy = "Install the fieldkit that wrote it, or a newer one." if newer else ""
        raise MetadataError(f"has version {version!r} of the format; this fieldkit reads {known}", remedy=remedy)


def read_model(model: type[Model], kind: str, file: Path, remedy: str, *, max_bytes: int) -> Model:
    """A file that fieldkit wrote as a model of pydantic's, which says the version that is known."""
    with suppress(InputError, ValidationError):  # most are right; what is wrong with the others is found below
        data = file_bytes(file, max_bytes, noun=kind)
        made = model.model_validate_json(data)
        if {"kind", "version"} <= made.model_fields_set and not _TRUE_VERSION.search(data):
            return made
    with about(file, remedy):
        document = read_kind(file, kind, max_bytes=max_bytes)
        check_version(document, model.model_fields["version"].default)
        return validated(model, document)


def validated(model: type[Model], document: dict[str, Any]) -> Model:
    """The document of a file as a model of pydantic's; lists may become tuples, all else is strict."""
    try:
        return model.model_validate_json(json.dumps(document))
    except ValidationError as error:
        raise MetadataError(first_problem(error)) from error


def first_problem(error: ValidationError) -> str:
    """The first thing that pydantic found wrong as "field: what it is", in one line, and how many more there are."""
    problems = error.errors(include_url=False, include_context=False)
    field = ".".join(str(part) for part in problems[0]["loc"]) or "the object"
    return validation_sentence(field, problems, {"extra_forbidden": "is not known to this version of the format"})


def schema_text(schema: dict[str, Any]) -> str:
    """A JSON Schema (2020-12) as text that ends in a newline."""
    document = {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema}
    return json.dumps(document, indent=2, ensure_ascii=False) + "\n"


def json_number(value: object) -> float | None:
    """A finite number of a JSON document, or None; also for true, false and integers beyond a double."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    try:
        result = float(value)
    except OverflowError:
        return None
    return result if math.isfinite(result) and abs(result) < 1e12 else None
