"""Photographs of a whole tree of folders, read once, and captures made of any of them.

`read_capture` takes a folder for a capture. Where folders hold photographs of several plots, or a plot's photographs
lie in several folders, `find_photographs` reads them all and `capture_of` makes a capture of a selection. Nothing is
moved, copied or changed, and each photograph keeps the sidecars of its own folder.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from fieldkit.captures.cameras import group_cameras
from fieldkit.captures.capture import assembled, camera_entries, listed_names, names_in, read_photo
from fieldkit.captures.folder import FolderContents, list_folder, natural_key
from fieldkit.captures.geo_txt import read_geo_txt
from fieldkit.captures.gps_tags import settle_hemispheres
from fieldkit.captures.model import CameraGroup, Capture, Photo
from fieldkit.captures.one_camera import one_camera
from fieldkit.captures.poses_csv import read_poses_csv
from fieldkit.captures.priors import PriorSet, priors_from_geo, priors_from_gps, priors_from_poses
from fieldkit.captures.tables import match_names
from fieldkit.errors import CaptureError
from fieldkit.results.finding import Finding
from fieldkit.runtime.progress import Progress, Silent

_MAX_FOLDERS = 100_000
_MASKS = "masks"


@dataclass(frozen=True)
class FoundPhoto:
    """A photograph somewhere below a folder."""

    photo: Photo
    """As read; its name is the file's."""
    place: str
    """Path of the file relative to the folder that was searched, with "/"."""
    sidecars: Mapping[str, Path]
    """What lies beside it, by name ("poses.csv", "camera.toml", …)."""
    findings: tuple[Finding, ...] = ()
    """Of this file."""

    @property
    def folders(self) -> tuple[str, ...]:
        """Names of the folders between the searched one and the file."""
        return tuple(self.place.split("/")[:-1])


@dataclass(frozen=True)
class FoundPhotos:
    """All photographs below a folder."""

    root: Path
    """The folder, as given."""
    photos: tuple[FoundPhoto, ...]
    """In natural order of their places; of files with the same bytes the first."""
    findings: tuple[Finding, ...]
    """Of files that are left out; their names are places."""


def find_photographs(
    root: Path, *, skip: Callable[[Path], bool] | None = None, progress: Progress | None = None
) -> FoundPhotos:
    """Read every photograph in a folder and below it. Symbolic links to folders are not followed.

    Folders whose names begin with a dot, and those called ``masks``, are passed over.

    Args:
        root: the folder.
        skip: says of a folder that it is passed over with all below it.
    """
    root = Path(root)
    listed: list[FolderContents] = []
    findings: list[Finding] = []
    for folder in _folders(root, skip):
        try:
            contents = list_folder(folder)
        except CaptureError as error:
            if folder == root:
                raise
            findings.append(Finding(_place(folder, root), "unreadable", error.message, True))
            continue
        if contents.image_folder == folder:
            listed.append(_with_sidecars_above(contents))
        else:  # its "images" come as a folder of their own
            own = tuple(f for f in contents.findings if os.path.lexists(folder / f.subject))
            contents = replace(contents, findings=own)
        findings += [replace(f, subject=_place(folder / f.subject, root)) for f in contents.findings if f.left_out]
    candidates = [(contents, candidate) for contents in listed for candidate in contents.candidates]
    found: list[FoundPhoto] = []
    with (progress or Silent()).stage("Reading photographs", len(candidates)) as advance:
        for contents, candidate in candidates:
            read = read_photo(candidate)
            place = _place(candidate.path, root)
            if read.photo is None:
                findings += [replace(finding, subject=place) for finding in read.findings]
            else:
                odd = (*(f for f in contents.findings if f.subject == candidate.name), *read.findings)
                found.append(FoundPhoto(read.photo, place, contents.sidecars, odd))
            advance(1)
    distinct, duplicates = _distinct(sorted(found, key=lambda each: natural_key(each.place)))
    settled, hemispheres = _with_hemispheres(distinct)
    return FoundPhotos(root, tuple(settled), (*findings, *duplicates, *hemispheres))


