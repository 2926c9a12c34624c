"""Metashape's cameras as XML (Export Cameras, Agisoft format).

A camera's ``transform`` is a camera-to-chunk matrix, row by row; the camera's axes are x right, y down, z forward. The
transform of its component, or of the chunk, leads from the chunk's own coordinates into geocentric ones (metres, of the
reference's ellipsoid), or into local ones where the reference is LOCAL_CS. Without it the chunk's unit is arbitrary.

Intrinsics by appendix D of the manual: f, cx and cy in pixels, these from the middle of the picture; fx = f + b1; the
manual's p1 is OpenCV's p2 and the other way round.
"""

from __future__ import annotations

from collections import Counter
from xml.etree.ElementTree import Element

import numpy as np

from fieldkit.arrays import FloatArray
from fieldkit.captures.camera_file import CameraEntry
from fieldkit.captures.crs import local_from_crs, local_from_geocentric, parse_crs, to_geodetic
from fieldkit.captures.programs.model import METRES, PosesFile, ProgramPoses
from fieldkit.documents.file_bytes import file_bytes
from fieldkit.documents.xml_tree import XmlError, parse_local
from fieldkit.errors import MetadataError, about
from fieldkit.geometry import Intrinsics, Pose, Similarity
from fieldkit.geometry.geodesy import SEMI_MAJOR_M, LocalFrame, ecef_to_geodetic
from fieldkit.results.finding import Finding
from fieldkit.wording import count

_REMEDY = "Export the cameras again: File > Export > Export Cameras, Agisoft XML."
_MAX_BYTES = 128 << 20
"""Largest file that is read, bytes."""
_EARTH_M = (6.3e6, 6.45e6)  # distances of places near the ground from the Earth's centre
_LARGEST = 1e12
"""Largest number that is believed."""


def read_metashape_xml(given: PosesFile) -> ProgramPoses:
    """The aligned cameras of the chunk that has most."""
    with about(given.path, _REMEDY):
        try:
            root = parse_local(file_bytes(given.path, _MAX_BYTES, noun="export of Metashape"))
            chunks = [root] if root.tag == "chunk" else root.findall("chunk")
            if not chunks:
                raise MetadataError("holds no chunk of Metashape")
            return _chunk(max(chunks, key=lambda each: len(each.findall(".//camera/transform"))), len(chunks), given)
        except (XmlError, ValueError, OverflowError) as error:
            raise MetadataError(f"is no export of Metashape's cameras: {error}") from error


def _chunk(chunk: Element, chunks: int, given: PosesFile) -> ProgramPoses:
    aligned: dict[str, tuple[str | None, str | None, Pose]] = {}
    missing, again = 0, set[str]()
    labels = Counter(camera.get("label", "") for camera in chunk.iter("camera") if camera.find("transform") is not None)
    groups = {camera: group.get("label", "") for group in chunk.iter("group") for camera in group.iter("camera")}
    for camera in chunk.iter("camera"):
        label, matrix = camera.get("label", ""), camera.find("transform")
        if matrix is None:
            missing += camera.find("reference") is not None or camera.get("sensor_id") is not None
            continue
        values = _numbers(matrix.text, 16, f"the transform of {label}").reshape(4, 4)
        pose = Pose(_rotation(values[:3, :3], label).T, values[:3, 3])
        if labels[label] > 1 and camera in groups:  # groups are folders, as a rule
            label = f"{groups[camera]}/{label}"
        if label in aligned:
            again.add(label)
        aligned[label] = (camera.get("sensor_id"), camera.get("component_id"), pose)
    aligned = {label: pose for label, pose in aligned.items() if label not in again}
    if not aligned:
        why = "no camera that is aligned" if not again else f"each aligned camera twice, as {min(again)}"
        raise MetadataError(f"has {why}", remedy="Align the photographs first, each once.")
    keys = [key for _, key, _ in aligned.values()]
    main = max(sorted(set(keys), key=str), key=keys.count)
    others = count(len(keys) - keys.count(main), "photograph is", "photographs are")
    said = [
        f"Metashape has not aligned {missing} of its photographs" if missing else "",
        f"of {chunks} chunks the one with most cameras is used" if chunks > 1 else "",
        f"{others} in other components; not used" if keys.count(main) < len(keys) else "",
        f"{count(len(again), 'label is', 'labels are')} there twice ({min(again)}); not used" if again else "",
    ]
    findings = [Finding(given.path.name, "poses-apart", message) for message in said if message]
    poses = {label: pose for label, (_, key, pose) in aligned.items() if key == main}
    component = next((c for c in chunk.findall("components/component") if c.get("id") == main), None)
    motion = None if component is None else _motion(component.find("transform"))
    motion = motion or _motion(chunk.find("transform"))
    poses, metric, origin, frame_said, of_datum = _placed(poses, motion, chunk.findtext("reference") or "", given)
    cameras, odd = _cameras(chunk, {label: sensor for label, (sensor, _, _) in aligned.items() if label in poses})
    return ProgramPoses(
        "Metashape",
        given.path,
        poses,
        metric=metric,
        origin=origin,
        cameras=cameras,
        frame_said=frame_said,
        findings=(*findings, *of_datum, *odd),
    )


