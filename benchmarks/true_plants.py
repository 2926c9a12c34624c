"""Figures of a simulated plot's own plants, from their meshes: the truth for reconstructed plants."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from fieldkit.clouds import Cloud
from fieldkit.clouds.plant_figures import HEIGHT_QUANTILE, hull_m3
from fieldkit.clouds.thinning import voxel_thin
from fieldkit.clouds.volume import Volume
from fieldkit.files import write_atomic
from fieldkit.planning.objective.simulated import Proxy
from fieldkit.scenes.library import find_scene
from fieldkit.scenes.scene_file import read_scene

FOLDER = "scenes"
_PIXEL_M = 0.001


@dataclass(frozen=True)
class TrueFigures:
    """Figures of a scene's plants, from their meshes; metres.

    Attributes:
        height_m: 95 % of the voxels of their visible surfaces are lower; above z = 0.
        height_max_m: of the highest vertex.
        covered_m2: covered ground within the volume of interest, from triangles drawn at 1 mm.
        hull_m3: convex hull of the vertices within the volume of interest.
    """

    height_m: float
    height_max_m: float
    covered_m2: float
    hull_m3: float


def true_figures(proxy: Proxy) -> TrueFigures:
    """The true figures of a scene's own plants."""
    meshes = [mesh for mesh in proxy.scene.meshes if mesh.plant]
    vertices = np.concatenate([mesh.vertices.astype(np.float64) for mesh in meshes])
    surface = voxel_thin(Cloud(proxy.reference.points), 0.01).points
    triangles = np.concatenate([mesh.vertices[mesh.faces] for mesh in meshes]).astype(np.float64)
    return TrueFigures(
        height_m=float(np.quantile(surface[:, 2], HEIGHT_QUANTILE)),
        height_max_m=float(vertices[:, 2].max()),
        covered_m2=_drawn_m2(triangles[:, :, :2], proxy.volume),
        hull_m3=hull_m3(vertices[proxy.volume.contains(vertices)]),
    )


def _drawn_m2(triangles: NDArray[np.float64], volume: Volume) -> float:
    """Area of triangles (n, 3, 2) drawn on one plane, within a volume's footprint."""
    low = np.array(volume.lower[:2])
    size = np.ceil((np.array(volume.upper[:2]) - low) / _PIXEL_M).astype(int)
    picture = np.zeros((size[1], size[0]), dtype=np.uint8)
    shift = 4
    corners = np.round(((triangles - low) / _PIXEL_M - 0.5) * 2**shift).astype(np.int32)
    for triangle in corners:
        cv2.fillConvexPoly(picture, triangle, 1, lineType=cv2.LINE_8, shift=shift)
    return float(picture.sum()) * _PIXEL_M**2


def kept_truth(folder: Path, scene: str, proxy: Proxy | None = None) -> tuple[Volume, TrueFigures]:
    """Volume of interest and true figures of a scene, read from ``folder``, or computed and written there.

    Args:
        folder: of captures.
        scene: by name.
        proxy: of the scene, if it is built already.
    """
    path = folder / FOLDER / f"{scene}.json"
    if path.is_file():
        found = json.loads(path.read_text(encoding="utf-8"))
        return Volume(tuple(found["lower_m"]), tuple(found["upper_m"])), TrueFigures(**found["figures"])
    proxy = proxy or Proxy.from_description(read_scene(find_scene(scene)))
    truth = true_figures(proxy)
    path.parent.mkdir(parents=True, exist_ok=True)
    told = {"lower_m": proxy.volume.lower, "upper_m": proxy.volume.upper, "figures": asdict(truth)}
    write_atomic(path, json.dumps(told) + "\n")
    return proxy.volume, truth
