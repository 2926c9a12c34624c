"""TOML (1.0) text from plain values. The standard library reads TOML but does not write it."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping, Sequence
from typing import Any

_BARE_KEY = re.compile(r"[A-Za-z0-9_-]+")
_WIDTH = 120


def toml_text(table: Mapping[str, Any]) -> str:
    """A document: values first, then tables and arrays of tables, each in the mapping's order; None is left out.

    Args:
        table: of str, bool, int, finite float, sequences of these, mappings, and sequences of mappings.
    """
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
