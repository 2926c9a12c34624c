"""Reading a folder of photographs into a `Capture`."""

from __future__ import annotations

import hashlib
import re
import warnings
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from PIL import Image, TiffImagePlugin, UnidentifiedImageError

from fieldkit.arrays import Float32Array
from fieldkit.captures.camera_file import CameraEntry, read_camera_file
from fieldkit.captures.cameras import group_cameras
from fieldkit.captures.compared import against_gps, several_places
from fieldkit.captures.decode import (
    jpeg_is_complete,
    saved_again,
    tiff_refusal,
)
from fieldkit.captures.exif import with_exif
from fieldkit.captures.folder import Candidate, folders_of_photographs, list_capture
from fieldkit.captures.geo_txt import read_geo_txt
from fieldkit.captures.gps_tags import Problem
from fieldkit.captures.markers_file import read_markers_file
from fieldkit.captures.model import CameraGroup, Capture, Photo
from fieldkit.captures.one_camera import one_camera
from fieldkit.captures.poses_csv import read_poses_csv
from fieldkit.captures.priors import PriorSet, priors_from_geo, priors_from_gps, priors_from_poses, priors_from_program
from fieldkit.captures.programs import PosesFile, ProgramPoses, program_of
from fieldkit.captures.tables import match_names
from fieldkit.errors import CaptureError, about
from fieldkit.results.finding import Finding
from fieldkit.vocabulary import DRAWN_BY
from fieldkit.wording import count, listed

MAX_PIXELS = 150_000_000
"""More than any single camera frame that flies today (100 Mpx), and 450 MB once decoded to RGB."""
_MAX_FILE_BYTES = 2 << 30
"""Largest file that is read as a photograph, bytes."""
_MOST_COMPARED = 400  # photographs of one shape that say no time


def read_capture(
    folder: Path, *, max_pixels: int = MAX_PIXELS, sidecars: bool = True, poses: PosesFile | None = None
) -> Capture:
    """Read a folder of photographs and what lies beside them. JPEGs are not decoded, and nothing is written.

    Photographs are JPEG, PNG or TIFF by content, directly in ``folder`` or, when there are none, in
    ``folder/images`` or in a card's folders 100MEDIA, 101MEDIA and so on. Whatever cannot be used is left out and named
    in ``findings``, and so are photographs of another camera than most (`one_camera`); one photograph is enough here
    (reconstruction asks for more).

    Args:
        max_pixels: larger images are left out undecoded (decompression bombs); Pillow's own limit of 178 Mpx
            holds besides.
        sidecars: whether poses.csv, geo.txt and other programs' results are looked at.
        poses: another program's result to take poses from; None takes what lies in the folder.
    """
    folder = Path(folder)
    contents = list_capture(folder)
    beside = {name: path for name, path in contents.sidecars.items() if sidecars or name not in _POSITIONS}
    read = [read_photo(candidate, max_pixels) for candidate in contents.candidates]
    findings = [*contents.findings, *(finding for _, odd in read for finding in odd)]
    photos = [photo for photo, _ in read if photo is not None]
    if not photos:
        raise _no_photographs(folder, findings)
    located = match_names(listed_names(beside), [photo.name for photo in photos]).values()
    photos, duplicates = distinct(photos, set(located))
    kept, other_cameras = of_one_camera(photos, [Part.of(photos, beside)])
    aside = {photo.name for photo in photos} - {photo.name for photo in kept}
    folders = (folder.absolute(), contents.image_folder.absolute())
    sizes = {photo.name: (photo.width, photo.height) for photo in kept}
    program, odd = program_of(sizes, folders, poses) if sidecars or poses is not None else (None, ())
    findings += [*duplicates, *other_cameras]
    capture = assembled(folders, kept, [Part.of(kept, beside, whole=True)], findings, program=program, odd=odd)
    # What is odd about photographs set aside does not matter, under whatever names sidecars give them.
    meant = match_names([f.subject for f in capture.findings if not f.left_out], aside)
    return replace(capture, findings=tuple(f for f in capture.findings if f.left_out or f.subject not in meant))


@dataclass(frozen=True)
class Part:
    """Photographs of a capture that share sidecars."""

    names: Mapping[str, str]
    """The capture's names, in order, by those that the sidecars know."""
    sidecars: Mapping[str, Path]
    whole: bool = False
    """Whether it is a whole folder: what its sidecars say of other photographs is told."""

    @classmethod
    def of(cls, photos: Sequence[Photo], sidecars: Mapping[str, Path], *, whole: bool = False) -> Part:
        """Of photographs that have one name."""
        return cls({photo.name: photo.name for photo in photos}, sidecars, whole)

    def renamed(self, listed: Iterable[str]) -> dict[str, str]:
        """The capture's names by those that a sidecar lists, without those of other photographs."""
        return {entry: self.names[name] for entry, name in match_names(listed, self.names).items()}


