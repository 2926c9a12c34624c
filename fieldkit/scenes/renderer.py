"""Off-screen rendering with pyrender on EGL: photographs and exact depth maps of a scene.

This is the one place that imports pyrender. What pyrender 0.1.45 leaves to be desired is replaced in
`_gl_renderer`: its lit shader (four times the time of ours), its depth maps (read from a multisample buffer, so
taken off the pixel's centre) and its clean-up (which ends every other context of the process).
"""

from __future__ import annotations

import ctypes
import os
import sys
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fieldkit.arrays import ByteArray, Float32Array
from fieldkit.errors import InputError
from fieldkit.geometry import Intrinsics, Pose
from fieldkit.runtime.kernels import inline_kernel, kernel
from fieldkit.scenes.scene import Mesh, Scene

_REMEDY = (
    "Rendering needs Linux and EGL (on Windows use WSL): install the off-screen OpenGL libraries (Debian and Ubuntu: "
    "apt-get install libegl1 libgl1-mesa-dri) and leave PYOPENGL_PLATFORM unset. References, evaluations, checks, "
    "missions and reports of photographs work without it."
)

_NEAR_M = 0.05
"""Nearest distance along the optical axis that is drawn, metres."""
_FAR_M = 200.0
"""Farthest distance along the optical axis that is drawn, metres."""
_SAMPLES = 4
"""Samples a pixel of photographs that are not economical."""


_LEAST_STEP = 16
"""Step from which an edge is smoothed, grey levels."""
_LEAST_SHARE = 0.15
"""The same as a share of the brighter side."""
_REACH = 10
"""Pixels that a stair is followed to either side."""
_LONE = 0.5
"""How much of a lone pixel's difference from those around it is taken away, at most."""


class RenderingError(InputError):
    """No image can be rendered on this machine as it is set up."""


