"""The stage cache: right keys, and entries that are whole or missing."""

import dataclasses
import enum
import os
import signal
import subprocess
import sys
import textwrap
import time
import warnings
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from fieldkit.cache import CacheWarning, StageCache, default_cache_root, digest

KEY = digest("key")
OTHER = digest("other")


class Fidelity(enum.Enum):
    DRAFT = "draft"
    FINE = "fine"


@dataclasses.dataclass(frozen=True)
class Settings:
    width: int = 500
    weights: tuple[float, ...] = (0.5, 0.1)
    fidelity: Fidelity = Fidelity.DRAFT


@dataclasses.dataclass(frozen=True)
class OtherSettings(Settings):
    pass


ARRAYS = hnp.arrays(
    dtype=st.sampled_from(["<f4", ">f8", "u1", "i8", "?", "<U3"]), shape=hnp.array_shapes(min_dims=0, min_side=0)
)
VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text() | st.binary(),
    lambda inner: st.lists(inner).map(tuple) | st.dictionaries(st.text() | st.integers(), inner),
    max_leaves=8,
)


class TestDigest:
    def test_is_what_it_always_was(self) -> None:
        """Pinned: a change of the digest throws everybody's cache away and has to be meant."""
        value = ("sift", 1, -2.5, True, None, b"\0", np.arange(6, dtype=np.float32).reshape(2, 3), {"b": 1, "a": 2})
        assert digest(*value, Settings(), Fidelity.FINE) == "25bbc20d8ef925dbdf3a6c4cb31daa17"

    @pytest.mark.parametrize("seed", ["0", "1", "2"])
    def test_is_the_same_in_every_process(self, seed: str) -> None:
        script = "from fieldkit.cache import digest; print(digest({'a', 'b', 'c'}, {'x': 1, 'y': frozenset('abc')}))"
        command = [sys.executable, "-c", script]
        environment = {**os.environ, "PYTHONHASHSEED": seed}
        done = subprocess.run(command, capture_output=True, text=True, check=True, env=environment)
        assert done.stdout.strip() == digest({"a", "b", "c"}, {"x": 1, "y": frozenset("abc")})

    def test_types_count(self) -> None:
        values = [1, 1.0, True, "1", b"1", None, (1,), ((1,),), {1}, {1: 1}, np.float32(1), np.array(1), np.array([1])]
        assert len({digest(value) for value in values}) == len(values)

    def test_dataclasses_count_by_field_and_class(self) -> None:
        assert digest(Settings()) == digest(Settings())
        assert digest(Settings()) != digest(Settings(width=501))
        assert digest(Settings()) != digest(Settings(fidelity=Fidelity.FINE))
        assert digest(Settings()) != digest(OtherSettings())

    @given(ARRAYS)
    def test_layout_of_an_array_does_not_count(self, array: np.ndarray) -> None:
        assert digest(array) == digest(np.asfortranarray(array).reshape(array.shape))
        assert digest(array) == digest(array.astype(array.dtype.newbyteorder()))
        if array.ndim > 1 and array.size > 0 and array.shape != array.T.shape:
            assert digest(array) != digest(array.T)

    @given(VALUES, VALUES)
    def test_equal_only_if_equal(self, a: object, b: object) -> None:
        assert (digest(a) == digest(b)) == (repr(_ordered(a)) == repr(_ordered(b)))


def _ordered(value: object) -> object:
    if isinstance(value, dict):
        return sorted((repr(key), repr(_ordered(item))) for key, item in value.items())
    if isinstance(value, tuple):
        return tuple(_ordered(item) for item in value)
    return value


class TestEntries:
    @given(st.dictionaries(st.sampled_from(["file", "arr_0", "a/b", "Größe"]), ARRAYS))
    def test_come_back_as_they_were(self, tmp_path_factory: pytest.TempPathFactory, arrays: dict) -> None:
        cache = StageCache(tmp_path_factory.mktemp("cache"))
        assert cache.get("features", KEY) is None
        cache.put("features", KEY, arrays)
        again = cache.get("features", KEY)
        assert again.keys() == arrays.keys()
        for name, array in arrays.items():
            assert again[name].dtype == array.dtype
            assert again[name].shape == array.shape
            assert again[name].tobytes() == array.tobytes()

    def test_without_a_root_nothing_is_kept(self) -> None:
        cache = StageCache(None)
        cache.put("features", KEY, {"x": np.zeros(1)})
        assert cache.get("features", KEY) is None
        assert cache.sizes() == {}
        assert cache.clear() == (0, 0)

    @pytest.mark.parametrize(("stage", "key"), [("../x", KEY), ("", KEY), ("a", "../x"), ("a", "ABCDEF00"), ("A", KEY)])
    def test_names_cannot_leave_the_folder(self, tmp_path: Path, stage: str, key: str) -> None:
        with pytest.raises(ValueError, match="not a stage"):
            StageCache(tmp_path).path(stage, key)

    def test_any_damaged_byte_is_harmless(self, tmp_path: Path) -> None:
        arrays = {"points": np.arange(4, dtype=np.float32), "ids": np.array([7], dtype=np.int16)}
        cache = StageCache(tmp_path)
        cache.put("features", KEY, arrays)
        path = cache.path("features", KEY)
        whole = path.read_bytes()
        for position in range(len(whole)):
            damaged = bytearray(whole)
            damaged[position] ^= 0xFF
            path.write_bytes(damaged)
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                again = cache.get("features", KEY)
            if again is not None:  # a byte without meaning, such as the time of day
                assert {name: array.tobytes() for name, array in again.items()} == {
                    name: array.tobytes() for name, array in arrays.items()
                }, position
                assert all(again[name].dtype == arrays[name].dtype for name in arrays)
            else:
                assert not path.exists()


