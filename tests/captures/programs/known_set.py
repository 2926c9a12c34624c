"""One set of known poses, and writers of the files in which other programs would keep it."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pycolmap
from scipy.spatial.transform import Rotation

from fieldkit.arrays import FloatArray
from fieldkit.geometry import Intrinsics, Pose, Similarity
from fieldkit.geometry.geodesy import LocalFrame
from fieldkit.geometry.pose import rotation_angle_deg

ORIGIN = LocalFrame(50.62, 6.985, 152.0)
CAMERA = Intrinsics("OPENCV", 4000, 3000, (2900.0, 2910.0, 2010.0, 1490.0, -0.02, 0.01, 0.001, -0.002))
NAMES = tuple(f"DJI_{k:04d}.JPG" for k in range(1, 9))


def known_poses(seed: int = 0, count: int = len(NAMES)) -> dict[str, Pose]:
    """Cameras some metres above a plot, looking down at all headings, tilts and rolls; east-north-up about `ORIGIN`."""
    rng = np.random.default_rng(seed)
    centers = np.column_stack([rng.uniform(-20, 20, (count, 2)), rng.uniform(3, 15, count)])
    angles = np.column_stack([rng.uniform(-180, 180, count), rng.uniform(-89, -20, count), rng.uniform(-30, 30, count)])
    return {
        name: Pose.from_yaw_pitch(center, *(float(v) for v in each))
        for name, center, each in zip(NAMES, centers, angles, strict=False)
    }


def apart(found: Mapping[str, Pose], wanted: Mapping[str, Pose]) -> tuple[float, float]:
    """Largest distance of centres and largest angle, degrees, between two sets of the same names."""
    assert set(found) == set(wanted)
    distances = [float(np.linalg.norm(found[n].center - wanted[n].center)) for n in wanted]
    return max(distances), max(rotation_angle_deg(found[n].rotation, wanted[n].rotation) for n in wanted)


def moved(poses: Mapping[str, Pose], motion: Similarity) -> dict[str, Pose]:
    return {name: motion.apply_pose(pose) for name, pose in poses.items()}


def some_motion(seed: int = 3) -> Similarity:
    rotation = Rotation.random(random_state=seed).as_matrix()
    return Similarity(0.37, rotation, np.array([3.0, -1.0, 8.0]))


def about(place: LocalFrame, poses: Mapping[str, Pose], frame: LocalFrame) -> dict[str, Pose]:
    """Poses of one local frame in another."""
    turn = frame.rotation() @ place.rotation().T
    centers = frame.to_local(*place.to_geodetic(np.array([pose.center for pose in poses.values()])))
    return {n: Pose(p.rotation @ turn.T, c) for (n, p), c in zip(poses.items(), centers, strict=True)}


def geocentric(poses: Mapping[str, Pose]) -> dict[str, Pose]:
    """Poses about `ORIGIN` in geocentric coordinates."""
    turn, start = ORIGIN.rotation(), ORIGIN._origin()
    return {n: Pose(p.rotation @ turn, turn.T @ p.center + start) for n, p in poses.items()}


def write_colmap(folder: Path, poses: Mapping[str, Pose], camera: Intrinsics = CAMERA, *, text: bool = False) -> Path:
    """A model as COLMAP writes it, with a point that two images see."""
    model = pycolmap.Reconstruction()
    own = pycolmap.Camera(model=camera.model, width=camera.width, height=camera.height, params=list(camera.params))
    own.camera_id = 1
    model.add_camera_with_trivial_rig(own)
    for number, (name, pose) in enumerate(poses.items(), 1):
        image = pycolmap.Image(name=name, camera_id=1, image_id=number, keypoints=np.full((3, 2), 50.0))
        model.add_image_with_trivial_frame(
            image, pycolmap.Rigid3d(pycolmap.Rotation3d(pose.rotation), pose.translation)
        )
    model.add_point3D(np.zeros(3), pycolmap.Track([pycolmap.TrackElement(1, 0), pycolmap.TrackElement(2, 1)]))
    folder.mkdir(parents=True, exist_ok=True)
    (model.write_text if text else model.write_binary)(folder)
    return folder


def opensfm_camera() -> dict[str, Any]:
    """`CAMERA` in OpenSfM's terms: by the longer side, from the picture's middle."""
    fx, fy, cx, cy, k1, k2, p1, p2 = CAMERA.params
    return {
        "projection_type": "brown",
        "width": 4000,
        "height": 3000,
        "focal_x": fx / 4000,
        "focal_y": fy / 4000,
        "c_x": (cx - 2000) / 4000,
        "c_y": (cy - 1500) / 4000,
        "k1": k1,
        "k2": k2,
        "k3": 0.0,
        "p1": p1,
        "p2": p2,
    }


def to_grid(poses: Mapping[str, Pose], epsg: int = 32632) -> dict[str, Pose]:
    """Poses about `ORIGIN` in a projected system, orientations against its grid: by tiny steps along each axis."""
    from pyproj import Transformer

    to = Transformer.from_crs(4979, epsg, always_xy=True)

    def project(points: FloatArray) -> FloatArray:
        latitude, longitude, height = ORIGIN.to_geodetic(points)
        x, y, _ = to.transform(longitude, latitude, height)
        return np.column_stack([x, y, height])

    placed = {}
    for name, pose in poses.items():
        steps = project(pose.center + 0.5 * np.vstack([np.zeros(3), np.eye(3)]))
        u, _, vt = np.linalg.svd((steps[1:] - steps[0]).T)
        placed[name] = Pose(pose.rotation @ (u @ vt).T, steps[0])
    return placed


def write_shots(
    path: Path, poses: Mapping[str, Pose], epsg: int = 32632, camera: Mapping[str, Any] | None = None
) -> Path:
    """odm_report/shots.geojson: UTM coordinates, rotation vectors against the grid, longitudes and latitudes.

    And cameras.json beside it.
    """
    camera = camera or opensfm_camera()
    features = []
    latitudes, longitudes, heights = ORIGIN.to_geodetic(np.array([pose.center for pose in poses.values()]))
    for index, (name, pose) in enumerate(to_grid(poses, epsg).items()):
        place = [float(longitudes[index]), float(latitudes[index]), float(heights[index])]
        properties = {
            "filename": name,
            "focal": 0.72,
            "width": camera["width"],
            "height": camera["height"],
            "translation": pose.center.tolist(),
            "rotation": Rotation.from_matrix(pose.rotation).as_rotvec().tolist(),
        }
        features.append(
            {"type": "Feature", "properties": properties, "geometry": {"type": "Point", "coordinates": place}}
        )
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps({"type": "FeatureCollection", "features": features}))
    (path.parent / "cameras.json").write_text(json.dumps({"v2 dji": camera}))
    return path


METASHAPE_CAMERA = (
    "<f>2910</f><cx>10</cx><cy>-10</cy><b1>-10</b1><k1>-0.02</k1><k2>0.01</k2><p1>-0.002</p1><p2>0.001</p2>"
)
"""`CAMERA`: fx = f + b1; p1 and p2 change places."""
WGS84 = 'GEOGCS["WGS 84",DATUM["World Geodetic System 1984",SPHEROID["WGS 84",6378137,298.257223563]],PRIMEM["Greenwich",0],UNIT["degree",0.0174532925199433]]'  # noqa: E501
LOCAL = 'LOCAL_CS["Local Coordinates (m)",LOCAL_DATUM["Local Datum",0],UNIT["metre",1]]'


def write_metashape(
    path: Path,
    poses: Mapping[str, Pose],
    *,
    reference: str = WGS84,
    motion: Similarity | None = None,
    calibration: str = METASHAPE_CAMERA,
    locked: str | None = "true",
    labels: Mapping[str, str] | None = None,
) -> Path:
    """Agisoft's XML: camera-to-chunk matrices, and the transform from the chunk into the reference's coordinates.

    Args:
        path: to write.
        poses: in the reference's coordinates (geocentric), or in the chunk's without ``motion``.
        reference: WKT; "" for none.
        motion: from the chunk's coordinates into those of ``poses``.
        calibration: elements of it.
        locked: attribute of the transform's elements.
        labels: by name; the names where not given.
    """
    inverse = None if motion is None else motion.inverse()
    cameras = []
    for number, (name, pose) in enumerate(poses.items()):
        own = pose if inverse is None else inverse.apply_pose(pose)
        matrix = np.eye(4)
        matrix[:3, :3], matrix[:3, 3] = own.rotation.T, own.center
        text = " ".join(repr(float(v)) for v in matrix.ravel())
        label = name if labels is None else labels[name]
        cameras.append(
            f'<camera id="{number}" sensor_id="0" component_id="0" label="{label}">'
            f"<transform>{text}</transform><orientation>1</orientation></camera>"
        )
    cameras.append('<camera id="99" sensor_id="0" label="lost"><orientation>1</orientation></camera>')
    transform = ""
    if motion is not None:
        says = "" if locked is None else f' locked="{locked}"'
        rotation, translation = (
            " ".join(repr(float(v)) for v in a.ravel()) for a in (motion.rotation, motion.translation)
        )
        transform = (
            f"<transform><rotation{says}>{rotation}</rotation><translation{says}>{translation}</translation>"
            f"<scale{says}>{motion.scale!r}</scale></transform>"
        )
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(
        '<?xml version="1.0" encoding="UTF-8"?>\n<document version="2.0.0">\n<chunk label="Chunk 1" enabled="true">\n'
        '<sensors next_id="1"><sensor id="0" label="FC" type="frame"><resolution width="4000" height="3000"/>'
        '<calibration type="frame" class="initial"><resolution width="4000" height="3000"/><f>1</f></calibration>'
        f'<calibration type="frame" class="adjusted"><resolution width="4000" height="3000"/>{calibration}'
        '</calibration></sensor></sensors>\n<components next_id="1"><component id="0" label="Component 1">'
        f'{transform}</component></components>\n<cameras next_id="9" next_group_id="1">'
        f'<group id="0" label="Group 1" type="folder">{"".join(cameras[:2])}</group>{"".join(cameras[2:])}</cameras>\n'
        f"{f'<reference>{reference}</reference>' if reference else ''}\n</chunk>\n</document>\n"
    )
    return path


def assert_close(found: Mapping[str, Pose], expected: Mapping[str, Pose], metres: float, degrees: float) -> None:
    """Fails where `apart` is more."""
    distance, angle = apart(found, expected)
    assert distance < metres
    assert angle < degrees
