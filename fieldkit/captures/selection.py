"""Photographs of a whole tree of folders, read once, and captures made of any of them.

`read_capture` takes a folder for a capture. Where folders hold photographs of several plots, or a plot's photographs
lie in several folders, `find_photographs` reads them all and `capture_of` makes a capture of a selection. Nothing is
moved, copied or changed, and each photograph keeps the sidecars of its own folder.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from fieldkit.captures.capture import Part, assembled, distinct, of_one_camera, read_photo
from fieldkit.captures.folder import FolderContents, list_folder, natural_key
from fieldkit.captures.model import Capture, Photo
from fieldkit.errors import CaptureError
from fieldkit.results.finding import Finding
from fieldkit.runtime.progress import Progress, Silent

_MAX_FOLDERS = 100_000
"""Most folders that are searched."""
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

    Folders whose names begin with a dot, and those called ``masks``, are passed over. ``skip`` says of a folder that it
    is passed over with all below it.
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
            photo, odd = read_photo(candidate)
            place = _place(candidate.path, root)
            if photo is None:
                findings += [replace(finding, subject=place) for finding in odd]
            else:
                own = (*(f for f in contents.findings if f.subject == candidate.name), *odd)
                found.append(FoundPhoto(photo, place, contents.sidecars, own))
            advance(1)
    if not found:
        raise CaptureError(
            "there are no usable photographs in this folder, nor below it",
            path=root,
            remedy="Give the folder that holds the photographs.",
        )
    found.sort(key=lambda each: natural_key(each.place))
    once, duplicates = distinct([replace(each.photo, name=each.place) for each in found])
    left = {photo.name for photo in once}
    return FoundPhotos(root, tuple(each for each in found if each.place in left), (*findings, *duplicates))


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
                photo, _ = read_photo(candidate)
                if photo is not None:
                    found.append(FoundPhoto(photo, candidate.path.as_posix(), contents.sidecars))
    return found


def capture_of(photos: Sequence[FoundPhoto], *, camera: Path | None = None, without: Iterable[str] = ()) -> Capture:
    """A capture of some photographs, with what the sidecars of their folders say of them.

    Photographs of several folders are named by their paths below the folder they have in common. Lines of poses.csv
    and geo.txt that name other photographs are passed over without a finding. Photographs of other cameras than most
    are left out, as `fieldkit.captures.read_capture` does.

    Args:
        camera: calibration of photographs without a camera file of their own.
        without: names of sidecars that are not looked at ("poses.csv").
    """
    unwanted = frozenset(without)
    photos = sorted(photos, key=lambda each: natural_key(each.photo.path.as_posix()))  # in whatever order they come
    _, named, parts = _parts(photos, unwanted)
    kept, other_cameras = of_one_camera(named, parts, camera)
    left = {photo.path for photo in kept}
    photos = [each for each in photos if each.photo.path in left]
    common, named, parts = _parts(photos, unwanted)
    odd = [replace(f, subject=photo.name) for photo, each in zip(named, photos, strict=True) for f in each.findings]
    ordered = sorted(named, key=lambda photo: natural_key(photo.name))
    return assembled((common, common), ordered, parts, [*odd, *other_cameras], camera=camera)


def _parts(found: Sequence[FoundPhoto], unwanted: Collection[str]) -> tuple[Path, list[Photo], list[Part]]:
    """The folder that photographs have in common, they by their paths below it, and parts of a capture by folder."""
    common = Path(os.path.commonpath([each.photo.path.parent for each in found]))
    photos = [replace(each.photo, name=each.photo.path.relative_to(common).as_posix()) for each in found]
    parts: dict[Path, tuple[dict[str, str], dict[str, Path]]] = {}
    for photo, each in zip(photos, found, strict=True):
        beside = {kind: path for kind, path in each.sidecars.items() if kind not in unwanted}
        parts.setdefault(photo.path.parent, ({}, beside))[0][each.photo.name] = photo.name
    return common, photos, [Part(*part) for part in parts.values()]


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
                f"there are more than {_MAX_FOLDERS:,} folders in it",
                path=root,
                remedy="Give the folder of the photographs, not one far above it.",
            )
    return found


def _with_sidecars_above(contents: FolderContents) -> FolderContents:
    """A folder called ``images`` shares the sidecars of the folder it lies in, as `read_capture` has it."""
    folder, sidecars = contents.image_folder, contents.sidecars
    if folder.name == "images":
        above = list_folder(folder.parent)
        sidecars = sidecars if above.candidates and above.image_folder != folder else above.sidecars
    # Absolute paths: a cluster's workers are in other folders.
    return replace(contents, sidecars={name: path.absolute() for name, path in sidecars.items()})


def _place(path: Path, root: Path) -> str:
    return path.relative_to(root).as_posix().encode("utf-8", "backslashreplace").decode()
