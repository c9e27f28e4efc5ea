"""Mitsuba's own plugins and path integrator on the same tables: fallback and reference.

Effects: holds Mitsuba scenes. `scalar_rgb` has no Dr.Jit arrays for our kernels, so this renders
there, slowly. In tests it is an independent second opinion. Coats become `roughplastic`, which is
like our BSDF but not equal to it (its roughness is the map's mean); metals become `roughconductor`,
normal maps `normalmap`. Diffuse scenes agree exactly. Cut-outs are solid.
"""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F32, F64, Bools
from pbrs_farm.core.camera import Camera
from pbrs_farm.core.gloss import MIN_ALPHA
from pbrs_farm.core.lighting import Group
from pbrs_farm.core.recipe import LightFields
from pbrs_farm.raycast.mitsuba_mesh import mitsuba_mesh
from pbrs_farm.raycast.variant import mitsuba
from pbrs_farm.transport.scene_tables.material_rows import (
    ALPHA,
    F0,
    FIRST_MAP_TEXEL,
    FIRST_TEXEL,
    GLASS,
    KD,
    KIND,
    MAP_ROUGHNESS,
    MAP_SIZE,
    MIRROR,
    NULL,
    TAU,
    TEXTURE_SIZE,
)
from pbrs_farm.transport.scene_tables.scene_tables import (
    DUV1,
    DUV2,
    EDGE1,
    EDGE2,
    NO_LAMP,
    NORMALS,
    ORIGIN,
    UV0,
    SceneTables,
)
from pbrs_farm.transport.scene_tables.sky import Sky
from pbrs_farm.transport.scene_tables.texture_atlas import unpacked_colours, unpacked_maps


class ScalarScene:
    """A house in Mitsuba's plugins, one scene per light group."""

    def __init__(self, tables: SceneTables, sky: Sky, variant: str) -> None:
        self._variant = variant
        self._tables = tables
        self._sky = sky
        self._scenes: dict[Group, Any] = {}  # built at the first use of each group

    def render(self, camera: Camera, group: Group, fields: LightFields, seed: int) -> F32:
        """(H, W, 3) radiance of one group; fields.spp, max_depth and rr_depth count."""
        mi = mitsuba(self._variant)
        scene = self._scene(group)
        integrator = mi.load_dict(
            {"type": "path", "max_depth": fields.max_depth, "rr_depth": fields.rr_depth}
        )
        sensor = mi.load_dict(_sensor(mi, camera, fields))
        image = mi.render(scene, sensor=sensor, integrator=integrator, spp=fields.spp, seed=seed)
        return np.nan_to_num(np.asarray(image.numpy()[..., :3], np.float32))

    def _scene(self, group: Group) -> Any:
        if group not in self._scenes:
            mi = mitsuba(self._variant)
            scene: dict[str, Any] = {"type": "scene", **self._shapes(mi, group)}
            if group is Group.OUTDOOR:
                scene.update(_outdoor(mi, self._sky))
            self._scenes[group] = mi.load_dict(scene)
        return self._scenes[group]

    def _shapes(self, mi: Any, group: Group) -> dict[str, Any]:
        t = self._tables
        shapes: dict[str, Any] = {}
        # Make a mesh of the faces that share a material, a lamp and the side their texture shows.
        mirrored = _is_mirrored(t.face_rows)
        for tag, flipped in itertools.product(np.unique(t.face_tags), (False, True)):
            faces = (t.face_tags == tag) & (mirrored == flipped)
            row = t.material_rows[int(tag & 0xFFFF)]
            if int(row[KIND]) == NULL or not faces.any():
                continue
            fields: dict[str, Any] = {"bsdf": _bsdf(mi, row, t, mirrored=flipped)}
            if group is Group.INDOOR and tag >> 16 != NO_LAMP:
                radiance = [float(v) for v in t.lamp_rows[int(tag >> 16), :3]]
                fields["emitter"] = {"type": "area", "radiance": {"type": "rgb", "value": radiance}}
            shapes[f"mesh_{tag}_{int(flipped)}"] = _mesh_of_rows(mi, t.face_rows[faces], fields)
        return shapes


def _is_mirrored(rows: F32) -> Bools:
    a, b = rows[:, DUV1], rows[:, DUV2]
    return np.asarray(a[:, 0] * b[:, 1] < a[:, 1] * b[:, 0])


def _mesh_of_rows(mi: Any, rows: F32, fields: dict[str, Any]) -> Any:
    # Faces share no corners.
    corners = rows[:, None, ORIGIN] + np.stack(
        [0 * rows[:, EDGE1], rows[:, EDGE1], rows[:, EDGE2]], 1
    )
    # Mitsuba measures v downwards, from the first row of a picture.
    uvs = rows[:, None, UV0] + np.stack([0 * rows[:, DUV1], rows[:, DUV1], rows[:, DUV2]], 1)
    uvs[..., 1] = 1 - uvs[..., 1]
    return mitsuba_mesh(
        mi, "part", corners.reshape(-1, 3), np.arange(3 * len(rows)).reshape(-1, 3),
        normals=np.stack([rows[:, c] for c in NORMALS], 1).reshape(-1, 3), uvs=uvs.reshape(-1, 2),
        plugins={name: mi.load_dict(plugin) for name, plugin in fields.items()},
    )  # fmt: skip