def _motion(element: Element | None) -> tuple[Similarity, bool] | None:
    """A transform out of the chunk's coordinates, and whether Metashape took it from references."""
    if element is None:
        return None
    rotation, translation, scale = (element.find(name) for name in ("rotation", "translation", "scale"))
    if rotation is None or translation is None or scale is None:
        return None
    turn = _rotation(_numbers(rotation.text, 9, "rotation").reshape(3, 3), "the chunk")
    size = float(_numbers(scale.text, 1, "scale")[0])
    if size <= 0:
        raise ValueError("the chunk's scale is not positive")
    similarity = Similarity(size, turn, _numbers(translation.text, 3, "translation"))
    return similarity, scale.get("locked") != "false"


def _placed(
    poses: dict[str, Pose], motion: tuple[Similarity, bool] | None, reference: str, given: PosesFile
) -> tuple[dict[str, Pose], bool, LocalFrame | None, str, list[Finding]]:
    """Poses of a chunk in a local frame, whether it is metric, where it lies, that in words, and what of its datum."""
    if motion is not None:
        poses = {name: motion[0].apply_pose(pose) for name, pose in poses.items()}
        distance = float(np.median([np.linalg.norm(pose.center) for pose in poses.values()]))
        if _EARTH_M[0] < distance < _EARTH_M[1] and "LOCAL_CS" not in reference:
            given.check_open()
            odd: list[Finding] = []
            if reference and "WGS 84" not in reference:
                datum = parse_crs(reference).geodetic_crs
                if datum is None or datum.ellipsoid.semi_major_metre != SEMI_MAJOR_M:
                    message = "is in the coordinates of another ellipsoid than that of WGS 84"
                    remedy = "Set the chunk's coordinate system to WGS 84, and export the cameras again."
                    raise MetadataError(message, remedy=remedy)
                centers = np.array([pose.center for pose in poses.values()])
                points = centers if datum.is_geocentric else np.stack(ecef_to_geodetic(centers), axis=1)[:, [1, 0, 2]]
                odd = to_geodetic(points, datum, given.path.name)[1]
            origin, local = local_from_geocentric(poses)
            return local, True, origin, "in metres about the place it gives", odd
    if given.frame == METRES:
        return poses, True, None, "in metres, as was said", []
    if given.frame:
        crs = parse_crs(given.frame)
        origin, local, odd = local_from_crs(poses, crs, given.path.name)
        return local, True, origin, f"in {crs.name}, as was said", odd
    if motion is not None and motion[1] and "LOCAL_CS" in reference:
        return poses, True, None, "in metres of its local coordinates", []
    return poses, False, None, "without metric scale, since the chunk has no reference", []


def _cameras(chunk: Element, sensor_of: dict[str, str | None]) -> tuple[list[CameraEntry], list[Finding]]:
    cameras, findings = [], []
    for sensor in chunk.findall("sensors/sensor"):
        names = tuple(label for label, key in sensor_of.items() if key == sensor.get("id"))
        given = {each.get("class"): each for each in sensor.findall("calibration")}
        calibration = given.get("adjusted", given.get("initial"))
        if not names:
            continue
        if calibration is None or calibration.get("type", "frame") != "frame" or calibration.find("f") is None:
            message = "Metashape's calibration is not used: it is none of a frame camera"
            findings.append(Finding(names[0], "camera-unused", message))
            continue
        camera, whole = _intrinsics(calibration)
        if not whole:
            message = "Metashape's calibration is a start only: COLMAP's camera has no k4, p3, p4 and b2"
            findings.append(Finding(names[0], "camera-approximate", message))
        cameras.append(CameraEntry(camera, names, whole and calibration.get("class") == "adjusted"))
    return cameras, findings


def _intrinsics(calibration: Element) -> tuple[Intrinsics, bool]:
    """COLMAP's camera of Metashape's, and whether that has no other terms."""
    size = calibration.find("resolution")
    if size is None:
        raise ValueError("a calibration has no resolution")
    width, height = int(size.get("width", "0")), int(size.get("height", "0"))
    keys = ("f", "cx", "cy", "k1", "k2", "k3", "k4", "p1", "p2", "p3", "p4", "b1", "b2")
    f, cx, cy, k1, k2, k3, k4, p1, p2, p3, p4, b1, b2 = (
        float(_numbers(calibration.findtext(key) or "0", 1, key)[0]) for key in keys
    )
    params = (f + b1, f, width / 2 + cx, height / 2 + cy, k1, k2, p2, p1, k3, 0.0, 0.0, 0.0)
    return Intrinsics("FULL_OPENCV", width, height, params), not any((k4, p3, p4, b2))


def _rotation(turn: FloatArray, whose: str) -> FloatArray:
    if not np.allclose(turn @ turn.T, np.eye(3), atol=1e-4) or np.linalg.det(turn) < 0:
        raise ValueError(f"the rotation of {whose} is none")
    return turn


def _numbers(text: str | None, many: int, what: str) -> FloatArray:
    try:
        values = np.array([float(word) for word in (text or "").split()])
    except ValueError:
        values = np.zeros(0)
    if len(values) != many or not (np.abs(values) < _LARGEST).all():
        raise ValueError(f"{what} is not {many} numbers")
    return values
