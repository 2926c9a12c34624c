"""TOML files of people: what is read, and what is said of those that cannot be."""

import tomllib
from pathlib import Path

import pytest

from fieldkit.documents.toml_file import parse_toml, read_versioned, toml_document
from fieldkit.errors import MetadataError, about

TEXT = "# Höhe\nformat = 1\n[home]\nlatitude_deg = 50.8649\n"
READ = {"format": 1, "home": {"latitude_deg": 50.8649}}


@pytest.mark.parametrize("mark", [b"", b"\xef\xbb\xbf"])
def test_the_document_of_a_file(tmp_path: Path, mark: bytes) -> None:
    path = tmp_path / "a.toml"
    data = mark + TEXT.encode()
    path.write_bytes(data)
    assert read_versioned(path, "site file", len(data)) == {"home": READ["home"]}
    assert toml_document("\ufeff" + TEXT) == READ
    with pytest.raises(MetadataError, match="is far too large for a site file"):
        read_versioned(path, "site file", len(data) - 1)


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"a = 1\nb = [1,\nc = 2\n", "is not TOML: .* line 3"),
        (b"a = 1\na = 2\n", "is not TOML: .* line 2"),
        (b"a = " + b"[" * 5000, "is not TOML: brackets without end"),
        (b"a = " + b"9" * 5000, "is not TOML: "),
        (b"a." * 100 + b"b = 1", "is not TOML: line 1 has keys of more than 64 parts"),
        (b"\xff\xfea", "is not text in UTF-8"),
    ],
)
def test_mistakes_are_told_on_one_line(tmp_path: Path, data: bytes, words: str) -> None:
    path = tmp_path / "a.toml"
    path.write_bytes(data)
    with pytest.raises(MetadataError, match=words) as caught, about(path, "Ask."):
        read_versioned(path, "site file", 1 << 20)
    assert caught.value.path == path
    assert caught.value.remedy
    assert "\n" not in caught.value.message
    assert len(caught.value.message) < 300


@pytest.mark.parametrize("key", ["a." * 40_000 + "b", ".".join(['"x"'] * 3000), " . ".join("k" * 200)])
def test_endless_keys_take_no_minutes(key: str) -> None:
    for line in (f"{key} = 1", f"[{key}]", f"t = {{ {key} = 1 }}"):
        with pytest.raises(tomllib.TOMLDecodeError, match="line 2 has keys"):
            parse_toml(f"a = 1\n{line}\n")
