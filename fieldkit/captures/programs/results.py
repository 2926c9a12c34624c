"""Which files are other programs' results, reading them, and what they say of a folder's photographs."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from fieldkit import wording
from fieldkit.captures.programs.colmap import colmap_suffix, read_colmap
from fieldkit.captures.programs.metashape import read_metashape_xml
from fieldkit.captures.programs.model import ANGLE_ACCURACY_DEG, POSITION_SHARE, PosesFile, ProgramPoses
from fieldkit.captures.programs.opendronemap import SHOTS, read_shots
from fieldkit.captures.tables import match_names
from fieldkit.errors import MetadataError
from fieldkit.regular_files import open_regular
from fieldkit.results.finding import Finding

_COLMAP_FILES = ("images", "cameras", "points3D", "rigs", "frames")
_COLMAP_PLACES = ("sparse/0", *(f"sparse/{k}" for k in range(1, 10)), "sparse", ".")
_ODM_PLACES = (f"odm_report/{SHOTS}", SHOTS)
_HEAD_BYTES = 4096
"""Bytes of a file by which its kind is told."""
_MOST_FILES = 50
"""Most files of a folder that are looked into."""
_KINDS = "Give a COLMAP model's folder, OpenDroneMap's shots.geojson, or Metashape's cameras as Agisoft XML."


def program_of(
    sizes: dict[str, tuple[int, int]], folders: Sequence[Path], given: PosesFile | None
) -> tuple[ProgramPoses | None, tuple[Finding, ...]]:
    """The poses of photographs that another program found, by their names, and what is to be said of them.

    Args:
        given: a result that was named; it counts instead of one in the folders.
    """
    if given is not None:
        found, odd = _of_photographs(read_result(given), sizes, folders[-1])
        if found is None:
            none = f"has poses of none of the photographs (the folder has {next(iter(sizes))})"
            raise MetadataError(
                odd[0].message if odd else none,
                path=given.path,
                remedy="Give the result of these photographs; their names there must be those of the files.",
            )
        return found, tuple(odd)
    found, findings = None, []
    for path in _find_results(folders):
        if found is not None:
            name = path.name if path.is_file() else f"{path.parent.name}/{path.name}"
            findings.append(Finding(name, "sidecar-unused", f"{found.path.name} of {found.program} is used"))
            continue
        try:
            found, odd = _of_photographs(read_result(PosesFile(path)), sizes, folders[-1])
        except MetadataError as error:
            remedy = f"{error.remedy} Or move it out of the photographs' folder."
            raise MetadataError(error.message, path=error.path or path, remedy=remedy) from error
        findings += odd
        if found is None and not odd:
            findings.append(Finding(path.name, "sidecar-unused", "it has poses of none of the photographs"))
    return found, tuple(findings)


def read_result(given: PosesFile) -> ProgramPoses:
    """Another program's result."""
    path = given.path
    if path.is_dir():
        found = next((place for place in (path, path / "sparse" / "0", path / "sparse") if colmap_suffix(place)), None)
        if found is not None:
            return read_colmap(replace(given, path=found))
        inside = _find_results([path])
        if not inside:
            raise MetadataError("this folder holds no result with poses", path=path, remedy=_KINDS)
        return read_result(replace(given, path=inside[0]))
    suffix = path.suffix.lower()
    if suffix in (".bin", ".txt") and path.stem in _COLMAP_FILES and colmap_suffix(path.parent):
        return read_colmap(replace(given, path=path.parent))
    if suffix == ".xml":
        return read_metashape_xml(given)
    if suffix == ".geojson":
        given.check_open()
        return read_shots(path)
    raise MetadataError("holds no poses of COLMAP, OpenDroneMap or Metashape", path=path, remedy=_KINDS)


