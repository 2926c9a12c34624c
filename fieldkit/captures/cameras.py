"""Which photographs share a camera, and where its intrinsics come from."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from fieldkit.captures.camera_file import CameraEntry
from fieldkit.captures.model import CameraGroup, Finding, Photo
from fieldkit.errors import MetadataError
from fieldkit.geometry import Intrinsics


def group_cameras(
    photos: Sequence[Photo], entries: Sequence[CameraEntry] = (), path: Path | None = None
) -> tuple[list[CameraGroup], list[Finding]]:
    """One group for each camera (make, model, serial, focal length) and size.

    Intrinsics come from the camera file, else from EXIF (a SIMPLE_RADIAL start value), else from nothing. A file entry
    with globs serves the photographs it names; among several that do, one of the photograph's own size is taken first.

    Args:
        photos: in order.
        entries: of the camera file, if there is one.
        path: that file.

    Raises:
        MetadataError: a photograph has another aspect ratio than the entries that cover it.
    """
    members: dict[tuple[object, ...], list[Photo]] = {}
    for photo in photos:
        entry = _choose_entry(photo, entries, path)
        identity = (photo.make, photo.model, photo.serial, photo.focal_35mm, photo.focal_mm)
        members.setdefault((entry, *identity, photo.width, photo.height), []).append(photo)
    groups: list[CameraGroup] = []
    findings: list[Finding] = []
    for key, shared in members.items():
        index = key[0] if isinstance(key[0], int) else None
        group, more = _make_group(shared, None if index is None else entries[index], index, path)
        groups.append(group)
        findings.extend(more)
    findings.extend(_mixed(list(members.values())))
    if path is not None:
        for number, camera in enumerate(entries, 1):
            if not any(camera.covers(photo.name) for photo in photos):
                findings.append(Finding(path.name, "camera-unused", f"camera {number} names no photograph"))
    return groups, findings


def _choose_entry(photo: Photo, entries: Sequence[CameraEntry], path: Path | None) -> int | None:
    covering = [i for i, entry in enumerate(entries) if entry.covers(photo.name)]
    named = [i for i in covering if entries[i].images]
    candidates = named or covering
    if not candidates:
        return None
    for i in candidates:
        if (entries[i].intrinsics.width, entries[i].intrinsics.height) == (photo.width, photo.height):
            return i
    for i in candidates:
        if entries[i].at_size(photo.width, photo.height) is not None:
            return i
    own = entries[candidates[0]].intrinsics
    raise MetadataError(
        f"the camera is {own.width}×{own.height}, but {photo.name} is {photo.width}×{photo.height}, "
        "which is another aspect ratio",
        path=path,
        remedy="Give a camera of the photographs' own size, or name its photographs with 'images'.",
    )


def _make_group(
    photos: list[Photo], entry: CameraEntry | None, index: int | None, path: Path | None
) -> tuple[CameraGroup, list[Finding]]:
    first = photos[0]
    names = tuple(photo.name for photo in photos)
    parts = [first.make, first.model, first.serial, _focal_text(first), f"{first.width}x{first.height}"]
    key = " ".join(part for part in parts if part) + ("" if index is None else f" camera {index + 1}")
    if entry is not None and path is not None:
        findings: list[Finding] = []
        intrinsics = entry.at_size(first.width, first.height)
        own = entry.intrinsics
        if intrinsics is not own:
            message = f"the calibration for {own.width}×{own.height} is scaled to {first.width}×{first.height}"
            findings.append(Finding(first.name, "camera-scaled", message))
        return CameraGroup(key, names, intrinsics, path.name.lower(), entry.fixed), findings
    focal = first.focal_px
    if focal is None:
        return CameraGroup(key, names, None, "self-calibrated", False), []
    params = (focal, first.width / 2, first.height / 2, 0.0)
    return CameraGroup(key, names, Intrinsics("SIMPLE_RADIAL", first.width, first.height, params), "EXIF", False), []


def _focal_text(photo: Photo) -> str | None:
    own = None if photo.focal_mm is None else f"{photo.focal_mm:g} mm"
    equivalent = None if photo.focal_35mm is None else f"{photo.focal_35mm:g} mm equivalent"
    return f"{own} ({equivalent})" if own and equivalent else own or equivalent


def _mixed(groups: list[list[Photo]]) -> list[Finding]:
    """A finding for each group beside the largest, saying how it differs from that one."""
    if len(groups) < 2:
        return []
    main = max(groups, key=len)
    findings: list[Finding] = []
    for group in groups:
        if group is main:
            continue
        first, other = group[0], main[0]
        count = "1 photograph" if len(group) == 1 else f"{len(group)} photographs from here"
        if (first.make, first.model, first.serial) != (other.make, other.model, other.serial):
            message = f"{count} by {_describe(first)}, most by {_describe(other)}"
            findings.append(Finding(first.name, "mixed-cameras", f"{message}; calibrated apart"))
        elif (first.focal_mm, first.focal_35mm) != (other.focal_mm, other.focal_35mm):
            message = f"{count} at {_focal_text(first) or 'an unknown focal length'}"
            most = _focal_text(other) or "an unknown focal length"
            findings.append(Finding(first.name, "mixed-focal-lengths", f"{message}, most at {most}; calibrated apart"))
        if (first.width, first.height) != (other.width, other.height):
            sizes = f"{first.width}×{first.height}, most {other.width}×{other.height}"
            findings.append(Finding(first.name, "mixed-sizes", f"{count} of {sizes}; calibrated apart"))
    return findings


def _describe(photo: Photo) -> str:
    parts = [photo.make, photo.model, f"(serial {photo.serial})" if photo.serial else None]
    return " ".join(part for part in parts if part) or "a camera without EXIF"
