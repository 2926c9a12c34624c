"""fieldkit demo: a rendered plot, its reference, and a few-view capture scored against it."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from fieldkit.cache import StageCache
from fieldkit.clouds import CloudScore, read_cloud, score
from fieldkit.evaluation.evaluate import evaluate_captures
from fieldkit.evaluation.reference import CLOUD_FILE, build_reference
from fieldkit.evaluation.schema import EvaluationReport, ReferenceReport
from fieldkit.files import atomic_folder, write_atomic
from fieldkit.geometry import Similarity
from fieldkit.progress import Progress
from fieldkit.reconstruction.features import FeatureSettings
from fieldkit.reconstruction.prior_mapping import PriorMappingSettings
from fieldkit.reconstruction.settings import ReconstructionSettings
from fieldkit.scenes.demo import write_demo_captures

DEMO_FILE = "demo.json"
# The photographs are small and their poses well known: half the features and neighbours are enough (all 30 right, 8 mm
# RMS from the commanded poses, which are 9 mm off).
_SETTINGS = ReconstructionSettings(
    features=FeatureSettings(max_features=2048), prior=PriorMappingSettings(max_neighbours=12)
)
CAPTURES, REFERENCE, EVALUATION = "captures", "reference", "evaluation"


@dataclass(frozen=True)
class Demo:
    """What the demo made.

    Attributes:
        reference: report of the dense capture.
        evaluation: report of the few-view capture, scored against the reference.
        truth: the reference's plants against the rendered plants' true surfaces.
    """

    reference: ReferenceReport
    evaluation: EvaluationReport
    truth: CloudScore


def run_demo(
    output: Path,
    *,
    seed: int = 0,
    cache: StageCache,
    progress: Progress,
    overwrite: bool = False,
    workers: int = 1,
) -> Demo:
    """Render two captures of a small maize plot, build the reference from the dense one and score the other.

    Args:
        output: folder of the result: captures/ (dense, few, truth), reference/, evaluation/ and demo.json.
        seed: of the captures' noise and the reconstruction.
        cache: of stages.
        progress: told of stages and findings.
        overwrite: replace an earlier demo in ``output``.
        workers: processes; the result does not depend on it.

    Raises:
        UsageError: ``output`` exists.
        RenderingError: this machine cannot render.
        ReconstructionError: the captures do not reconstruct.
    """
    settings = replace(_SETTINGS, seed=seed)
    with atomic_folder(output, overwrite=overwrite, marker=DEMO_FILE) as folder:
        captures = write_demo_captures(folder / CAPTURES, seed, progress=progress)
        reference = build_reference(
            captures.dense, folder / REFERENCE, settings, cache=cache, progress=progress, workers=workers, scene=False
        )
        evaluation = evaluate_captures(
            captures.few, folder / EVALUATION, settings, reference=folder / REFERENCE, cache=cache, progress=progress,
            workers=workers,
        )  # fmt: skip
        # The captures' poses.csv is in the scene's frame, and so are the true surfaces.
        motion = Similarity.from_matrix(np.array(reference.frame.plot_from_source))
        plants = read_cloud(folder / REFERENCE / CLOUD_FILE).transformed(motion.inverse())
        truth = score(read_cloud(captures.truth / "reference.ply"), plants)
        write_atomic(folder / DEMO_FILE, json.dumps({"kind": "demo", "version": 1, "seed": seed}, indent=2) + "\n")
    return Demo(reference, evaluation, truth)
