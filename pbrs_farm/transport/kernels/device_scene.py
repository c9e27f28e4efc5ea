"""Ray intersections: the hit point, its frame and its material, gathered from the tables; kernels.

No effects beyond the buffers of a DeviceScene on the device.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F32
from pbrs_farm.raycast.mitsuba_mesh import move_vertices
from pbrs_farm.raycast.tracer import MESH_NAME, scene_from_mesh
from pbrs_farm.transport.kernels.bsdf import Bsdf, thin_glass_reflectance, thin_glass_transmittance
from pbrs_farm.transport.kernels.packets import colour, point, vector
from pbrs_farm.transport.kernels.sampler import device_array
from pbrs_farm.transport.kernels.surface_textures import (
    ShadedSurface,
    Triangle,
    colour_at,
    follow_maps,
    is_hole_at,
)
from pbrs_farm.transport.scene_tables.material_rows import (
    CUTOFF,
    FIRST_MAP_TEXEL,
    GLASS,
    KIND,
    MATERIAL_FLOATS,
    MIRROR,
    NULL,
)
from pbrs_farm.transport.scene_tables.scene_tables import (
    BACK_PDF,
    FACE_FLOATS,
    FRONT_PDF,
    NO_LAMP,
    TARGET_EMITTER,
    SceneTables,
)

_RAY_OFFSET = 2e-5  # of a point's largest coordinate plus 1 m
MAX_TRANSPARENT = 16  # surfaces that a shadow ray passes
MAX_SHEETS = 64  # with holes, that a ray passes which wants one answer
LEAST_COS = 0.02  # of a shading normal to where it is seen from; one that turns away more is bent
# With more faces or lamps the second tree costs more than it saves.
MAX_FAST_FACES = 1_000_000
MAX_FAST_LAMPS = 200
_FACE_PACKETS = FACE_FLOATS // 4
_MATERIAL_PACKETS = MATERIAL_FLOATS // 4
_MAP_PACKET = FIRST_MAP_TEXEL // 4  # the last one, of the maps


class SurfaceInteraction(NamedTuple):
    """The first surface along each ray where `valid`; both normals point to the side that the ray comes from."""

    valid: Any  # Bool: the ray meets a surface
    p: Any  # Point3f
    ng: Any  # unit normal of the face
    n: Any  # unit shading normal, of the normal map too, bent where it would turn from the ray
    n_interpolated: Any  # the same before bending
    emitter: Any  # UInt32, NO_LAMP = none
    bsdf: Bsdf
    is_cutout: Any  # Bool: an alpha texture leaves nothing here
    face: Any  # UInt32
    target_pdf: Any  # per m2, of guided rays that aim at p on this side (guiding_targets.py)
    target_emitter: Any  # UInt32, the emitter those rays go for


def with_device_texels(tables: SceneTables) -> SceneTables:
    """Tables with their texels, most of their bytes, on the device alone."""
    return replace(tables, texels=device_array(mi.UInt32, tables.texels))


class DeviceScene:
    """The geometry and materials of a house on the device: Mitsuba scenes and buffers.

    `intersect` is for paths, `transmittance` for shadow rays. Kernels gather from its buffers
    and hold no number of the house, so they are compiled once for all houses. It is not for
    scalar variants, which have no arrays. Building it builds one or two trees over all faces;
    keep it as long as the house is rendered.
    """

    panes: Panes | None = None  # glass of the windows, for rays straight from the camera

    def __init__(self, tables: SceneTables, *, one_scene: bool = False) -> None:
        """one_scene: all rays go through one Mitsuba scene, for OptiX, which takes one in a kernel.

        It would leave out the rays of a second one, and with them the shadows, with a warning alone.
        """
        self._all = scene_from_mesh(mi, tables.positions, tables.faces)
        # Embree builds a tree for its faster test three times as long, and needs it beside the other.
        self.fast: Any = None
        is_small = len(tables.faces) <= MAX_FAST_FACES and len(tables.lamps) <= MAX_FAST_LAMPS
        if is_small and not one_scene:
            self.fast = scene_from_mesh(mi, tables.positions, tables.faces, watertight=False)
        transparent = tables.transparent
        self.has_transparent = bool(transparent.any())
        rows = tables.material_rows[tables.face_tags & np.uint32(0xFFFF)]
        self._has_holes = bool(((rows[:, CUTOFF] > 0) | (rows[:, KIND] == NULL)).any())
        self._opaque = self._all
        self._transparent: Any = None
        self._aims_again = False  # behind each transparent face, at where the shadow ray ends
        if self.has_transparent and one_scene:
            # Go through all faces one by one: an opaque one lets nothing through.
            self._opaque, self._transparent = None, self._all
            self._aims_again = True
            faces = np.arange(len(tables.faces), dtype=np.uint32)
            self._transparent_faces = device_array(mi.UInt32, faces)
        elif self.has_transparent:
            # Ask the opaque faces first; go through the transparent ones one by one.
            self._transparent = scene_from_mesh(mi, tables.positions, tables.faces[transparent])
            self._transparent_faces = device_array(
                mi.UInt32, transparent.nonzero()[0].astype("uint32")
            )
            self._opaque = None
            if not transparent.all():
                self._opaque = scene_from_mesh(mi, tables.positions, tables.faces[~transparent])
                self._opaque_faces = device_array(
                    mi.UInt32, (~transparent).nonzero()[0].astype("uint32")
                )
        self._rows = device_array(mi.Float, tables.face_rows.ravel())
        self._tags = device_array(mi.UInt32, tables.face_tags)
        self._materials = device_array(mi.Float, tables.material_rows.ravel())
        self._texels = device_array(mi.UInt32, tables.texels)
        self._max_albedo = dr.opaque(mi.Float, tables.max_albedo)

    def move(self, positions: F32, faces: NDArray[np.uint32], rows: F32) -> None:
        """Move vertices: all positions (V, 3), new rows of the moving faces (N,); emitters must not move."""
        scenes = {id(s): s for s in (self._all, self.fast, self._opaque, self._transparent)}
        for scene in scenes.values():
            if scene is not None:
                move_vertices(mi, scene, MESH_NAME, positions)
        geometric = np.setdiff1d(
            np.arange(FACE_FLOATS), (FRONT_PDF, BACK_PDF, TARGET_EMITTER)
        ).astype(np.uint32)
        index = faces.astype(np.uint32)[:, None] * np.uint32(FACE_FLOATS) + geometric
        values = device_array(mi.Float, np.ascontiguousarray(rows[:, geometric]).ravel())
        dr.scatter(self._rows, values, device_array(mi.UInt32, index.ravel()))
        dr.eval(self._rows)

    def intersect(self, o: Any, d: Any, active: Any) -> SurfaceInteraction:
        """The first surface along a ray, by the faster of the available intersection tests.

        It takes one ray of two million through an edge to the face behind (docs/light_methods.md). Glass in
        contact with an opaque face is skipped: a ray behind it would start below that face.
        """
        ray = _ray(o, d, dr.inf)
        first = self._all if self.fast is None else self.fast
        face, bary, valid = _first_face(first, ray, active)
        if self.fast is not None:
            face, bary, valid = self._look_again(ray, face, bary, valid, active & ~valid)
        if dr.hint(self._transparent is not None and self._opaque is not None, mode="scalar"):
            face, bary = self._below_glass(o, d, face, bary, valid)
        return self._interaction(face, bary, d, valid, with_maps=True)

    @dr.syntax
    def _look_again(self, ray: Any, face: Any, bary: Any, valid: Any, missed: Any) -> Any:
        """Repeat missed rays with the watertight test."""
        face, bary, valid = mi.UInt32(face), mi.Point2f(bary), mi.Bool(valid)
        # Branch: no ray leaves a closed house, so most packets pass by.
        if missed:
            face2, bary2, valid2 = _first_face(self._all, ray, missed)
            face, bary, valid = face2, mi.Point2f(bary2), valid2
        return face, bary, valid

    @dr.syntax
    def _below_glass(self, o: Any, d: Any, face: Any, bary: Any, valid: Any) -> tuple[Any, Any]:
        """(face, its barycentric coordinates) of a hit, skipping glass that touches the face behind it.

        As for a drinking glass on a table. Touching means closer than a ray's offset from its surface.
        """
        tag = dr.gather(mi.UInt32, self._tags, face, valid) & 0xFFFF
        kind = dr.gather(mi.Float, self._materials, tag * MATERIAL_FLOATS + KIND, valid)
        face, bary = mi.UInt32(face), mi.Point2f(bary)
        is_glass = valid & (mi.UInt32(kind) == GLASS)
        # Branch: packets of lanes that meet no glass pass by.
        if is_glass:
            v0, e1, e2 = (self._packet(face, k, is_glass) for k in range(3))
            a, b = vector(e1), vector(e2)
            p = point(v0) + bary.x * a + bary.y * b
            cos = dr.abs(dr.dot(dr.normalize(dr.cross(a, b)), d))
            # Look a little before it, too, for faces in one plane, but not behind where the ray began.
            step = _ray_step(p) / dr.maximum(cos, LEAST_COS)
            near = _ray(p - 0.5 * step * d, d, 2.5 * step)
            behind = self._opaque.ray_intersect_preliminary(near, False, is_glass)
            touches = is_glass & behind.is_valid()
            below = dr.gather(mi.UInt32, self._opaque_faces, behind.prim_index, touches)
            face = dr.select(touches, below, face)
            bary = dr.select(touches, mi.Point2f(behind.prim_uv), bary)
        return face, bary

    @dr.syntax
    def intersect_past_holes(self, o: Any, d: Any, active: Any) -> SurfaceInteraction:
        """The first surface along a ray that is not cut out; after MAX_SHEETS any surface counts."""
        start = mi.Point3f(o)
        if dr.hint(self._has_holes, mode="scalar"):
            looks, n = mi.Bool(active), mi.UInt32(0)
            while dr.hint(looks, exclude=[self, d]):
                si = self.intersect(start, d, looks)
                looks &= si.valid & si.is_cutout & (n < MAX_SHEETS)
                start = dr.select(looks, offset_ray_origin(si.p, -si.ng), start)
                n += 1
        return self.intersect(start, d, active)

    def transmittance(self, o: Any, d: Any, distance: Any, active: Any) -> Any:
        """Color3f of light let through between o and o + distance d: 0 behind opaque faces.

        o: Point3f, d: unit Vector3f, distance: Float, infinite for the sky. 1 where nothing is
        between. Where the scene has no transparent face it is one shadow ray; else each lane walks
        through panes one by one.
        """
        clear = mi.Bool(active)
        if self._opaque is not None:
            clear &= ~self._opaque.ray_test(_ray(o, d, distance), active)
        if not self.has_transparent:
            return dr.select(clear, mi.Color3f(1), 0)
        return self._through_transparent(o, d, distance, clear)

    @dr.syntax
    def _through_transparent(self, o: Any, d: Any, distance: Any, clear: Any) -> Any:
        share = dr.select(clear, mi.Color3f(1), 0)
        start = mi.Point3f(o)
        reach = mi.Float(distance)
        end, is_finite = o + distance * d, distance < dr.inf
        go_on = mi.Bool(clear)
        n = mi.UInt32(0)
        # Constants are excluded from the state of the loop, or Dr.Jit traces its code twice.
        while dr.hint(go_on, exclude=[self, d, end, is_finite]):
            way = mi.Vector3f(d)
            if dr.hint(self._aims_again, mode="scalar"):
                # The step aside must not make the ray graze the small lamp it ends at.
                way = dr.select(is_finite & (n > 0), (end - start) / dr.maximum(reach, 1e-12), way)
            # Find the next transparent surface.
            sheet = self._transparent.ray_intersect_preliminary(
                _ray(start, way, reach), False, go_on
            )
            is_hit = go_on & sheet.is_valid()
            # Branch: packets of lanes whose way is clear pass by.
            if dr.hint(is_hit, exclude=[self, d, end, is_finite]):
                face = dr.gather(mi.UInt32, self._transparent_faces, sheet.prim_index, is_hit)
                si = self._interaction(face, sheet.prim_uv, way, is_hit)
                # Let through what glass does not reflect, all at a cut-out.
                cos = dr.dot(si.n, way)
                clear_share = 1 - thin_glass_reflectance(cos)
                through = thin_glass_transmittance(si.bsdf.tau, cos) * clear_share
                through = dr.select(si.bsdf.kind == GLASS, through, 0)
                share = share * dr.select(si.is_cutout, mi.Color3f(1), through)
                # Go on behind it.
                beyond = offset_ray_origin(si.p, -si.ng)
                reach = reach - dr.dot(beyond - start, way)
                start = mi.Point3f(beyond)
                if dr.hint(self._aims_again, mode="scalar"):
                    reach = dr.select(is_finite, dr.norm(end - start), reach)
            n += 1
            brightest: Any = dr.max(share)
            go_on = is_hit & (brightest > 0) & (reach > 0) & (n < MAX_TRANSPARENT)
        # Treat anything behind more sheets than occur in practice as occluded.
        return dr.select(n >= MAX_TRANSPARENT, 0, share)

    def sample_face(self, face: Any, u: Any, active: Any) -> tuple[Any, Any]:
        """(point, unit geometric normal) uniform over a face (UInt32), u: Point2f; undefined in inactive lanes."""
        bary = mi.warp.square_to_uniform_triangle(u)
        v0, e1, e2 = (self._packet(face, k, active) for k in range(3))
        a, b = vector(e1), vector(e2)
        p = point(v0) + bary.x * a + bary.y * b
        return p, dr.normalize(dr.cross(a, b))

    def set_guiding_targets(self, faces: Any, front: Any, back: Any, lamps: Any) -> None:
        """Store the target_pdf of both sides and the target_emitter for each of faces (K,).

        front, back: (K,) pdf per area of each side; lamps: (K,) emitter whose light the face sends. Faces
        that were set before and are not listed keep theirs. Runs a kernel immediately.
        """
        if not len(faces):
            return
        row = device_array(mi.UInt32, faces) * FACE_FLOATS
        for column, values in ((FRONT_PDF, front), (BACK_PDF, back)):
            dr.scatter(self._rows, device_array(mi.Float, values), row + column)
        bits = dr.reinterpret_array(mi.Float, device_array(mi.UInt32, lamps))
        dr.scatter(self._rows, bits, row + TARGET_EMITTER)
        dr.eval(self._rows)

    def _packet(self, face: Any, k: int, active: Any) -> Any:
        return dr.gather(mi.Vector4f, self._rows, face * _FACE_PACKETS + k, active)

    def _interaction(
        self, face: Any, bary: Any, d: Any, valid: Any, *, with_maps: bool = False
    ) -> SurfaceInteraction:
        # Interpolate the position, the shading normal and the texture coordinates.
        rows = [self._packet(face, k, valid) for k in range(_FACE_PACKETS)]
        e1, e2 = vector(rows[1]), vector(rows[2])
        v, w = bary.x, bary.y
        p = point(rows[0]) + v * e1 + w * e2
        ng = dr.normalize(dr.cross(e1, e2))
        normal = rows[4] * (1 - v - w) + rows[5] * v + rows[6] * w
        normal = dr.normalize(vector(normal))
        uv = mi.Point2f(
            rows[0][3] + v * rows[2][3] + w * rows[3][1],
            rows[1][3] + v * rows[3][0] + w * rows[3][2],
        )

        # Gather the material; its maps count in the frame of the face's front.
        tag = dr.gather(mi.UInt32, self._tags, face, valid)  # material + 65536 * emitter
        bsdf, is_cutout, map_roughness = self._material(tag & 0xFFFF, uv, valid)
        if with_maps:
            uv1, uv2 = mi.Point2f(rows[2][3], rows[3][0]), mi.Point2f(rows[3][1], rows[3][2])
            mapped = follow_maps(
                self._texels, self._materials, (tag & 0xFFFF) * _MATERIAL_PACKETS + _MAP_PACKET, uv,
                Triangle(e1, e2, uv1, uv2), ShadedSurface(normal, bsdf.alpha), map_roughness,
                valid & (map_roughness > 0),
            )  # fmt: skip
            normal, bsdf = mapped.normal, bsdf._replace(alpha=mapped.alpha)

        # Turn both normals to the ray's side; bend a shading normal back that turns away.
        turned = dr.dot(ng, d) > 0
        ng, normal = dr.select(turned, -ng, ng), dr.select(turned, -normal, normal)
        return SurfaceInteraction(
            valid=valid,
            p=p,
            ng=ng,
            n=bend_normal(normal, d),
            n_interpolated=normal,
            emitter=tag >> 16,
            bsdf=bsdf,
            is_cutout=is_cutout,
            face=face,
            target_pdf=dr.select(turned, rows[5][3], rows[4][3]),
            target_emitter=dr.reinterpret_array(mi.UInt32, rows[6][3]),
        )

    def _material(self, index: Any, uv: Any, active: Any) -> tuple[Bsdf, Any, Any]:
        """(parameters, whether nothing is here, roughness of the maps) of a material at uv."""
        first = index * _MATERIAL_PACKETS
        packets = [
            dr.gather(mi.Vector4f, self._materials, first + k, active) for k in range(_MAP_PACKET)
        ]
        kd, f0, tau, texture = packets
        first_texel: Any = dr.reinterpret_array(mi.UInt32, texture[0])
        has_texture: Any = active & (first_texel > mi.UInt32(0))
        rgb = colour_at(self._texels, texture, uv, has_texture)
        kind = mi.UInt32(tau[3])
        tinted = has_texture & (kind != MIRROR)
        bsdf = Bsdf(
            kd=dr.minimum(dr.select(tinted, colour(kd) * rgb, colour(kd)), self._max_albedo),
            f0=colour(f0),
            tau=dr.select(tinted, colour(tau) * rgb, colour(tau)),
            alpha=f0[3],
            kind=kind,
        )
        is_cut = is_hole_at(self._texels, texture, uv, has_texture & (texture[3] > 0))
        return bsdf, active & (is_cut | (kind == NULL)), kd[3]


class Panes:
    """The glass of windows, which only rays meet that nothing has scattered: each shadow ray would pay a test."""

    def __init__(self, tables: SceneTables) -> None:
        """tables: of the panes alone (`panes_of_house`)."""
        self._scene = DeviceScene(tables)

    def move(self, positions: F32, faces: NDArray[np.uint32], rows: F32) -> None:
        """Put panes elsewhere, as `DeviceScene.move`; nothing where none moves."""
        if len(faces):
            self._scene.move(positions, faces, rows)

    def before(
        self, si: SurfaceInteraction, o: Any, d: Any, looks: Any
    ) -> tuple[SurfaceInteraction, Any, Any]:
        """(what a ray meets first of si and the panes, Bool: it is a pane, Bool: one between rooms).

        looks: Bool, where panes count. si: what the ray of origin o (Point3f) and direction d (unit Vector3f) meets at home.
        """
        is_pane, is_inner, p, n = self._nearer(si.valid, si.p, o, d, looks)
        n = dr.select(is_pane, n, si.n)
        clear = Bsdf(
            kd=dr.select(is_pane, 0, si.bsdf.kd),
            f0=dr.select(is_pane, 0, si.bsdf.f0),
            tau=dr.select(is_pane, 1, si.bsdf.tau),
            alpha=dr.select(is_pane, 0, si.bsdf.alpha),
            kind=dr.select(is_pane, mi.UInt32(GLASS), si.bsdf.kind),
        )
        nearest = si._replace(
            valid=si.valid | is_pane,
            p=dr.select(is_pane, p, si.p),
            ng=dr.select(is_pane, n, si.ng),
            n=n,
            emitter=dr.select(is_pane, mi.UInt32(NO_LAMP), si.emitter),
            bsdf=clear,
            is_cutout=si.is_cutout & ~is_pane,
        )
        return nearest, is_pane, is_inner

    @dr.syntax
    def _nearer(self, valid: Any, at: Any, o: Any, d: Any, looks: Any) -> tuple[Any, Any, Any, Any]:
        """(Bool: a pane is in front of the point at, Bool: one between rooms, its hit and normal)."""
        is_pane, is_inner = mi.Bool(False), mi.Bool(False)
        p, n = mi.Point3f(0), mi.Vector3f(0, 1, 0)
        # Branch: packets of lanes whose rays were all scattered pass by.
        if looks:
            pane = self._scene.intersect(o, d, looks)
            is_behind = valid & (dr.dot(at - o, d) <= dr.dot(pane.p - o, d))
            is_pane = looks & pane.valid & ~is_behind
            is_inner = is_pane & (pane.bsdf.kind == MIRROR)
            p, n = mi.Point3f(pane.p), mi.Vector3f(pane.ng)
        return is_pane, is_inner, p, n


def bend_normal(n: Any, d: Any) -> Any:
    """A unit shading normal, bent where a ray of direction d would come from behind it.

    A normal map or interpolation may turn the shading normal from the viewer; at least
    LEAST_COS is left between both, so that the reflectance model is defined.
    """
    towards = -dr.dot(n, d)
    return dr.select(towards < LEAST_COS, dr.normalize(n - (LEAST_COS - towards) * d), n)


def offset_ray_origin(p: Any, n: Any) -> Any:
    """p moved off its surface along n (unit, the ray's side) by a step that grows as float32's spacing does."""
    return mi.Point3f(p + n * _ray_step(p))


def _ray_step(p: Any) -> Any:
    return _RAY_OFFSET * (1 + dr.max(dr.abs(p)))


def _first_face(scene: Any, ray: Any, active: Any) -> tuple[Any, Any, Any]:
    """(number, barycentric coordinates, whether there is one) of the first face along a ray."""
    hit = scene.ray_intersect_preliminary(ray, False, active)
    return hit.prim_index, hit.prim_uv, active & hit.is_valid()


def _ray(o: Any, d: Any, reach: Any) -> Any:
    ray: Any = mi.Ray3f
    return ray(o, d, mi.Float(reach), 0.0, mi.Color0f())
