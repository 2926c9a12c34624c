"""Results, references and disks that cannot be used."""

import json
import os
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.endtoend.commands import DRAFT, CommandLine, contents, differing, partial_folders
from tests.endtoend.conftest import Built

Photographs = Callable[..., Path]


class TestOutput:
    @pytest.mark.parametrize("command", ["reference", "evaluate"])
    def test_an_existing_result_stays(self, command: str, warm: CommandLine, small_plot: Path, built: Built) -> None:
        shutil.copytree(built.reference, warm.folder / "out")
        done = warm.run(command, str(small_plot), "-o", "out", *DRAFT, "--json", code=2)
        assert done.error["type"] == "UsageError"
        assert done.error["message"] == "the result exists already"
        assert done.error["path"] == str(warm.folder / "out")
        assert "--overwrite" in done.error["remedy"]
        assert contents(warm.folder / "out") == contents(built.reference)

    def test_overwrite_replaces_a_result_and_nothing_else(self, warm, small_plot, built) -> None:
        shutil.copytree(built.reference, warm.folder / "out")
        (warm.folder / "out" / "cloud.ply").write_bytes(b"")
        done = warm.run("reference", str(small_plot), "-o", "out", *DRAFT, "--overwrite")
        assert differing(warm.folder / "out", built.reference) == []
        (warm.folder / "mine").mkdir()
        (warm.folder / "mine" / "thesis.txt").write_text("years")
        done = warm.run("reference", str(small_plot), "-o", "mine", *DRAFT, "--overwrite", "--json", code=2)
        assert "reference.json" in done.error["message"]
        assert (warm.folder / "mine" / "thesis.txt").read_text() == "years"

    def test_a_cache_on_a_full_disk_costs_only_time(self, line, small_plot, built, small_disk) -> None:
        (small_disk / "filler").write_bytes(bytes(1_000_000))
        full = CommandLine(line.folder, small_disk / "cache")
        done = full.run("reference", str(small_plot), "-o", "out", *DRAFT, "--no-scene", "--json")
        assert done.err.count("nothing more is kept in the cache") == 1
        assert "fieldkit cache prune" in done.err
        assert (line.folder / "out/cloud.ply").read_bytes() == (built.reference / "cloud.ply").read_bytes()


def changed_cloud(folder: Path) -> None:
    with (folder / "cloud.ply").open("r+b") as file:
        file.seek(-1, os.SEEK_END)
        file.write(b"\x7f")


def without_scale(folder: Path) -> None:
    _edit(folder, metric=False)


def _edit(folder: Path, **changes: object) -> None:
    file = folder / "reference.json"
    file.write_text(json.dumps(json.loads(file.read_text("utf-8")) | changes), "utf-8")


class TestReference:
    @pytest.mark.parametrize(
        ("damage", "message", "remedy", "file"),
        [
            (changed_cloud, "was changed after the reference was built", "Build the reference again", "cloud.ply"),
            (without_scale, "has no metric scale", "Build it again with poses.csv", "reference.json"),
        ],
    )
    def test_damaged(self, damage, message, remedy, file, warm: CommandLine, small_plot: Path, built: Built) -> None:
        shutil.copytree(built.reference, warm.folder / "ref")
        damage(warm.folder / "ref")
        done = warm.run("evaluate", str(small_plot), "--reference", "ref", "-o", "out", *DRAFT, "--json", code=3)
        error = done.error
        assert error["type"] == "MetadataError"
        assert message in error["message"]
        assert remedy in error["remedy"]
        assert error["path"] == str(Path("ref", file))
        assert not (warm.folder / "out").exists()
        assert partial_folders(warm.folder) == []


class TestManyPlots:
    def test_some_fail(self, warm: CommandLine, photographs: Photographs, built: Built) -> None:
        photographs("field/plot 2")
        photographs("field/plot 10", 1)
        photographs("field/plot 11", poses=False)
        (warm.folder / "field" / "plot 12").mkdir()
        (warm.folder / "field" / "plot 12" / "IMG_0001.jpg").touch()
        (warm.folder / "field" / "notes").mkdir()
        (warm.folder / "field" / "notes" / "weather.txt").write_text("dry")
        done = warm.run("evaluate", "field", "--reference", str(built.reference), "-o", "out", *DRAFT, "--json")
        plots = done.json["plots"]
        assert [plot["name"] for plot in plots] == ["plot 2", "plot 10", "plot 11", "plot 12"]
        errors = [plot["error"] and plot["error"]["type"] for plot in plots]
        assert errors == [None, "ReconstructionError", "ReconstructionError", "CaptureError"]
        for plot in plots[1:]:
            assert plot["name"] in plot["error"]["message"]
            assert plot["error"]["remedy"]
            assert plot["chamfer_m"] is None
        assert sorted(path.name for path in (warm.folder / "out").iterdir()) == [
            "evaluation.json",
            "plot 2",
            "plots.csv",
            "traits.csv",
        ]
        people = warm.run("evaluate", "field", "--reference", str(built.reference), "-o", "again", *DRAFT)
        for plot in plots[1:]:
            assert f"{plot['name']}: " in people.out
        rows = (warm.folder / "out" / "plots.csv").read_text("utf-8").splitlines()
        assert [row.split(",")[0] for row in rows] == ["plot", "plot 2", "plot 10", "plot 11", "plot 12"]


def test_a_day_with_odd_names_of_plots(warm: CommandLine, small_plot: Path, built: Built) -> None:
    """Names that are no UTF-8, and those of the result's own files."""
    names = ["plots.csv", "evaluation.json", os.fsdecode(b"Fl\xe4che")]
    day = warm.folder / "day"
    try:
        for name in names:
            shutil.copytree(small_plot, day / name)
    except OSError:
        pytest.skip("this file system takes names in UTF-8 only")
    warm.run("evaluate", "day", "-o", "out", *DRAFT, "--json")
    report = json.loads((warm.folder / "out" / "evaluation.json").read_text())
    assert [plot["error"] for plot in report["plots"]] == [None] * 3
    assert sorted(plot["name"] for plot in report["plots"]) == [r"Fl\udce4che", "evaluation.json", "plots.csv"]
    for plot in report["plots"]:
        for entry in plot["files"]:
            assert (warm.folder / "out" / entry["name"]).stat().st_size == entry["bytes"]
    assert (warm.folder / "out" / "plots.csv").is_file()
    warm.run("report", "out", "-o", "report.html")
