"""What a run is planned on: scenes, references or recorded photographs, as they are given and as they were."""

from __future__ import annotations

from itertools import zip_longest
from pathlib import Path

from fieldkit.captures import read_capture
from fieldkit.errors import SceneError, UsageError
from fieldkit.evaluation.cloud_reference import is_cloud, reference_file
from fieldkit.evaluation.reference import Reference
from fieldkit.planning.plan_settings import PlanSettings
from fieldkit.planning.settings import GivenPlot
from fieldkit.results.finding import DOUBTFUL, PLANTS_APART
from fieldkit.results.plan import PlanSource
from fieldkit.results.report_files import REFERENCE_FILE, file_sha256, load_reference_report
from fieldkit.scenes.library import find_scene, scene_reference


def describe_sources(asked: PlanSettings) -> tuple[GivenPlot, ...]:
    """The plots that a plan is asked for. Raises UsageError: they do not go together."""
    for reference in asked.reference:
        if is_cloud(reference) and reference_file(reference) == reference:
            raise UsageError(
                "a plan needs a reference's cameras and ground, which a bare cloud does not have",
                path=reference,
                remedy="Build one of photographs: `fieldkit reference IMAGES -o REF`.",
            )
    asked.check_sources()
    if asked.captures is not None and asked.recorded:
        folder = asked.captures.resolve()
        read_capture(folder)
        return (GivenPlot(source=PlanSource(kind="captures", name=folder.name), path=str(folder)),)
    found = [_described_scene(scene) for scene in asked.scene]
    found += [_described_reference(*each) for each in zip_longest(asked.reference, asked.images)]
    for number, plot in enumerate(found):
        if any(plot.path == same.path or plot.source.sha256 == same.source.sha256 for same in found[:number]):
            raise UsageError(
                "is given twice", path=Path(plot.path), remedy="Give every plot once; --vary K draws others of them."
            )
    return tuple(found)


def _described_scene(scene: Path) -> GivenPlot:
    file = find_scene(scene)
    source = PlanSource(kind="scene", name=file.name, sha256=file_sha256(file))
    return GivenPlot(source=source, path=str(scene_reference(file)))


def _described_reference(reference: Path, images: Path | None) -> GivenPlot:
    folder = (reference.parent if reference.is_file() else reference).resolve()
    Reference(folder)
    source = PlanSource(kind="reference", name=folder.name, sha256=file_sha256(folder / REFERENCE_FILE))
    return GivenPlot(source=source, path=str(folder), images_path=None if images is None else str(images.resolve()))


def check_unchanged(plot: GivenPlot) -> None:
    """Raise a UsageError if a plot is gone, or is not what it was when the run began."""
    if plot.source.sha256 is None:
        return
    path = Path(plot.path)
    file = path / REFERENCE_FILE if plot.source.kind == "reference" else _scene_file(path)
    if not file.is_file():
        raise UsageError("the source of this run is gone", path=file, remedy="Put it back there, or start a new run.")
    if file_sha256(file) != plot.source.sha256:
        raise UsageError("has changed since this run began", path=file, remedy="Start a new run in another folder.")


def source_doubts(plot: GivenPlot) -> list[str]:
    """What a reference's own findings say against a plan for it: plants that are not the plot's, above all."""
    if plot.source.kind != "reference":
        return []
    found = load_reference_report(Path(plot.path)).findings
    return [f"{plot.source.name}: {each.message}" for each in found if each.code in DOUBTFUL | {PLANTS_APART}]


def _scene_file(path: Path) -> Path:
    try:
        return find_scene(path)
    except SceneError:
        return path
