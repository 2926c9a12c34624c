"""From a reference's folder to a scene that can be rendered and planned on."""

from __future__ import annotations

from pathlib import Path

from fieldkit.errors import MetadataError
from fieldkit.evaluation.report_files import REFERENCE_FILE, check_file, load_reference_report
from fieldkit.geometry import Intrinsics
from fieldkit.scenes.description import Bounds
from fieldkit.scenes.from_reference import MAX_GROUND_SURFELS, RecordedScene, ReferenceFiles, scene_from_reference


def make_proxy(
    reference: Path, output: Path, *, max_ground_surfels: int = MAX_GROUND_SURFELS, overwrite: bool = False
) -> RecordedScene:
    """Write a scene of the reference's clouds.

    Args:
        reference: what `fieldkit reference` wrote.
        output: folder for scene.toml, plants.ply and ground.ply.
        max_ground_surfels: everything but the plants is thinned to this.
        overwrite: replace an existing scene.

    Raises:
        MetadataError: ``reference`` is no reference, has no metric scale, or was built with --no-scene.
        SceneError: its clouds cannot be drawn.
        UsageError: ``output`` exists.
        StorageError: the disk is full or not writable.
    """
    report = load_reference_report(reference)
    folder = reference if reference.is_dir() else reference.parent
    if not report.metric:
        raise MetadataError(
            "the reference has no metric scale, and a mission needs metres", path=folder / REFERENCE_FILE,
            remedy="Give the photographs poses.csv, GPS or markers, and build it again.",
        )  # fmt: skip
    camera = max(report.cameras, key=lambda c: c.photos)
    ground = report.frame.ground
    files = ReferenceFiles(
        plants=check_file(folder, report, "cloud.ply"),
        scene=check_file(folder, report, "scene.ply"),
        bounds=Bounds(report.volume.lower_m, report.volume.upper_m),
        camera=Intrinsics(camera.model, camera.width, camera.height, camera.params),
        ground_tolerance_m=0.005 if ground is None else ground.tolerance_m,
        name=report.source,
    )
    return scene_from_reference(files, output, max_ground_surfels=max_ground_surfels, overwrite=overwrite)