def _bsdf(mi: Any, row: F32, tables: SceneTables, *, mirrored: bool) -> dict[str, Any]:
    texels = tables.texels
    flat = _flat_bsdf(mi, row, tables)
    if int(row[KIND]) == GLASS:
        return flat
    bent = flat
    maps = _texels(row, texels, FIRST_MAP_TEXEL, MAP_SIZE)
    if maps is not None:
        # Mitsuba's second tangent is the cross product; a mirrored texture's looks the other way.
        normals, _roughness = unpacked_maps(maps)
        normals[..., 1] *= -1 if mirrored else 1
        picture = _bitmap(mi, 0.5 * normals + 0.5)
        # As ours: what leaves through the face is lost, and nothing else.
        plain = {"flip_invalid_normals": False, "use_shadowing_function": False}
        bent = {"type": "normalmap", "normalmap": picture, "nested": flat} | plain
    return {"type": "twosided", "nested": bent}


def _flat_bsdf(mi: Any, row: F32, tables: SceneTables) -> dict[str, Any]:
    """The plugin of a material, seen from one side, without its normal map."""
    texels = tables.texels
    colours = _texels(row, texels, FIRST_TEXEL, TEXTURE_SIZE)

    def rgb(values: F32) -> dict[str, Any]:
        if colours is None:
            return {"type": "rgb", "value": [float(v) for v in values]}
        return _bitmap(mi, unpacked_colours(colours) * values)

    def diffuse() -> dict[str, Any]:
        if colours is None:
            return rgb(row[KD])
        return _bitmap(mi, np.minimum(unpacked_colours(colours) * row[KD], tables.max_albedo))

    # Choose the plugin by the kind of BSDF.
    if int(row[KIND]) == MIRROR:
        tint = {"type": "rgb", "value": [float(v) for v in row[F0]]}
        return {"type": "conductor", "material": "none", "specular_reflectance": tint}
    if int(row[KIND]) == GLASS:
        pane = {"type": "thindielectric", "int_ior": 1.5, "ext_ior": 1.0}
        return pane | {"specular_transmittance": rgb(row[TAU])}
    if row[ALPHA] <= 0:
        return {"type": "diffuse", "reflectance": diffuse()}
    # Square the roughness of maps, texel by texel.
    alpha = np.full((1, 1), row[ALPHA], np.float64)
    maps = _texels(row, texels, FIRST_MAP_TEXEL, MAP_SIZE)
    if maps is not None:
        _normals, roughness = unpacked_maps(maps)
        alpha = np.maximum((row[MAP_ROUGHNESS] * roughness) ** 2, MIN_ALPHA)
    if row[KD].max() > 0:
        coat = {"type": "roughplastic", "alpha": float(alpha.mean()), "nonlinear": False}
        return coat | {"diffuse_reflectance": diffuse()}
    metal = {"type": "roughconductor", "material": "none", "distribution": "ggx"}
    tint = {"type": "rgb", "value": [float(v) for v in row[F0]]}
    return metal | {"specular_reflectance": tint, "alpha": _bitmap(mi, alpha[..., None])}


def _texels(
    row: F32, texels: NDArray[np.uint32], first: int, size: slice
) -> NDArray[np.uint32] | None:
    """(H, W) texels of a material's colours or maps, None without any."""
    begin = int(row[first : first + 1].view(np.uint32)[0])
    if begin == 0:
        return None
    width, height = (int(n) for n in row[size])
    return texels[begin : begin + width * height].reshape(height, width)


def _bitmap(mi: Any, values: F64) -> dict[str, Any]:
    picture = mi.Bitmap(np.ascontiguousarray(values, np.float32))
    return {"type": "bitmap", "bitmap": picture, "raw": True, "wrap_mode": "repeat"}


def _outdoor(mi: Any, sky: Sky) -> dict[str, Any]:
    # Pass the dome unchanged: Mitsuba's envmap has our axes, azimuth atan2(x, -z), row 0 up.
    emitters: dict[str, Any] = {
        "dome": {"type": "envmap", "bitmap": mi.Bitmap(np.asarray(sky.dome, np.float32))}
    }
    if sky.sun_irradiance.max() > 0:
        emitters["sun"] = {
            "type": "directional",
            "direction": [float(-v) for v in sky.sun_direction],
            "irradiance": {"type": "rgb", "value": [float(v) for v in sky.sun_irradiance]},
        }
    return emitters


def _sensor(mi: Any, camera: Camera, fields: LightFields) -> dict[str, Any]:
    i = camera.intrinsics
    eye = [float(v) for v in camera.eye]
    target = [float(v) for v in camera.eye + camera.towards]
    up = [float(v) for v in camera.world_from_camera[:3, 1]]
    film = {
        "type": "hdrfilm", "width": i.width_px, "height": i.height_px,
        "rfilter": {"type": fields.filter}, "pixel_format": "rgb",
    }  # fmt: skip
    # Mitsuba takes the principal point as an offset from the middle, in picture widths and heights.
    return {
        "type": "perspective",
        "fov": math.degrees(2 * math.atan(0.5 * i.width_px / i.fx)),
        "fov_axis": "x",
        "near_clip": 1e-3,
        "far_clip": 1e4,
        "principal_point_offset_x": -(i.cx / i.width_px - 0.5),
        "principal_point_offset_y": -(i.cy / i.height_px - 0.5),
        "to_world": mi.ScalarTransform4f().look_at(eye, target, up),
        "sampler": {"type": "independent"},
        "film": film,
    }
