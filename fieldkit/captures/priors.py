"""What is known of the photographs' poses: poses.csv before geo.txt before other programs before EXIF GPS."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np
from scipy.spatial import cKDTree

from fieldkit.arrays import FloatArray
from fieldkit.captures.crs import frame_about
from fieldkit.captures.geo_txt import GeoRow
from fieldkit.captures.heights import accuracy_m, choose_heights
from fieldkit.captures.model import GeoTag, Photo
from fieldkit.captures.poses_csv import PoseRow
from fieldkit.captures.programs.model import ANGLE_ACCURACY_DEG, ProgramPoses
from fieldkit.captures.tables import match_names
from fieldkit.documents.mistaken import CENTIMETRES
from fieldkit.errors import MetadataError
from fieldkit.geometry.geodesy import LocalFrame, geodetic_to_ecef
from fieldkit.geometry.pose import wrapped_deg
from fieldkit.geometry.priors import POSITION_SIGMA_M, Angles, PosePrior
from fieldkit.results.finding import Finding
from fieldkit.wording import count

_MIN_FOR_SCALE = 3
"""Least number of positions that give a scale."""
_WIDE_SPACING_M = 15.0
"""Distance between neighbours beyond which positions are hardly metres, metres."""
_NARROW_EXTENT_M = 0.02
"""Extent of a capture below which positions are hardly metres, metres."""
_MAX_EXTENT_M = 50_000.0
"""Distance from the others beyond which a position is left out, metres."""
_SAME_M = 1e-3
"""What receivers' last digits change by at least."""
_CLIMBED_M = 0.5
"""Climb between photographs at one place that makes them other views, metres."""
_TURNED_DEG = 5.0
"""Turn between photographs at one place that makes them other views, degrees."""
_ZEROS_MESSAGE = "yaw, pitch and roll are 0 in all photographs, so they were not measured; not used"


@dataclass(frozen=True)
class PriorSet:
    """Priors and the frame they are in; the fields of `fieldkit.captures.Capture` of the same names."""

    priors: dict[str, PosePrior] = field(default_factory=dict)
    metric_source: str | None = None
    origin: LocalFrame | None = None
    height_source: str | None = None
    findings: tuple[Finding, ...] = ()
    to_take_off_m: Mapping[str, float] = field(default_factory=dict)


def priors_from_poses(photos: Sequence[Photo], rows: Sequence[PoseRow]) -> PriorSet:
    """Priors from poses.csv; its frame is the metric frame. XMP angles are not mixed in: north may be elsewhere.

    Where it gives longitude and latitude, the frame is a local east-north-up one, as of geo.txt, and photographs
    without angles of its own have those of their XMP.
    """
    matched, findings = _match([row.image for row in rows], photos, "poses.csv")
    if any(row.geographic for row in rows):
        return _finish(_from_degrees(photos, rows, matched, findings), photos)
    unmeasured = _all_zero([(row.yaw_deg, row.pitch_deg, row.roll_deg) for row in rows])
    if unmeasured:
        findings.append(Finding("poses.csv", "angles-zero", _ZEROS_MESSAGE))
    priors = {}
    for row in rows:
        name = matched.get(row.image)
        if name is None:
            continue
        prior = row.prior("poses.csv")
        priors[name] = prior.with_angles(None) if unmeasured else prior
    # Where GPS knows their lengths, against_gps compares them.
    tagged = sum(photo.geotag is not None and photo.name in priors for photo in photos)
    doubt = unit_doubt(np.array([p.position for p in priors.values()], dtype=float))
    if doubt and tagged < _MIN_FOR_SCALE:
        findings.append(Finding("poses.csv", "unit-suspicious", doubt))
    ordered = {photo.name: priors[photo.name] for photo in photos if photo.name in priors}
    return _finish(PriorSet(ordered, "poses.csv", None, None, tuple(findings)), photos)


def unit_doubt(positions: FloatArray) -> str:
    """Why camera positions (n, 3) may not be metres, in words; empty where nothing speaks so.

    Two rules of thumb: neighbouring photographs of one plot are not more than 15 m apart (median of the
    nearest-neighbour distances: 24–31 "m" for a rig's circle in millimetres, 1–12 m for drones), and a capture is more
    than 2 cm wide.
    """
    if len(positions) < _MIN_FOR_SCALE:
        return ""
    extent = float(np.linalg.norm(np.ptp(positions, axis=0)))
    if 0.0 < extent < _NARROW_EXTENT_M:
        return f"all positions lie within {extent * 1000:.1f} mm of one another; are they metres?"
    spacing = float(np.median(cKDTree(positions).query(positions, k=2)[0][:, 1]))
    if spacing <= _WIDE_SPACING_M:
        return ""
    return f"neighbouring photographs would be {spacing:.0f} m apart: {CENTIMETRES.looks_like}"


