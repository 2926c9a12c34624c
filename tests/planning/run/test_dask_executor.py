"""The Dask executor on a local cluster, one of whose workers is killed in the middle."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from fieldkit.errors import UsageError
from fieldkit.planning.run.executor import Job, SerialExecutor, evaluate_all
from tests.planning.traps import EXIT, REFUSE, SLOW, Trap, job_cameras

distributed = pytest.importorskip("distributed", reason="Dask is not installed (pip install 'fieldkit[cluster]')")
pytestmark = [pytest.mark.slow, pytest.mark.filterwarnings("ignore")]


@pytest.fixture
def client() -> Iterator[Any]:
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        with distributed.Client(cluster) as connected:
            yield connected


def test_results_are_those_of_this_process(tmp_path: Path, client: Any) -> None:
    from fieldkit.planning.run.dask_executor import DaskExecutor

    jobs = [job_cameras(x) for x in (SLOW, 1.0, 2.0, 3.0)]
    with DaskExecutor(Trap(tmp_path), client) as executor, SerialExecutor(Trap(tmp_path)) as serial:
        assert evaluate_all(executor, jobs, seed=2) == evaluate_all(serial, jobs, seed=2)
        with pytest.raises(UsageError, match="cannot be had"):
            evaluate_all(executor, [job_cameras(REFUSE)])


def test_a_killed_worker_costs_nothing(tmp_path: Path, client: Any) -> None:
    from fieldkit.planning.run.dask_executor import DaskExecutor

    with DaskExecutor(Trap(tmp_path), client) as executor:
        results = executor.run([Job(job_cameras(SLOW), seed) for seed in range(8)])
        first = next(results)
        os.kill(next(iter(client.run(os.getpid).values())), signal.SIGKILL)
        found = [first, *results]
    assert [e.value_m for e in found] == [first.value_m + k for k in range(8)]
    assert all(e.measured for e in found)


def test_what_always_kills_its_worker_is_recorded_as_failed(tmp_path: Path, client: Any) -> None:
    from fieldkit.planning.run.dask_executor import DaskExecutor

    with DaskExecutor(Trap(tmp_path), client) as executor:
        good, broken = evaluate_all(executor, [job_cameras(1.0), job_cameras(EXIT)])
    assert good.measured
    assert not broken.measured
    assert "KilledWorker" in broken.failure


def test_workers_with_many_threads_are_refused(tmp_path: Path) -> None:
    from fieldkit.planning.run.dask_executor import DaskExecutor

    with distributed.LocalCluster(n_workers=1, threads_per_worker=2, dashboard_address=None) as cluster:
        with distributed.Client(cluster) as connected, pytest.raises(UsageError, match="one thread"):
            DaskExecutor(Trap(tmp_path), connected)
