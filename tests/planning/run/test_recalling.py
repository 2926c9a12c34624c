"""What other runs evaluated is not evaluated again."""

from __future__ import annotations

from pathlib import Path

import pytest

from fieldkit.planning.run.executor import Job, SerialExecutor
from fieldkit.planning.run.folder import LogEntry, create_run, open_run
from fieldkit.planning.run.loop import confirm, search
from fieldkit.planning.run.recalling import Recalling
from tests.planning.bowl import Bowl, bowl_problem, bowl_settings
from tests.planning.run.test_loop import Greedy, ignore, never, plain


def finished(folder: Path, known: list[LogEntry], counted: Path | None = None) -> list[LogEntry]:
    with create_run(folder, bowl_settings()) as run, SerialExecutor(Bowl(counted, noise_m=0.1)) as serial:
        executor = Recalling(serial, known, run.settings.fidelity)
        search(Greedy(bowl_problem()), executor, run, out_of_time=never, watch=ignore)
        confirm(Greedy(bowl_problem()), executor, run, watch=ignore)
        return list(run.entries)


def test_a_run_that_knows_everything_evaluates_nothing_and_logs_the_same(tmp_path: Path) -> None:
    first = finished(tmp_path / "first", [])
    (tmp_path / "counted").mkdir()
    again = finished(tmp_path / "again", first, tmp_path / "counted")
    assert plain(again) == plain(first)
    assert not (tmp_path / "counted" / "evaluated").exists()
    assert [e.cpu_s for e in again] == [e.cpu_s for e in first]
    with open_run(tmp_path / "again") as run:
        assert plain(run.entries) == plain(first)


@pytest.mark.parametrize("differs", ["cameras", "seed", "fidelity"])
def test_only_the_same_job_is_known(tmp_path: Path, differs: str) -> None:
    entry = finished(tmp_path / "run", [])[0]
    job = Job(entry.trial.cameras, entry.seed)
    other = {
        "cameras": Job(bowl_problem().sample(999), entry.seed),
        "seed": Job(job.cameras, entry.seed + 1),
        "fidelity": Job(job.cameras, entry.seed, "fine"),
    }[differs]
    with SerialExecutor(Bowl(tmp_path, noise_m=0.1)) as serial, Recalling(serial, [entry], entry.fidelity) as executor:
        assert list(executor.run([other, job]))[1] == entry.evaluation
    assert len((tmp_path / "evaluated").read_text().splitlines()) == 1


def test_cancelling_forgets_what_waits(tmp_path: Path) -> None:
    entry = finished(tmp_path / "run", [])[0]
    with SerialExecutor(Bowl()) as serial, Recalling(serial, [entry], entry.fidelity) as executor:
        executor.submit(Job(entry.trial.cameras, entry.seed))
        executor.submit(Job(bowl_problem().sample(7), 0))
        executor.cancel()
        assert executor.collect() == []
        assert executor.submit(Job(entry.trial.cameras, entry.seed)) == 2
        assert [ticket for ticket, _ in executor.collect()] == [2]
