"""The same photographs and seed give the same bytes: in any process, on any number of workers, whatever is cached."""

from pathlib import Path

import pytest

from tests.endtoend.commands import DRAFT, CommandLine, differing
from tests.endtoend.conftest import Built


def build(line: CommandLine, images: Path, name: str, *options: str, hash_seed: int) -> Path:
    done = line.run("reference", str(images), "-o", name, *DRAFT, *options, hash_seed=hash_seed)
    assert done.code == 0, done.err
    return line.folder / name


def test_whole_result_without_a_cache(line: CommandLine, small_plot: Path, built: Built) -> None:
    assert differing(build(line, small_plot, "out", "--no-cache", hash_seed=1), built.reference) == []
    assert not line.cache.exists()


def test_whole_result_with_two_workers_and_an_empty_cache(line: CommandLine, small_plot: Path, built: Built) -> None:
    assert differing(build(line, small_plot, "out", "--workers", "2", hash_seed=2), built.reference) == []


def test_whole_result_from_the_cache(warm: CommandLine, small_plot: Path, built: Built) -> None:
    before = warm.entries()
    assert differing(build(warm, small_plot, "out", "--workers", "2", hash_seed=3), built.reference) == []
    assert warm.entries() == before


def test_cloud_does_not_depend_on_the_scene(line: CommandLine, small_plot: Path, built: Built) -> None:
    out = build(line, small_plot, "out", "--no-scene", hash_seed=4)
    assert (out / "cloud.ply").read_bytes() == (built.reference / "cloud.ply").read_bytes()
    assert not (out / "scene.ply").exists()


@pytest.mark.slow
def test_a_damaged_cache_is_computed_again(line: CommandLine, small_plot: Path, built: Built) -> None:
    build(line, small_plot, "first", "--no-scene", hash_seed=5)
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
    out = build(line, small_plot, "second", "--no-scene", hash_seed=6)
    assert differing(line.folder / "first", out) == []


def test_the_seed_counts(warm: CommandLine, small_plot: Path, built: Built) -> None:
    out = build(warm, small_plot, "out", "--no-scene", "--seed", "1", hash_seed=0)
    assert (out / "cloud.ply").read_bytes() != (built.reference / "cloud.ply").read_bytes()


def test_photographs_are_not_written_to(warm: CommandLine, small_plot: Path, built: Built) -> None:
    names = {"camera.toml", "poses.csv", *(f"IMG_{number:04d}.jpg" for number in range(1, 9))}
    assert {path.name for path in small_plot.iterdir()} == names
