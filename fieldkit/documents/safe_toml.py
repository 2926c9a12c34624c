"""TOML from people and strangers: `tomllib`, without the lines that make it take minutes and the machine's memory."""

from __future__ import annotations

import re
import tomllib
from typing import Any

# tomllib takes time and memory that grow with the square of a dotted key's parts, and a key is on one line. Numbers
# have dots, too, and comments rows of them.
_NUMBER = re.compile(r"(?<![\w.])[+-]?\d{1,20}\.\d{1,20}(?:[eE][+-]?\d{1,3})?(?![\w.])")
_DOTS = re.compile(r"\.+")
_MOST_DOTS = 64


def loads(text: str) -> dict[str, Any]:
    """The document of a TOML text."""
    for number, line in enumerate(text.split("\n"), 1):
        if line.count(".") > _MOST_DOTS and _other_dots(line) > _MOST_DOTS:
            raise tomllib.TOMLDecodeError(f"line {number} has keys of more than {_MOST_DOTS} parts")
    return tomllib.loads(text)


def _other_dots(line: str) -> int:
    """Dots of a line that are not in numbers; those in a row are one."""
    return len(_DOTS.findall(_NUMBER.sub("0", line)))