class Renderer:
    """Renders one scene. The scene is uploaded once; use it as a context manager or call `close`."""

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        try:
            self._pyrender, self._platform, self._gl = _start(scene)
        except Exception as error:  # PyOpenGL raises anything from AssertionError to AttributeError here
            raise RenderingError(f"off-screen rendering cannot start: {error!r}", remedy=_REMEDY) from error
        self._content = self._pyrender.Scene(bg_color=[*scene.background, 1.0], ambient_light=[0.0, 0.0, 0.0])
        self._meshes: dict[str, Any] = {}
        for index, mesh in enumerate(scene.meshes):
            uploaded = _upload(self._pyrender, mesh)
            self._content.add(uploaded, name=f"{index:06d}")  # the order they are drawn in
            self._meshes[mesh.name] = uploaded
        self._camera: Any = None

    def __enter__(self) -> Renderer:
        return self

    def __exit__(self, *_error: object) -> None:
        self.close()

    def __del__(self) -> None:
        # One that was forgotten must not leave its clean-up to pyrender, which ends all other contexts.
        if not sys.is_finalizing():
            with suppress(Exception):  # in another thread than its own a context cannot be ended
                self.close()

    def close(self) -> None:
        """Free the OpenGL context. A second call does nothing."""
        if getattr(self, "_platform", None) is None:
            return
        try:
            self._platform.make_current()
            self._gl.delete()
        finally:
            self._platform.delete_context()
            self._platform = self._gl = None

    def move(self, vertices: Mapping[str, Float32Array]) -> None:
        """Put the vertices of some meshes elsewhere, as wind does (`fieldkit.scenes.sway`), until the next call.

        Normals, colours and baked light stay. Costs an upload of these meshes and nothing else. ``vertices`` are (n, 3)
        by mesh name, as many as the mesh has; meshes that are not named keep their place.
        """
        if self._platform is None:
            raise RenderingError("the renderer is closed")
        self._platform.make_current()
        for name, points in vertices.items():
            if name not in self._meshes:
                raise ValueError(f"the scene has no mesh {name!r}")
            (primitive,) = self._meshes[name].primitives
            if points.shape != primitive.positions.shape:
                raise ValueError(f"{name} has {len(primitive.positions)} vertices, not {points.shape}")
            self._gl.move(primitive, np.ascontiguousarray(points, dtype=np.float32))

    def rest(self) -> None:
        """Put every mesh back where the scene has it."""
        self.move({m.name: m.vertices for m in self.scene.meshes if m.plant or m.flex_m is not None})

    def photograph(self, pose: Pose, intrinsics: Intrinsics, *, samples: int = 4) -> ByteArray:
        """(height, width, 3) uint8 sRGB image with ``samples`` samples per pixel (0: no anti-aliasing)."""
        self._aim(pose, intrinsics)
        image: ByteArray = self._gl.draw(self._content, samples=samples, output="color")
        return image

    def depth(self, pose: Pose, intrinsics: Intrinsics) -> Float32Array:
        """(height, width) float32: metres along the optical axis at each pixel's centre, 0 where nothing is hit."""
        self._aim(pose, intrinsics)
        return self._metres(self._gl.draw(self._content, samples=0, output="depth"))

    def _metres(self, drawn: Float32Array) -> Float32Array:
        metres = drawn.astype(np.float64)
        metres *= _NEAR_M - _FAR_M
        metres += _FAR_M
        np.divide(_NEAR_M * _FAR_M, metres, out=metres)
        metres[drawn >= 1.0] = 0.0
        return metres.astype(np.float32)

    def drawn(
        self, pose: Pose, intrinsics: Intrinsics, *, depth: bool, economy: bool
    ) -> tuple[ByteArray, Float32Array | None]:
        """`photograph`, and with ``depth`` `depth`: what a camera's effects and noise are put on.

        ``economy`` draws one sample per pixel instead of four, and smooths edges afterwards.
        """
        image, distance = self.photograph(pose, intrinsics, samples=0 if economy else _SAMPLES), None
        if depth:
            distance = self._metres(self._gl.depth_of_last()) if economy else self.depth(pose, intrinsics)
        return smooth_edges(image) if economy else image, distance

    def _aim(self, pose: Pose, intrinsics: Intrinsics) -> None:
        if self._platform is None:
            raise RenderingError("the renderer is closed")
        if intrinsics.distorted:
            raise ValueError("images are rendered without distortion: pass intrinsics.without_distortion()")
        self._platform.make_current()
        camera = self._pyrender.IntrinsicsCamera(
            intrinsics.fx, intrinsics.fy, intrinsics.cx, intrinsics.cy, znear=_NEAR_M, zfar=_FAR_M
        )
        if self._camera is not None:
            self._content.remove_node(self._camera)
        world_from_camera = np.eye(4)
        # OpenGL's camera looks along −z with y up, COLMAP's along +z with y down.
        world_from_camera[:3, :3] = pose.rotation.T @ np.diag([1.0, -1.0, -1.0])
        world_from_camera[:3, 3] = pose.center
        self._camera = self._content.add(camera, pose=world_from_camera)
        self._content.main_camera_node = self._camera
        self._gl.viewport_width, self._gl.viewport_height = intrinsics.width, intrinsics.height


def _start(scene: Scene) -> tuple[Any, Any, Any]:
    """pyrender, a current OpenGL context and a renderer in it."""
    os.environ.setdefault("PYOPENGL_PLATFORM", "egl")
    if not hasattr(np, "infty"):
        setattr(np, "infty", np.inf)  # noqa: B010  # pyrender 0.1.45 uses the name NumPy 2 dropped
    from OpenGL.plugins import FormatHandler

    # PyOpenGL 3.1.0, which pyrender pins, knows references of ctypes by the name they had until Python 3.11.
    reference = type(ctypes.byref(ctypes.c_int()))
    FormatHandler.by_name("ctypesparameter").check.append(f"{reference.__module__}.{reference.__name__}")
    import pyrender
    from pyrender.platforms import egl

    from fieldkit.scenes._gl_renderer import EGLPlatform, GLRenderer

    if (name := os.environ["PYOPENGL_PLATFORM"]) != "egl":
        raise ValueError(f"PYOPENGL_PLATFORM is {name!r}")
    platform = EGLPlatform(64, 64, device=egl.get_device_by_index(int(os.environ.get("EGL_DEVICE_ID", "0"))))
    platform.init_context()
    platform.make_current()
    from OpenGL.GL import GL_UNPACK_ALIGNMENT, glPixelStorei

    glPixelStorei(GL_UNPACK_ALIGNMENT, 1)  # pyrender's textures have no padding behind their rows
    return pyrender, platform, GLRenderer(scene.light, Path(__file__).parent / "shaders")