def camera_entries(
    sidecars: Mapping[str, Path], otherwise: Path | None = None
) -> tuple[Sequence[CameraEntry], Path | None]:
    """What a folder's camera file says, and which file that is; ``otherwise`` where the folder has none."""
    path = sidecars.get("camera.toml") or sidecars.get("camera.json") or otherwise
    return (() if path is None else read_camera_file(path)), path


def names_in(entries: Sequence[CameraEntry], names: Iterable[str]) -> set[str]:
    """Of photographs, those that a camera file names."""
    return {name for name in names if any(entry.images and entry.covers(name) for entry in entries)}


def of_one_camera(
    photos: Sequence[Photo], parts: Sequence[Part], camera: Path | None = None
) -> tuple[list[Photo], list[Finding]]:
    """`one_camera`, with what the sidecars say; ``camera`` is the camera file of parts without one."""
    located, calibrated = set[str](), set[str]()
    for part in parts:
        located |= set(part.renamed(listed_names(part.sidecars)).values())
        entries, _ = camera_entries(part.sidecars, camera)
        calibrated |= {part.names[name] for name in names_in(entries, part.names)}
    return one_camera(photos, located=located, calibrated=calibrated)


def assembled(
    folders: tuple[Path, Path],
    photos: Sequence[Photo],
    parts: Sequence[Part],
    findings: Sequence[Finding],
    *,
    camera: Path | None = None,
    program: ProgramPoses | None = None,
    odd: Sequence[Finding] = (),
) -> Capture:
    """A capture of photographs, with what their sidecars or another program say of them.

    ``folders`` are the capture's and that of its images; ``camera`` is a camera file for parts without one.
    """
    groups, of_cameras = _cameras(photos, parts, camera, program)
    priors = _priors(photos, parts, program)
    markers = {part.sidecars.get("markers.toml") for part in parts}
    marker = markers.pop() if len(markers) == 1 else None
    return Capture(
        *folders,
        photos=tuple(photos),
        groups=tuple(groups),
        findings=(*findings, *of_cameras, *odd, *priors.findings, *several_places(photos, priors.priors)),
        priors=priors.priors,
        metric_source=priors.metric_source,
        origin=priors.origin,
        height_source=priors.height_source,
        to_take_off_m=priors.to_take_off_m,
        markers=None if marker is None else read_markers_file(marker),
        program=None if program is None or priors.metric_source == program.program else program,
    )


def _no_photographs(folder: Path, findings: list[Finding]) -> CaptureError:
    left_out = [f for f in findings if f.left_out]
    inner = [] if left_out else folders_of_photographs(folder)
    if inner:
        return CaptureError(
            f"there are no photographs directly in this folder, only in {listed(inner)}",
            path=folder,
            remedy="Give one of these folders, or put the photographs of one capture into one folder.",
        )
    if not left_out:
        return CaptureError(
            "there are no photographs in this folder",
            path=folder,
            remedy="Put JPEG, PNG or TIFF images directly into it, or into a subfolder 'images'.",
        )
    shown = "; ".join(f"{f.subject}: {f.message}" for f in left_out[:3])
    more = f"; and {len(left_out) - 3} more" if len(left_out) > 3 else ""
    return CaptureError(
        f"of {count(len(left_out), 'image file')} none can be used ({shown}{more})",
        path=folder,
        remedy=(
            "Convert them to JPEG or TIFF, or copy the JPEG files that the camera took beside them."
            if all(finding.code == "unsupported-format" for finding in left_out)
            else "Give the folder of the photographs themselves."
            if all(finding.code == "other-camera" for finding in left_out)
            else "Copy the photographs again from the camera."
        ),
    )


