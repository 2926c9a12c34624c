"""The fuzzer finds what it looks for."""

from pathlib import Path

import pytest

from benchmarks import fuzzing
from benchmarks.fuzzing import Target, fuzz
from fieldkit.errors import MetadataError

SEEDS = (b'{"a": 12.5, "b": [1, 2, 3]}', b'{"a": -7, "b": []}')


def test_refusals_defects_hangs_and_writing_are_told_apart(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fuzzing, "LIMIT_S", 0.2)
    seen = iter(range(1000))
    outside = tmp_path / "outside.txt"

    def read(file: Path) -> None:
        number = next(seen)
        file.read_bytes()
        if number == 3:
            raise ZeroDivisionError("three")
        while number == 5:
            pass
        if number == 7:
            outside.write_text("x")
        if number % 2:
            raise MetadataError("odd")

    (tmp_path / "files").mkdir()
    found = fuzz(Target(".json", SEEDS, read), 12, tmp_path / "files", seed=0)
    assert (found.files, found.accepted, found.refused, found.hangs) == (12, 6, 4, 1)
    assert len(found.defects) == 1
    assert next(iter(found.defects)).startswith("ZeroDivisionError: three (test_fuzzing.py:")
    assert found.written == (str(outside),)