WRITER = textwrap.dedent("""
    import sys
    from pathlib import Path
    import numpy as np
    from fieldkit.cache import StageCache, digest
    cache = StageCache(Path(sys.argv[1]))
    print("ready", flush=True)
    for turn in range(int(sys.argv[2])):
        cache.put("features", digest(turn % 3), {"x": np.full(200_000, turn % 3)})
    print("done", flush=True)
""")


def _writer(root: Path, turns: int) -> subprocess.Popen[str]:
    return subprocess.Popen([sys.executable, "-c", WRITER, str(root), str(turns)], stdout=subprocess.PIPE, text=True)


class TestProcesses:
    def test_killed_while_writing(self, tmp_path: Path) -> None:
        """Whatever the moment, a reader then finds a whole entry or none, and the rest is swept up later."""
        cache = StageCache(tmp_path)
        for delay in (0.0, 0.003, 0.01, 0.02, 0.05):
            with _writer(tmp_path, 1_000_000) as process:
                process.stdout.readline()
                time.sleep(delay)
                process.send_signal(signal.SIGKILL)
            for turn in range(3):
                entry = cache.get("features", digest(turn))
                assert entry is None or (entry["x"] == turn).all()
        for partial in tmp_path.rglob("*.partial"):
            os.utime(partial, (0, 0))
        cache.prune()
        assert not list(tmp_path.rglob("*.partial"))

    def test_two_write_the_same_key(self, tmp_path: Path) -> None:
        cache = StageCache(tmp_path)
        with _writer(tmp_path, 60) as first, _writer(tmp_path, 60) as second:
            while first.poll() is None or second.poll() is None:
                for turn in range(3):
                    entry = cache.get("features", digest(turn))
                    assert entry is None or (entry["x"] == turn).all()
        assert first.returncode == second.returncode == 0
        assert cache.sizes()["features"].entries == 3
        assert not list(tmp_path.rglob("*.partial"))


class TestPlacesThatCannotBeWritten:
    def test_full_disk(self, small_disk: Path) -> None:
        cache = StageCache(small_disk)
        cache.put("features", KEY, {"x": np.zeros(10)})
        with pytest.warns(CacheWarning, match=r"No space.*cache prune. makes room"):
            cache.put("features", OTHER, {"x": np.zeros(1 << 20)})
        cache.put("features", OTHER, {"x": np.zeros(1 << 20)})  # the second time without a word
        assert cache.get("features", OTHER) is None
        assert cache.get("features", KEY) is not None, "what is kept still serves"
        assert not list(small_disk.rglob("*.partial"))


class TestPruning:
    @pytest.fixture
    def cache(self, tmp_path: Path) -> StageCache:
        """Ten entries in two stages; entry i was used last i hours ago."""
        cache = StageCache(tmp_path)
        for hours in range(10):
            stage = "features" if hours % 2 else "matches"
            cache.put(stage, digest(hours), {"x": np.zeros(1000)})
            used = time.time() - 3600 * hours
            os.utime(cache.path(stage, digest(hours)), (used, used))
        return cache

    def test_by_size_the_longest_unused_first(self, cache: StageCache) -> None:
        assert cache.get("features", digest(9)) is not None  # used just now
        removed = cache.prune(max_bytes=30_000)
        assert removed.entries == 7
        assert sum(size.bytes for size in cache.sizes().values()) <= 30_000
        assert cache.get("features", digest(9)) is not None
        assert cache.get("matches", digest(8)) is None

    def test_clear_takes_only_what_is_ours(self, cache: StageCache, tmp_path: Path) -> None:
        mine = [tmp_path / "notes.txt", tmp_path / "features" / "a.txt", tmp_path / "features" / "ab" / "x.npz"]
        for path in mine:
            path.parent.mkdir(exist_ok=True)
            path.write_text("mine")
        assert cache.clear().entries == 10
        assert cache.sizes() == {}
        assert [path for path in sorted(tmp_path.rglob("*")) if path.is_file()] == sorted(mine)
        assert not (tmp_path / "matches").exists()


def test_default_root(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("FIELDKIT_CACHE", str(tmp_path))
    assert default_cache_root() == tmp_path
    monkeypatch.delenv("FIELDKIT_CACHE")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "xdg"))
    assert default_cache_root() == tmp_path / "xdg" / "fieldkit"
