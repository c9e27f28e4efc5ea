"""The rasterizer: OpenGL pictures of a house, and depth and items at pixel centres.

Effects: holds an EGL context, on the GPU when there is one, else on the CPU (Mesa's llvmpipe).
Light is summed in linear half floats, 4 samples a pixel, resolved in linear light, encoded last.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import TracebackType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F32, F64, I64, Bools, Matrix4, Srgb8Image
from pbrs_farm.core.camera import Camera, pinholes_of
from pbrs_farm.core.frames import linear_from_srgb, srgb_from_linear
from pbrs_farm.core.house import House, Material, MaterialKind, Surface
from pbrs_farm.core.mesh import triangle_corners, unit_normals
from pbrs_farm.core.recipe import RasterFields
from pbrs_farm.raster.gl_device import (
    RenderTarget,
    n_samples,
    open_context,
    srgb8_from_half,
    texture_from_pixels,
)
from pbrs_farm.raster.light_choice import LIGHT_FLOATS, best_lights, brightness_scale, light_table
from pbrs_farm.raster.shader_programs import (
    Feature,
    depth_program,
    feature_names,
    features_of_material,
    light_features,
    surface_program,
)

# Projection: camera to OpenGL clip space on Camera.rays()' pixel grid, frustum culling.


NEAR_PLANE_M = 0.02  # closer than any camera stands to a wall


def clip_from_world(camera: Camera, far_m: float) -> Matrix4:
    """(4, 4) world to clip space; pixel centres lie at +0.5 in the coordinates of K, row 0 on top."""
    # Shift the principal point: clip space runs from -1 to 1, upwards, across the picture.
    i = camera.intrinsics
    w, h, n, f = i.width_px, i.height_px, NEAR_PLANE_M, far_m
    clip_from_camera = np.array(
        [
            [2 * i.fx / w, 0, 1 - 2 * i.cx / w, 0],
            [0, 2 * i.fy / h, 2 * i.cy / h - 1, 0],
            [0, 0, -(f + n) / (f - n), -2 * f * n / (f - n)],
            [0, 0, -1, 0],
        ]
    )
    return np.asarray(clip_from_camera @ np.linalg.inv(camera.world_from_camera))


def far_plane(camera: Camera, low: F64, high: F64) -> float:
    """Depth of a far plane just beyond every box (N, 3) for the camera, and at least a metre."""
    if not len(low):
        return 1.0
    # Measure to the farthest corner of the box around all boxes.
    reach = np.maximum(np.abs(low.min(0) - camera.eye), np.abs(high.max(0) - camera.eye))
    return max(1.0, 1.01 * float(np.linalg.norm(reach)))


def boxes_in_view(clip: Matrix4, low: F64, high: F64) -> Bools:
    """(N,) bool: the box is not wholly outside one plane of the view frustum."""
    # Read the six planes off the clip matrix (Gribb and Hartmann 2001).
    planes = np.concatenate([clip[3] + clip[:3], clip[3] - clip[:3]])
    normal, offset = planes[:, :3], planes[:, 3]
    # Test the corner of each box that lies farthest inwards.
    farthest = np.where(normal[:, None] > 0, high, low)
    return np.asarray((np.einsum("pk,pnk->pn", normal, farthest) + offset[:, None] >= 0).all(0))


def distance_to_boxes(eye: F64, low: F64, high: F64) -> F64:
    """(N,) distance from eye to the nearest point of each box."""
    gap = np.maximum(np.maximum(low - eye, eye - high), 0.0)
    return np.asarray(np.sqrt(np.einsum("nk,nk->n", gap, gap)))


# Vertex buffers: a house as one vertex buffer, one index buffer and draw calls.


@dataclass(frozen=True, slots=True, eq=False)
class DrawMesh:
    """All triangles of a house for OpenGL; a draw is those of one item with one material."""

    vertices: F32  # (V, 8) position (world, m), normal (unit), uv (v up)
    indices: NDArray[np.uint32]  # (F, 3)
    draw_first: I64  # (D,) first triangle
    draw_count: I64  # (D,) number of triangles
    draw_item: I64  # (D,) instance id
    draw_material: I64  # (D,) index into House.materials
    draw_low: F64  # (D, 3) corners of the bounding box in the world
    draw_high: F64

    @property
    def n_draws(self) -> int:
        """The number of draws."""
        return len(self.draw_first)


def mesh_from_house(house: House) -> DrawMesh:
    """The mesh of every surface of house, panes included; non-finite triangles are dropped."""
    vertices: list[F32] = []
    indices: list[NDArray[np.uint32]] = []
    rows: list[tuple[int, int, int, int]] = []
    boxes: list[tuple[F32, F32]] = []
    n_vertices = n_faces = 0

    # Write item by item, and within an item material by material: each pair is one draw.
    for instance, item in enumerate(house.items, start=1):
        for material in dict.fromkeys(s.material for s in item.surfaces):
            first, corners = n_faces, []
            for surface in item.surfaces:
                if surface.material != material:
                    continue
                v, f = _vertices(surface)
                vertices.append(v)
                indices.append((f + n_vertices).astype(np.uint32))
                corners.append(v[f.reshape(-1), :3])
                n_vertices, n_faces = n_vertices + len(v), n_faces + len(f)
            if n_faces > first:
                points = np.concatenate(corners)
                boxes.append((points.min(0), points.max(0)))
                rows.append((first, n_faces - first, instance, material))

    table = np.array(rows, np.int64).reshape(-1, 4)
    box = np.array(boxes, np.float64).reshape(-1, 2, 3)
    return DrawMesh(
        np.concatenate([np.zeros((0, 8), np.float32), *vertices]),
        np.concatenate([np.zeros((0, 3), np.uint32), *indices]),
        *table.T, *np.moveaxis(box, 1, 0),
    )  # fmt: skip


def _vertices(surface: Surface) -> tuple[F32, I64]:
    """(V, 8) vertices and (F, 3) faces of a surface; flat ones get three vertices per face."""
    # Drop faces with a vertex that is not finite.
    points, faces = surface.positions, surface.faces.astype(np.int64)
    finite: Bools = np.all(np.isfinite(points), axis=1)
    faces = faces[np.all(finite[faces], axis=1)]
    uvs = surface.uvs if surface.uvs is not None else np.zeros((len(points), 2), np.float32)
    normals = surface.normals
    # Split vertices where a normal is missing or not of unit length: faces have their own there.
    if normals is None or not _is_unit(normals[faces.reshape(-1)]).all():
        corner = faces.reshape(-1)
        own = unit_normals(triangle_corners(points, faces))
        own[~own.any(1)] = (0.0, 1.0, 0.0)  # up, where a triangle has no area
        flat = np.repeat(own.astype(np.float32), 3, axis=0)
        if normals is not None:
            given = normals[corner]
            flat = np.where(_is_unit(given)[:, None], given, flat)
        points, normals, uvs = points[corner], flat, uvs[corner]
        faces = np.arange(len(corner)).reshape(-1, 3)
    finite_uvs = np.where(np.isfinite(uvs), uvs, np.float32(0))
    return np.concatenate([points, normals, finite_uvs], 1, dtype=np.float32), faces


def _is_unit(normals: F32) -> Bools:
    with np.errstate(invalid="ignore"):
        return np.asarray(np.abs(np.einsum("ij,ij->i", normals, normals) - 1) < 0.1)


# Uniform blocks of the shaders: one of each material, one of each item's lights.


BLOCK_FLOATS = 16  # four vec4, as surface.frag.glsl declares them
_HEADER_FLOATS = 4  # before the lights: their number, transmission, 0, 0
LAMP_TRANSMISSION = 0.1  # share of light that passes through a lamp's own parts: shades look lit

_EMISSION = {MaterialKind.BULB: 1.0, MaterialKind.SHADE: 0.5}


def material_blocks(house: House) -> F32:
    """(n_materials, 16) the Material block of each material."""
    rows = [_material_block(m) for m in house.materials]
    return np.array(rows, np.float32).reshape(-1, BLOCK_FLOATS)


def _material_block(material: Material) -> list[float]:
    # Decode colours to linear light; a black highlight gets exponent 0, which switches it off.
    diffuse = linear_from_srgb(np.array(material.diffuse))
    specular = linear_from_srgb(np.array(material.specular))
    emission = _EMISSION.get(material.kind, 0.0) * diffuse
    exponent = material.shininess if specular.any() else 0.0
    is_pane = material.kind is MaterialKind.PANE
    return [
        *diffuse, material.opacity,
        *specular, exponent,
        *emission, 0.0,
        float(is_pane), 0.0, 0.0, 0.0,
    ]  # fmt: skip


def light_blocks(house: House, n_best: int) -> F32:
    """(n_items + 1, 4 + 16 n_best) the Lights block of each instance id: its best lights."""
    lights = light_table(house)
    block = np.zeros((len(house.items) + 1, _HEADER_FLOATS + LIGHT_FLOATS * n_best), np.float32)
    if len(lights) and house.items:
        bounds = np.array([item.bounds for item in house.items])
        best = best_lights(lights, bounds[:, 0], bounds[:, 1], n_best)
        block[1:, 0] = best.shape[1]
        block[1:, 1] = [LAMP_TRANSMISSION if item.lights else 0.0 for item in house.items]
        end = _HEADER_FLOATS + LIGHT_FLOATS * best.shape[1]
        block[1:, _HEADER_FLOATS:end] = lights[best].reshape(len(best), -1)
    return block


def aligned_rows(rows: F32, alignment_bytes: int) -> F32:
    """Rows padded so that each starts at a multiple of alignment_bytes."""
    step = -(-rows.shape[1] * 4 // alignment_bytes) * alignment_bytes // 4
    padded = np.zeros((len(rows), step), np.float32)
    padded[:, : rows.shape[1]] = rows
    return padded


# The rasterizer.


SKY_SRGB = (0.78, 0.87, 0.96)  # background: behind windows and beyond the house


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
        features = [
            features_of_material(m, is_textured=m.texture_id in textures) for m in house.materials
        ]
        self._features = np.array(features, int)  # feature bits of each material
        self._light_features = light_features(house)
        # (mode, feature bits) -> program, vertex array
        self._programs: dict[tuple[str, int], tuple[Any, Any]] = {}
        self._queries = [self._context.query(samples=True) for _ in range(self._mesh.n_draws)]
        self._targets: dict[tuple[int, int], RenderTarget] = {}  # (width, height)
        self._upload(house, textures, n_lights)

    def _upload(
        self, house: House, textures: Mapping[str, NDArray[np.uint8]], n_lights: int
    ) -> None:
        gl, alignment = self._context, self._context.info["GL_UNIFORM_BUFFER_OFFSET_ALIGNMENT"]
        # Upload the mesh; OpenGL takes no empty buffer.
        self._vertices = gl.buffer(self._mesh.vertices.tobytes() or bytes(32))
        self._indices = gl.buffer(self._mesh.indices.tobytes() or bytes(12))
        # Upload the uniform blocks, one row a material and one an item.
        material_rows = aligned_rows(material_blocks(house), alignment)
        light_rows = aligned_rows(light_blocks(house, n_lights), alignment)
        self._materials = gl.buffer(material_rows.tobytes() or bytes(4))
        self._material_step = material_rows[:1].nbytes
        self._lights, self._light_step = gl.buffer(light_rows.tobytes()), light_rows[:1].nbytes
        self._light_bytes = 4 * (4 + LIGHT_FLOATS * n_lights)
        # Upload the textures in use; a material without one samples a white texel.
        used = {m.texture_id for m in house.materials}
        wanted = ((name, pixels) for name, pixels in sorted(textures.items()) if name in used)
        uploaded = {name: texture_from_pixels(gl, pixels) for name, pixels in wanted}
        white = texture_from_pixels(gl, np.full((1, 1, 3), 255, np.uint8))
        self._textures = [uploaded.get(m.texture_id or "", white) for m in house.materials]

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
        """(H, W, 3) OpenGL-DL: a headlight and two directional lights, no shadows (docs/spec/suncg.md section 4)."""
        return self._picture(camera, "dl")

    def render_il(self, camera: Camera) -> Srgb8Image:
        """(H, W, 3) OpenGL-IL: the lamps' lights, the best of them for each object, no shadows."""
        return self._picture(camera, "il")

    def _picture(self, camera: Camera, mode: str) -> Srgb8Image:
        if camera.intrinsics.lens.is_pinhole:
            return self._render(camera, mode, camera.towards)
        # OpenGL draws straight lines: resample another lens's picture from pin-holes, in linear light.
        cameras, faces = pinholes_of(camera)
        forward = camera.towards if len(cameras) == 1 else np.zeros(3)
        linear = linear_from_srgb(np.arange(256) / 255).astype(np.float32)
        found = faces.bilinear([linear[self._render(c, mode, forward)] for c in cameras])
        return np.rint(np.clip(srgb_from_linear(found), 0, 1) * 255).astype(np.uint8)

    def _render(self, camera: Camera, mode: str, forward: F64) -> Srgb8Image:
        """forward (3,): where the headlight points; 0 = it stands at the eye."""
        with self._context:
            target = self._target(camera)
            clip = clip_from_world(camera, far_plane(camera, *self._boxes))
            order = self._front_to_back(camera, clip)
            if mode == "il":
                order = self._visible_draws(target, order, clip)
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
        """The draws with a visible sample, by occlusion queries in a depth pre-pass.

        A software renderer lights every hidden sample of a multisampled picture.
        """
        # Draw opaque surfaces into the depth texture and count the samples that pass.
        program, vao = self._program("depth", 0)
        _set(program, clip_from_world=clip)
        see_through = Feature.TRANSPARENT | Feature.ALPHA_CUTOUT
        is_solid = (self._features[self._mesh.draw_material[draws]] & see_through) == 0
        target.begin_depth_prepass()
        for draw in draws[is_solid]:
            with self._queries[draw]:
                self._draw(vao, int(draw))
        target.prepass_depth.use(1)
        # Keep whatever may be seen through, unasked.
        kept = ~is_solid
        kept[is_solid] = [self._queries[draw].samples > 0 for draw in draws[is_solid]]
        return np.asarray(draws[kept])

    def _begin_surfaces(
        self, mode: str, features: int, camera: Camera, clip: F64, forward: F64
    ) -> None:
        _set(
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
        self._textures[material].use(0)

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


def _set(program: Any, **values: Any) -> None:
    """Set the uniforms the program has; matrices (4, 4) are given row by row."""
    for name, value in values.items():
        if name in program:
            array = np.asarray(value, np.float32)
            program[name].write(array.T.tobytes() if array.ndim == 2 else array.tobytes())
