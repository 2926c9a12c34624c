"""Small XML documents from anywhere, as a tree; and text made safe for XML.

Parsed with expat alone: a document type declaration ends the parsing, so that no entity is ever defined, let alone
expanded. Depth and number of elements have limits.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from xml.parsers import expat

_MAX_DEPTH = 64
_MAX_ELEMENTS = 1_000_000
_FORBIDDEN = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


class XmlError(ValueError):
    """A document that cannot be parsed, or is refused."""


@dataclass(slots=True)
class Element:
    """An element by its local name.

    Attributes:
        name: without namespace or prefix.
        children: elements in it.
        text: the characters directly in it, stripped.
    """

    name: str
    children: list[Element] = field(default_factory=list)
    text: str = ""

    def child(self, name: str) -> Element | None:
        """The first child of that name."""
        return next((c for c in self.children if c.name == name), None)

    def value(self, *names: str) -> str | None:
        """The text down a path of names; None where it is missing or empty."""
        here: Element | None = self
        for name in names:
            here = None if here is None else here.child(name)
        return None if here is None or not here.text else here.text

    def all(self, name: str) -> Iterator[Element]:
        """Descendants of that name, in the document's order."""
        stack = list(reversed(self.children))
        while stack:
            element = stack.pop()
            if element.name == name:
                yield element
            stack.extend(reversed(element.children))


def parse(data: bytes) -> Element:
    """The root element of a document.

    Raises:
        XmlError: not well-formed, too deep, too many elements, or with a document type declaration.
    """
    top = Element("")
    path = [top]
    text: list[list[str]] = [[]]
    count = 0

    def start(name: str, _: dict[str, str]) -> None:
        nonlocal count
        count += 1
        if count > _MAX_ELEMENTS or len(path) > _MAX_DEPTH:
            raise XmlError("the XML has far too many elements")
        element = Element(name.rpartition(" ")[2])
        path[-1].children.append(element)
        path.append(element)
        text.append([])

    def end(_: str) -> None:
        path.pop().text = "".join(text.pop()).strip()

    def refuse(*_: object) -> None:
        raise XmlError("the XML has a document type declaration")

    parser = expat.ParserCreate(namespace_separator=" ")
    parser.buffer_text = True
    parser.StartElementHandler = start
    parser.EndElementHandler = end
    parser.CharacterDataHandler = lambda characters: text[-1].append(characters)
    parser.StartDoctypeDeclHandler = refuse
    parser.EntityDeclHandler = refuse
    try:
        parser.Parse(data, True)
    except XmlError:
        raise
    except (expat.ExpatError, ValueError, LookupError) as error:  # the last two: an encoding Python does not have
        raise XmlError(f"the XML is not well-formed ({error})") from error
    return top.children[0]


def escaped(text: str) -> str:
    """Text for an element or attribute; characters that XML cannot hold are left out."""
    text = _FORBIDDEN.sub("", text)
    return text.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;").replace('"', "&quot;")
