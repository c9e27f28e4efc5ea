"""An item buffer by moderngl: what the ray caster is compared with, for speed and in tests.

Effects: an OpenGL context. One indexed draw per camera, integer target, no culling.
"""

from __future__ import annotations

import moderngl
import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.camera import Camera
from pbrs_farm.core.house import Geometry

_VERTEX = """
#version 330
uniform mat4 clip_from_world;
in vec3 position;
in uint item;
flat out uint v_item;
void main() { v_item = item; gl_Position = clip_from_world * vec4(position, 1.0); }
"""
_FRAGMENT = """
#version 330
flat in uint v_item;
out uint f_item;
void main() { f_item = v_item; }
"""
NEAR_M, FAR_M = 0.02, 200.0


class GlItems:
    """Item buffers of one geometry at one size."""

    def __init__(self, geometry: Geometry, width_px: int, height_px: int) -> None:
        self.gl = moderngl.create_standalone_context(backend="egl")
        program = self.gl.program(vertex_shader=_VERTEX, fragment_shader=_FRAGMENT)
        vertex_item = np.zeros(len(geometry.positions), np.uint32)
        vertex_item[geometry.faces] = geometry.face_item[:, None]
        self._uniform = program["clip_from_world"]
        self._mesh = self.gl.vertex_array(
            program,
            [
                (self.gl.buffer(geometry.positions.tobytes()), "3f", "position"),
                (self.gl.buffer(vertex_item.tobytes()), "1u4", "item"),
            ],
            index_buffer=self.gl.buffer(geometry.faces.astype(np.uint32).tobytes()),
        )
        size = (width_px, height_px)
        self._target = self.gl.framebuffer(
            [self.gl.texture(size, 1, dtype="u4")], self.gl.depth_renderbuffer(size)
        )
        self._target.use()
        self.gl.enable_only(moderngl.DEPTH_TEST)

    def item_buffer(self, camera: Camera) -> NDArray[np.uint32]:
        """(H, W) uint32 instance id seen in each pixel, row 0 on top."""
        clip_from_world = projection(camera) @ np.linalg.inv(camera.world_from_camera)
        self._uniform.write(clip_from_world.T.astype("f4").tobytes())
        self._target.clear()
        self._mesh.render()
        data = self._target.read(components=1, dtype="u4")
        width, height = self._target.size
        return np.frombuffer(data, np.uint32).reshape(height, width)[::-1]

    def release(self) -> None:
        """Give the context back."""
        self.gl.release()


def projection(camera: Camera) -> NDArray[np.float64]:
    """(4, 4) clip from camera for the camera's intrinsics."""
    i = camera.intrinsics
    depth = (FAR_M + NEAR_M) / (NEAR_M - FAR_M), 2 * FAR_M * NEAR_M / (NEAR_M - FAR_M)
    return np.array(
        [
            [2 * i.fx / i.width_px, 0, 1 - 2 * i.cx / i.width_px, 0],
            [0, 2 * i.fy / i.height_px, 2 * i.cy / i.height_px - 1, 0],
            [0, 0, *depth],
            [0, 0, -1, 0],
        ]
    )
