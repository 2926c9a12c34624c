"""The Dask executor on a local cluster, one of whose workers is killed in the middle."""

import os
import signal
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from fieldkit.errors import UsageError
from fieldkit.planning.objective.evaluation import Evaluation
from fieldkit.planning.run.loop import Evaluations, Job
from fieldkit.planning.space.cameras import Cameras
from fieldkit.runtime.cluster import TRUSTED, Cluster, check_scheduler
from fieldkit.runtime.executor import open_executor
from fieldkit.runtime.worker import Limits, NoWorkersError, WorkerError
from tests.planning.bowl import here
from tests.planning.traps import REFUSE, SEGFAULT, SLOW, Trap, job_cameras

distributed = pytest.importorskip("distributed", reason="Dask is not installed (pip install 'fieldkit[cluster]')")
pytestmark = [pytest.mark.slow, pytest.mark.filterwarnings("ignore")]


@pytest.fixture
def client() -> Iterator[Any]:
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        with distributed.Client(cluster) as connected:
            yield connected


@contextmanager
def on(client: Any, folder: Path) -> Iterator[Evaluations]:
    with Cluster(client, make=partial(Trap, folder), limits=Limits(seconds=60.0)) as cluster:
        yield Evaluations(cluster)


def evaluate_all(evaluations: Evaluations, cameras: Sequence[Cameras], seed: int | None = None) -> list[Evaluation]:
    return list(evaluations.each(Job(each, seed) for each in cameras))


def test_results_are_those_of_this_process(tmp_path: Path, client: Any) -> None:
    jobs = [job_cameras(x) for x in (SLOW, 1.0, 2.0, 3.0)]
    with on(client, tmp_path) as pool:
        assert evaluate_all(pool, jobs, seed=2) == evaluate_all(here(Trap(tmp_path)), jobs, seed=2)
        with pytest.raises(UsageError, match="cannot be had"):
            evaluate_all(pool, [job_cameras(REFUSE)])


def test_a_killed_worker_costs_nothing(tmp_path: Path, client: Any) -> None:
    with on(client, tmp_path) as pool:
        results = pool.each([Job(job_cameras(SLOW), seed) for seed in range(8)])
        first = next(results)
        os.kill(next(iter(client.run(os.getpid).values())), signal.SIGKILL)
        found = [first, *results]
    assert [e.value_m for e in found] == [first.value_m + k for k in range(8)]
    assert all(e.measured for e in found)


def test_what_always_kills_its_worker_is_recorded_as_failed(tmp_path: Path, client: Any) -> None:
    with on(client, tmp_path) as pool:
        good, broken = evaluate_all(pool, [job_cameras(1.0), job_cameras(SEGFAULT)])
    assert good.measured
    assert not broken.measured
    assert "KilledWorker" in broken.failure


def test_a_call_that_takes_too_long_ends_its_worker(client: Any) -> None:
    with Cluster(client, limits=Limits(seconds=1.0)) as cluster:
        assert list(cluster.map(abs, [-1, 2])) == [1, 2]
        with pytest.raises(WorkerError, match="KilledWorker"):
            cluster.submit(time.sleep, 600).result()


def test_a_scheduler_that_is_not_there_is_told() -> None:
    with pytest.raises(NoWorkersError, match="cannot reach"), open_executor(1, "tcp://127.0.0.1:1"):
        pass


REACHED = {
    "tcp://127.0.0.1:8786": True,
    "tcp://[::1]:8786": True,
    "localhost:8786": True,
    "tls://field.lab:8786": True,
    "tcp://10.0.0.7:8786": False,
    "field.lab:8786": False,
    "ws://field.lab:80": False,
}


@pytest.mark.parametrize(("scheduler", "taken"), REACHED.items())
def test_other_machines_are_reached_by_tls_unless_that_is_wished(monkeypatch, scheduler: str, taken: bool) -> None:
    monkeypatch.delenv(TRUSTED, raising=False)
    if not taken:
        with pytest.raises(UsageError, match="without TLS"):
            check_scheduler(scheduler)
        monkeypatch.setenv(TRUSTED, "1")
    check_scheduler(scheduler)
