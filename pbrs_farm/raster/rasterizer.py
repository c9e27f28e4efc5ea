"""A house in OpenGL: pictures under the modes' lights, and depth and items at pixel centres.

Effects: holds an EGL context, on the GPU when there is one, else on the CPU (Mesa's llvmpipe).
Light is added up in linear half floats, 4 samples a pixel, resolved in linear light, and encoded
to sRGB once, at the end.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import TracebackType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import DepthZ, ItemBuffer, Srgb8Image
from pbrs_farm.core.camera import Camera
from pbrs_farm.core.frames import linear_from_srgb
from pbrs_farm.core.house import House
from pbrs_farm.core.recipe import RasterFields
from pbrs_farm.raster.gl_device import Target, encoded, n_samples, open_context, texture_from_pixels
from pbrs_farm.raster.light_choice import LIGHT_FLOATS, brightness_scale
from pbrs_farm.raster.projection import boxes_in_view, clip_from_world, distance_to_boxes, far_plane
from pbrs_farm.raster.shader_features import (
    CUTOUT,
    SEE_THROUGH,
    features_of_kind,
    kind_of_material,
    light_features,
)
from pbrs_farm.raster.shader_programs import plain_program, surface_program
from pbrs_farm.raster.uniform_blocks import LOOK_FLOATS, aligned_rows, item_lights, looks
from pbrs_farm.raster.vertex_buffers import mesh_from_house

SKY_SRGB = (0.78, 0.87, 0.96)
"""Colour of what lies behind windows and beyond the house."""


class Rasterizer:
    """One house in one OpenGL context; close() it, or use it in a with statement.

    textures: texture id -> (H, W, 3 or 4) uint8 sRGB, row 0 = top; a missing one is drawn without.
    Raises MachineFailed when this machine has no EGL.
    """

    def __init__(
        self,
        house: House,
        textures: Mapping[str, NDArray[np.uint8]],
        fields: RasterFields | None = None,
    ) -> None:
        self._fields = fields or RasterFields()
        n_lights = self._fields.lights_per_object
        self._context = open_context()
        self._samples = n_samples(self._context, self._fields.samples)
        self._mesh = mesh_from_house(house)
        self._white_per_lx = brightness_scale(house, n_lights)
        self._sky = tuple(linear_from_srgb(np.array(SKY_SRGB)))
        self._kind = np.array(
            [kind_of_material(m, is_textured=m.texture_id in textures) for m in house.materials],
            int,
        )
        self._light_features = light_features(house)
        self._programs: dict[tuple[str, int], tuple[Any, Any]] = {}
        self._queries = [self._context.query(samples=True) for _ in range(self._mesh.n_draws)]
        self._targets: dict[tuple[int, int, str], Target] = {}
        self._upload(house, textures, n_lights)

    def _upload(
        self, house: House, textures: Mapping[str, NDArray[np.uint8]], n_lights: int
    ) -> None:
        gl, alignment = self._context, self._context.info["GL_UNIFORM_BUFFER_OFFSET_ALIGNMENT"]
        self._vertices = gl.buffer(self._mesh.vertices.tobytes() or bytes(32))
        self._indices = gl.buffer(self._mesh.indices.tobytes() or bytes(12))
        look_rows = aligned_rows(looks(house), alignment)
        light_rows = aligned_rows(item_lights(house, n_lights), alignment)
        self._looks, self._look_step = (
            gl.buffer(look_rows.tobytes() or bytes(4)),
            look_rows[:1].nbytes,
        )
        self._lights, self._light_step = gl.buffer(light_rows.tobytes()), light_rows[:1].nbytes
        self._light_bytes = 4 * (4 + LIGHT_FLOATS * n_lights)
        used = {m.texture_id for m in house.materials}
        pictures = {
            name: texture_from_pixels(gl, pixels)
            for name, pixels in sorted(textures.items())
            if name in used
        }
        white = texture_from_pixels(gl, np.full((1, 1, 3), 255, np.uint8))
        self._pictures = [pictures.get(m.texture_id or "", white) for m in house.materials]

    def __enter__(self) -> Rasterizer:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def close(self) -> None:
        """Release the context and everything on it."""
        if self._context is not None:
            self._context.release()
            self._context = None

    @property
    def name(self) -> str:
        """The driver's own name for what draws, for versions in view.json."""
        return str(self._context.info["GL_RENDERER"])

    def render_dl(self, camera: Camera) -> Srgb8Image:
        """(H, W, 3) OpenGL-DL: a headlight and two directional lights, no shadows (suncg section 4)."""
        return self._render(camera, "dl")

    def render_il(self, camera: Camera) -> Srgb8Image:
        """(H, W, 3) OpenGL-IL: the lamps' lights, the best of them for each object, no shadows."""
        return self._render(camera, "il")

    def depth_and_items(self, camera: Camera) -> tuple[DepthZ, ItemBuffer]:
        """(H, W) depth_z in metres and (H, W) instance ids at pixel centres; 0 = nothing.

        Panes and glass are solid here, as in the hit record.
        """
        with self._context:
            target = self._target(camera, "ids")
            clip = clip_from_world(camera, far_plane(camera, *self._boxes))
            target.begin((0.0, 0.0, 0.0, 0.0))
            program, vao = self._program("ids", 0)
            _set(program, clip_from_world=clip)
            for draw in self._near_to_far(camera, clip):
                program["item"] = int(self._mesh.draw_item[draw])
                self._draw(vao, draw)
            depth_z, item = target.read("f4", 0, 1), target.read("u4", 1, 1)
        return depth_z[..., 0], item[..., 0]

    def _render(self, camera: Camera, mode: str) -> Srgb8Image:
        with self._context:
            target = self._target(camera, "colour")
            clip = clip_from_world(camera, far_plane(camera, *self._boxes))
            order = self._near_to_far(camera, clip)
            if mode == "il":
                order = self._unhidden(target, order, clip)
            kind = self._kind[self._mesh.draw_material[order]]
            target.begin((*self._sky, 1.0))
            for number in np.unique(kind):
                self._begin_surfaces(mode, int(number), camera, clip)
                if number & SEE_THROUGH:
                    continue
                for draw in order[kind == number]:
                    self._bind(mode, int(draw))
                    self._draw(self._program(mode, int(number))[1], int(draw))
            if (kind & SEE_THROUGH).any():
                self._draw_glass(mode, order[(kind & SEE_THROUGH) > 0], camera)
            return encoded(target.read("f2", 0, 3))

    @property
    def _boxes(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        return self._mesh.draw_low, self._mesh.draw_high

    def _near_to_far(self, camera: Camera, clip: NDArray[np.float64]) -> NDArray[np.int64]:
        """Numbers of the draws in view, nearest box first, so that hidden pixels are never lit."""
        seen = np.nonzero(boxes_in_view(clip, *self._boxes))[0]
        low, high = self._boxes
        return seen[np.argsort(distance_to_boxes(camera.eye, low[seen], high[seen]), kind="stable")]

    def _unhidden(
        self, target: Target, draws: NDArray[np.int64], clip: NDArray[np.float64]
    ) -> NDArray[np.int64]:
        """The draws of which any sample is seen, after a first pass that draws nothing but depth.

        A software renderer pays for light on all that is hidden when samples are several.
        """
        program, vao = self._program("depth", 0)
        _set(program, clip_from_world=clip)
        is_solid = (self._kind[self._mesh.draw_material[draws]] & (SEE_THROUGH | CUTOUT)) == 0
        target.begin_depths()
        for draw in draws[is_solid]:
            with self._queries[draw]:
                self._draw(vao, int(draw))
        target.nearest.use(1)
        kept = ~is_solid
        kept[is_solid] = [self._queries[draw].samples > 0 for draw in draws[is_solid]]
        return np.asarray(draws[kept])

    def _begin_surfaces(
        self, mode: str, kind: int, camera: Camera, clip: NDArray[np.float64]
    ) -> None:
        _set(
            self._program(mode, kind)[0],
            clip_from_world=clip,
            eye=camera.eye,
            forward=camera.towards,
            sky=self._sky,
            white_per_lx=self._white_per_lx,
        )

    def _bind(self, mode: str, draw: int) -> None:
        material = int(self._mesh.draw_material[draw])
        self._looks.bind_to_uniform_block(
            0, offset=material * self._look_step, size=4 * LOOK_FLOATS
        )
        if mode == "il":
            offset = int(self._mesh.draw_item[draw]) * self._light_step
            self._lights.bind_to_uniform_block(1, offset=offset, size=self._light_bytes)
        self._pictures[material].use(0)

    def _draw(self, vao: Any, draw: int) -> None:
        count, first = int(self._mesh.draw_count[draw]), int(self._mesh.draw_first[draw])
        vao.render(vertices=3 * count, first=3 * first)

    def _draw_glass(self, mode: str, draws: NDArray[np.int64], camera: Camera) -> None:
        """Blend every see-through triangle in view, farthest first, without writing depth."""
        gl, mesh = self._context, self._mesh
        counts = mesh.draw_count[draws]
        triangle = np.concatenate(
            [np.arange(mesh.draw_first[d], mesh.draw_first[d] + mesh.draw_count[d]) for d in draws]
        )
        owner = np.repeat(draws, counts)
        corners = mesh.vertices[mesh.indices[triangle].astype(np.int64), :3]
        depth = (corners.mean(axis=1) - camera.eye) @ camera.towards
        order = np.argsort(-depth, kind="stable")
        triangle, owner = triangle[order], owner[order]

        indices = gl.buffer(np.ascontiguousarray(mesh.indices[triangle]).tobytes())
        kinds = self._kind[mesh.draw_material[owner]]
        vaos = {
            int(k): self._vao(self._program(mode, int(k))[0], indices) for k in np.unique(kinds)
        }
        gl.enable(gl.BLEND)
        gl.blend_func = gl.ONE, gl.ONE_MINUS_SRC_ALPHA
        gl.depth_mask = False
        starts = np.nonzero(np.diff(owner, prepend=-1))[0]
        for start, end in zip(starts, [*starts[1:], len(owner)], strict=True):
            self._bind(mode, int(owner[start]))
            vaos[int(kinds[start])].render(vertices=3 * int(end - start), first=3 * int(start))
        gl.depth_mask = True
        gl.disable(gl.BLEND)
        for vao in vaos.values():
            vao.release()
        indices.release()

    def _program(self, mode: str, kind: int) -> tuple[Any, Any]:
        """Program and vertex array of a mode ("dl", "il", "ids") for a kind of material."""
        if (mode, kind) not in self._programs:
            if mode in ("ids", "depth"):
                program = plain_program(self._context, mode)
            else:
                features = [f"MODE_{mode.upper()}", *features_of_kind(kind)]
                features += self._light_features if mode == "il" else []
                n_lights = self._fields.lights_per_object
                program = surface_program(self._context, features, n_lights, self._samples)
                if "nearest" in program:
                    program["nearest"] = 1
                for block, binding in (("Look", 0), ("Lights", 1)):
                    if block in program:
                        program[block].binding = binding
            self._programs[mode, kind] = program, self._vao(program, self._indices)
        return self._programs[mode, kind]

    def _vao(self, program: Any, indices: Any) -> Any:
        names = [n if n in program else None for n in ("in_position", "in_normal", "in_uv")]
        layout = " ".join(
            size if name else f"{4 * int(size[0])}x"
            for name, size in zip(names, ("3f", "3f", "2f"))
        )
        return self._context.vertex_array(
            program, [(self._vertices, layout, *[n for n in names if n])], indices
        )

    def _target(self, camera: Camera, kind: str) -> Target:
        i = camera.intrinsics
        key = (i.width_px, i.height_px, kind)
        if key not in self._targets:
            size = (i.width_px, i.height_px)
            self._targets[key] = Target(self._context, size, kind, self._samples)
        return self._targets[key]


def _set(program: Any, **values: Any) -> None:
    """Set the uniforms the program has; matrices (4, 4) are given row by row."""
    for name, value in values.items():
        if name in program:
            array = np.asarray(value, np.float32)
            program[name].write(array.T.tobytes() if array.ndim == 2 else array.tobytes())
