"""COLMAP's reconstruction objects: made from our values, read back into them, and as arrays for the stage cache."""

from __future__ import annotations

import copyreg
import itertools
import tempfile
from collections import Counter
from collections.abc import Collection, Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from fieldkit.arrays import FloatArray, IntArray
from fieldkit.captures.decode import read_image
from fieldkit.captures.model import Photo
from fieldkit.geometry import Intrinsics, Pose, Similarity
from fieldkit.reconstruction.features import Features
from fieldkit.runtime.colmap import pycolmap

Track = tuple[tuple[int, int], ...]
"""((image index, feature index), …), sorted, at most one feature per image."""
Arrays = dict[str, np.ndarray]


def to_colmap_camera(intrinsics: Intrinsics, camera_id: int) -> pycolmap.Camera:
    """COLMAP's camera of the same model and parameters."""
    camera = pycolmap.Camera(
        model=intrinsics.model, width=intrinsics.width, height=intrinsics.height, params=list(intrinsics.params)
    )
    camera.camera_id = camera_id
    return camera


def from_colmap_camera(camera: pycolmap.Camera) -> Intrinsics:
    """The same camera as a value."""
    return Intrinsics(camera.model.name, camera.width, camera.height, tuple(float(p) for p in camera.params))


def to_rigid(pose: Pose) -> pycolmap.Rigid3d:
    """COLMAP's camera-from-world."""
    return pycolmap.Rigid3d(pycolmap.Rotation3d(pose.rotation), pose.translation)


def pose_of(image: pycolmap.Image) -> Pose:
    """Pose of a registered image."""
    return Pose(image.cam_from_world().rotation.matrix(), image.projection_center())


def model_poses(model: pycolmap.Reconstruction) -> dict[str, Pose]:
    """Poses of the registered images by name, in the order of names."""
    images = [model.image(i) for i in model.reg_image_ids()]
    return {image.name: pose_of(image) for image in sorted(images, key=lambda image: str(image.name))}


def model_intrinsics(model: pycolmap.Reconstruction) -> dict[str, Intrinsics]:
    """Intrinsics of the registered images by name."""
    images = [model.image(i) for i in model.reg_image_ids()]
    return {image.name: from_colmap_camera(model.camera(image.camera_id)) for image in images}


def model_points(model: pycolmap.Reconstruction) -> FloatArray:
    """(n, 3) points, by ascending id."""
    points = [model.points3D[k].xyz for k in sorted(model.point3D_ids())]
    return np.array(points, dtype=np.float64).reshape(-1, 3)


def track_lengths(model: pycolmap.Reconstruction) -> IntArray:
    """(n,) how many photographs each point is seen in, by ascending id."""
    return np.array([model.points3D[k].track.length() for k in sorted(model.point3D_ids())], dtype=np.int64)


def color_points(model: pycolmap.Reconstruction, photos: Iterable[Photo]) -> None:
    """Give every 3D point the mean colour of the pixels that it was seen in; ``photos`` are those of the model."""
    by_name = {image.name: image for image in model.images.values() if image.has_pose}
    sums: dict[int, IntArray] = {}
    for photo in photos:
        image = by_name.get(photo.name)
        if image is None:
            continue
        pixels = read_image(photo)
        last = np.array([photo.width, photo.height]) - 1
        for point in image.points2D:
            if point.has_point3D():
                column, row = np.clip(np.floor(point.xy), 0, last).astype(np.int64)
                known = sums.setdefault(point.point3D_id, np.zeros(4, dtype=np.int64))
                known += (*pixels[row, column], 1)
    for key, (*channels, count) in sums.items():
        model.points3D[key].color = np.rint(np.array(channels) / count).astype(np.uint8)


def transform_model(model: pycolmap.Reconstruction, similarity: Similarity) -> None:
    """Move a model, in place, into the similarity's target frame."""
    model.transform(pycolmap.Sim3d(similarity.scale, pycolmap.Rotation3d(similarity.rotation), similarity.translation))


def part_of_model(model: pycolmap.Reconstruction, names: Collection[str]) -> pycolmap.Reconstruction:
    """A model of some of the images, without their features, and of the points that two of them see, without tracks."""
    part, seen = pycolmap.Reconstruction(), Counter[int]()
    for image in model.images.values():
        if image.name in names and image.has_pose:
            if not part.exists_camera(image.camera_id):
                part.add_camera_with_trivial_rig(model.camera(image.camera_id))
            alone = pycolmap.Image(name=image.name, camera_id=image.camera_id, image_id=image.image_id)
            part.add_image_with_trivial_frame(alone, image.cam_from_world())
            seen.update(point.point3D_id for point in image.get_observation_points2D())
    for key, images in sorted(seen.items()):
        if images > 1:
            part.add_point3D(model.points3D[key].xyz, pycolmap.Track())
    return part


