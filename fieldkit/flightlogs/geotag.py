"""Photographs and a flight log: where each was taken, as poses.csv. The photographs themselves are only read."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import UTC
from pathlib import Path

from fieldkit.captures.capture import read_capture
from fieldkit.captures.heights import BAROMETER_ACCURACY_M, GPS_ACCURACY_M, RTK_ACCURACY_M
from fieldkit.captures.model import Photo
from fieldkit.captures.poses_csv import PoseRow, poses_table
from fieldkit.errors import MetadataError
from fieldkit.files import check_writable, write_atomic
from fieldkit.flightlogs.achieved import FixedMount, achieved_pose
from fieldkit.flightlogs.matching import Matches, Stamp, match_log
from fieldkit.flightlogs.model import FlightLog, Trigger
from fieldkit.flightlogs.reading import read_flight_log
from fieldkit.geometry.geodesy import EAST_DEG, LocalFrame, plot_from_enu
from fieldkit.regular_files import check_replaceable
from fieldkit.wording import count


@dataclass(frozen=True)
class GeotagReport:
    """What `geotag` did."""

    images: int
    poses: tuple[PoseRow, ...]
    """Of those that were matched, in the order of the photographs."""
    matches: Matches
    """How photographs and triggers belong together."""
    origin: LocalFrame
    """Of the frame of the poses (z up; z = 0 at its altitude above mean sea level)."""
    origin_source: str
    """Where that is from: "home of the log", "given", "first trigger"."""
    triggers: int
    remarks: tuple[str, ...]
    """Of the log and of the matching."""


def geotag(
    images: Path,
    log: Path,
    output: Path,
    *,
    origin: LocalFrame | None = None,
    heading_deg: float = EAST_DEG,
    mount: FixedMount | None = None,
    offset_s: float | None = None,
    camera: int | None = None,
    overwrite: bool = False,
) -> GeotagReport:
    """Write a poses.csv for the photographs of a flight.

    Positions are the autopilot's estimate of the vehicle's place, in one frame.

    Args:
        images: folder of photographs; nothing in it is changed, but for ``output`` where that lies in it.
        log: flight log.
        output: poses.csv to write.
        origin: of the frame, its altitude above mean sea level; None takes the log's home.
        heading_deg: compass heading of the frame's x axis: of a plot's rows, so that it is the plan's frame.
        mount: of a camera without a gimbal.
        offset_s: camera's clock less UTC, where it is known.
        camera: number of the camera in a log with triggers of several; None takes the one that fits.
        overwrite: replace ``output``.
    """
    output = Path(output)
    check_replaceable(output, overwrite=overwrite)
    check_writable(output.parent)
    flight = read_flight_log(log)
    if not flight.triggers:
        raise MetadataError(
            "holds no camera trigger",
            path=flight.path,
            remedy="Let the autopilot release the shutter (CAM1_TYPE, TRIG_INTERFACE), and log CAMERA_FEEDBACK, CAM or "
            "camera_capture.",
        )
    capture = read_capture(images, sidecars=False)
    photos = capture.photos
    frame, source = frame_of(flight, origin)
    flight, matches = match_log([stamp(photo) for photo in photos], flight, offset_s=offset_s, camera=camera)
    poses = local_poses(flight, matches, frame, [p.name for p in photos], mount)
    if not poses:
        said = f": {'; '.join(matches.remarks)}" if matches.remarks else ""
        raise MetadataError(
            f"of {count(len(photos), 'photograph')} none could be matched to its "
            f"{count(len(flight.triggers), 'trigger')}{said}",
            path=log,
            remedy="Check that log and photographs are of one flight; --camera-offset gives the camera's clock error.",
        )
    poses = [turned(pose, heading_deg) for pose in poses]
    write_atomic(output, poses_table(poses))
    others = (f"{f.subject}: left out: {f.message}" for f in capture.findings if f.code == "other-camera")
    remarks = (*flight.remarks, *matches.remarks, *others)
    return GeotagReport(len(photos), tuple(poses), matches, frame, source, len(flight.triggers), remarks)


def stamp(photo: Photo) -> Stamp:
    """When and where a photograph says it was taken. EXIF's local time is counted as if it were UTC."""
    taken, tag = photo.captured_at, photo.geotag
    time = None if taken is None else taken.replace(tzinfo=UTC).timestamp()
    if tag is None:
        return Stamp(photo.name, time)
    return Stamp(photo.name, time, tag.latitude_deg, tag.longitude_deg)


def frame_of(flight: FlightLog, origin: LocalFrame | None = None) -> tuple[LocalFrame, str]:
    """The local frame of a flight's poses, and what its origin is."""
    if origin is not None:
        return origin, "given"
    first = next((t.place for t in flight.triggers if t.place is not None and t.place.amsl_m is not None), None)
    for place, source in ((flight.home, "home of the log"), (first, "first trigger")):
        if place is not None and place.amsl_m is not None:
            return LocalFrame(place.latitude_deg, place.longitude_deg, place.amsl_m, "sea level"), source
    own = "another log of the flight" if flight.kind != "tlog" else "the autopilot's own log (.BIN, .ulg)"
    raise MetadataError("says of no trigger where it was", path=flight.path, remedy=f"Give {own}.")


def local_poses(
    flight: FlightLog,
    matches: Matches,
    frame: LocalFrame,
    names: Sequence[str],
    mount: FixedMount | None = None,
) -> list[PoseRow]:
    """Poses of the matched photographs, in the order of ``names``; those whose trigger has no place are left out."""
    by_name = {pair.photograph: pair.trigger for pair in matches.pairs}
    poses = []
    for name in names:
        if name not in by_name:
            continue
        trigger = flight.triggers[by_name[name]]
        pose = achieved_pose(trigger, mount)
        place = pose.place
        if place is None or place.amsl_m is None:
            continue
        x, y, z = frame.to_local(place.latitude_deg, place.longitude_deg, place.amsl_m)[0].tolist()
        poses.append(PoseRow(name, (x, y, z), pose.yaw_deg, pose.pitch_deg, accuracy_m=_accuracy_m(trigger)))
    return poses


def _accuracy_m(trigger: Trigger) -> float:
    """What the worse of a trigger's place and height is good to; an estimate's height is the barometer's, as a rule."""
    if trigger.accuracy_m is None:
        return GPS_ACCURACY_M
    height = BAROMETER_ACCURACY_M if trigger.height_accuracy_m is None else trigger.height_accuracy_m
    return max(trigger.accuracy_m, height, RTK_ACCURACY_M)


def turned(pose: PoseRow, heading_deg: float) -> PoseRow:
    """A pose of an east-north-up frame in the frame about the same origin whose x axis has a compass heading."""
    if heading_deg == EAST_DEG:
        return pose
    x, y, z = (plot_from_enu(heading_deg) @ pose.position).tolist()
    yaw = None if pose.yaw_deg is None else (pose.yaw_deg - heading_deg + EAST_DEG) % 360.0
    return replace(pose, position=(x, y, z), yaw_deg=yaw)
