"""References of photographs whose poses another program found, and our own model read back."""

import shutil
from pathlib import Path

import pytest

from fieldkit.captures.programs import METRES, PosesFile, read_result
from fieldkit.errors import ReconstructionError
from fieldkit.evaluation.evaluate import evaluate
from fieldkit.evaluation.reference import build_reference
from fieldkit.evaluation.settings import EvaluationSettings
from fieldkit.geometry import Pose
from fieldkit.results.evaluation import ReferenceReport
from fieldkit.runtime.context import Context
from tests.captures.programs.known_set import apart, moved, some_motion, write_colmap

pytestmark = pytest.mark.slow
PHOTOGRAPHS = Path(__file__).parents[1] / "data" / "small_plot"
DRAFT = EvaluationSettings(fidelity="draft")


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, ReferenceReport]:
    folder = tmp_path_factory.mktemp("reference") / "ref"
    return folder, build_reference(PHOTOGRAPHS, folder, DRAFT, context=Context(), scene=False)


@pytest.fixture
def bare(tmp_path: Path) -> Path:
    """The photographs alone, of which blind mapping makes next to nothing."""
    folder = tmp_path / "photographs"
    folder.mkdir()
    for path in PHOTOGRAPHS.glob("*.jpg"):
        shutil.copy(path, folder)
    return folder


def poses_of(report: ReferenceReport) -> dict[str, Pose]:
    return {image.name: pose for image in report.image_reports if (pose := image.pose) is not None}


def test_our_own_model_reads_back_with_the_same_poses(built: tuple[Path, ReferenceReport]) -> None:
    folder, report = built
    found = read_result(PosesFile(folder / "model", METRES))
    distance, angle = apart(found.poses, poses_of(report))
    assert distance < 1e-9
    assert angle < 1e-6
    (camera,) = found.cameras
    assert camera.intrinsics.params == report.cameras[0].params


def test_a_model_without_scale_registers_all_photographs_and_claims_no_metres(built, bare, tmp_path) -> None:
    model = read_result(PosesFile(built[0] / "model"))
    write_colmap(bare / "sparse" / "0", moved(model.poses, some_motion()), model.cameras[0].intrinsics)
    report = build_reference(bare, tmp_path / "out", DRAFT, context=Context(), scene=False)
    assert (report.method, report.registered, report.right) == ("prior", 8, 8)
    assert not report.metric
    assert (report.metric_source, report.pose_rms_m, report.position_bound_m) == ("none", None, None)
    assert all(image.position_residual_m is None for image in report.image_reports)
    assert any("no metric source" in note for note in report.frame.notes)
    with pytest.raises(ReconstructionError, match="no metric scale"):
        evaluate_with(bare, built[0], tmp_path / "scores")


def evaluate_with(photographs: Path, reference: Path, output: Path, poses: PosesFile | None = None) -> float | None:
    report = evaluate(photographs, output, DRAFT, reference=reference, poses=poses, context=Context())
    (plot,) = report.plots
    if plot.error is not None:
        raise ReconstructionError(plot.error.message)
    return plot.chamfer_m
