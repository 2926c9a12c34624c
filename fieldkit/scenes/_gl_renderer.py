"""pyrender's OpenGL renderer with our shaders, sample counts and read-back. Imported only by `renderer`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from OpenGL import GL
from pyrender.constants import RenderFlags
from pyrender.platforms import egl
from pyrender.renderer import Renderer as PyrenderRenderer
from pyrender.shader_program import ShaderProgramCache

from fieldkit.arrays import Float32Array
from fieldkit.scenes.scene import Light


class EGLPlatform(egl.EGLPlatform):  # type: ignore[misc]
    """A context of EGL. pyrender's own, once collected, ends the display and with it every context of the process."""

    def delete_context(self) -> None:
        """End this context alone. A second call does nothing."""
        from OpenGL import EGL  # once it is imported PyOpenGL 3.1.0 can load no more of GL's extensions

        context = self._egl_context
        self._egl_context: Any = None
        if context is not None:
            EGL.eglDestroyContext(self._egl_display, context)


class GLRenderer(PyrenderRenderer):  # type: ignore[misc]
    """Draws with the shaders of ``shader_folder``; needs a current OpenGL context."""

    def __init__(self, light: Light, shader_folder: Path) -> None:
        super().__init__(64, 64)
        self._program_cache = ShaderProgramCache(str(shader_folder))
        self._uniforms = {
            name: np.array(getattr(light, name), dtype=np.float32)
            for name in ("sun", "sun_color", "sky_color", "ground_color")
        }
        self._samples = 4
        self._allocated: tuple[int, int, int] | None = None
        self._output = "color"

    def draw(self, scene: Any, *, samples: int, output: str) -> NDArray[Any]:
        """(h, w, 3) uint8 for output "color", (h, w) float32 window depth in [0, 1] for "depth"."""
        self._samples, self._output = samples, output
        result: NDArray[Any] = self.render(scene, RenderFlags.FLAT | RenderFlags.OFFSCREEN)
        return result

    def depth_of_last(self) -> Float32Array:
        """(h, w) window depth of what was drawn last; at the pixels' centres only where that had no samples."""
        return self._read_depth()

    def move(self, primitive: Any, positions: Float32Array) -> None:
        """Replace a primitive's positions, in its vertex buffer too where it has been uploaded."""
        primitive.positions = positions
        if primitive._vaid is None:
            return
        # pyrender keeps all attributes of a vertex side by side in one buffer, in this order.
        parts = [positions, primitive.normals, primitive.tangents, primitive.texcoord_0, primitive.color_0]
        data = np.hstack([part for part in parts if part is not None]).astype(np.float32)
        GL.glBindBuffer(GL.GL_ARRAY_BUFFER, primitive._buffers[0])
        GL.glBufferData(GL.GL_ARRAY_BUFFER, data.nbytes, data, GL.GL_STATIC_DRAW)
        GL.glBindBuffer(GL.GL_ARRAY_BUFFER, 0)

    def _sorted_mesh_nodes(self, scene: Any) -> list[Any]:
        # pyrender takes them from a set, so surfaces that touch would be drawn in another order in every process.
        return sorted(scene.mesh_nodes, key=lambda node: node.name)

    def _update_context(self, scene: Any, flags: int) -> None:
        super()._update_context(scene, flags)
        for texture in self._mesh_textures:
            texture.source = None  # pyrender's copy

    def _configure_forward_pass_viewport(self, flags: int) -> None:
        super()._configure_forward_pass_viewport(flags)
        if not self._samples:  # no need for buffers of many samples, and none to copy
            GL.glBindFramebuffer(GL.GL_DRAW_FRAMEBUFFER, self._main_fb)

    def _get_primitive_program(self, primitive: Any, flags: int, program_flags: int) -> Any:
        if self._output == "depth":
            program = self._program_cache.get_program("depth.vert", "depth.frag")
            if not program._in_context():
                program._add_to_context()
            return program
        program = super()._get_primitive_program(primitive, flags, program_flags)
        program._bind()
        for name, value in self._uniforms.items():
            program.set_uniform(name, value)
        return program

    def _configure_main_framebuffer(self) -> None:
        super()._configure_main_framebuffer()
        wanted = self._allocated or (1, 1, 0)
        if self._samples:
            wanted = self.viewport_width, self.viewport_height, self._samples
        if self._allocated == wanted:
            return
        for buffer, layout in ((self._main_cb_ms, GL.GL_RGBA), (self._main_db_ms, GL.GL_DEPTH_COMPONENT24)):
            GL.glBindRenderbuffer(GL.GL_RENDERBUFFER, buffer)
            GL.glRenderbufferStorageMultisample(GL.GL_RENDERBUFFER, wanted[2], layout, *wanted[:2])
        self._allocated = wanted

    def _delete_main_framebuffer(self) -> None:
        super()._delete_main_framebuffer()
        self._allocated = None

    def _read_main_framebuffer(self, scene: Any, flags: int) -> NDArray[Any]:
        if self._output == "depth":
            return self._read_depth()
        width, height = self._resolve(GL.GL_COLOR_BUFFER_BIT)
        data = GL.glReadPixels(0, 0, width, height, GL.GL_RGB, GL.GL_UNSIGNED_BYTE)
        return np.ascontiguousarray(np.flip(np.frombuffer(data, np.uint8).reshape(height, width, 3), 0))

    def _read_depth(self) -> Float32Array:
        width, height = self._resolve(GL.GL_DEPTH_BUFFER_BIT)
        data = GL.glReadPixels(0, 0, width, height, GL.GL_DEPTH_COMPONENT, GL.GL_FLOAT)
        return np.flip(np.frombuffer(data, np.float32).reshape(height, width), 0)

    def _resolve(self, bit: int) -> tuple[int, int]:
        """Copy what was drawn to where it can be read; its width and height."""
        width, height = self._main_fb_dims
        if self._samples:
            GL.glBindFramebuffer(GL.GL_READ_FRAMEBUFFER, self._main_fb_ms)
            GL.glBindFramebuffer(GL.GL_DRAW_FRAMEBUFFER, self._main_fb)
            GL.glBlitFramebuffer(0, 0, width, height, 0, 0, width, height, bit, GL.GL_NEAREST)
        GL.glBindFramebuffer(GL.GL_READ_FRAMEBUFFER, self._main_fb)
        GL.glPixelStorei(GL.GL_PACK_ALIGNMENT, 1)
        return width, height
