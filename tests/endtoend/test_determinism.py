"""The same photographs and seed give the same bytes: in any process, on any number of workers, whatever is cached."""

import shutil
from pathlib import Path

import pytest

from tests.endtoend.commands import DRAFT, CommandLine, differing, finish
from tests.endtoend.conftest import Built


def build(line: CommandLine, images: Path, name: str, *options: str) -> Path:
    line.run("reference", str(images), "-o", name, *DRAFT, *options)
    return line.folder / name


def test_whole_result_by_two_workers_of_another_process_without_a_cache(line, small_plot, built, monkeypatch) -> None:
    monkeypatch.setenv("PYTHONHASHSEED", "1")
    done = finish(line.start("reference", str(small_plot), "-o", "out", *DRAFT, "--no-cache", "--workers", "2"))
    assert done.code == 0, done.err
    assert differing(line.folder / "out", built.reference) == []
    assert not line.cache.exists()


def test_whole_result_from_the_cache(line: CommandLine, small_plot: Path, built: Built) -> None:
    shutil.copytree(built.cache, line.cache)  # others use it meanwhile
    before = line.entries()
    assert differing(build(line, small_plot, "out"), built.reference) == []
    assert line.entries() == before
    names = {"camera.toml", "poses.csv", *(f"IMG_{number:04d}.jpg" for number in range(1, 9))}
    assert {path.name for path in small_plot.iterdir()} == names  # where nothing is written


def test_cloud_does_not_depend_on_the_scene(warm: CommandLine, small_plot: Path, built: Built) -> None:
    out = build(warm, small_plot, "out", "--no-scene")
    assert (out / "cloud.ply").read_bytes() == (built.reference / "cloud.ply").read_bytes()
    assert not (out / "scene.ply").exists()


@pytest.mark.slow
def test_a_damaged_cache_is_computed_again(line: CommandLine, small_plot: Path, built: Built) -> None:
    build(line, small_plot, "first", "--no-scene")
    for number, entry in enumerate(sorted(line.cache.glob("*/*/*.npz"))):
        data = entry.read_bytes()
        match number % 3:
            case 0:
                entry.write_bytes(data[: len(data) // 2])
            case 1:
                entry.write_bytes(b"")
            case _:
                middle = len(data) // 2
                entry.write_bytes(data[:middle] + bytes([data[middle] ^ 0xFF]) + data[middle + 1 :])
    out = build(line, small_plot, "second", "--no-scene")
    assert differing(line.folder / "first", out) == []
