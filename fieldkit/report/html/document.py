"""A page of content as one self-contained HTML document.

Nothing is loaded from anywhere, which a Content Security Policy enforces (CSP level 3, https://www.w3.org/TR/CSP3/):
only styles and scripts with the listed SHA-256 apply, pictures are data of the page itself, and nothing can be sent.
All text is escaped by the template engine and shown without hidden characters.
"""

from __future__ import annotations

import base64
import hashlib
import io
from collections.abc import Iterator, Sequence
from functools import cache

from jinja2 import Environment
from markupsafe import Markup

from fieldkit.figures import content
from fieldkit.figures.content import Block, Details, Page, PlotMap, View3D
from fieldkit.report.html.drawings import draw, draw_map
from fieldkit.report.html.viewer import TEMPLATES, environment, viewer_html, viewer_script, viewer_style

_PRINTED_ROWS = 40
"""Rows of a table on paper, as page.css has them: a report is printed on ten pages at most."""
_NARROW_COLUMNS = 4
"""Number of columns that fit a screen 390 pixels wide."""
_FEW_ROWS = 8
"""Most rows of a wider table that are set one below the other there."""
_KINDS = {
    content.Statements: "statements",
    content.Paragraph: "paragraph",
    content.KeyFigures: "key_figures",
    content.Terms: "terms",
    content.Table: "table",
    content.Charts: "charts",
    PlotMap: "map",
    content.View3D: "view",
    content.Details: "details",
}


def render(page: Page) -> str:
    """The page as HTML, ending in a newline."""
    has_views = any(True for _ in views_of(page))
    styles = [_read("page.css"), *([viewer_style()] if has_views else [])]
    scripts = [_read("page.js"), *([viewer_script()] if has_views else [])]
    template = _environment().get_template("page.html.jinja")
    raw = {"styles": list(map(Markup, styles)), "scripts": list(map(Markup, scripts))}
    text = io.StringIO()  # `render` would hold every piece of it at once
    text.writelines(template.generate(page=page, policy=Markup(policy(styles, scripts)), **raw))
    return text.getvalue()


def policy(styles: Sequence[str], scripts: Sequence[str]) -> str:
    """The Content Security Policy under which only these inline styles and scripts apply, and nothing is loaded."""
    style, script = (" ".join(map(_source, texts)) for texts in (styles, scripts))
    return (
        f"default-src 'none'; img-src data:; style-src {style}; script-src {script}; base-uri 'none'; "
        "form-action 'none'"
    )


def views_of(page: Page) -> Iterator[View3D]:
    """The page's 3D views, including folded ones."""
    return (block for block in _blocks_of(page) if isinstance(block, View3D))


def _blocks_of(page: Page) -> Iterator[Block]:
    """All blocks, folded ones included."""

    def within(blocks: Sequence[Block]) -> Iterator[Block]:
        for block in blocks:
            yield block
            if isinstance(block, Details):
                yield from within(block.blocks)

    for section in page.sections:
        yield from within(section.blocks)


def _source(text: str) -> str:
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"


@cache
def _read(name: str) -> str:
    return (TEMPLATES / name).read_text(encoding="utf-8")


@cache
def _environment() -> Environment:
    engine = environment()
    engine.globals.update(
        printed_rows=_PRINTED_ROWS,
        narrow_columns=_NARROW_COLUMNS,
        few_rows=_FEW_ROWS,
        draw=draw,
        draw_map=draw_map,
        data_uri=_data_uri,
        kind=lambda block: _KINDS[type(block)],
        view_html=lambda view: Markup(viewer_html(view.scene, identifier=view.identifier)),
    )
    engine.filters.update(path=Markup)  # drawn here, so that it is not cut like foreign text
    engine.tests["text"] = lambda value: isinstance(value, str)
    engine.tests["link"] = lambda value: isinstance(value, content.Link)
    engine.tests["picture"] = lambda value: isinstance(value, content.Picture)
    return engine


def _data_uri(picture: content.Picture) -> Markup:
    # Base64 has no special characters of HTML; marked so that it is not cut like foreign text.
    kind = "webp" if picture.data.startswith(b"RIFF") else "jpeg"
    return Markup(f"data:image/{kind};base64," + base64.b64encode(picture.data).decode())
