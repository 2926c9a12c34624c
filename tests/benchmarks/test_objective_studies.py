"""The objective's studies on a tiny plot: their structure and that their measures are right."""

import numpy as np
import pytest

from benchmarks.objective import ObjectiveOptions
from benchmarks.objective_cost import run_cost, run_throughput
from benchmarks.objective_noise import run_noise
from benchmarks.objective_ranks import Ranks, rank_table, run_ranks
from benchmarks.objective_scenes import TuningPlot, tuning_plot
from fieldkit.cache import StageCache
from fieldkit.planning.objective.evaluation import Evaluation, StageCost
from fieldkit.planning.objective.simulated import SimulatedSource
from fieldkit.planning.space.cameras import Cameras
from fieldkit.planning.space.envelope import Envelope
from fieldkit.runtime.progress import Silent
from fieldkit.scenes.library import find_scene
from fieldkit.scenes.renderer import Renderer, RenderingError
from fieldkit.scenes.scene_file import read_scene
from fieldkit_sim.simulation import ring
from tests.planning.conftest import small_proxy

NOTHING = ObjectiveOptions(None, StageCache(None))


def evaluation(value: float, cpu_s: float) -> Evaluation:
    times = (StageCost("Mapping", cpu_s - 1.0, 0.0), StageCost("Scoring", 1.0, 0.0))
    return Evaluation(value, value, 0.5 * value, 0.5 * value, {}, 13, 13, 12, 1, 100, "", (), times=times)


@pytest.fixture(scope="module")
def plot() -> TuningPlot:
    proxy = small_proxy()
    try:
        Renderer(proxy.scene).close()
    except RenderingError as error:
        pytest.skip(f"no picture can be rendered here: {error}")
    envelope = Envelope.around(proxy.reference, proxy.volume, margin_m=0.7, height_m=(0.8, 1.2), clearance_m=0.3)
    return TuningPlot(
        "small", SimulatedSource(proxy), envelope, Cameras.from_poses(ring(30, 1.1, 0.9, (0.15, 0.0, 0.2))[:5])
    )


def test_ranks_are_correlated() -> None:
    ranks = Ranks("s", (0.01, 0.02, 0.03), (0.02, 0.01, 0.03), ((0.01, 0.012), (0.02, 0.022)), (1.0, 2.0))
    assert ranks.spearman == pytest.approx(0.5)
    assert ranks.noise == pytest.approx(np.sqrt(0.002**2 / 2))
    assert ranks.spread == pytest.approx(0.01)
    (row,) = rank_table([ranks], ("draft", "fine")).rows
    assert row[:3] == ("s", "0.50", "10.0–30.0")
    assert row[6] == "0.14"


@pytest.mark.slow
def test_a_tuning_plot_is_as_its_scene_file_says() -> None:
    plot = tuning_plot("tuning-4")
    described = read_scene(find_scene("tuning-4"))
    assert plot.source.proxy.camera == described.camera
    assert (plot.source.noise, plot.source.effects) == (described.noise, described.camera_effects)
    assert plot.envelope.contains(plot.ring)


@pytest.mark.slow
def test_cost(plot: TuningPlot) -> None:
    result = run_cost(plot, ("draft",), repeats=1, progress=Silent())
    assert 0 < result.figures["cpu_s"]["draft"] < 60
    assert {row[0] for row in result.tables[0].rows} >= {"Rendering", "Mapping", "Scoring", "everything"}


@pytest.mark.slow
def test_throughput_gives_the_same_results_with_both_counts(plot: TuningPlot) -> None:
    result = run_throughput(plot, evaluations=2, progress=Silent())
    assert result.figures["equal"]
    assert [row[0] for row in result.tables[0].rows] == [1, 2]


@pytest.mark.slow
def test_ranks(plot: TuningPlot) -> None:
    result = run_ranks([plot], configurations=3, seeds=2, fidelities=("draft", "standard"), progress=Silent())
    figures = result.figures["small"]
    assert len(figures["cheap"]) == len(figures["fine"]) == 3
    assert [len(values) for values in figures["repeats"]] == [2, 2, 2]
    assert result.pictures["ranks.png"].startswith(b"\x89PNG")


@pytest.mark.slow
def test_noise(plot: TuningPlot) -> None:
    result = run_noise(
        plot, "draft", positions_m=(0.0, 0.05), angles_deg=(0.0,), grey_levels=(40.0,), seeds=2, progress=Silent()
    )
    rows = {(row[0], row[1]): row for row in result.tables[0].rows}
    assert len(rows) == 4
    values = {name: [e["value_m"] for e in es] for name, es in result.figures["position noise, mm"].items()}
    assert np.mean(values["50"]) > np.mean(values["0"])
    assert result.pictures["noise.png"].startswith(b"\x89PNG")
