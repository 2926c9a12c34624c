"""Both sides of a whole evaluation, on the demo's ten small renderings."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from fieldkit.benchmarks.full_evaluation import LENT, OURS, THEIRS, Case, ours, summary, theirs
from fieldkit.clouds import read_cloud
from fieldkit.clouds.volume import Volume
from fieldkit.geometry import Similarity
from fieldkit.progress import Silent
from fieldkit.reconstruction.known_poses import SourceFrame
from fieldkit.reconstruction.pipeline import KnownPlot
from fieldkit.scenes.demo import write_demo_captures
from fieldkit.scenes.renderer import RenderingError


@pytest.fixture(scope="module")
def few(tmp_path_factory: pytest.TempPathFactory) -> Case:
    try:
        captures = write_demo_captures(tmp_path_factory.mktemp("demo"))
    except RenderingError as error:
        pytest.skip(f"no picture can be rendered here: {error}")
    truth = read_cloud(captures.truth / "reference.ply")
    volume = Volume.around(truth.points, margin_m=0.03)
    plot = KnownPlot(SourceFrame("poses.csv", None, Similarity.identity()), volume, None)
    return Case("demo", captures.few, plot, truth)


@pytest.mark.slow
def test_both_sides_reach_a_score(few: Case) -> None:
    first, second = ours(few, Silent()), theirs(few, Silent())
    assert (first.name, second.name) == (OURS, THEIRS)
    assert first.right == 10
    assert first.refined_f_score is not None
    assert first.refined_f_score > 0.8
    assert sum(first.stages.values()) == pytest.approx(first.cpu_s, rel=0.1)
    assert second.stages["Features"] > 0
    assert second.right <= second.registered <= 10
    assert (second.f_score is None) == bool(second.error)
    assert len(summary({"demo": (first, second)}).rows) == 2


@pytest.mark.slow
def test_photographs_that_do_not_register_are_an_answer(few: Case, tmp_path: Path) -> None:
    folder = tmp_path / "two"
    shutil.copytree(few.folder, folder)
    for path in sorted(folder.glob("*.jpg"))[2:]:
        path.unlink()
    side = theirs(replace(few, folder=folder), Silent())
    assert side.f_score is None
    assert "registered" in side.error


@pytest.mark.slow
def test_a_baseline_that_does_not_register_is_lent_poses(few: Case) -> None:
    first = ours(few, Silent())
    lent = theirs(few, Silent(), first.poses)
    assert lent.name == LENT
    assert lent.refined_f_score is not None
    assert lent.refined_f_score > 0.5
    assert {"Features", "Matching", "Mapping", "Dense stereo"} <= lent.stages.keys()
    assert "poses" not in first.plain()
