"""Another program's result, for the photographs of a folder."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from fieldkit import wording
from fieldkit.captures.listed_names import match_names
from fieldkit.captures.model import Photo
from fieldkit.captures.programs.model import POSITION_SHARE, PosesFile, ProgramPoses
from fieldkit.captures.programs.reading import find_results, read_result
from fieldkit.errors import MetadataError
from fieldkit.results.finding import Finding


def program_of(
    photos: Sequence[Photo], folders: Sequence[Path], given: PosesFile | None
) -> tuple[ProgramPoses | None, tuple[Finding, ...]]:
    """The poses of these photographs that another program found, by their names, and what is to be said of them.

    Args:
        photos: of a capture.
        folders: of the capture, where a result may lie.
        given: a result that was named; it counts instead of one in the folders.

    Raises:
        MetadataError: a result cannot be read, or the one that was named has none of the photographs.
    """
    if given is not None:
        found, odd = _of_photographs(read_result(given), photos)
        if found is None:
            raise MetadataError(
                f"has poses of none of the photographs (the folder has {photos[0].name})", path=given.path,
                remedy="Give the result of these photographs; their names there must be those of the files.",
            )  # fmt: skip
        return found, tuple(odd)
    found, findings = None, []
    for path in find_results(folders):
        if found is not None:
            findings.append(Finding(path.name, "sidecar-unused", f"{found.path.name} of {found.program} is used"))
            continue
        try:
            found, odd = _of_photographs(read_result(PosesFile(path)), photos)
        except MetadataError as error:
            remedy = f"{error.remedy} Or move it out of the photographs' folder."
            raise MetadataError(error.message, path=error.path or path, remedy=remedy) from error
        findings += odd
        if found is None:
            findings.append(Finding(path.name, "sidecar-unused", "it has poses of none of the photographs"))
    return found, tuple(findings)


def _of_photographs(result: ProgramPoses, photos: Sequence[Photo]) -> tuple[ProgramPoses | None, list[Finding]]:
    matched: dict[str, str] = {}
    for entry, name in match_names(result.poses, [photo.name for photo in photos]).items():
        if name not in matched.values():
            matched[entry] = name
    if not matched:
        return None, []
    found = _without_turned(result.renamed(matched), photos)
    count, of = len(found.poses), len(photos)
    findings = [
        Finding(
            found.path.name, "program-poses",
            f"{found.program} has poses of {count if count < of else 'all'} {f'of {of} ' if count < of else ''}"
            f"photographs, {found.frame_said}; taken for good to {100 * POSITION_SHARE:g} % of the cameras' spread and "
            f"{found.angle_accuracy_deg:.2g}°",
        )
    ]  # fmt: skip
    if found.unoriented:
        names = ", ".join(sorted(found.unoriented)[:3])
        turned = wording.count(len(found.unoriented), "photograph")
        message = f"{found.program} has turned {turned} ({names}): only positions are used"
        findings.append(Finding(found.path.name, "angles-not-used", message))
    return found, [*findings, *result.findings]


def _without_turned(found: ProgramPoses, photos: Sequence[Photo]) -> ProgramPoses:
    """Without orientations and cameras of photographs that the program had upright where the file has them on edge."""
    sizes = {photo.name: (photo.width, photo.height) for photo in photos}
    turned = {
        name
        for camera in found.cameras
        for name in camera.names
        if _on_edge(sizes[name], (camera.intrinsics.width, camera.intrinsics.height))
    }
    cameras = [camera for camera in found.cameras if not turned & set(camera.names)]
    return replace(found, unoriented=found.unoriented | turned, cameras=tuple(cameras))


def _on_edge(size: tuple[int, int], other: tuple[int, int]) -> bool:
    return (size[0] > size[1] and other[0] < other[1]) or (size[0] < size[1] and other[0] > other[1])
