"""The rasterizer: OpenGL pictures of a house, and depth and items at pixel centres.

Effects: holds an EGL context, on the GPU when there is one, else on the CPU (Mesa's llvmpipe).
Light is summed in linear half floats, 4 samples a pixel, resolved in linear light, encoded last.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import TracebackType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F64, I64, Srgb8Image
from pbrs_farm.core.camera import Camera, pinholes_of
from pbrs_farm.core.frames import linear_from_srgb, srgb_from_linear
from pbrs_farm.core.house import House
from pbrs_farm.core.recipe import RasterFields
from pbrs_farm.raster.draw_mesh import mesh_from_house, move_item
from pbrs_farm.raster.gl_device import (
    RenderTarget,
    n_samples,
    open_context,
    srgb8_from_half,
    texture_from_pixels,
)
from pbrs_farm.raster.light_choice import LIGHT_FLOATS, brightness_scale
from pbrs_farm.raster.projection import boxes_in_view, clip_from_world, distance_to_boxes, far_plane
from pbrs_farm.raster.shader_programs import (
    Feature,
    depth_program,
    feature_names,
    features_of_material,
    light_features,
    surface_program,
)
from pbrs_farm.raster.uniform_blocks import (
    BLOCK_FLOATS,
    aligned_rows,
    light_blocks,
    material_blocks,
)

_EDGE = 1e-3  # coordinates that leave a texture by less do not repeat it
SKY_SRGB = (0.78, 0.87, 0.96)  # background: behind windows and beyond the house


class Rasterizer:
    """One house in one OpenGL context; close() it, or use it in a with statement.

    textures: texture id -> (H, W, 3 or 4) uint8 sRGB, row 0 = top, each looked up when it is first drawn; a missing
    one is drawn without.
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
        self._house, self._mesh = house, mesh_from_house(house)
        self._white_per_lx = brightness_scale(house, n_lights)
        self._sky = tuple(linear_from_srgb(np.array(SKY_SRGB)))
        features = [
            features_of_material(m, is_textured=m.texture_id in textures) for m in house.materials
        ]
        self._features = np.array(features, int)  # feature bits of each material
        self._light_features = light_features(house)
        # (mode, feature bits) -> program, vertex array
        self._programs: dict[tuple[str, int], tuple[Any, Any]] = {}
        self._queries = [self._context.query(samples=True) for _ in range(self._mesh.n_draws)]
        self._targets: dict[tuple[int, int], RenderTarget] = {}  # (width, height)
        self._pictures = textures
        self._textures: dict[str, Any] = {}  # uploaded so far, by id
        self._visible: tuple[object, I64] | None = None  # the last view and its visible draws
        self._upload(house, n_lights)

    def _upload(self, house: House, n_lights: int) -> None:
        gl, alignment = self._context, self._context.info["GL_UNIFORM_BUFFER_OFFSET_ALIGNMENT"]
        # Upload the mesh; OpenGL takes no empty buffer.
        vertices, indices = self._mesh.vertices, self._mesh.indices
        self._vertices = gl.buffer(vertices if vertices.size else bytes(32))
        self._indices = gl.buffer(indices if indices.size else bytes(12))
        # Upload the uniform blocks, one row a material and one an item.
        material_rows = aligned_rows(material_blocks(house), alignment)
        light_rows = aligned_rows(light_blocks(house, n_lights), alignment)
        self._materials = gl.buffer(material_rows.tobytes() or bytes(4))
        self._material_step = material_rows[:1].nbytes
        self._lights, self._light_step = gl.buffer(light_rows.tobytes()), light_rows[:1].nbytes
        self._light_bytes = 4 * (4 + LIGHT_FLOATS * n_lights)
        self._repeating = _repeating_textures(house)

    def _texture(self, material: int) -> Any:
        """The texture of a material, uploaded at its first draw: a view shows few rooms' textures."""
        name = self._house.materials[material].texture_id or ""
        name = name if name in self._pictures else ""
        if name not in self._textures:
            # A material without a texture, or with an unreadable one, samples a white texel.
            pixels = self._pictures.get(name, np.full((1, 1, 3), 255, np.uint8))
            repeats = (name, 0) in self._repeating, (name, 1) in self._repeating
            self._textures[name] = texture_from_pixels(self._context, pixels, repeats)
        return self._textures[name]

    def draw_house(self, house: House) -> None:
        """Draw the house with rigidly moved parts from now on; uploads only moved vertices."""
        changed = [
            k
            for k, (a, b) in enumerate(zip(self._house.items, house.items, strict=True))
            if a is not b
        ]
        if changed:
            alignment = self._context.info["GL_UNIFORM_BUFFER_OFFSET_ALIGNMENT"]
            blocks = light_blocks(house, self._fields.lights_per_object)
            with self._context:
                self._lights.write(aligned_rows(blocks, alignment).tobytes())
                for k in changed:
                    rows = move_item(self._mesh, k + 1, house.items[k])
                    data = self._mesh.vertices[rows].tobytes()
                    self._vertices.write(data, offset=rows.start * self._mesh.vertices[0].nbytes)
            self._visible = None
        self._house = house

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
        """Release the context and everything on it, as a with statement does; drawing afterwards fails."""
        if self._context is not None:
            self._context.release()
            self._context = None

    @property
    def name(self) -> str:
        """The driver's own name for what draws, for versions in view.json."""
        return str(self._context.info["GL_RENDERER"])

    def render_dl(self, camera: Camera) -> Srgb8Image:
        """(H, W, 3) uint8 OpenGL-DL: a headlight and two fixed lights (docs/spec/suncg.md section 4)."""
        return self._picture(camera, "dl")

    def render_il(self, camera: Camera) -> Srgb8Image:
        """(H, W, 3) uint8 OpenGL-IL: the best lamps for each object, no shadows; a headlight without lamps."""
        return self._picture(camera, "il")

    def _picture(self, camera: Camera, mode: str) -> Srgb8Image:
        if camera.intrinsics.lens.is_pinhole:
            return self._render(camera, mode, camera.towards)
        # OpenGL draws straight lines: resample another lens's picture from pin-holes, in linear light.
        cameras, faces = pinholes_of(camera)
        forward = camera.towards if len(cameras) == 1 else np.zeros(3)
        linear = linear_from_srgb(np.arange(256) / 255).astype(np.float32)
        picture = faces.bilinear([linear[self._render(c, mode, forward)] for c in cameras])
        return np.rint(np.clip(srgb_from_linear(picture), 0, 1) * 255).astype(np.uint8)

    def _render(self, camera: Camera, mode: str, forward: F64) -> Srgb8Image:
        """forward (3,): direction of the headlight; 0 = at the eye."""
        with self._context:
            target = self._target(camera)
            clip = clip_from_world(camera, far_plane(camera, *self._boxes))
            # Ask once for the pictures of both modes.
            view = camera.intrinsics, camera.world_from_camera.tobytes()
            if self._visible is None or self._visible[0] != view:
                order = self._front_to_back(camera, clip)
                self._visible = view, self._visible_draws(target, order, clip)
            order = self._visible[1]
            target.prepass_depth.use(1)
            # Draw opaque surfaces program by program, then blend the transparent ones over them.
            features = self._features[self._mesh.draw_material[order]]
            target.begin((*self._sky, 1.0))
            for bits in np.unique(features):
                self._begin_surfaces(mode, int(bits), camera, clip, forward)
                if bits & Feature.TRANSPARENT:
                    continue
                for draw in order[features == bits]:
                    self._bind(mode, int(draw))
                    self._draw(self._program(mode, int(bits))[1], int(draw))
            if (features & Feature.TRANSPARENT).any():
                self._blend_transparent(mode, order[(features & Feature.TRANSPARENT) > 0], camera)
            return srgb8_from_half(target.read())

    @property
    def _boxes(self) -> tuple[F64, F64]:
        return self._mesh.draw_low, self._mesh.draw_high

    def _front_to_back(self, camera: Camera, clip: F64) -> I64:
        """Numbers of the draws in the frustum, nearest box first, so that hidden pixels are not lit."""
        draws = np.nonzero(boxes_in_view(clip, *self._boxes))[0]
        low, high = self._boxes
        distance = distance_to_boxes(camera.eye, low[draws], high[draws])
        return draws[np.argsort(distance, kind="stable")]

    def _visible_draws(self, target: RenderTarget, draws: I64, clip: F64) -> I64:
        """The draws with a visible sample, by queries in a pre-pass: hidden ones cost light."""
        # Draw opaque surfaces into the depth texture and count the samples that pass.
        program, vao = self._program("depth", 0)
        _set_uniforms(program, clip_from_world=clip)
        see_through = Feature.TRANSPARENT | Feature.ALPHA_CUTOUT
        is_solid = (self._features[self._mesh.draw_material[draws]] & see_through) == 0
        target.begin_depth_prepass()
        for draw in draws[is_solid]:
            with self._queries[draw]:
                self._draw(vao, int(draw))
        # Keep whatever may be seen through, unasked.
        visible = ~is_solid
        visible[is_solid] = [self._queries[draw].samples > 0 for draw in draws[is_solid]]
        return np.asarray(draws[visible])

    def _begin_surfaces(
        self, mode: str, features: int, camera: Camera, clip: F64, forward: F64
    ) -> None:
        _set_uniforms(
            self._program(mode, features)[0],
            clip_from_world=clip,
            eye=camera.eye,
            forward=forward,
            sky=self._sky,
            white_per_lx=self._white_per_lx,
        )

    def _bind(self, mode: str, draw: int) -> None:
        material = int(self._mesh.draw_material[draw])
        self._materials.bind_to_uniform_block(
            0, offset=material * self._material_step, size=4 * BLOCK_FLOATS
        )
        if mode == "il":
            offset = int(self._mesh.draw_item[draw]) * self._light_step
            self._lights.bind_to_uniform_block(1, offset=offset, size=self._light_bytes)
        self._texture(material).use(0)

    def _draw(self, vao: Any, draw: int) -> None:
        count, first = int(self._mesh.draw_count[draw]), int(self._mesh.draw_first[draw])
        vao.render(vertices=3 * count, first=3 * first)

    def _blend_transparent(self, mode: str, draws: I64, camera: Camera) -> None:
        """Blend every transparent triangle in view, farthest first, without writing depth."""
        # List the triangles of all transparent draws and sort them by the depth of their middle.
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

        # Build an index buffer in that order, and a vertex array for each program.
        indices = gl.buffer(np.ascontiguousarray(mesh.indices[triangle]).tobytes())
        features = self._features[mesh.draw_material[owner]]
        vaos = {
            int(b): self._vao(self._program(mode, int(b))[0], indices) for b in np.unique(features)
        }
        # Draw runs of triangles that share a draw; colours are premultiplied by alpha.
        gl.enable(gl.BLEND)
        gl.blend_func = gl.ONE, gl.ONE_MINUS_SRC_ALPHA
        gl.depth_mask = False
        starts = np.nonzero(np.diff(owner, prepend=-1))[0]
        for start, end in zip(starts, [*starts[1:], len(owner)], strict=True):
            self._bind(mode, int(owner[start]))
            vaos[int(features[start])].render(vertices=3 * int(end - start), first=3 * int(start))
        gl.depth_mask = True
        gl.disable(gl.BLEND)
        for vao in vaos.values():
            vao.release()
        indices.release()

    def _program(self, mode: str, features: int) -> tuple[Any, Any]:
        """Program and vertex array of a mode ("dl", "il", "depth") for feature bits."""
        if (mode, features) not in self._programs:
            if mode == "depth":
                program = depth_program(self._context)
            else:
                # Features become #defines: a program has no code that its surfaces do not need.
                defines = [f"MODE_{mode.upper()}", *feature_names(features)]
                defines += self._light_features if mode == "il" else []
                n_lights = self._fields.lights_per_object
                program = surface_program(self._context, defines, n_lights, self._samples)
                # The compiler drops uniforms that no feature uses, so ask for each.
                if "prepass_depth" in program:
                    program["prepass_depth"] = 1
                for block, binding in (("Material", 0), ("Lights", 1)):
                    if block in program:
                        program[block].binding = binding
            self._programs[mode, features] = program, self._vao(program, self._indices)
        return self._programs[mode, features]

    def _vao(self, program: Any, indices: Any) -> Any:
        # Skip the bytes of attributes that the program does not read.
        names = [n if n in program else None for n in ("in_position", "in_normal", "in_uv")]
        layout = " ".join(
            size if name else f"{4 * int(size[0])}x"
            for name, size in zip(names, ("3f", "3f", "2f"))
        )
        return self._context.vertex_array(
            program, [(self._vertices, layout, *[n for n in names if n])], indices
        )

    def _target(self, camera: Camera) -> RenderTarget:
        size = (camera.intrinsics.width_px, camera.intrinsics.height_px)
        if size not in self._targets:
            self._targets[size] = RenderTarget(self._context, size, self._samples)
        return self._targets[size]


def _repeating_textures(house: House) -> set[tuple[str, int]]:
    """(texture id, 0 along u or 1 along v) of textures that a surface shows beyond their edges."""
    repeating = set()
    for item in house.items:
        for surface in item.surfaces:
            name = house.materials[surface.material].texture_id
            if name and surface.uvs is not None and len(surface.uvs):
                uvs = np.nan_to_num(surface.uvs)
                leaves = (uvs.min(0) < -_EDGE) | (uvs.max(0) > 1 + _EDGE)
                repeating |= {(name, k) for k in range(2) if leaves[k]}
    return repeating


def _set_uniforms(program: Any, **values: Any) -> None:
    """Set the uniforms the program has; matrices (4, 4) are given row by row."""
    for name, value in values.items():
        if name in program:
            array = np.asarray(value, np.float32)
            program[name].write(array.T.tobytes() if array.ndim == 2 else array.tobytes())
