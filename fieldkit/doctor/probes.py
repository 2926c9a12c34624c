"""What `fieldkit doctor` tries in processes of their own, because a broken driver or library ends its process.

    python -m fieldkit.doctor.probes imports|renderer|pycolmap

prints one JSON object a line.
"""

from __future__ import annotations

import importlib
import json
import sys
from typing import Any

IMPORTS = {
    **{name: name for name in ("numpy", "numba", "pydantic", "trimesh", "psutil", "jinja2", "markupsafe", "pyvrp")},
    "filelock": "filelock",
    "shapely": "shapely",
    "scipy": "scipy.spatial",
    "opencv-python-headless": "cv2",
    "pillow": "PIL.Image",
    "defusedxml": "defusedxml.ElementTree",
    "small-gicp": "small_gicp",
    "matplotlib": "matplotlib.figure",
    "pymavlink": "pymavlink.dialects.v20.ardupilotmega",
    "mavsdk": "mavsdk.plugins.mavlink_direct",
}
"""Distribution and the module that shows whether it works; pyrender and pycolmap have probes of their own."""


def probe_imports() -> None:
    """Import each package; its name is printed first, so that a crash names the culprit."""
    for distribution, module in IMPORTS.items():
        _print(importing=distribution)
        try:
            importlib.import_module(module)
        except Exception as error:  # whatever a broken installation raises is the finding
            _print(failed=distribution, error=f"{type(error).__name__}: {error}")


def probe_renderer() -> None:
    """Render a square with a red texture in front of a blue background and look at colours and depth."""
    import numpy as np

    from fieldkit.geometry import Intrinsics, Pose
    from fieldkit.scenes.renderer import Renderer
    from fieldkit.scenes.scene import Mesh, Scene

    distance_m, half_m = 2.0, 0.5
    corners = [[-half_m, -half_m, 0.0], [half_m, -half_m, 0.0], [half_m, half_m, 0.0], [-half_m, half_m, 0.0]]
    square = Mesh(
        "square",
        np.array(corners, np.float32),
        np.array([[0, 1, 2], [0, 2, 3]], np.int32),
        uv=np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32),
        texture=np.full((2, 2, 3), (255, 0, 0), np.uint8),
    )
    pose = Pose.from_yaw_pitch([0.0, 0.0, distance_m], 0.0, -90.0)
    # 64 pixels see 2 m, so the square of 1 m covers the pixels 16 to 47.
    with Renderer(Scene((square,), background=(0.0, 0.0, 1.0))) as renderer:
        image, depth = renderer.render(pose, Intrinsics.pinhole(64, 64, 64.0))
        from OpenGL.GL import GL_RENDERER, glGetString

        name = glGetString(GL_RENDERER).decode()
    expected = np.zeros((64, 64), bool)
    expected[16:48, 16:48] = True
    red = (image[..., 0] > 200) & (image[..., 2] < 50)
    blue = (image[..., 2] > 200) & (image[..., 0] < 50)
    _print(
        renderer=name,
        wrong_pixels=int((red != expected).sum() + (blue == expected).sum()),
        wrong_depths=int((abs(np.where(expected, depth - distance_m, depth)) > 0.002).sum()),
    )


def probe_pycolmap() -> None:
    """Import pycolmap, and detect features in a small image."""
    import numpy as np
    import pycolmap

    noise = np.random.default_rng(0).integers(0, 255, (16, 16), np.uint8)
    image = np.kron(noise, np.ones((8, 8), np.uint8))
    options = pycolmap.FeatureExtractionOptions()
    options.use_gpu = False
    pycolmap.logging.minloglevel = pycolmap.logging.ERROR.value
    extractor = pycolmap.FeatureExtractor.create(options, device=pycolmap.Device.cpu)
    keypoints, _ = extractor.extract(pycolmap.Bitmap.from_array(image))
    _print(version=pycolmap.__version__, features=len(keypoints))


def _print(**values: Any) -> None:
    print(json.dumps(values), flush=True)  # noqa: T201


if __name__ == "__main__":
    {"imports": probe_imports, "renderer": probe_renderer, "pycolmap": probe_pycolmap}[sys.argv[1]]()
