"""The template engine: it escapes all text and shows it without hidden characters."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup, escape

from fieldkit.figures.style import format_nominal, unbroken, visible

TEMPLATES = Path(__file__).parent / "templates"
_CODE = re.compile("`([^`]+)`")


@cache
def environment() -> Environment:
    """The engine with this page's templates and filters."""
    engine = Environment(
        loader=FileSystemLoader(TEMPLATES),
        autoescape=True,
        undefined=StrictUndefined,
        finalize=_shown,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    engine.filters.update(unbroken=unbroken, nominal=format_nominal, coded=_coded)
    return engine


def _coded(text: str) -> Markup:
    """Text in which what stands between backticks is code: commands to copy."""
    shown = escape(visible(unbroken(text)))
    return Markup(_CODE.sub(r"<code>\1</code>", str(shown))) if "`" in text else shown


def _shown(value: Any) -> Any:
    """The engine's output for an expression: foreign text without hidden characters."""
    return visible(value) if isinstance(value, str) and not isinstance(value, Markup) else value