def photographs_at(paths: Sequence[Path]) -> list[FoundPhoto]:
    """The photographs at some paths, with the sidecars of their folders; those that are gone or damaged are left out.

    Their places are the paths.
    """
    found = []
    for folder in dict.fromkeys(path.parent for path in paths):
        try:
            contents = _with_sidecars_above(list_folder(folder))
        except CaptureError:
            continue
        wanted = {path.name for path in paths if path.parent == folder}
        for candidate in contents.candidates:
            if candidate.name in wanted and candidate.path.parent == folder:
                photo = read_photo(candidate).photo
                if photo is not None:
                    found.append(FoundPhoto(photo, candidate.path.as_posix(), contents.sidecars))
    return _with_hemispheres(found)[0]


def capture_of(photos: Sequence[FoundPhoto], *, camera: Path | None = None, without: Iterable[str] = ()) -> Capture:
    """A capture of some photographs, with what the sidecars of their folders say of them.

    Photographs of several folders are named by their paths below the folder they have in common. Lines of poses.csv
    and geo.txt that name other photographs are passed over without a finding. Photographs of other cameras than most
    are left out, as `fieldkit.captures.read_capture` does.

    Args:
        photos: one or more, each once.
        camera: calibration of photographs without a camera file of their own.
        without: names of sidecars that are not looked at ("poses.csv").
    """
    unwanted = frozenset(without)
    photos = sorted(photos, key=lambda each: natural_key(each.photo.path.as_posix()))  # in whatever order they come
    photos, other_cameras = _of_one_camera(photos, camera, unwanted)
    common = Path(os.path.commonpath([each.photo.path.parent for each in photos]))
    named = {each.photo.path: each.photo.path.relative_to(common).as_posix() for each in photos}
    by_folder: dict[Path, list[FoundPhoto]] = {}
    for each in photos:
        by_folder.setdefault(each.photo.path.parent, []).append(each)
    ordered = sorted(
        (replace(each.photo, name=named[each.photo.path]) for each in photos), key=lambda p: natural_key(p.name)
    )
    groups, findings = _cameras(by_folder, named, camera)
    priors = _priors(ordered, by_folder, named, unwanted)
    markers = {each.sidecars.get("markers.toml") for each in photos}
    marker = markers.pop() if len(markers) == 1 else None
    odd = [replace(f, subject=named[each.photo.path]) for each in photos for f in each.findings]
    return assembled(
        (common, common), ordered, groups, [*odd, *other_cameras, *findings, *priors.findings], priors, marker
    )


def _folders(root: Path, skip: Callable[[Path], bool] | None) -> list[Path]:
    found: list[Path] = [root]
    for place, names, _ in os.walk(root):
        names[:] = [
            name
            for name in sorted(names, key=natural_key)
            if not name.startswith(".") and name != _MASKS and not (skip is not None and skip(Path(place) / name))
        ]
        found += [Path(place) / name for name in names if not (Path(place) / name).is_symlink()]
        if len(found) > _MAX_FOLDERS:
            raise CaptureError(
                f"there are more than {_MAX_FOLDERS:,} folders in it", path=root,
                remedy="Give the folder of the photographs, not one far above it.",
            )  # fmt: skip
    return found


def _with_sidecars_above(contents: FolderContents) -> FolderContents:
    """A folder called ``images`` shares the sidecars of the folder it lies in, as `read_capture` has it."""
    folder = contents.image_folder
    if folder.name != "images":
        return contents
    above = list_folder(folder.parent)
    return contents if above.candidates and above.image_folder != folder else replace(contents, sidecars=above.sidecars)


def _place(path: Path, root: Path) -> str:
    return path.relative_to(root).as_posix().encode("utf-8", "backslashreplace").decode()


def _distinct(found: Sequence[FoundPhoto]) -> tuple[list[FoundPhoto], list[Finding]]:
    first: dict[str, FoundPhoto] = {}
    findings = []
    for each in found:
        kept = first.setdefault(each.photo.sha256, each)
        if kept is not each:
            findings.append(Finding(each.place, "duplicate", f"the same bytes as {kept.place}", True))
    return list(first.values()), findings


