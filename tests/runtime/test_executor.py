import math
import os
import pickle
import signal
import subprocess
import sys
import textwrap
import time
import warnings
from contextlib import suppress
from functools import partial
from pathlib import Path

import pytest

from fieldkit.cache import CacheWarning
from fieldkit.errors import UsageError
from fieldkit.runtime.executor import Processes, map_parallel, map_threads
from fieldkit.runtime.worker import WorkerError

LIMIT_S = 120.0


def job(number: int) -> tuple[int, int]:
    if number == 3:
        os.kill(os.getpid(), signal.SIGKILL)
    if number == 4:
        os._exit(7)
    return os.getpid(), number * number


class Unpicklable(Exception):
    """Its arguments are not those of its class."""

    def __init__(self, one: int, two: int) -> None:
        super().__init__(f"{one} and {two}")


def raising(number: int) -> int:
    if number == 1:
        raise UsageError("not this one", remedy="Take another.")
    if number == 2:
        raise Unpicklable(1, 2)
    return number


def threads_of(_: int) -> list[int]:
    from threadpoolctl import threadpool_info

    return [pool["num_threads"] for pool in threadpool_info()]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("print(map_parallel(abs, [1, -2], workers=2))", "UsageError"),
        ("Context(workers=2)", "UsageError"),
        ("print(map_parallel(abs, [1, -2], workers=1))", "[1, 2]"),
        ("if __name__ == '__main__':\n    print(map_parallel(abs, [1, -2], workers=2))", "[1, 2]"),
    ],
)
def test_a_script_without_a_main_guard_is_told_at_once(tmp_path: Path, text: str, said: str) -> None:
    file = tmp_path / "script.py"
    head = "from fieldkit.runtime.context import Context\nfrom fieldkit.runtime.executor import map_parallel\n"
    file.write_text(f"{head}{text}\n")
    done = subprocess.run([sys.executable, str(file)], capture_output=True, text=True, timeout=LIMIT_S)
    assert said in done.stdout + done.stderr
    assert done.stderr.count("Traceback") == (said == "UsageError")  # no worker was started
    assert ("or give workers=1" in done.stderr) == (said == "UsageError")


@pytest.mark.parametrize("mapper", [map_parallel, map_threads])
@pytest.mark.parametrize("workers", [1, 2, 5])
def test_results_keep_the_order_of_the_items_whatever_the_workers(mapper, workers) -> None:
    advanced: list[int] = []
    assert mapper(math.factorial, [5, 1, 3], workers=workers, advance=advanced.append) == [120, 1, 6]
    assert advanced == [1, 1, 1]


def test_errors_come_from_workers_as_they_are_or_in_words_with_where_they_were_raised() -> None:
    with pytest.raises(UsageError, match="not this one") as caught:
        map_parallel(raising, [1, 3], workers=2)
    assert caught.value.remedy == "Take another."
    assert "in raising" in caught.value.__notes__[0]
    with pytest.raises(RuntimeError, match="Unpicklable: 1 and 2"):
        map_parallel(raising, [2, 3], workers=2)


def test_a_state_that_cannot_be_sent_is_an_error_of_every_call() -> None:
    with (
        Processes(1, make=lambda: 1) as executor,
        pytest.raises((AttributeError, pickle.PicklingError), match="lambda"),
    ):
        executor.submit(abs, 1).result()


def test_a_worker_that_dies_in_a_map_is_told_in_words() -> None:
    with pytest.raises(WorkerError, match="ended by SIGKILL"):
        map_parallel(job, [1, 3], workers=2)


def test_workers_compute_on_one_thread() -> None:
    for found in map_parallel(threads_of, [1, 2], workers=2):
        assert set(found) <= {1}


def test_what_is_being_written_when_a_map_breaks_off_is_finished(tmp_path: Path) -> None:
    with pytest.raises(UsageError):
        map_parallel(slow_or_raising, [(tmp_path, True), (tmp_path, False)], workers=2)
    assert (tmp_path / "written").is_file()


def slow_or_raising(item: tuple[Path, bool]) -> None:
    folder, writes = item
    if writes:
        (folder / "begun").touch()
        time.sleep(0.5)
        (folder / "written").touch()
        return
    while not (folder / "begun").is_file():
        time.sleep(0.01)
    raise UsageError("no file")


@pytest.mark.skipif(not hasattr(signal, "pthread_sigmask"), reason="Ctrl-C is another thing here")
def test_ctrl_c_while_workers_start_is_the_parents_alone(tmp_path: Path) -> None:
    """In a terminal it reaches all processes; one that imported ended with a traceback of its own."""
    module = tmp_path / "importing.py"
    module.write_text(
        textwrap.dedent("""
        import sys, time
        from pathlib import Path
        from fieldkit.runtime.executor import Processes

        if __name__ == "__mp_main__":
            Path(sys.argv[1]).touch()
            time.sleep(0.5)

        if __name__ == "__main__":
            try:
                with Processes(2) as executor:
                    executor.submit(abs, 1).result()
            except KeyboardInterrupt:
                print("interrupted")
    """)
    )
    begun = tmp_path / "begun"
    process = subprocess.Popen(
        [sys.executable, str(module), str(begun)],
        start_new_session=True,
        text=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )
    give_up = time.monotonic() + LIMIT_S
    while not begun.is_file() and time.monotonic() < give_up:
        time.sleep(0.02)
    os.killpg(process.pid, signal.SIGINT)
    out, err = process.communicate(timeout=LIMIT_S)
    assert (out, err) == ("interrupted\n", "")


def test_a_worker_that_dies_costs_its_job_only() -> None:
    with Processes(2) as executor:
        futures = {number: executor.submit(job, number) for number in (1, 2, 3, 4, 5)}
    for number in (1, 2, 5):
        assert futures[number].result()[1] == number * number
    for number, words in ((3, r"ended by SIGKILL \(out of memory\?\)"), (4, "exit code 7")):
        with pytest.raises(WorkerError, match=words):
            futures[number].result()


def once(folder: Path, number: int) -> int:
    """Dies at the first attempt, next to others."""
    with suppress(FileExistsError):
        (folder / str(number)).touch(exist_ok=False)
        os._exit(7)
    return number


def test_a_call_whose_worker_died_is_repeated(tmp_path: Path) -> None:
    with Processes(2) as executor:
        assert list(executor.map(once, [tmp_path] * 3, [1, 2, 3])) == [1, 2, 3]
    with pytest.raises(RuntimeError, match="has ended"):
        executor.submit(abs, 1)


def made(folder: Path) -> list[int]:
    return [len(list(folder.iterdir()))]


def noted(own: list[int], number: int) -> tuple[int, int]:
    own.append(number)
    warnings.warn(CacheWarning(f"of {number}"), stacklevel=1)
    return id(own), len(own)


def test_every_worker_makes_its_state_once_and_its_warnings_come_with_results(tmp_path: Path) -> None:
    with Processes(1, make=partial(made, tmp_path)) as executor:
        futures = [executor.submit(noted, number) for number in (5, 6)]
        with pytest.warns(CacheWarning, match="of 5"):
            first, count = futures[0].result()
        assert futures[0].result() == (first, count) == (first, 2)
        with pytest.warns(CacheWarning, match="of 6"):
            assert futures[1].result() == (first, 3)