def _from_degrees(
    photos: Sequence[Photo], rows: Sequence[PoseRow], matched: dict[str, str], findings: list[Finding]
) -> PriorSet:
    if not all(row.geographic for row in rows):
        raise MetadataError(
            "some poses.csv give longitude and latitude, others x and y", remedy="Give all in the same coordinates."
        )
    by_name = {matched[row.image]: row for row in rows if row.image in matched}
    tags = {
        name: GeoTag(row.position[1], row.position[0], row.position[2], horizontal_accuracy_m=row.accuracy_m)
        for name, row in by_name.items()
    }
    return _georeferenced([_turned(p, by_name.get(p.name)) for p in photos], tags, "poses.csv", findings)


def _turned(photo: Photo, row: PoseRow | None) -> Photo:
    """A photograph with the angles that a row gives instead of its own."""
    if row is None or (row.yaw_deg is None and row.pitch_deg is None):
        return photo
    return replace(photo, yaw_deg=row.yaw_deg, pitch_deg=row.pitch_deg, roll_deg=row.roll_deg)


def priors_from_geo(photos: Sequence[Photo], rows: Sequence[GeoRow]) -> PriorSet:
    """Priors from geo.txt in a local east-north-up frame, with the photographs' XMP angles."""
    matched, findings = _match([row.image for row in rows], photos, "geo.txt")
    tags: dict[str, GeoTag] = {matched[row.image]: row for row in rows if row.image in matched}
    return _finish(_georeferenced(photos, tags, "geo.txt", findings), photos)


def priors_from_gps(photos: Sequence[Photo]) -> PriorSet:
    """Priors from EXIF GPS in a local east-north-up frame; where there is none, XMP angles alone."""
    tags = {photo.name: photo.geotag for photo in photos if photo.geotag is not None}
    findings: list[Finding] = []
    if tags:
        without = [photo.name for photo in photos if photo.name not in tags]
        findings += [Finding(name, "no-gps", "no usable GPS position; others have one") for name in without]
    return _finish(_georeferenced(photos, tags, "EXIF GPS", findings), photos)


def priors_from_program(photos: Sequence[Photo], program: ProgramPoses) -> PriorSet:
    """Priors from another program's poses whose lengths are metres; its frame is the metric frame."""
    accuracy = program.accuracy or POSITION_SIGMA_M
    priors = {}
    for photo in photos:
        pose = program.poses.get(photo.name)
        if pose is None:
            continue
        prior = PosePrior(pose.center, accuracy, angle_sigma_deg=ANGLE_ACCURACY_DEG, source=program.program)
        angles = None if photo.name in program.unoriented else pose.yaw_pitch_roll_deg()
        priors[photo.name] = prior.with_angles(angles)
    heights = None if program.origin is None else program.program
    return _finish(PriorSet(priors, program.program, program.origin, heights), photos)


def _match(listed: list[str], photos: Sequence[Photo], source: str) -> tuple[dict[str, str], list[Finding]]:
    names = [photo.name for photo in photos]
    matched = match_names(listed, names)
    if not matched:
        examples = ", ".join(listed[:2])
        raise MetadataError(
            f"{source} names no photograph of the folder (it has {examples}; the folder {', '.join(names[:2])})",
            remedy=f"Write the photographs' file names into {source}, or move it away.",
        )
    findings = []
    targets: dict[str, str] = {}
    for entry in listed:
        name = matched.get(entry)
        if name is None:
            findings.append(Finding(entry, "pose-without-photo", f"listed in {source}, but not among the photographs"))
        elif name in targets:
            raise MetadataError(
                f"{source} has two lines for {name} ({targets[name]} and {entry})",
                remedy="Keep one line per photograph.",
            )
        else:
            targets[name] = entry
    findings += [
        Finding(name, "photo-without-pose", f"not listed in {source}") for name in names if name not in targets
    ]
    return matched, findings


def _georeferenced(photos: Sequence[Photo], tags: dict[str, GeoTag], source: str, findings: list[Finding]) -> PriorSet:
    far, more_far = _far_away(tags)
    chosen = choose_heights({name: tag for name, tag in tags.items() if name not in far})
    findings = [*findings, *chosen.findings, *more_far]
    located = list(chosen.heights)
    priors: dict[str, PosePrior] = {}
    origin = None
    positions: dict[str, FloatArray] = {}
    if located:
        geodetic = np.array([(tags[n].latitude_deg, tags[n].longitude_deg, chosen.heights[n]) for n in located])
        origin = frame_about(geodetic, chosen.datum)
        positions = dict(zip(located, origin.to_local(*geodetic.T), strict=True))
    repeated, step_m = _repeated(photos, positions)
    if repeated:
        message = (
            f"{count(len(repeated), 'photograph has', 'photographs have')} the very place of the one before, this one "
            f"first: the receiver gave no new one, and they are taken for good to {step_m:.1f} m, the usual distance"
        )
        findings.append(Finding(repeated[0], "gps-repeated", message))
    unmeasured = _unmeasured(photos)
    if unmeasured:
        findings.append(_zeros_finding(unmeasured, photos))
    for photo in photos:
        position = positions.get(photo.name)
        if position is None:
            prior = PosePrior(source="XMP")
        else:
            sigma = _accuracy(tags[photo.name], chosen.accuracies_m[photo.name])
            sigma = max(sigma, step_m) if photo.name in repeated else sigma
            prior = PosePrior(position, sigma, source=source)
        if photo.name not in unmeasured:
            prior = prior.with_angles((photo.yaw_deg, photo.pitch_deg, photo.roll_deg))
        if prior.position is not None or prior.angles is not None:
            priors[photo.name] = prior
    height_source = chosen.source if located else None
    return PriorSet(priors, source if located else None, origin, height_source, tuple(findings), chosen.to_take_off_m)