def read_photo(candidate: Candidate, max_pixels: int = MAX_PIXELS) -> tuple[Photo | None, list[Finding]]:
    """The photograph that a file is and what is odd about it, or the finding that leaves it out.

    Only TIFF and PNG are decoded.
    """
    try:
        photo, problems = _opened(candidate, max_pixels)
    except _LeaveOut as why:
        code, message = why.args
    except Image.DecompressionBombError as error:
        # Pillow refuses these before it tells their size otherwise.
        pixels = re.search(r"[0-9]+", str(error))
        size = f"{int(pixels[0]) / 1e6:.0f} Mpx" if pixels else "the image"
        code, message = "too-large", _too_large(size, max_pixels)
    except OSError as error:
        code, message = "truncated", "the file is damaged or cut short; copy it again from the camera"
        if isinstance(error, UnidentifiedImageError) and candidate.format == "TIFF":
            code, message = "unsupported-format", "a TIFF of an unknown kind, or damaged; convert it to 8 bits"
        elif error.errno is not None:
            code, message = "unreadable", f"cannot be read ({(error.strerror or str(error)).lower()})"
    # Pillow's readers raise whatever a damaged header leads them into (SyntaxError, struct.error, ValueError …).
    except Exception as error:
        code, message = "truncated", f"the file is damaged ({type(error).__name__})"
    else:
        return photo, [Finding(candidate.name, *problem) for problem in problems]
    return None, [Finding(candidate.name, code, message, True)]


class _LeaveOut(Exception):
    """Why a file cannot be used: a finding's code and message."""


def _opened(candidate: Candidate, max_pixels: int) -> tuple[Photo, list[Problem]]:
    with warnings.catch_warnings():
        # Pillow warns of large images and of odd EXIF; both are findings here.
        warnings.simplefilter("ignore")
        with Image.open(candidate.path, formats=[candidate.format]) as image:
            width, height = image.size
            if image.info.get("Software") == DRAWN_BY:
                raise _LeaveOut("other-camera", "a picture that fieldkit drew, no photograph")
            if width * height > max_pixels:
                raise _LeaveOut("too-large", _too_large(f"{width}×{height} pixels", max_pixels))
            if candidate.path.stat().st_size > _MAX_FILE_BYTES:
                raise _LeaveOut("too-large", "the file is larger than 2 GiB")
            data = candidate.path.read_bytes()
            if isinstance(image, TiffImagePlugin.TiffImageFile) and (refusal := tiff_refusal(image)):
                raise _LeaveOut("unsupported-format", refusal)
            if candidate.format == "PNG":  # whose metadata may stand behind the pixels
                image.load()
            sha256 = hashlib.sha256(data).hexdigest()
            bare = Photo(candidate.path.absolute(), candidate.name, width, height, candidate.format, sha256)
            photo, problems = with_exif(bare, image)
            if photo.projection.lower() not in ("", "perspective", "rectilinear"):
                raise _LeaveOut("other-camera", f"a panorama ({photo.projection[:40]}), no photograph of one view")
    if candidate.format == "JPEG" and not jpeg_is_complete(data):
        raise _LeaveOut("truncated", "the file is cut short; copy it again from the camera")
    return photo, problems


def distinct(photos: Sequence[Photo], located: Collection[str] = ()) -> tuple[list[Photo], list[Finding]]:
    """One photograph of each content: the first that is ``located``, else the first.

    Of one that was saved again by another program, those that say when it was taken count, of these the largest, and
    of these the shortest name. Where nothing says it, all of one shape are compared.
    """
    kept: dict[str, Photo] = {}
    for photo in sorted(photos, key=lambda each: each.name not in located):
        kept.setdefault(photo.sha256, photo)
    why = {
        photo.name: f"the same bytes as {kept[photo.sha256].name}"
        for photo in photos
        if photo is not kept[photo.sha256]
    }
    moments, shapes = dict[tuple[object, ...], list[Photo]](), dict[float, list[Photo]]()
    for photo in kept.values():
        shapes.setdefault(round(photo.width / photo.height, 2), []).append(photo)
        if photo.captured_at is not None:
            place = photo.geotag and (round(photo.geotag.latitude_deg, 7), round(photo.geotag.longitude_deg, 7))
            moments.setdefault((photo.captured_at, place, photo.make, photo.model, photo.serial), []).append(photo)
    details: dict[Path, Float32Array] = {}
    few = (those for those in shapes.values() if len(those) <= _MOST_COMPARED)
    for alike, timed in [*((those, True) for those in moments.values()), *((those, False) for those in few)]:
        alike.sort(key=lambda e: (e.name not in located, e.captured_at is None, -e.width * e.height, len(e.name)))
        for k, photo in enumerate(alike):
            others = (e for e in alike[:k] if timed or None in (e.captured_at, photo.captured_at))
            others = (e for e in others if not {e.name, photo.name} & why.keys())
            first = next((e for e in others if saved_again(e.path, photo.path, details)), None)
            if first is not None:
                why[photo.name] = f"{first.name} again, saved by another program"
    findings = [Finding(photo.name, "duplicate", why[photo.name], True) for photo in photos if photo.name in why]
    return [photo for photo in photos if photo.name not in why], findings