def _with_hemispheres(found: Sequence[FoundPhoto]) -> tuple[list[FoundPhoto], list[Finding]]:
    """`settle_hemispheres`, its findings named by places."""
    settled, findings = settle_hemispheres([replace(each.photo, name=each.place) for each in found])
    kept = [
        replace(each, photo=replace(photo, name=each.photo.name)) for each, photo in zip(found, settled, strict=True)
    ]
    return kept, findings


def _of_one_camera(
    photos: Sequence[FoundPhoto], camera: Path | None, unwanted: frozenset[str]
) -> tuple[list[FoundPhoto], list[Finding]]:
    """`one_camera` of all folders' photographs."""
    common = Path(os.path.commonpath([each.photo.path.parent for each in photos]))
    named = {each.photo.path.relative_to(common).as_posix(): each for each in photos}
    located: set[str] = set()
    calibrated: set[str] = set()
    for folder in dict.fromkeys(each.photo.path.parent for each in photos):
        members = {name: each for name, each in named.items() if each.photo.path.parent == folder}
        sidecars = next(iter(members.values())).sidecars
        bare = {each.photo.name: name for name, each in members.items()}
        listed = listed_names({name: path for name, path in sidecars.items() if name not in unwanted})
        located |= {bare[name] for name in match_names(listed, bare).values()}
        calibrated |= {bare[name] for name in names_in(camera_entries(sidecars, camera)[0], bare)}
    kept, findings = one_camera(
        [replace(each.photo, name=name) for name, each in named.items()], located=located, calibrated=calibrated
    )
    return [named[photo.name] for photo in kept], findings


def _cameras(
    by_folder: Mapping[Path, Sequence[FoundPhoto]], named: Mapping[Path, str], camera: Path | None
) -> tuple[list[CameraGroup], list[Finding]]:
    """Camera groups of all folders; those of one camera, calibrated alike, are one."""
    merged: dict[tuple[object, ...], CameraGroup] = {}
    findings: list[Finding] = []
    for folder, members in by_folder.items():
        entries, file = camera_entries(members[0].sidecars, camera)
        groups, odd = group_cameras([each.photo for each in members], entries, file)
        odd = [finding for finding in odd if finding.code != "camera-unused"]
        findings += [replace(f, subject=named.get(folder / f.subject, f.subject)) for f in odd]
        for group in groups:
            names = tuple(named[folder / name] for name in group.photos)
            same = (group.key, group.intrinsics, group.source, group.fixed)
            earlier = merged.get(same)
            merged[same] = replace(group, photos=names if earlier is None else (*earlier.photos, *names))
    keys: dict[str, int] = {}
    result = []
    for group in merged.values():
        keys[group.key] = keys.get(group.key, 0) + 1
        number = keys[group.key]
        result.append(group if number == 1 else replace(group, key=f"{group.key} ({number})"))
    return result, findings


def _priors(
    photos: Sequence[Photo],
    by_folder: Mapping[Path, Sequence[FoundPhoto]],
    named: Mapping[Path, str],
    unwanted: frozenset[str],
) -> PriorSet:
    """As `read_capture`: poses.csv before geo.txt before GPS; of all folders the first kind that names any of them."""
    findings: list[Finding] = []
    for kind in ("poses.csv", "geo.txt"):
        pose_rows, geo_rows = [], []
        for folder, members in by_folder.items():
            file = members[0].sidecars.get(kind)
            if file is None or kind in unwanted:
                continue
            bare = [each.photo.name for each in members]
            if kind == "poses.csv":
                poses, odd = read_poses_csv(file)
                matched = match_names([row.image for row in poses], bare)
                pose_rows += [replace(r, image=named[folder / matched[r.image]]) for r in poses if r.image in matched]
            else:
                geo, odd = read_geo_txt(file)
                matched = match_names([row.image for row in geo], bare)
                geo_rows += [replace(r, image=named[folder / matched[r.image]]) for r in geo if r.image in matched]
            findings += [replace(f, subject=named[folder / matched[f.subject]]) for f in odd if f.subject in matched]
        if pose_rows or geo_rows:
            found = priors_from_poses(photos, pose_rows) if pose_rows else priors_from_geo(photos, geo_rows)
            return replace(found, findings=(*findings, *found.findings))
    return priors_from_gps(photos)
