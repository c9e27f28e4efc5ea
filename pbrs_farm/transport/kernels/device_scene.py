"""What a ray meets: the point, its frame and its material, gathered from the tables; kernels.

No effects beyond the buffers a DeviceScene holds on the device.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import drjit as dr
import mitsuba as mi

from pbrs_farm.raycast.tracer import scene_from_mesh
from pbrs_farm.transport.kernels.bsdf import Scatter, thin_glass_reflectance
from pbrs_farm.transport.kernels.sampler import device_array
from pbrs_farm.transport.scene_tables.material_rows import GLASS, HOLE, MIRROR
from pbrs_farm.transport.scene_tables.scene_tables import FACE_FLOATS, SceneTables

_RAY_OFFSET = 2e-5
_MAX_VEILS = 16


class Hit(NamedTuple):
    """A ray's first meeting with the scene.

    valid; p: point; ng: unit face normal on the ray's side; n: shading normal, on the ray's side
    too, bent where it would turn away; smooth: the same before bending; lamp: UInt32, NO_LAMP =
    none; scatter: the material there; is_hole: cut out by alpha. face: UInt32; aim: density per m2
    with which guided rays aim at p on this side, when they go for lamp aim_lamp (transport/guiding/lampshade_exitance.py).
    """

    valid: Any
    p: Any
    ng: Any
    n: Any
    smooth: Any
    lamp: Any
    scatter: Scatter
    is_hole: Any
    face: Any
    aim: Any
    aim_lamp: Any


class DeviceScene:
    """The geometry and materials of a house on the device: Mitsuba scenes and buffers."""

    def __init__(self, tables: SceneTables) -> None:
        self._all = scene_from_mesh(mi, tables.positions, tables.faces)
        veil = tables.see_through
        self.has_veils = bool(veil.any())
        self._opaque = self._all
        self._veils: Any = None
        if self.has_veils:
            # Shadow rays ask the opaque faces first, then walk through the see-through ones.
            self._veils = scene_from_mesh(mi, tables.positions, tables.faces[veil])
            self._veil_faces = device_array(mi.UInt32, veil.nonzero()[0].astype("uint32"))
            self._opaque = None
            if not veil.all():
                self._opaque = scene_from_mesh(mi, tables.positions, tables.faces[~veil])
        self._rows = device_array(mi.Float, tables.face_rows.ravel())
        self._tags = device_array(mi.UInt32, tables.face_tags)
        self._materials = device_array(mi.Float, tables.material_rows.ravel())
        self._texels = device_array(mi.UInt32, tables.texels)

    def hit(self, o: Any, d: Any, active: Any, *, coherent: bool = False) -> Hit:
        """The first surface along a ray."""
        found = self._all.ray_intersect_preliminary(_ray(o, d, dr.inf), coherent, active)
        valid = active & found.is_valid()
        return self._described(found.prim_index, found.prim_uv, d, valid)

    def transmittance(self, o: Any, d: Any, distance: Any, active: Any) -> Any:
        """Color3f of light let through between o and o + distance d: 0 behind opaque faces."""
        clear = mi.Bool(active)
        if self._opaque is not None:
            clear &= ~self._opaque.ray_test(_ray(o, d, distance), active)
        if not self.has_veils:
            return dr.select(clear, mi.Color3f(1), 0)
        return self._through_veils(o, d, distance, clear)

    @dr.syntax
    def _through_veils(self, o: Any, d: Any, distance: Any, clear: Any) -> Any:
        left = dr.select(clear, mi.Color3f(1), 0)
        here = mi.Point3f(o)
        reach = mi.Float(distance)
        go_on = mi.Bool(clear)
        n = mi.UInt32(0)
        while go_on:
            found = self._veils.ray_intersect_preliminary(_ray(here, d, reach), False, go_on)
            met = go_on & found.is_valid()
            face = dr.gather(mi.UInt32, self._veil_faces, found.prim_index, met)
            hit = self._described(face, found.prim_uv, d, met)
            passes = 1 - thin_glass_reflectance(dr.dot(hit.n, d))
            glass = hit.scatter.kind == GLASS
            through = dr.select(glass, hit.scatter.tau * passes, 0)
            through = dr.select(hit.is_hole, mi.Color3f(1), through)
            left = dr.select(met, left * through, left)
            beyond = offset(hit.p, -hit.ng)
            reach = dr.select(met, reach - dr.dot(beyond - here, d), reach)
            here = dr.select(met, beyond, here)
            n += 1
            brightest: Any = dr.max(left)
            go_on = met & (brightest > 0) & (reach > 0) & (n < _MAX_VEILS)
        # More sheets than anyone hangs in a row: treat the rest as opaque.
        return dr.select(n >= _MAX_VEILS, 0, left)

    def lamp_point(self, face: Any, u: Any, active: Any) -> tuple[Any, Any]:
        """(point, unit normal) uniform over a face."""
        bary = mi.warp.square_to_uniform_triangle(u)
        v0 = self._packet(face, 0, active)
        e1, e2 = self._packet(face, 1, active), self._packet(face, 2, active)
        a, b = mi.Vector3f(e1[0], e1[1], e1[2]), mi.Vector3f(e2[0], e2[1], e2[2])
        p = mi.Point3f(v0[0], v0[1], v0[2]) + bary.x * a + bary.y * b
        return p, dr.normalize(dr.cross(a, b))

    def set_aims(self, faces: Any, front: Any, back: Any, lamps: Any) -> None:
        """Keep with each of faces (K,) the densities of Hit.aim, either side, and the lamp."""
        if not len(faces):
            return
        at = device_array(mi.UInt32, faces) * FACE_FLOATS
        for column, values in ((19, front), (23, back)):
            dr.scatter(self._rows, device_array(mi.Float, values), at + column)
        bits = dr.reinterpret_array(mi.Float, device_array(mi.UInt32, lamps))
        dr.scatter(self._rows, bits, at + 27)
        dr.eval(self._rows)

    def _packet(self, face: Any, k: int, active: Any) -> Any:
        return dr.gather(mi.Vector4f, self._rows, face * 7 + k, active)

    def _described(self, face: Any, bary: Any, d: Any, valid: Any) -> Hit:
        rows = [self._packet(face, k, valid) for k in range(7)]
        e1 = mi.Vector3f(rows[1][0], rows[1][1], rows[1][2])
        e2 = mi.Vector3f(rows[2][0], rows[2][1], rows[2][2])
        v, w = bary.x, bary.y
        p = mi.Point3f(rows[0][0], rows[0][1], rows[0][2]) + v * e1 + w * e2
        ng = dr.normalize(dr.cross(e1, e2))
        smooth = rows[4] * (1 - v - w) + rows[5] * v + rows[6] * w
        n = dr.normalize(mi.Vector3f(smooth[0], smooth[1], smooth[2]))

        # Both normals on the ray's side; a shading normal that turns away is bent back.
        turned = dr.dot(ng, d) > 0
        ng, smooth = dr.select(turned, -ng, ng), dr.select(turned, -n, n)
        n = bent(smooth, d)

        tag = dr.gather(mi.UInt32, self._tags, face, valid)
        u = mi.Point2f(
            rows[0][3] + v * rows[2][3] + w * rows[3][1],
            rows[1][3] + v * rows[3][0] + w * rows[3][2],
        )
        scatter, is_hole = self._material(tag & 0xFFFF, u, valid)
        aim = dr.select(turned, rows[5][3], rows[4][3])
        aim_lamp = dr.reinterpret_array(mi.UInt32, rows[6][3])
        return Hit(valid, p, ng, n, smooth, tag >> 16, scatter, is_hole, face, aim, aim_lamp)

    def _material(self, index: Any, uv: Any, active: Any) -> tuple[Scatter, Any]:
        rows = [dr.gather(mi.Vector4f, self._materials, index * 4 + k, active) for k in range(4)]
        first: Any = dr.reinterpret_array(mi.UInt32, rows[3][0])
        has_texture: Any = active & (first > mi.UInt32(0))
        rgb, is_solid = self._texture(first, rows[3][1], rows[3][2], uv, has_texture)
        kind = mi.UInt32(rows[2][3])
        kd = mi.Color3f(rows[0][0], rows[0][1], rows[0][2])
        tau = mi.Color3f(rows[2][0], rows[2][1], rows[2][2])
        tinted = has_texture & (kind != MIRROR)
        scatter = Scatter(
            kd=dr.select(tinted, kd * rgb, kd),
            f0=mi.Color3f(rows[1][0], rows[1][1], rows[1][2]),
            tau=dr.select(tinted, tau * rgb, tau),
            alpha=rows[1][3],
            kind=kind,
        )
        is_cut: Any = rows[3][3] > 0
        cut = has_texture & is_cut & ~is_solid
        return scatter, active & (cut | (kind == HOLE))

    def _texture(
        self, first: Any, width: Any, height: Any, uv: Any, active: Any
    ) -> tuple[Any, Any]:
        # Row 0 is the top (v = 1); both axes repeat; four texels are blended.
        w, h = dr.maximum(mi.Int32(width), 1), dr.maximum(mi.Int32(height), 1)
        x = (uv.x - dr.floor(uv.x)) * width - 0.5
        y = (1 - (uv.y - dr.floor(uv.y))) * height - 0.5
        fx, fy = dr.floor(x), dr.floor(y)
        x0, y0 = mi.Int32(fx), mi.Int32(fy)
        tx, ty = x - fx, y - fy
        total = mi.Color3f(0)
        solid = mi.Float(0)
        for dx, dy in ((0, 0), (1, 0), (0, 1), (1, 1)):
            column, row = x0 + dx, y0 + dy
            column = dr.select(column < 0, column + w, dr.select(column >= w, column - w, column))
            row = dr.select(row < 0, row + h, dr.select(row >= h, row - h, row))
            index = first + mi.UInt32(row * w + column)
            bits = dr.gather(mi.UInt32, self._texels, index, active)
            weight = (tx if dx else 1 - tx) * (ty if dy else 1 - ty)
            root = mi.Color3f(bits & 1023, (bits >> 10) & 1023, (bits >> 20) & 1023) * (1 / 1023)
            total += weight * dr.square(root)
            solid += dr.select((bits >> 30) > 0, weight, 0)
        return total, solid >= 0.5


def bent(n: Any, d: Any) -> Any:
    """A shading normal turned so that a ray of direction d comes from its front."""
    towards = -dr.dot(n, d)
    return dr.select(towards < 0.02, dr.normalize(n - (0.02 - towards) * d), n)


def offset(p: Any, n: Any) -> Any:
    """p moved off its surface along n, so that a ray from there does not meet it again."""
    return mi.Point3f(p + n * (_RAY_OFFSET * (1 + dr.max(dr.abs(p)))))


def _ray(o: Any, d: Any, reach: Any) -> Any:
    ray: Any = mi.Ray3f
    return ray(o, d, mi.Float(reach), 0.0, mi.Color0f())
