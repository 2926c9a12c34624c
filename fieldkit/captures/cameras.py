"""Which photographs share a camera, and where its intrinsics come from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from fieldkit.captures.camera_file import CameraEntry
from fieldkit.captures.model import CameraGroup, Photo
from fieldkit.errors import MetadataError
from fieldkit.geometry import Intrinsics
from fieldkit.results.finding import Finding
from fieldkit.wording import count


def group_cameras(
    photos: Sequence[Photo], entries: Sequence[CameraEntry] = (), path: Path | None = None, source: str = ""
) -> tuple[list[CameraGroup], list[Finding]]:
    """One group for each camera (make, model, serial, focal length) and size.

    Intrinsics come from the camera file, else from the maker's calibration in the XMP, else from EXIF (a SIMPLE_RADIAL
    start value), else from nothing. A file entry
    with globs serves the photographs it names; among several that do, one of the photograph's own size is taken first.
    ``source`` is what the groups name as that of intrinsics from the file, its name where not given.
    """
    members: dict[tuple[object, ...], list[Photo]] = {}
    for photo in photos:
        entry = _choose_entry(photo, entries, path)
        identity = (
            photo.make,
            photo.model,
            photo.serial,
            photo.focal_35mm,
            photo.focal_mm,
            photo.digital_zoom,
            photo.calibration,
        )
        members.setdefault((entry, *identity, photo.width, photo.height), []).append(photo)
    groups: list[CameraGroup] = []
    findings: list[Finding] = []
    for key, shared in members.items():
        index = key[0] if isinstance(key[0], int) else None
        group, more = _make_group(shared, None if index is None else entries[index], index, path)
        if source and group.source == (path and path.name.lower()):
            group = replace(group, source=source)
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
        if entries[i].intrinsics.at_size(photo.width, photo.height) is not None:
            return i
    own = entries[candidates[0]].intrinsics
    raise MetadataError(
        f"the camera is {own.width}×{own.height}, but {photo.name} is {photo.width}×{photo.height}, "
        "which is another aspect ratio",
        path=path,
        remedy="Give a camera of the photographs' own size, or name its photographs with 'images'.",
    )


def _make_group(
    photos: list[Photo],
    entry: CameraEntry | None,
    index: int | None,
    path: Path | None,
) -> tuple[CameraGroup, list[Finding]]:
    first = photos[0]
    names = tuple(photo.name for photo in photos)
    parts = [first.make, first.model, first.serial, _focal_text(first), f"{first.width}x{first.height}"]
    key = " ".join(part for part in parts if part) + ("" if index is None else f" camera {index + 1}")
    if entry is not None and path is not None:
        findings: list[Finding] = []
        intrinsics = entry.intrinsics.at_size(first.width, first.height)
        own = entry.intrinsics
        if intrinsics is not own:
            message = f"the calibration for {own.width}×{own.height} is scaled to {first.width}×{first.height}"
            findings.append(Finding(first.name, "camera-scaled", message))
        return CameraGroup(key, names, intrinsics, path.name.lower(), entry.fixed), findings
    focal = first.focal_px
    if first.calibration is not None:
        return CameraGroup(key, names, first.calibration, "XMP", False), []
    if focal is None:
        return CameraGroup(key, names, None, "self-calibrated", False), []
    zoomed: list[Finding] = []
    if first.digital_zoom > 1.0:
        message = (
            f"{first.digital_zoom:g}× digital zoom: the focal length is taken for {focal:.0f} px; where the 35 mm "
            "equivalent includes the zoom, give camera.toml"
        )
        zoomed.append(Finding(first.name, "digital-zoom", message))
    params = (focal, first.width / 2, first.height / 2, 0.0)
    intrinsics = Intrinsics("SIMPLE_RADIAL", first.width, first.height, params)
    return CameraGroup(key, names, intrinsics, "EXIF", False), zoomed


def _focal_text(photo: Photo) -> str | None:
    own = None if photo.focal_mm is None else f"{photo.focal_mm:g} mm"
    equivalent = None if photo.focal_35mm is None else f"{photo.focal_35mm:g} mm equivalent"
    zoom = "" if photo.digital_zoom == 1.0 else f" {photo.digital_zoom:g}× zoom"
    text = f"{own} ({equivalent})" if own and equivalent else own or equivalent
    return text and text + zoom


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
        those = count(len(group), "photograph", "photographs from here")
        if (first.make, first.model, first.serial) != (other.make, other.model, other.serial):
            message = f"{those} by {_describe(first)}, most by {_describe(other)}"
            findings.append(Finding(first.name, "mixed-cameras", f"{message}; calibrated apart"))
        elif _focal_text(first) != _focal_text(other):
            message = f"{those} at {_focal_text(first) or 'an unknown focal length'}"
            most = _focal_text(other) or "an unknown focal length"
            findings.append(Finding(first.name, "mixed-focal-lengths", f"{message}, most at {most}; calibrated apart"))
        if (first.width, first.height) != (other.width, other.height):
            sizes = f"{first.width}×{first.height}, most {other.width}×{other.height}"
            findings.append(Finding(first.name, "mixed-sizes", f"{those} of {sizes}; calibrated apart"))
    return findings


def _describe(photo: Photo) -> str:
    parts = [photo.make, photo.model, f"(serial {photo.serial})" if photo.serial else None]
    return " ".join(part for part in parts if part) or "a camera without EXIF"
