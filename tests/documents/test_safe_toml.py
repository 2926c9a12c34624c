"""TOML without the lines that take minutes."""

from __future__ import annotations

import tomllib

import pytest

from fieldkit.documents.toml_file import parse_toml


def test_documents_are_tomllibs() -> None:
    text = "a.b.c = 1\nxs = [" + ", ".join(f"{k}.25" for k in range(5000)) + "]\n# " + "." * 500 + "\n[t]\nd = 1e-3\n"
    assert parse_toml(text) == tomllib.loads(text)


@pytest.mark.parametrize("key", ["a." * 40_000 + "b", ".".join(['"x"'] * 3000), " . ".join("k" * 200)])
def test_endless_keys_are_refused_unparsed(key: str) -> None:
    for line in (f"{key} = 1", f"[{key}]", f"t = {{ {key} = 1 }}"):
        with pytest.raises(tomllib.TOMLDecodeError, match="line 2 has keys"):
            parse_toml(f"a = 1\n{line}\n")