def new_model(
    names: Sequence[str],
    cameras: Sequence[Intrinsics],
    camera_of: Sequence[int],
    poses: Sequence[Pose],
    features: Sequence[Features],
) -> pycolmap.Reconstruction:
    """A model of posed images without points. Image ids are 1 + the position in ``names``, camera ids likewise."""
    model = pycolmap.Reconstruction()
    for index, intrinsics in enumerate(cameras):
        model.add_camera_with_trivial_rig(to_colmap_camera(intrinsics, index + 1))
    for index, name in enumerate(names):
        image = pycolmap.Image(
            name=name, camera_id=camera_of[index] + 1, image_id=index + 1, keypoints=features[index].points
        )
        model.add_image_with_trivial_frame(image, to_rigid(poses[index]))
    return model


def triangulation(
    max_error_px: float, min_angle_deg: float, *, trials: int, seed: int
) -> pycolmap.EstimateTriangulationOptions:
    """How a point is found among views that can be wrong."""
    options = pycolmap.EstimateTriangulationOptions()
    options.min_tri_angle = np.radians(min_angle_deg)
    options.residual_type = pycolmap.TriangulationResidualType.REPROJECTION_ERROR
    options.ransac.max_error = max_error_px
    options.ransac.random_seed = seed
    options.ransac.min_inlier_ratio = 0.02
    options.ransac.confidence = 0.9999
    options.ransac.max_num_trials = trials
    return options


def triangulate_tracks(
    model: pycolmap.Reconstruction,
    features: Sequence[Features],
    tracks: Sequence[Track],
    *,
    max_error_px: float,
    min_angle_deg: float,
    seed: int,
) -> int:
    """Add a point for every track that triangulates; observations over ``max_error_px`` are left out of it.

    Returns the number of points added.
    """
    options = triangulation(max_error_px, min_angle_deg, trials=100, seed=seed)
    rigid: Mapping[int, pycolmap.Rigid3d] = {i: image.cam_from_world() for i, image in model.images.items()}
    cameras = {i: model.camera(image.camera_id) for i, image in model.images.items()}
    added = 0
    for track in tracks:
        ids = [i + 1 for i, _ in track]
        pixels = np.array([features[i].keypoints[k, :2] for i, k in track], dtype=np.float64)
        found = pycolmap.estimate_triangulation(pixels, [rigid[i] for i in ids], [cameras[i] for i in ids], options)
        if found is None:
            continue
        inliers = zip(track, found["inliers"], strict=True)
        kept = [pycolmap.TrackElement(i + 1, k) for (i, k), good in inliers if good]
        if len(kept) >= 2:
            model.add_point3D(found["xyz"], pycolmap.Track(kept))
            added += 1
    return added


def build_tracks(counts: list[int], matches: Mapping[tuple[int, int], NDArray[np.uint32]]) -> list[Track]:
    """Join matches into tracks. ``matches`` (k, 2) are feature indices per pair (i, j) of image indices.

    Returns:
        Tracks of at least two images, in the order of their first observation. Where a track holds several
        features of an image (some match in it is wrong), that image's observations are dropped from it.
    """
    offsets = np.concatenate([[0], np.cumsum(counts)])
    left = [offsets[i] + m[:, 0].astype(np.int64) for (i, _), m in matches.items() if len(m)]
    right = [offsets[j] + m[:, 1].astype(np.int64) for (_, j), m in matches.items() if len(m)]
    if not left:
        return []
    rows, columns = np.concatenate(left), np.concatenate(right)
    total = int(offsets[-1])
    graph = coo_matrix((np.ones(len(rows), np.int8), (rows, columns)), shape=(total, total))
    _, labels = connected_components(graph, directed=False)
    used = np.unique(np.concatenate([rows, columns]))
    images = np.repeat(np.arange(len(counts)), counts)[used]
    _, at, occurrences = np.unique(labels[used] * len(counts) + images, return_inverse=True, return_counts=True)
    single = occurrences[at] == 1
    used, images = used[single], images[single]
    by_track = np.argsort(labels[used], kind="stable")
    ends = np.flatnonzero(np.diff(labels[used[by_track]])) + 1
    elements = list(zip(images[by_track].tolist(), (used - offsets[images])[by_track].tolist(), strict=True))
    starts = [0, *ends.tolist(), len(elements)]
    return sorted(tuple(elements[a:b]) for a, b in itertools.pairwise(starts) if b - a >= 2)


def model_to_arrays(model: pycolmap.Reconstruction, prefix: str = "") -> Arrays:
    """COLMAP's binary files as uint8 arrays by file name.

    A model always passes through this form, so that a run that computed it and one that found it in the cache go on
    from the same bytes.
    """
    with tempfile.TemporaryDirectory(prefix="fieldkit-") as folder:
        model.write_binary(folder)
        return {
            f"{prefix}{path.stem}": np.frombuffer(path.read_bytes(), dtype=np.uint8)
            for path in sorted(Path(folder).glob("*.bin"))
        }


def arrays_to_model(arrays: Arrays, prefix: str = "") -> pycolmap.Reconstruction:
    """The model that `model_to_arrays` packed."""
    with tempfile.TemporaryDirectory(prefix="fieldkit-") as folder:
        for name, data in arrays.items():
            if name.startswith(prefix):
                (Path(folder) / f"{name.removeprefix(prefix)}.bin").write_bytes(data.tobytes())
        model = pycolmap.Reconstruction()
        model.read_binary(folder)
        return model


copyreg.pickle(pycolmap.Reconstruction, lambda model: (arrays_to_model, (model_to_arrays(model),)))
