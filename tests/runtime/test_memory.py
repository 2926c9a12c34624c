"""Arrays in memory, or in files without a name."""

import numpy as np
import pytest

from fieldkit.errors import StorageError
from fieldkit.runtime.machine import this_machine
from fieldkit.runtime.memory import MEMORY, MemoryBudget


def test_large_arrays_go_to_files_and_small_ones_do_not(tmp_path):
    free = this_machine().available_bytes
    assert MemoryBudget.for_bytes(0.01 * free, tmp_path) == MEMORY
    assert MemoryBudget.for_bytes(2.0 * free, tmp_path).folder == tmp_path
    elsewhere = MemoryBudget.for_bytes(2.0 * free, tmp_path / "missing").folder
    assert elsewhere is not None
    assert elsewhere.is_dir()


@pytest.mark.parametrize("shape", [(0, 3), (7,), (300, 200, 3)])
def test_arrays_in_files_hold_what_they_are_given(tmp_path, shape):
    memory, given = MemoryBudget(tmp_path), np.random.default_rng(0).random(shape).astype(np.float32)
    assert not memory.zeros(shape, np.float32).any()
    assert np.array_equal(memory.kept(given), given)
    assert not list(tmp_path.iterdir())


def test_a_full_disk_is_an_error_and_not_a_crash(small_disk):
    with pytest.raises(StorageError, match="space"):
        MemoryBudget(small_disk).zeros((1 << 20,), np.float32)
