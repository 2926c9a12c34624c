"""Small XML documents from anywhere, as a tree; and text made safe for XML.

defusedxml refuses a document type declaration, and with it every entity; depth and number of elements have limits.
"""

from __future__ import annotations

import re
from typing import Any
from xml.etree.ElementTree import Element, ParseError, TreeBuilder
from xml.sax.saxutils import escape

from defusedxml import DTDForbidden
from defusedxml.ElementTree import DefusedXMLParser

_MAX_DEPTH = 64
"""Most levels of elements."""
_MAX_ELEMENTS = 1_000_000
"""Most elements of a document."""
_FORBIDDEN = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


class XmlError(ValueError):
    """A document that cannot be parsed, or is refused."""


class _LimitedTree(TreeBuilder):
    """Builds elements with their texts stripped, up to the limits."""

    def __init__(self) -> None:
        super().__init__()
        self._depth = self._count = 0

    def start(self, tag: str, attrs: dict[Any, Any], /) -> Element:
        self._depth += 1
        self._count += 1
        if self._count > _MAX_ELEMENTS or self._depth > _MAX_DEPTH:
            raise XmlError("the XML has far too many elements")
        return super().start(tag, attrs)

    def end(self, tag: str, /) -> Element:
        self._depth -= 1
        element = super().end(tag)
        element.text = (element.text or "").strip()
        return element


def parse(data: bytes) -> Element:
    """The root element of a document; texts are stripped."""
    parser = DefusedXMLParser(target=_LimitedTree(), forbid_dtd=True)
    try:
        parser.feed(data)
        root: Element = parser.close()
    except XmlError:
        raise
    except DTDForbidden as error:
        raise XmlError("the XML has a document type declaration") from error
    except (ParseError, ValueError, LookupError) as error:  # the last two: an encoding Python does not have
        raise XmlError(f"the XML is not well-formed ({error})") from error
    return root


def parse_local(data: bytes) -> Element:
    """As `parse`, with the names of elements without their namespaces."""
    root = parse(data)
    for element in root.iter():
        element.tag = element.tag.rpartition("}")[2]
    return root


def escaped(text: str) -> str:
    """Text for an element or attribute; characters that XML cannot hold are left out."""
    return escape(_FORBIDDEN.sub("", text), {'"': "&quot;"})