def listed_names(sidecars: Mapping[str, Path]) -> list[str]:
    """Names in the sidecar that the positions come from."""
    kind = next((kind for kind in _POSITIONS if kind in sidecars), None)
    return [] if kind is None else [row.image for row in _POSITIONS[kind][0](sidecars[kind])[0]]


def _too_large(what: str, max_pixels: int) -> str:
    return f"{what} is more than the limit of {max_pixels / 1e6:.0f} Mpx; not decoded"


def _cameras(
    photos: Sequence[Photo], parts: Sequence[Part], camera: Path | None, program: ProgramPoses | None
) -> tuple[list[CameraGroup], list[Finding]]:
    """Camera groups of all parts; those of one camera, calibrated alike, are one."""
    by_name = {photo.name: photo for photo in photos}
    merged: dict[tuple[object, ...], CameraGroup] = {}
    findings: list[Finding] = []
    for part in parts:
        members = [replace(by_name[name], name=own) for own, name in part.names.items()]
        entries, file = camera_entries(part.sidecars, camera)
        groups, odd = _program_cameras(members, program) if file is None else group_cameras(members, entries, file)
        if not part.whole:
            odd = [finding for finding in odd if finding.code != "camera-unused"]
        elif "camera.toml" in part.sidecars and "camera.json" in part.sidecars:
            odd = [*odd, Finding("camera.json", "sidecar-unused", "camera.toml is used instead")]
        findings += [replace(f, subject=part.names.get(f.subject, f.subject)) for f in odd]
        for group in groups:
            same = (group.key, group.intrinsics, group.source, group.fixed)
            earlier = merged[same].photos if same in merged else ()
            merged[same] = replace(group, photos=(*earlier, *(part.names[name] for name in group.photos)))
    keys: dict[str, int] = {}
    result = []
    for group in merged.values():
        number = keys[group.key] = keys.get(group.key, 0) + 1
        result.append(group if number == 1 else replace(group, key=f"{group.key} ({number})"))
    return result, findings


def _program_cameras(photos: list[Photo], program: ProgramPoses | None) -> tuple[list[CameraGroup], list[Finding]]:
    """Cameras as another program calibrated them, where it did; else as `group_cameras`."""
    if program is None:
        return group_cameras(photos)
    entries = program.camera_entries()
    kept = [entry for entry in entries if _fits(entry, photos)]
    findings = []
    if len(kept) < len(entries):
        message = f"a calibration of {program.program} is of pictures of another shape; not used"
        findings.append(Finding(program.path.name, "camera-unused", message))
    groups, odd = group_cameras(photos, kept, program.path if kept else None, program.program)
    return groups, [*findings, *odd]


def _fits(entry: CameraEntry, photos: list[Photo]) -> bool:
    """Whether a calibration can be that of all photographs that it names."""
    return all(entry.intrinsics.at_size(photo.width, photo.height) for photo in photos if entry.covers(photo.name))


def _priors(photos: Sequence[Photo], parts: Sequence[Part], program: ProgramPoses | None) -> PriorSet:
    """poses.csv before geo.txt before another program before GPS: the first kind that names any of the photographs."""
    for kind, (read, made) in _POSITIONS.items():
        rows: list[Any] = []
        findings: list[Finding] = []
        for part in parts:
            if kind not in part.sidecars:
                continue
            found, odd = read(part.sidecars[kind])
            if not part.whole:
                meant = part.renamed(row.image for row in found)
                found = [replace(row, image=meant[row.image]) for row in found if row.image in meant]
                odd = [replace(each, subject=meant[each.subject]) for each in odd if each.subject in meant]
            rows += found
            findings += odd
        if not rows:
            continue
        with about(next(part.sidecars[kind] for part in parts if kind in part.sidecars)):
            priors = made(photos, rows)
            findings += against_gps(photos, priors.priors, priors.origin, kind)
        if kind == "poses.csv" and any(part.whole and "geo.txt" in part.sidecars for part in parts):
            findings.append(Finding("geo.txt", "sidecar-unused", "poses.csv is used instead"))
        return replace(priors, findings=(*findings, *priors.findings))
    if program is not None and program.metric:
        priors = priors_from_program(photos, program)
        with about(program.path):
            odd = against_gps(photos, priors.priors, priors.origin, program.path.name)
        return replace(priors, findings=(*priors.findings, *odd))
    return priors_from_gps(photos)


_POSITIONS: dict[str, tuple[Callable[[Path], Any], Callable[[Sequence[Photo], list[Any]], PriorSet]]] = {
    "poses.csv": (read_poses_csv, priors_from_poses),
    "geo.txt": (read_geo_txt, priors_from_geo),
}
"""Sidecars with positions: how they are read, and what priors they give."""
