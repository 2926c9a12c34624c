"""Reading a folder of photographs into a `Capture`."""

from __future__ import annotations

import hashlib
import re
import warnings
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from PIL import Image

from fieldkit.captures.camera_file import CameraEntry, read_camera_file
from fieldkit.captures.cameras import group_cameras
from fieldkit.captures.decode import PngMetadata, dark_refusal, jpeg_is_complete, read_png_metadata, tiff_refusal
from fieldkit.captures.exif import with_exif
from fieldkit.captures.folder import Candidate, FolderContents, folders_of_photographs, list_capture
from fieldkit.captures.geo_txt import read_geo_txt
from fieldkit.captures.gps_tags import Problem, settle_hemispheres
from fieldkit.captures.markers_file import read_markers_file
from fieldkit.captures.model import CameraGroup, Capture, Photo
from fieldkit.captures.one_camera import one_camera
from fieldkit.captures.poses_csv import read_poses_csv
from fieldkit.captures.priors import PriorSet, priors_from_geo, priors_from_gps, priors_from_poses, priors_from_program
from fieldkit.captures.programs import PosesFile, ProgramPoses, program_of
from fieldkit.captures.tables import match_names
from fieldkit.errors import CaptureError, MetadataError
from fieldkit.results.finding import Finding
from fieldkit.wording import count

MAX_PIXELS = 150_000_000
"""More than any single camera frame that flies today (100 Mpx), and 450 MB once decoded to RGB."""
_MAX_FILE_BYTES = 2 << 30


@dataclass(frozen=True)
class ReadPhoto:
    """A file that was read: the photograph, None where it cannot be used, and what is odd about it."""

    photo: Photo | None
    findings: tuple[Finding, ...]


def read_capture(
    folder: Path, *, max_pixels: int = MAX_PIXELS, sidecars: bool = True, poses: PosesFile | None = None
) -> Capture:
    """Read a folder of photographs and what lies beside them. Nothing is decoded and nothing written.

    Photographs are JPEG, PNG or TIFF by content, directly in ``folder`` or, when there are none, in
    ``folder/images`` or in a card's folders 100MEDIA, 101MEDIA and so on. Whatever cannot be used is left out and named
    in ``findings``, and so are photographs of another camera than most (`one_camera`); one photograph is enough here
    (reconstruction asks for more).

    Args:
        folder: with the photographs.
        max_pixels: larger images are left out undecoded (decompression bombs); Pillow's own limit of 178 Mpx
            holds besides.
        sidecars: whether poses.csv, geo.txt and other programs' results are looked at.
        poses: another program's result to take poses from; None takes what lies in the folder.
    """
    folder = Path(folder)
    contents = list_capture(folder)
    if not sidecars:
        others = {name: path for name, path in contents.sidecars.items() if name not in ("poses.csv", "geo.txt")}
        contents = replace(contents, sidecars=others)
    photos: list[Photo] = []
    findings = list(contents.findings)
    for candidate in contents.candidates:
        read = read_photo(candidate, max_pixels)
        findings.extend(read.findings)
        if read.photo is not None:
            photos.append(read.photo)
    if not photos:
        raise _no_photographs(folder, findings)
    photos, duplicates = _distinct(photos, contents)
    entries, _ = camera_entries(contents.sidecars)
    names = [photo.name for photo in photos]
    located = set(match_names(listed_names(contents.sidecars), names).values())
    kept, other_cameras = one_camera(photos, located=located, calibrated=names_in(entries, names))
    aside = set(names) - {photo.name for photo in kept}
    photos, hemispheres = settle_hemispheres(kept)
    findings = [*without_findings_of(aside, findings), *duplicates, *other_cameras, *hemispheres]
    folders = (folder.absolute(), contents.image_folder.absolute())
    sizes = {photo.name: (photo.width, photo.height) for photo in photos}
    program, odd = program_of(sizes, folders, poses) if sidecars or poses is not None else (None, ())
    groups, camera_findings = _cameras(photos, contents, program)
    priors = _priors(photos, contents, program)
    findings += [*camera_findings, *without_findings_of(aside, [*odd, *priors.findings])]
    markers = contents.sidecars.get("markers.toml")
    capture = assembled(folders, photos, groups, findings, priors, markers)
    return capture if program is None or priors.metric_source == program.program else replace(capture, program=program)


