"""Worker processes: what breaks costs its own evaluation only, and nothing stays behind."""

import os
import signal
import subprocess
import sys
import textwrap
import time
from collections.abc import Sequence
from pathlib import Path

import psutil
import pytest

from fieldkit.errors import InputError, UsageError
from fieldkit.planning.objective.evaluation import Evaluation
from fieldkit.planning.run.loop import Evaluations, Job, evaluating
from fieldkit.planning.space.cameras import Cameras
from fieldkit.runtime.context import Context
from fieldkit.runtime.worker import Limits
from tests.planning.traps import GROW, HANG, RAISE, REFUSE, SEGFAULT, Trap, job_cameras


def evaluate_all(evaluations: Evaluations, cameras: Sequence[Cameras], seed: int | None = None) -> list[Evaluation]:
    return list(evaluations.each(Job(each, seed) for each in cameras))


@pytest.mark.parametrize(
    ("seconds", "reasons"),
    [
        # Only what hangs is stopped by the clock: a busy machine takes longer than that to fill its memory.
        (1.5, {HANG: "longer than 1.5 s"}),
        pytest.param(
            60.0,
            {SEGFAULT: "SIGSEGV", GROW: "GiB of memory", RAISE: "RuntimeError: a bug"},
            marks=pytest.mark.slow,
        ),
    ],
)
def test_what_breaks_costs_itself_only(tmp_path: Path, seconds: float, reasons: dict[float, str]) -> None:
    with evaluating(Trap(tmp_path), Context(), Limits(seconds, memory_bytes=700 << 20)) as pool:
        first, *broken, last = evaluate_all(pool, [job_cameras(x) for x in (1.0, *reasons, 2.0)])
        after = evaluate_all(pool, [job_cameras(5.0)])
    assert (first.value_m, last.value_m, after[0].value_m) == (3.0, 4.0, 7.0)
    attempts = (tmp_path / "attempts").read_text().split()
    for (trap, reason), found in zip(reasons.items(), broken, strict=True):
        assert not found.measured
        assert reason in found.failure
        assert found.value_m == 0.2
        # A worker's death may be luck, a bug is not.
        assert attempts.count(f"{trap:g}") == (1 if trap == RAISE else 2)


def test_errors_for_people_come_through(tmp_path: Path) -> None:
    with evaluating(Trap(tmp_path), Context()) as pool:
        with pytest.raises(UsageError, match="cannot be had"):
            evaluate_all(pool, [job_cameras(REFUSE), job_cameras(1.0)])
        assert evaluate_all(pool, [job_cameras(1.0)])[0].value_m == 3.0  # and the pool can be used again
    with (
        evaluating(Trap(tmp_path, unusable=True), Context()) as pool,
        pytest.raises(InputError, match="rendered"),
    ):
        evaluate_all(pool, [job_cameras(1.0)])


@pytest.mark.parametrize("ending", [signal.SIGINT, signal.SIGKILL])
def test_no_orphans_when_the_parent_ends(tmp_path: Path, ending: signal.Signals) -> None:
    script = tmp_path / "run.py"
    script.write_text(
        textwrap.dedent(
            f"""
            from pathlib import Path
            from fieldkit.planning.run.loop import Job, evaluating
            from fieldkit.runtime.context import Context
            from tests.planning.traps import HANG, Trap, job_cameras

            if __name__ == "__main__":
                with evaluating(Trap(Path({str(tmp_path)!r})), Context(workers=1)) as pool:
                    list(pool.each([Job(job_cameras(HANG))]))
            """
        )
    )
    root = Path(__file__).parents[3]
    environment = os.environ | {"PYTHONPATH": str(root)}
    parent = subprocess.Popen(
        [sys.executable, str(script)], env=environment, stderr=subprocess.DEVNULL, start_new_session=True
    )
    attempts = tmp_path / "attempts"
    with parent:
        try:
            wait_until(lambda: attempts.exists() and attempts.read_text())
            workers = [int(path.name.removeprefix("worker-")) for path in tmp_path.glob("worker-*")]
            assert len(workers) == 1
            if ending == signal.SIGINT:
                os.killpg(parent.pid, signal.SIGINT)  # as a terminal does: to the whole group
            else:
                parent.kill()
            assert parent.wait(60) != 0
            wait_until(lambda: not any(psutil.pid_exists(pid) for pid in workers))
        finally:
            parent.kill()


def wait_until(done: object, seconds: float = 60.0) -> None:
    until = time.monotonic() + seconds
    while not done():
        assert time.monotonic() < until, "took too long"
        time.sleep(0.1)
