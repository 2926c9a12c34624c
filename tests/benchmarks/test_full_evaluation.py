"""Both sides of a whole evaluation, on the demo's ten small renderings."""

from dataclasses import replace

import pytest

from benchmarks.full_evaluation import LENT, OURS, THEIRS, Case, ours, summary, theirs
from fieldkit.clouds import read_cloud
from fieldkit.clouds.volume import Volume
from fieldkit.geometry import Similarity
from fieldkit.geometry.priors import SourceFrame
from fieldkit.reconstruction.pipeline import KnownPlot
from fieldkit.runtime.progress import Silent
from fieldkit.scenes.library import find_scene
from fieldkit.scenes.renderer import RenderingError
from fieldkit.scenes.scene_file import read_scene
from fieldkit.scenes.simulate import CaptureNoise
from fieldkit_sim.simulation import ring_about, simulate


@pytest.fixture(scope="module")
def few(tmp_path_factory: pytest.TempPathFactory) -> Case:
    folder = tmp_path_factory.mktemp("demo")
    try:
        simulate(
            replace(read_scene(find_scene("demo")), noise=CaptureNoise(0.010, 1.0)),
            ring_about(10),
            folder / "few",
            truth_cloud=folder / "truth.ply",
        )
    except RenderingError as error:
        pytest.skip(f"no picture can be rendered here: {error}")
    truth = read_cloud(folder / "truth.ply")
    volume = Volume.around(truth.points, margin_m=0.03)
    plot = KnownPlot(SourceFrame("poses.csv", None, Similarity.identity()), volume, None)
    return Case("demo", folder / "few", plot, truth)


@pytest.mark.slow
def test_both_sides_reach_a_score(few: Case) -> None:
    first = ours(few, Silent())
    alone, *lent = theirs(few, Silent(), first.poses)
    assert (first.name, alone.name) == (OURS, THEIRS)
    assert first.right == 10
    assert first.refined_f_score > 0.8
    assert sum(first.stages.values()) == pytest.approx(first.cpu_s, rel=0.1)
    assert "poses" not in first.as_dict()
    assert alone.stages["Features"] > 0
    assert alone.right <= alone.registered <= 10
    assert (alone.f_score is None) == bool(alone.error) == bool(lent)
    for side in lent:
        assert side.name == LENT
        assert side.refined_f_score > 0.5
        assert side.cpu_s > alone.cpu_s
        assert {"Features", "Matching", "Mapping", "Dense stereo"} <= side.stages.keys()
    assert len(summary({"demo": (first, alone, *lent)}).rows) == 2 + len(lent)