def camera_entries(
    sidecars: Mapping[str, Path], otherwise: Path | None = None
) -> tuple[Sequence[CameraEntry], Path | None]:
    """What a folder's camera file says, and which file that is; ``otherwise`` where the folder has none."""
    path = sidecars.get("camera.toml") or sidecars.get("camera.json") or otherwise
    return (() if path is None else read_camera_file(path)), path


def names_in(entries: Sequence[CameraEntry], names: Iterable[str]) -> set[str]:
    """Of photographs, those that a camera file names."""
    return {name for name in names if any(entry.images and entry.covers(name) for entry in entries)}


def without_findings_of(aside: Collection[str], findings: Sequence[Finding]) -> list[Finding]:
    """Findings but for those of photographs that are set aside, under whatever names sidecars give them."""
    meant = match_names([f.subject for f in findings if not f.left_out], aside)
    return [f for f in findings if f.left_out or f.subject not in meant]


def assembled(
    folders: tuple[Path, Path],
    photos: Sequence[Photo],
    groups: Sequence[CameraGroup],
    findings: Sequence[Finding],
    priors: PriorSet,
    markers: Path | None,
) -> Capture:
    """A capture of its parts: folder and image folder, and perhaps a markers.toml, which is read here."""
    return Capture(
        *folders,
        photos=tuple(photos),
        groups=tuple(groups),
        findings=tuple(findings),
        priors=priors.priors,
        metric_source=priors.metric_source,
        origin=priors.origin,
        height_source=priors.height_source,
        markers=None if markers is None else read_markers_file(markers),
    )


def _no_photographs(folder: Path, findings: list[Finding]) -> CaptureError:
    left_out = [f for f in findings if f.left_out]
    inner = [] if left_out else folders_of_photographs(folder)
    if inner:
        return CaptureError(
            f"there are no photographs directly in this folder, only in {', '.join(inner[:5])}"
            + (f" and {count(len(inner) - 5, 'more folder')}" if len(inner) > 5 else ""),
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
            else "Copy the photographs again from the camera."
        ),
    )


def read_photo(candidate: Candidate, max_pixels: int = MAX_PIXELS) -> ReadPhoto:
    """The photograph that a file is, or the finding that leaves it out. Only a TIFF is decoded."""
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
        if error.errno is not None:
            code, message = "unreadable", f"cannot be read ({(error.strerror or str(error)).lower()})"
    # Pillow's readers raise whatever a damaged header leads them into (SyntaxError, struct.error, ValueError …).
    except Exception as error:
        code, message = "truncated", f"the file is damaged ({type(error).__name__})"
    else:
        return ReadPhoto(photo, tuple(Finding(candidate.name, *problem) for problem in problems))
    return ReadPhoto(None, (Finding(candidate.name, code, message, True),))


class _LeaveOut(Exception):
    """Why a file cannot be used: a finding's code and message."""


