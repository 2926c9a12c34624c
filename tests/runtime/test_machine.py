"""Cores and memory under control groups."""

import os
from pathlib import Path

import pytest

from fieldkit.runtime.machine import Machine, cgroup_limits, this_machine, usual_workers


def tree(root: Path, files: dict[str, str]) -> Path:
    for name, content in files.items():
        path = root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(content)
    return root


@pytest.mark.parametrize(
    ("groups", "files", "expected"),
    [
        ("0::/\n", {}, (None, None)),
        ("0::/\n", {"cpu.max": "150000 100000\n", "memory.max": "1073741824\n"}, (1.5, 1 << 30)),
        ("0::/\n", {"cpu.max": "max 100000\n", "memory.max": "max\n"}, (None, None)),
        # The tightest on the way up counts.
        (
            "0::/slurm/job\n",
            {"slurm/memory.max": "4096\n", "slurm/job/memory.max": "8192\n", "slurm/job/cpu.max": "100000 100000\n"},
            (1.0, 4096),
        ),
        # A container sees its own group at the root, whatever path the process file gives.
        ("0::/docker/abc\n", {"memory.max": "4096\n"}, (None, 4096)),
        ("3:cpu:/\n", {"cpu.max": "150000 100000\n"}, (None, None)),
    ],
)
def test_cgroup_limits(tmp_path: Path, groups: str, files: dict[str, str], expected: object) -> None:
    (tmp_path / "cgroup").write_text(groups)
    assert cgroup_limits(tmp_path / "cgroup", tree(tmp_path / "fs", files)) == expected


def test_this_machine(monkeypatch: pytest.MonkeyPatch) -> None:
    machine = this_machine()
    assert 1 <= machine.cores <= (os.cpu_count() or 1)
    assert 0 < machine.available_bytes <= machine.memory_bytes
    monkeypatch.setattr("fieldkit.runtime.machine.cgroup_limits", lambda: (0.5, 1 << 20))
    assert this_machine().cores == 1
    assert this_machine().memory_bytes == 1 << 20
    assert this_machine().available_bytes == 0


def test_as_many_processes_as_cores_and_memory_allow(monkeypatch: pytest.MonkeyPatch) -> None:
    machine = this_machine()
    assert 1 <= usual_workers() <= machine.cores
    for gigabytes, expected in ((1.0, 1), (5.0, 3), (100.0, 8)):
        there = Machine(8, 1 << 40, round(gigabytes * 1e9))
        monkeypatch.setattr("fieldkit.runtime.machine.this_machine", lambda there=there: there)
        assert usual_workers() == expected
