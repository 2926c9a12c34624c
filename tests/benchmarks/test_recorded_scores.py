"""The recorded and proxy studies: who may judge whom, their tables, and small runs on real photographs."""

import os
from pathlib import Path

import numpy as np
import pytest

import benchmarks.recorded_scores as module
from benchmarks.proxy_scores import run_proxy, view_sets
from benchmarks.recorded_scores import run_recorded, witnessed_cloud
from fieldkit.cache import StageCache
from fieldkit.captures import read_capture
from fieldkit.clouds import score
from fieldkit.geometry import Similarity
from fieldkit.geometry.priors import SourceFrame
from fieldkit.reconstruction.pipeline import KnownPlot, reconstruct
from fieldkit.reconstruction.settings import ReconstructionSettings
from fieldkit.runtime.context import Context
from fieldkit.runtime.progress import Silent
from fieldkit.scenes.renderer import RenderingError

DATA = Path(os.environ.get("FIELDKIT_DATA", ""))
needs_data = pytest.mark.skipif("FIELDKIT_DATA" not in os.environ, reason="FIELDKIT_DATA names no recorded sets")
SMALL_PLOT = Path(__file__).parents[1] / "data" / "small_plot"


@pytest.mark.slow
def test_witnesses_alone_make_the_truth(monkeypatch: pytest.MonkeyPatch) -> None:
    capture, cache = read_capture(SMALL_PLOT), StageCache(None)
    whole = reconstruct(capture, ReconstructionSettings(), context=Context(cache))
    plot = KnownPlot(SourceFrame("poses.csv", None, Similarity.identity()), whole.volume, whole.sparse.frame.ground)
    seen: list[str] = []
    prepare = module.prepare_view

    def watched(name: str, *rest: object) -> object:
        seen.append(name)
        return prepare(name, *rest)

    monkeypatch.setattr(module, "prepare_view", watched)
    names = capture.names[::2]
    cloud = witnessed_cloud(capture, names, plot, cache, Silent())
    assert seen == list(names)
    assert len(cloud) > 300
    assert plot.volume.contains(cloud.points).all()
    assert score(whole.plants, cloud).chamfer.accuracy_m < 0.01


def test_view_sets_are_distinct_and_of_one_size() -> None:
    for count, views in ((79, 13), (60, 13), (60, 8)):
        sets = view_sets(count, views)
        assert len(sets) == 10
        assert {len(set(index.tolist())) for index in sets.values()} == {views}
        assert all(index.min() >= 0 and index.max() < count for index in sets.values())
        assert len({tuple(index) for index in sets.values()}) == 10
    gaps = {name: np.diff(index).max() for name, index in view_sets(79, 13).items()}
    assert gaps["ring"] <= 7 < gaps["two clumps"]
    with pytest.raises(ValueError, match="little to choose"):
        view_sets(20, 13)


@needs_data
@pytest.mark.slow
def test_recorded_on_real_photographs(tmp_path: Path) -> None:
    result = run_recorded(
        DATA,
        rig_name="arabidopsis_rig",
        subsets=2,
        views=10,
        fidelity="draft",
        cache=StageCache(tmp_path),
        progress=Silent(),
    )
    figures = result.figures
    assert not set(figures["candidates"]) & set(figures["witnesses"])
    assert all(set(subset) <= set(figures["candidates"]) for subset in figures["subsets"])
    assert figures["truth_points"] > 1000
    assert all(0 < e["value_m"] <= 0.2 for e in figures["evaluations"])
    assert result.pictures["recorded.png"].startswith(b"\x89PNG")


@needs_data
@pytest.mark.slow
def test_proxy_on_real_photographs(tmp_path: Path) -> None:
    try:
        result = run_proxy(
            DATA,
            rig_name="arabidopsis_rig",
            fidelities=("draft",),
            sets=("ring", "neighbours"),
            cache=StageCache(tmp_path),
            progress=Silent(),
        )
    except RenderingError as error:
        pytest.skip(f"no picture can be rendered here: {error}")
    values = result.figures["values_m"]
    assert set(values) == {"photographs", "photographs, poses of all", "proxy, draft"}
    assert all(len(each) == 2 and 0 < min(each) <= max(each) <= 0.2 for each in values.values())
