"""Reading TOML files that people write: how large they may be, how they are decoded, and what is said of mistakes."""

from __future__ import annotations

import json
import math
import re
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, TypeAdapter, ValidationError

from fieldkit.documents.file_bytes import decoded, file_bytes
from fieldkit.documents.validation_sentence import validation_sentence
from fieldkit.errors import MetadataError

MOST_CHARACTERS = 16 << 20
"""Of any TOML text; the parser takes some seconds for so many."""
_MOST_SHOWN = 200
"""Most letters of a value in a message."""


_NUMBER = re.compile(r"(?<![\w.])[+-]?\d{1,20}\.\d{1,20}(?:[eE][+-]?\d{1,3})?(?![\w.])")
_DOTS = re.compile(r"\.+")
_MOST_DOTS = 64
"""Most parts of a dotted key: the parser's time grows with their square."""
FORMAT = 1
"""Number of the format of fieldkit's TOML files."""
Model = TypeVar("Model", bound=BaseModel)
Value = TypeVar("Value")
_BARE_KEY = re.compile(r"[A-Za-z0-9_-]+")
_WIDTH = 120
"""Width to which written arrays are wrapped, letters."""


def toml_document(text: str) -> dict[str, Any]:
    """The document of a TOML text."""
    if len(text) > MOST_CHARACTERS:
        raise MetadataError(f"is far too large: more than {MOST_CHARACTERS:,} characters")
    try:
        return parse_toml(text.removeprefix("\ufeff"))
    except (ValueError, RecursionError) as caught:  # ValueError: also integers with thousands of digits
        raise MetadataError(f"is not TOML: {one_line(caught)}") from caught


def one_line(error: BaseException) -> str:
    """What an error of a parser says, as one short line."""
    text = "brackets without end" if isinstance(error, RecursionError) else str(error).partition("\n")[0]
    return text if len(text) <= _MOST_SHOWN else f"{text[:_MOST_SHOWN]}…"


# tomllib takes time and memory that grow with the square of a dotted key's parts, and a key is on one line. Numbers
# have dots, too, and comments rows of them.


def parse_toml(text: str) -> dict[str, Any]:
    """The document of a TOML text."""
    for number, line in enumerate(text.split("\n"), 1):
        if line.count(".") > _MOST_DOTS and _other_dots(line) > _MOST_DOTS:
            raise tomllib.TOMLDecodeError(f"line {number} has keys of more than {_MOST_DOTS} parts")
    return tomllib.loads(text)


def _other_dots(line: str) -> int:
    """Dots of a line that are not in numbers; those in a row are one."""
    return len(_DOTS.findall(_NUMBER.sub("0", line)))


def read_versioned(path: Path, noun: str, max_bytes: int) -> dict[str, Any]:
    """The TOML document that a file holds, its ``format`` checked and left out."""
    document = toml_document(decoded(file_bytes(path, max_bytes, noun=noun, name=noun)))
    _check_format(document.pop("format", None))
    return document


def validated_toml(model: type[Model], document: dict[str, Any]) -> Model:
    """The document of a file as a model of pydantic's; lists may become tuples, all else is strict."""
    return validated(TypeAdapter(model), {"format": FORMAT, **document})


def validated(adapter: TypeAdapter[Value], document: Any) -> Value:
    """As `validated_toml`, of any type of pydantic's and without a version."""
    try:
        return adapter.validate_json(json.dumps(document, default=str))
    except ValidationError as error:
        raise MetadataError(sentence(error)) from error
    except (ValueError, RecursionError) as error:
        raise MetadataError(f"cannot be understood: {one_line(error)}") from error


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
    unknown, table = "is not a key of this format", "should be a table"
    texts = {"extra_forbidden": unknown, "unexpected_keyword_argument": unknown}
    texts |= dict.fromkeys(("model_type", "dataclass_type", "dict_type"), table)
    return validation_sentence(key, problems, texts)


def _check_format(found: Any) -> None:
    first_line = f"Put 'format = {FORMAT}' on its first line."
    if found is None:
        raise MetadataError("has no 'format'", remedy=first_line)
    if found != FORMAT or isinstance(found, bool):
        newer = isinstance(found, int) and found > FORMAT
        shown = repr(found) if isinstance(found, int | float) and abs(found) < 1e6 else "something else"
        remedy = "Install a newer fieldkit." if newer else first_line
        raise MetadataError(f"has format {shown}; this fieldkit reads {FORMAT}", remedy=remedy)


def toml_text(table: Mapping[str, Any]) -> str:
    """A document: values first, then tables and arrays of tables, each in the mapping's order; None is left out."""
    return "\n".join(_lines(table, ())).strip("\n") + "\n"


def _lines(table: Mapping[str, Any], path: tuple[str, ...]) -> list[str]:
    present = {key: value for key, value in table.items() if value is not None}
    lines = []
    for key, value in present.items():
        if not _is_table(value) and not _is_tables(value):
            lines.append(f"{_key(key)} = {_value(value)}")
    for key, value in present.items():
        place = (*path, key)
        name = ".".join(map(_key, place))
        if _is_table(value):
            inner = _lines(value, place)
            # A heading of its own is needed only above values; tables below it name it in theirs.
            lines += inner if inner and not inner[0] else ["", f"[{name}]", *inner]
        elif _is_tables(value):
            for item in value:
                lines += ["", f"[[{name}]]", *_lines(item, place)]
    return lines


def _is_table(value: Any) -> bool:
    return isinstance(value, Mapping)


def _is_tables(value: Any) -> bool:
    return isinstance(value, list | tuple) and bool(value) and all(isinstance(item, Mapping) for item in value)


def _key(key: str) -> str:
    return key if _BARE_KEY.fullmatch(key) else _string(key)


def _value(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return _string(value)
    if isinstance(value, int):
        return str(value)
    if isinstance(value, float):
        if not math.isfinite(value):
            raise ValueError("a number is not finite")
        return repr(value)
    if isinstance(value, Sequence):
        return _array([_value(item) for item in value])
    raise TypeError(f"TOML has no {type(value).__name__}")


def _array(items: list[str]) -> str:
    line = f"[{', '.join(items)}]"
    if len(line) < _WIDTH:
        return line
    return "[\n" + "".join(f"    {item},\n" for item in items) + "]"


def _string(text: str) -> str:
    # JSON's escapes are TOML's, but for DEL, which TOML forbids and JSON leaves as it is.
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007F")
