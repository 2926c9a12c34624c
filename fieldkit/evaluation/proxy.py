"""From a reference's folder to a scene that can be rendered and planned on."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from fieldkit.captures import read_capture
from fieldkit.captures.decode import read_image
from fieldkit.errors import MetadataError
from fieldkit.results.evaluation import CLOUD_FILE, SCENE_FILE, ReferenceReport
from fieldkit.results.report_files import REFERENCE_FILE, check_file, load_reference_report
from fieldkit.runtime.progress import Progress
from fieldkit.scenes.description import Bounds
from fieldkit.scenes.from_reference import PosedPhotograph, RecordedScene, ReferenceFiles, scene_from_reference


def make_proxy(
    reference: Path,
    output: Path,
    *,
    images: Path | None = None,
    overwrite: bool = False,
    progress: Progress | None = None,
) -> RecordedScene:
    """Write a scene of the reference's clouds.

    Args:
        reference: what `fieldkit reference` wrote.
        output: folder for scene.toml, plants.ply and ground.ply, and plants.png and ground.png with ``images``.
        images: the photographs the reference was built from, for finer surfels.
        overwrite: replace an existing scene.
    """
    report = load_reference_report(reference)
    folder = reference if reference.is_dir() else reference.parent
    if not report.metric:
        raise MetadataError(
            "the reference has no metric scale, and a mission needs metres",
            path=folder / REFERENCE_FILE,
            remedy="Give the photographs poses.csv, GPS or markers, and build it again.",
        )
    if report.scene_points is None:
        raise MetadataError(
            f"the reference is of the plants alone, and what is planned on needs the ground about them ({SCENE_FILE})",
            path=folder,
            remedy="Add it: `fieldkit reference IMAGES -o REF --resume`, with the options it was built with.",
        )
    camera = max(report.cameras, key=lambda c: c.photos)
    ground = report.frame.ground
    files = ReferenceFiles(
        plants=check_file(folder, report, CLOUD_FILE),
        scene=check_file(folder, report, SCENE_FILE),
        bounds=Bounds(report.volume.lower_m, report.volume.upper_m),
        camera=camera.intrinsics,
        ground_tolerance_m=0.005 if ground is None else ground.tolerance_m,
        name=report.source,
    )
    photographs = [] if images is None else _photographs(report, images)
    return scene_from_reference(
        files,
        output,
        photographs=photographs,
        overwrite=overwrite,
        progress=progress,
    )


def _photographs(report: ReferenceReport, images: Path) -> list[PosedPhotograph]:
    """The photographs whose poses the reference does not find wrong, with these; none where nothing is known."""
    found = {photo.name: photo for photo in read_capture(images).photos}
    cameras = [c.intrinsics for c in report.cameras]
    photographs = []
    for entry in report.image_reports:
        photo = found.get(entry.name)
        pose = entry.pose
        known = entry.right or (entry.counts and entry.position_residual_m is not None)
        if not known or photo is None or pose is None or entry.roll_deg is None:
            continue
        camera = next((c for c in cameras if (c.width, c.height) == (photo.width, photo.height)), None)
        if camera is not None:
            photographs.append(PosedPhotograph(partial(read_image, photo), pose, camera))
    if not photographs:
        raise MetadataError(
            "holds none of the photographs the reference was built from",
            path=images,
            remedy="Give the folder that `fieldkit reference` read.",
        )
    return photographs