def _find_results(folders: Sequence[Path]) -> list[Path]:
    """Results with poses where their programs put them, of Metashape by their content; the first to be used first."""
    found = dict.fromkeys(path for folder in dict.fromkeys(folders) for path in _in_folder(folder))
    roots = [folder.resolve() for folder in folders]
    return [path for path in found if any(path.resolve().is_relative_to(root) for root in roots)]


def _in_folder(folder: Path) -> Iterator[Path]:
    yield from (place for each in _COLMAP_PLACES if colmap_suffix(place := folder / each))
    yield from (place for each in _ODM_PLACES if (place := folder / each).is_file())
    try:
        names = sorted(entry.name for entry in os.scandir(folder) if entry.name.lower().endswith(".xml"))
    except OSError:
        return
    for name in names[:_MOST_FILES]:
        try:
            with open_regular(folder / name) as file:
                head = file.read(_HEAD_BYTES)
        except (OSError, ValueError):
            continue
        if b"<document" in head and b"<chunk" in head:
            yield folder / name


def _of_photographs(
    result: ProgramPoses, sizes: dict[str, tuple[int, int]], folder: Path
) -> tuple[ProgramPoses | None, list[Finding]]:
    """Of these photographs. Orientations and cameras of those that the program had upright do not count."""
    meant = match_names(result.poses, list(sizes))
    if len(set(meant.values())) < len(meant):  # photographs of several folders: theirs may tell
        own = {f"{folder.name}/{name}": name for name in sizes}
        meant = {entry: own[name] for entry, name in match_names(result.poses, own).items()} or meant
    times = Counter(meant.values())
    matched = {entry: name for entry, name in meant.items() if times[name] == 1}
    doubtful = sorted(name for name, number in times.items() if number > 1)
    if not matched and doubtful:
        raise MetadataError(
            f"has several poses of each photograph of the folder, as {doubtful[0]}",
            path=result.path,
            remedy="Photographs of several folders have one name. Put them into folders called as the program has "
            "them, or export the poses of these alone.",
        )
    if not matched:
        return None, []
    found = result.renamed(matched)
    turned = {
        name
        for camera in found.cameras
        for name in camera.images
        if (sizes[name][0] - sizes[name][1]) * (camera.intrinsics.width - camera.intrinsics.height) < 0
    }
    cameras = tuple(camera for camera in found.cameras if not turned & set(camera.images))
    unfit = [
        camera for camera in cameras if any(camera.intrinsics.at_size(*sizes[name]) is None for name in camera.images)
    ]
    if unfit and len(unfit) == len(found.cameras):
        theirs, name = unfit[0].intrinsics, unfit[0].images[0]
        message = (
            f"{found.program}'s cameras are of pictures of {theirs.width}×{theirs.height}, {name} has "
            f"{sizes[name][0]}×{sizes[name][1]}: of undistorted or cropped ones, to which they belong (COLMAP writes "
            "undistorted ones into dense/images, with dense/sparse); not used"
        )
        return None, [Finding(found.path.name, "undistorted-model", message)]
    found = replace(found, unoriented=found.unoriented | turned, cameras=cameras)
    many = f"{len(found.poses)} of {len(sizes)}" if len(found.poses) < len(sizes) else "all"
    said = (
        f"{found.program} has poses of {many} photographs, {found.frame_said}; taken for good to "
        f"{100 * POSITION_SHARE:g} % of the cameras' spread and {ANGLE_ACCURACY_DEG:.2g}°"
    )
    findings = [Finding(found.path.name, "program-poses", said)]
    if doubtful:
        message = f"{result.program} has several poses of {wording.listed(doubtful, 3)}, of other folders; not used"
        findings.append(Finding(found.path.name, "poses-apart", message))
    if found.unoriented:
        names = ", ".join(sorted(found.unoriented)[:3])
        message = (
            f"{found.program} has turned {wording.count(len(found.unoriented), 'photograph')} ({names}): only "
            "positions are used"
        )
        findings.append(Finding(found.path.name, "angles-not-used", message))
    return found, [*findings, *result.findings]
