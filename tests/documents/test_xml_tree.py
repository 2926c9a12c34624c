"""XML of anybody: what is read of it, and what is refused."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fieldkit.documents.xml_tree import XmlError, escaped, parse, parse_local


def test_names_with_and_without_namespaces_and_stripped_texts() -> None:
    data = b'<a xmlns:x="urn:x" x:n="1"><x:b> two\n</x:b><!-- no --><c/></a>'
    root = parse(data)
    assert [element.tag for element in root.iter()] == ["a", "{urn:x}b", "c"]
    assert dict(root.items()) == {"{urn:x}n": "1"}
    local = parse_local(data)
    assert (local.findtext("b"), local.findtext("c"), local.findtext("d")) == ("two", "", None)


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", "not well-formed"),
        (b"<a><b></a>", "not well-formed"),
        (b"<a>&b;</a>", "not well-formed"),
        (b"<a/><a/>", "not well-formed"),
        (b'<?xml version="1.0" encoding="no-such"?><a/>', "not well-formed"),
        (b'<?xml version="1.0" encoding="utf-7"?><a/>', "not well-formed"),
        (b"<!DOCTYPE a><a/>", "document type"),
        (b'<!DOCTYPE a [<!ENTITY b "bbb">]><a>&b;</a>', "document type"),
        (b'<!DOCTYPE a SYSTEM "file:///etc/hostname"><a/>', "document type"),
        (b"<a>" * 65 + b"</a>" * 65, "too many elements"),
        (b"<a>" * 1_000_000, "too many elements"),
    ],
    ids=range(11),
)
def test_broken_and_hostile_documents_are_refused(data: bytes, message: str) -> None:
    with pytest.raises(XmlError, match=message):
        parse(data)


@given(st.binary(max_size=200))
def test_any_bytes_are_read_or_refused(data: bytes) -> None:
    for each in (data, b"<a>" + data + b"</a>"):
        try:
            parse(each)
        except XmlError:
            continue


@given(st.text())
def test_escaped_text_is_read_back_without_what_xml_cannot_hold(text: str) -> None:
    root = parse(f'<a b="{escaped(text)}">{escaped(text)}</a>'.encode(errors="surrogatepass"))
    kept = "".join(c for c in text if c in "\t\n\r" or c >= " ")
    assert len(root.attrib["b"]) == len("".join(c for c in kept if c not in "\ufffe\uffff").replace("\r\n", "\n"))
