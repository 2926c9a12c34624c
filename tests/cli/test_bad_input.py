"""reference and evaluate on what cannot be used: a message for people, the right exit code, and nothing left behind."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from fieldkit.cli.main import main


@pytest.fixture(autouse=True)
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("FIELDKIT_CACHE", str(tmp_path / "cache"))
    monkeypatch.chdir(tmp_path)
    return tmp_path


def noise(path: Path, seed: int, width: int = 400) -> None:
    """A photograph that matches no other."""
    path.parent.mkdir(parents=True, exist_ok=True)
    coarse = np.random.default_rng(seed).integers(0, 255, (30, 40, 3), dtype=np.uint8)
    Image.fromarray(coarse).resize((width, 300), Image.Resampling.BICUBIC).save(path, quality=90)


def run(capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[int, dict]:
    code = main([*arguments, "--json"])
    output = capsys.readouterr()
    assert "Traceback" not in output.err
    assert len(output.out.splitlines()) > 1
    return code, json.loads(output.out)


def no_folder(folder: Path) -> None:
    pass


def empty_folder(folder: Path) -> None:
    folder.mkdir()


def only_text(folder: Path) -> None:
    folder.mkdir()
    (folder / "a.jpg").write_text("not an image")
    (folder / "b.jpg").write_bytes(b"")


def a_file(folder: Path) -> None:
    noise(folder, 0) if folder.suffix else folder.write_text("x")


def bad_poses(folder: Path) -> None:
    noise(folder / "a.jpg", 0)
    noise(folder / "b.jpg", 1)
    (folder / "poses.csv").write_text("image,x_m,y_m,z_m\na.jpg,1,two,3\n")


class TestPhotographs:
    @pytest.mark.parametrize("make", [no_folder, empty_folder, only_text, a_file, bad_poses])
    @pytest.mark.parametrize("command", ["reference", "evaluate"])
    def test_cannot_be_used(
        self, command: str, make: Callable[[Path], None], place: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        make(place / "photos")
        code, found = run(capsys, command, "photos", "-o", "out")
        assert code == 3, found
        assert found["error"]["remedy"]
        assert "photos" in found["error"]["path"]
        assert not (place / "out").exists()

    @pytest.mark.parametrize("count", [1, 2])
    def test_too_few_or_without_overlap(self, count: int, place: Path, capsys: pytest.CaptureFixture[str]) -> None:
        for index in range(count):
            noise(place / "photos" / f"{index}.jpg", index)
        code, found = run(capsys, "reference", "photos", "-o", "out", "--fidelity", "draft")
        assert code == 4, found
        assert found["error"]["type"] == "ReconstructionError"
        assert found["error"]["remedy"]
        assert not (place / "out").exists()

    def test_every_plot_failed(self, place: Path, capsys: pytest.CaptureFixture[str]) -> None:
        noise(place / "field" / "=plot 1" / "a.jpg", 0)
        (place / "field" / "plot 2").mkdir()
        (place / "field" / "plot 2" / "b.jpg").write_text("not an image")
        code, found = run(capsys, "evaluate", "field", "-o", "out", "--fidelity", "draft")
        assert code == 4
        assert [plot["error"]["type"] for plot in found["plots"]] == ["ReconstructionError", "CaptureError"]
        assert found["plots"][0]["chamfer_m"] is None
        assert sorted(path.name for path in (place / "out").iterdir()) == ["evaluation.json", "plots.csv", "traits.csv"]
        rows = (place / "out" / "plots.csv").read_text("utf-8").splitlines()
        assert rows[1].startswith("'=plot 1,")
        assert main(["evaluate", "field", "-o", "out", "--overwrite"]) == 4
        people = capsys.readouterr()
        assert people.out == ""
        assert "plot 2" in people.err


class TestPlaces:
    def test_the_result_exists(self, place: Path, capsys: pytest.CaptureFixture[str]) -> None:
        noise(place / "photos" / "a.jpg", 0)
        (place / "out").mkdir()
        (place / "out" / "mine.txt").write_text("kept")
        for arguments in (["-o", "out"], ["-o", "out", "--overwrite"]):
            for command in ("reference", "evaluate"):
                code, found = run(capsys, command, "photos", *arguments)
                assert code == 2
                assert found["error"]["type"] == "UsageError"
        assert (place / "out" / "mine.txt").read_text() == "kept"

    @pytest.mark.parametrize("command", ["reference", "evaluate"])
    def test_no_permission(
        self, command: str, place: Path, unwritable: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        noise(place / "photos" / "a.jpg", 0)
        code, found = run(capsys, command, "photos", "-o", str(unwritable / "out"))
        assert code == 3
        assert found["error"]["type"] == "StorageError"


class TestReference:
    @pytest.mark.parametrize("content", [None, "", "{}", '{"kind": "evaluation", "version": 1}'])
    def test_is_none(self, content: str | None, place: Path, capsys: pytest.CaptureFixture[str]) -> None:
        noise(place / "photos" / "a.jpg", 0)
        if content is not None:
            (place / "ref").mkdir()
            (place / "ref" / "reference.json").write_text(content)
        code, found = run(capsys, "evaluate", "photos", "--reference", "ref", "-o", "out")
        assert code == 3
        assert found["error"]["type"] == "MetadataError"
        assert "ref" in found["error"]["path"]
        assert "fieldkit reference" in found["error"]["remedy"]