def _repeated(photos: Sequence[Photo], positions: Mapping[str, FloatArray]) -> tuple[list[str], float]:
    """Photographs at exactly the place of the one before, with its heading, and how far apart others follow each other.

    Cameras that write positions more slowly than they photograph repeat the last; a vehicle that hovers turns between
    photographs, or its receiver's last digits change.
    """

    def still(a: Photo, b: Photo) -> bool:
        away = np.abs(positions[b.name] - positions[a.name])
        turned = 0.0 if a.yaw_deg is None or b.yaw_deg is None else abs(wrapped_deg(b.yaw_deg - a.yaw_deg))
        return bool(away[:2].max() < _SAME_M and away[2] < _CLIMBED_M and turned < _TURNED_DEG)

    flown = sorted(
        (p for p in photos if p.name in positions), key=lambda p: (p.captured_at is None, p.captured_at or 0)
    )
    apart = [float(np.linalg.norm(positions[b.name] - positions[a.name])) for a, b in pairwise(flown)]
    moved = [away for away in apart if away > _SAME_M]
    same = [b.name for a, b in pairwise(flown) if still(a, b)]
    return (same, float(np.median(moved))) if moved else ([], 0.0)


def _unmeasured(photos: Sequence[Photo]) -> tuple[str, ...]:
    """Photographs whose yaw, pitch and roll are zeros: all that have any, or some that have all three."""
    angles = {photo.name: (photo.yaw_deg, photo.pitch_deg, photo.roll_deg) for photo in photos}
    if _all_zero(list(angles.values())):
        return tuple(angles)
    return tuple(name for name, own in angles.items() if own == (0.0, 0.0, 0.0)) if len(photos) > 1 else ()


def _zeros_finding(unmeasured: Sequence[str], photos: Sequence[Photo]) -> Finding:
    if len(unmeasured) == len(photos):
        return Finding(photos[0].name, "angles-zero", _ZEROS_MESSAGE)
    message = f"yaw, pitch and roll are 0 in {len(unmeasured)} of {len(photos)} photographs, this one first; not used"
    return Finding(unmeasured[0], "angles-zero", message)


def _all_zero(angles: Sequence[Angles]) -> bool:
    """Whether angles (yaw, pitch, roll) of all photographs that have any are zeros that nobody filled in."""
    given = [each for each in angles if any(angle is not None for angle in each)]
    return len(given) > 1 and not any(any(each) for each in given)


def _accuracy(tag: GeoTag, height_m: float) -> float:
    """One standard deviation of a position whose height is good to ``height_m``."""
    return max(accuracy_m(tag, tag.horizontal_accuracy_m, tag.vertical_accuracy_m), height_m)


def _far_away(tags: dict[str, GeoTag]) -> tuple[set[str], list[Finding]]:
    """Positions far from the others, as a camera writes them before its first fix: they would tilt the frame."""
    if len(tags) < _MIN_FOR_SCALE:
        return set(), []
    degrees = np.array([(tag.latitude_deg, tag.longitude_deg) for tag in tags.values()])
    points = geodetic_to_ecef(degrees[:, 0], degrees[:, 1], 0.0)
    distance = np.linalg.norm(points - np.median(points, axis=0), axis=1)
    far = {name for name, d in zip(tags, distance, strict=True) if d > _MAX_EXTENT_M}
    message = "the position is more than 50 km from the other photographs'; not used"
    return far, [Finding(name, "gps-far-away", message) for name in sorted(far)]


def _finish(priors: PriorSet, photos: Sequence[Photo]) -> PriorSet:
    """Three positions are the least that scale and orient a model."""
    count = sum(prior.position is not None for prior in priors.priors.values())
    if priors.metric_source is None or count >= _MIN_FOR_SCALE:
        return priors
    message = f"{priors.metric_source} locates {count} of {len(photos)} photographs; scale and orientation need 3"
    finding = Finding(photos[0].name, "too-few-positions", message)
    return replace(priors, metric_source=None, findings=(*priors.findings, finding))