def _upload(pyrender: Any, mesh: Mesh) -> Any:
    texture = None
    if mesh.texture is not None:
        texture = pyrender.Texture(source=mesh.texture, source_channels="RGB")
    material = pyrender.MetallicRoughnessMaterial(
        baseColorFactor=[1.0, 1.0, 1.0, 1.0], baseColorTexture=texture, doubleSided=mesh.two_sided, alphaMode="OPAQUE"
    )
    colors = None
    if mesh.colors is not None:
        colors = np.column_stack([mesh.colors, np.ones(len(mesh.colors), np.float32)])
    primitive = pyrender.Primitive(
        positions=mesh.vertices,
        normals=mesh.normals if mesh.shading is not None else None,
        tangents=mesh.shading,
        texcoord_0=mesh.uv,
        color_0=colors,
        indices=mesh.faces,
        material=material,
        mode=4,
    )
    return pyrender.Mesh([primitive], name=mesh.name, is_visible=True)


def smooth_edges(image: ByteArray) -> ByteArray:
    """The image (h, w, 3), uint8, with its stair-steps smoothed; pixels away from edges keep their values."""
    result = image.copy()
    _smooth(image, _brightness(image), result)
    return result


@kernel
def _brightness(image: ByteArray) -> NDArray[np.int32]:
    """(h, w) weighted sum of red, green and blue, 0 to 1020."""
    h, w = image.shape[:2]
    luma = np.empty((h, w), np.int32)
    for i in range(h):
        for j in range(w):
            luma[i, j] = np.int32(image[i, j, 0]) + 2 * np.int32(image[i, j, 1]) + np.int32(image[i, j, 2])
    return luma


@inline_kernel
def _walk(luma: NDArray[np.int32], i: int, j: int, across: int, horizontal: bool, step: int, reach: int) -> float:
    """Pixels to the end of the edge between (i, j) and its neighbour ``across``; negative where its end is brighter."""
    h, w = luma.shape
    middle = luma[i, j] + (luma[i + across, j] if horizontal else luma[i, j + across])
    gap = abs(2 * luma[i, j] - middle)
    for k in range(1, reach + 1):
        a, b = (i, j + step * k) if horizontal else (i + step * k, j)
        c, d = (a + across, b) if horizontal else (a, b + across)
        if a < 0 or b < 0 or a >= h or b >= w:
            return float(k)
        change = luma[a, b] + luma[c, d] - middle
        if 2 * abs(change) >= gap:
            return float(k) if change < 0 else -float(k)
    return float(reach + 1)


@kernel
def _smooth(image: ByteArray, luma: NDArray[np.int32], result: ByteArray) -> None:
    h, w = luma.shape
    for i in range(1, h - 1):
        for j in range(1, w - 1):
            m, n, s, e, v = luma[i, j], luma[i - 1, j], luma[i + 1, j], luma[i, j + 1], luma[i, j - 1]
            high, low = max(m, n, s, e, v), min(m, n, s, e, v)
            if high - low < max(4 * _LEAST_STEP, _LEAST_SHARE * high):
                continue
            nw, ne, sw, se = luma[i - 1, j - 1], luma[i - 1, j + 1], luma[i + 1, j - 1], luma[i + 1, j + 1]
            across_rows = abs(nw + sw - 2 * v) + 2 * abs(n + s - 2 * m) + abs(ne + se - 2 * e)
            across_columns = abs(nw + ne - 2 * n) + 2 * abs(v + e - 2 * m) + abs(sw + se - 2 * s)
            horizontal = across_rows >= across_columns
            first, second = (n, s) if horizontal else (v, e)
            across = -1 if abs(first - m) >= abs(second - m) else 1
            other = first if across < 0 else second
            back = _walk(luma, i, j, across, horizontal, -1, _REACH)
            ahead = _walk(luma, i, j, across, horizontal, 1, _REACH)
            near = back if abs(back) <= abs(ahead) else ahead
            share = 0.0
            # The edge's nearer end tells which side of it this pixel's stair belongs to.
            if abs(near) <= _REACH and (near > 0) == (m > other):
                share = 0.5 - abs(near) / (abs(back) + abs(ahead))
            mean = (2 * (n + s + e + v) + nw + ne + sw + se) / 12.0
            lone = min(abs(mean - m) / (high - low), 1.0)
            lone = (3.0 - 2.0 * lone) * lone * lone
            share = max(share, _LONE * lone * lone)
            if share <= 0.0:
                continue
            a, b = (i + across, j) if horizontal else (i, j + across)
            for c in range(3):
                mixed = (1.0 - share) * image[i, j, c] + share * image[a, b, c]
                result[i, j, c] = np.uint8(mixed + 0.5)
