"""Results appear whole or not at all."""

import errno
import os
import signal
import subprocess
import sys
import textwrap
from collections.abc import Callable
from pathlib import Path

import pytest

from fieldkit.errors import MetadataError, StorageError, UsageError
from fieldkit.files import atomic_folder, check_writable, file_beside, named_file, write_atomic


def names(folder: Path) -> list[str]:
    return sorted(place.name for place in folder.iterdir())


class TestAtomicFolder:
    def test_appears_only_when_complete(self, tmp_path: Path) -> None:
        target = tmp_path / "deep" / "reference"
        with atomic_folder(target) as folder:
            (folder / "a.txt").write_text("a")
            assert not target.exists()
            assert folder.parent == target.parent
        assert names(target) == ["a.txt"]
        assert names(target.parent) == ["reference"]

    def test_leaves_nothing_when_interrupted_before_the_block_begins(self, tmp_path, monkeypatch) -> None:
        def interrupt(*_: object) -> None:
            assert len(names(tmp_path)) == 1  # the folder is there already
            raise KeyboardInterrupt

        monkeypatch.setattr("fieldkit.files.lock", interrupt)
        with pytest.raises(KeyboardInterrupt), atomic_folder(tmp_path / "reference"):
            raise AssertionError("the block was entered")
        assert names(tmp_path) == []

    def test_refuses_an_existing_result_before_any_work(self, tmp_path: Path) -> None:
        (tmp_path / "old.txt").write_text("old")
        worked = False
        with pytest.raises(UsageError, match="exists already") as caught, atomic_folder(tmp_path):
            worked = True
        assert not worked
        assert "--overwrite" in caught.value.remedy
        assert names(tmp_path) == ["old.txt"]

    @pytest.mark.parametrize("can_exchange", [True, False])
    def test_overwrites_when_told_to(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, can_exchange: bool) -> None:
        if not can_exchange:
            monkeypatch.setattr("fieldkit.files._exchange", lambda a, b: False)
        target = tmp_path / "reference"
        for content in ("first", "second"):
            with atomic_folder(target, overwrite=True, marker="reference.json") as folder:
                if content == "second":
                    assert (target / "reference.json").read_text() == "first", "the old result stays meanwhile"
                (folder / "reference.json").write_text(content)
        assert (target / "reference.json").read_text() == "second"
        assert names(tmp_path) == ["reference"]

    def test_never_replaces_what_is_not_a_result(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        (tmp_path / "thesis.odt").write_text("years of work")
        with (
            pytest.raises(UsageError, match="not a result"),
            atomic_folder(tmp_path, overwrite=True, marker="reference.json"),
        ):
            pass
        monkeypatch.chdir(tmp_path)
        with pytest.raises(UsageError, match="will not replace"), atomic_folder(Path(), overwrite=True):
            pass
        monkeypatch.setenv("HOME", str(tmp_path))
        monkeypatch.chdir("/")
        with pytest.raises(UsageError, match="will not replace"), atomic_folder(Path("~"), overwrite=True):
            pass
        assert names(tmp_path) == ["thesis.odt"]

    def test_the_second_of_two_runs_learns_it_at_the_start(self, tmp_path: Path) -> None:
        target = tmp_path / "reference"
        with atomic_folder(target) as folder:
            (folder / "a.txt").write_text("first")
            with pytest.raises(UsageError, match="another run is writing"), atomic_folder(target, overwrite=True):
                raise AssertionError("the block was entered")
        assert (target / "a.txt").read_text() == "first"
        assert names(tmp_path) == ["reference"]

    def test_runs_whose_names_begin_alike_do_not_disturb_each_other(self, tmp_path: Path) -> None:
        one, other = tmp_path / f"{'x' * 60}-1", tmp_path / f"{'x' * 60}-2"
        with atomic_folder(one) as first, atomic_folder(other) as second:
            (first / "a.txt").write_text("1")
            (second / "a.txt").write_text("2")
        assert [(place / "a.txt").read_text() for place in (one, other)] == ["1", "2"]

    def test_longest_name(self, tmp_path: Path) -> None:
        target = tmp_path / ("ä" * 127)
        with atomic_folder(target) as folder:
            write_atomic(folder / ("é" * 127), "x")
        assert len(names(target)) == 1

    def test_places_that_cannot_be(self, tmp_path: Path) -> None:
        (tmp_path / "file").write_text("")
        with pytest.raises(UsageError, match="not a folder"), atomic_folder(tmp_path / "file", overwrite=True):
            pass
        for place, remedy in ((tmp_path / "file" / "reference", ""), (tmp_path / ("x" * 256), "shorter")):
            with pytest.raises(StorageError) as caught, atomic_folder(place):
                pass
            assert remedy in caught.value.remedy

    def test_killed_in_the_middle(self, tmp_path: Path) -> None:
        script = textwrap.dedent("""
            import sys, time
            from pathlib import Path
            from fieldkit.files import atomic_folder
            with atomic_folder(Path(sys.argv[1])) as folder:
                (folder / "a.txt").write_text("half")
                print("ready", flush=True)
                time.sleep(60)
        """)
        target = tmp_path / "reference"
        with subprocess.Popen([sys.executable, "-c", script, str(target)], stdout=subprocess.PIPE) as process:
            process.stdout.readline()
            with pytest.raises(UsageError, match="another run"), atomic_folder(target):
                pass
            assert len(names(tmp_path)) == 1, "a living run's folder is left alone"
            process.send_signal(signal.SIGKILL)
        assert len(names(tmp_path)) == 1
        with atomic_folder(target) as folder:
            (folder / "a.txt").write_text("next")
        assert names(tmp_path) == ["reference"], "the dead run's folder is removed"


class TestWriteAtomic:
    def test_writes_text_and_bytes(self, tmp_path: Path) -> None:
        write_atomic(tmp_path / "sub" / "a.txt", "µ")
        write_atomic(tmp_path / "sub" / "b.bin", b"\xff")
        assert (tmp_path / "sub" / "a.txt").read_bytes() == "µ".encode()
        assert (tmp_path / "sub" / "b.bin").read_bytes() == b"\xff"
        assert names(tmp_path / "sub") == ["a.txt", "b.bin"]

    def test_respects_the_umask(self, tmp_path: Path) -> None:
        before = os.umask(0o027)
        try:
            write_atomic(tmp_path / "a.txt", "a")
        finally:
            os.umask(before)
        assert (tmp_path / "a.txt").stat().st_mode & 0o777 == 0o640


def _make_folder(path: Path, data: bytes = b"") -> None:
    with atomic_folder(path) as folder:
        (folder / "cloud.ply").write_bytes(data)


class TestStorageErrors:
    @pytest.mark.parametrize("write", [_make_folder, write_atomic])
    def test_full_disk(self, small_disk: Path, write: Callable[[Path, bytes], None]) -> None:
        """Every writer of the package goes through one of these two; nothing half written is left."""
        with pytest.raises(StorageError) as caught:
            write(small_disk / "reference", bytes(8 << 20))
        assert "space" in str(caught.value).lower()
        assert "Free some space" in caught.value.remedy
        assert names(small_disk) == []

    def test_unwritable_folder(self, unwritable: Path) -> None:
        for act in (check_writable, lambda path: write_atomic(path / "a", ""), _make_folder):
            with pytest.raises(StorageError) as caught:
                act(unwritable / "reference")
            assert caught.value.remedy
        assert names(unwritable) == []

    def test_unreadable_input_is_not_blamed_on_the_output(self, tmp_path: Path) -> None:
        with pytest.raises(PermissionError), atomic_folder(tmp_path / "out" / "reference"):
            raise PermissionError(errno.EACCES, "Permission denied", str(tmp_path / "photos" / "a.jpg"))

    @pytest.mark.skipif(not Path("/proc/self").exists(), reason="there is no folder that takes no files")
    def test_a_home_that_does_not_exist(self) -> None:
        with pytest.raises(StorageError, match="cannot write"):
            check_writable(Path("/proc/nobody/.cache"))


def test_a_named_file_lies_in_its_owners_folder_or_is_named_absolutely(tmp_path: Path) -> None:
    owner = tmp_path / "site" / "site.toml"
    (owner.parent / "deep").mkdir(parents=True)
    (owner.parent / "out").symlink_to(tmp_path)
    folder = owner.parent.resolve()
    assert file_beside(Path("deep/../a.json"), owner) == folder / "a.json"
    assert file_beside(tmp_path / "a.json", owner) == tmp_path / "a.json"
    for name in ("../a.json", "deep/../../a.json", "out/a.json"):
        assert file_beside(Path(name), owner) is None
        with pytest.raises(MetadataError, match=f"plan: {name} leads out of the scene's folder"):
            named_file(name, owner, "plan", what="scene")
    for name in ("", "a\0", "a" * 1001):
        with pytest.raises(MetadataError, match="plan: is not a path"):
            named_file(name, owner, "plan", what="site file")