def _opened(candidate: Candidate, max_pixels: int) -> tuple[Photo, list[Problem]]:
    png: PngMetadata | None = None
    if candidate.format == "TIFF" and candidate.path.stat().st_size <= _MAX_FILE_BYTES:
        refusal = tiff_refusal(candidate.path.read_bytes())
        if refusal is not None:
            raise _LeaveOut("unsupported-format", refusal)
    with warnings.catch_warnings():
        # Pillow warns of large images and of odd EXIF; both are findings here.
        warnings.simplefilter("ignore")
        with Image.open(candidate.path, formats=[candidate.format]) as image:
            width, height = image.size
            if width * height > max_pixels:
                raise _LeaveOut("too-large", _too_large(f"{width}×{height} pixels", max_pixels))
            if candidate.path.stat().st_size > _MAX_FILE_BYTES:
                raise _LeaveOut("too-large", "the file is larger than 2 GiB")
            data = candidate.path.read_bytes()
            if candidate.format == "PNG":
                png = read_png_metadata(data)
            sha256 = hashlib.sha256(data).hexdigest()
            bare = Photo(candidate.path.absolute(), candidate.name, width, height, candidate.format, sha256)
            photo, problems = with_exif(bare, image, png)
            if candidate.format == "TIFF":
                image.load()
                refusal = dark_refusal(image)
                if refusal is not None:
                    raise _LeaveOut("unsupported-format", refusal)
    if (candidate.format == "PNG" and png is None) or (candidate.format == "JPEG" and not jpeg_is_complete(data)):
        raise _LeaveOut("truncated", "the file is cut short; copy it again from the camera")
    return photo, problems


def _distinct(photos: list[Photo], contents: FolderContents) -> tuple[list[Photo], list[Finding]]:
    """One photograph of each content: the one that poses.csv or geo.txt names, else the first."""
    groups: dict[str, list[Photo]] = {}
    for photo in photos:
        groups.setdefault(photo.sha256, []).append(photo)
    if len(groups) == len(photos):
        return photos, []
    located = set(match_names(listed_names(contents.sidecars), [photo.name for photo in photos]).values())
    kept = {key: next((p.name for p in group if p.name in located), group[0].name) for key, group in groups.items()}
    findings = [
        Finding(photo.name, "duplicate", f"the same bytes as {kept[photo.sha256]}", True)
        for photo in photos
        if photo.name != kept[photo.sha256]
    ]
    return [photo for photo in photos if photo.name == kept[photo.sha256]], findings


def listed_names(sidecars: Mapping[str, Path]) -> list[str]:
    """Names in the sidecar that the positions come from."""
    poses, geo = sidecars.get("poses.csv"), sidecars.get("geo.txt")
    if poses is not None:
        return [row.image for row in read_poses_csv(poses)[0]]
    return [] if geo is None else [row.image for row in read_geo_txt(geo)[0]]


def _too_large(what: str, max_pixels: int) -> str:
    return f"{what} is more than the limit of {max_pixels / 1e6:.0f} Mpx; not decoded"


def _cameras(
    photos: list[Photo], contents: FolderContents, program: ProgramPoses | None
) -> tuple[list[CameraGroup], list[Finding]]:
    toml, json_file = contents.sidecars.get("camera.toml"), contents.sidecars.get("camera.json")
    path = toml or json_file
    if path is None:
        return _program_cameras(photos, program)
    groups, findings = group_cameras(photos, read_camera_file(path), path)
    if toml is not None and json_file is not None:
        findings.append(Finding("camera.json", "sidecar-unused", "camera.toml is used instead"))
    return groups, findings


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
    return all(entry.at_size(photo.width, photo.height) for photo in photos if entry.covers(photo.name))


def _priors(photos: list[Photo], contents: FolderContents, program: ProgramPoses | None) -> PriorSet:
    poses, geo = contents.sidecars.get("poses.csv"), contents.sidecars.get("geo.txt")
    try:
        if poses is not None:
            pose_rows, odd = read_poses_csv(poses)
            priors = priors_from_poses(photos, pose_rows)
        elif geo is not None:
            geo_rows, odd = read_geo_txt(geo)
            priors = priors_from_geo(photos, geo_rows)
        elif program is not None and program.metric:
            return priors_from_program(photos, program)
        else:
            return priors_from_gps(photos)
    except MetadataError as error:
        if error.path is None:
            raise MetadataError(error.message, path=poses or geo, remedy=error.remedy) from error
        raise
    if poses is not None and geo is not None:
        odd = [*odd, Finding("geo.txt", "sidecar-unused", "poses.csv is used instead")]
    return replace(priors, findings=(*odd, *priors.findings))
