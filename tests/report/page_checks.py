"""What a report's HTML says, read back by the standard library's parser."""

import base64
import hashlib
import re
from dataclasses import dataclass, field
from html.parser import HTMLParser

VOID = {"meta", "img", "input", "br", "hr", "link"}
IN_SVG = {"line", "path", "circle", "rect", "stop", "image"}


@dataclass
class Parsed(HTMLParser):
    """The elements, attributes and texts of a page; raises where tags do not close in order."""

    elements: list[tuple[str, dict[str, str]]] = field(default_factory=list)
    texts: list[str] = field(default_factory=list)
    raw: dict[str, list[str]] = field(default_factory=lambda: {"script": [], "style": []})

    def __init__(self, html: str) -> None:
        super().__init__()
        self.elements, self.texts, self.raw, self._open = [], [], {"script": [], "style": []}, []
        self.feed(html)
        self.close()
        assert self._open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        assert len({name for name, _ in attrs}) == len(attrs), f"an attribute twice: {tag} {attrs}"
        self.elements.append((tag, {name: value or "" for name, value in attrs}))
        if tag in self.raw and self._is_ours(tag):
            self.raw[tag].append("")
        if tag not in VOID:
            self._open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        assert tag in IN_SVG
        self.elements.append((tag, {name: value or "" for name, value in attrs}))

    def handle_endtag(self, tag: str) -> None:
        assert self._open, tag
        assert self._open.pop() == tag

    def handle_data(self, data: str) -> None:
        inside = self._open[-1] if self._open else ""
        if inside in self.raw:
            if self._is_ours(inside):
                self.raw[inside][-1] += data
        else:
            self.texts.append(data)

    def _is_ours(self, tag: str) -> bool:
        return tag == "style" or "type" not in self.elements[-1][1]

    @property
    def text(self) -> str:
        """All of the page's text, with single spaces."""
        return " ".join(" ".join(self.texts).split())

    def all(self, tag: str) -> list[dict[str, str]]:
        """The attributes of all elements of a name."""
        return [attributes for name, attributes in self.elements if name == tag]


def checked(html: str) -> Parsed:
    """A page that is whole, loads nothing, runs nothing but its own scripts, and can be read without seeing it."""
    page = Parsed(html)
    (policy,) = [a["content"] for a in page.all("meta") if a.get("http-equiv") == "Content-Security-Policy"]
    rules = dict(rule.strip().split(" ", 1) for rule in policy.split(";"))
    assert rules["default-src"] == "'none'"
    assert rules["img-src"] == "data:"
    for tag in ("script", "style"):
        hashes = [base64.b64encode(hashlib.sha256(text.encode()).digest()).decode() for text in page.raw[tag]]
        assert rules[f"{tag}-src"].split() == [f"'sha256-{value}'" for value in hashes]
    for tag, attributes in page.elements:
        assert not [name for name in attributes if name.startswith("on")], (tag, attributes)
        assert "style" not in attributes, (tag, attributes)
        assert tag not in ("link", "iframe", "object", "embed", "base", "form", "audio", "video"), tag
        for name in ("src", "href", "srcset", "action", "data", "xlink:href", "poster"):
            value = attributes.get(name, "#")
            assert re.match("#|data:image/(jpeg|webp);base64,", value), (tag, name, value[:80])
    styles = "".join(page.raw["style"])
    assert not re.search(r"@import|url\(\s*['\"]?(?!#)", styles)
    anchors = [a["id"] for _, a in page.elements if "id" in a]
    assert len(anchors) == len(set(anchors))
    assert {a["href"][1:] for a in page.all("a")} <= set(anchors)
    assert all(a.get("alt") for a in page.all("img"))
    assert all(a.get("scope") in ("col", "row") for a in page.all("th"))
    assert all("aria-label" in a or "aria-hidden" in a for a in page.all("svg"))
    assert page.all("html")[0]["lang"] == "en"
    assert [tag for tag, _ in page.elements].count("h1") == 1
    return page
