"""Mitsuba's own plugins and path integrator on the same tables: fallback and reference.

Effects: holds Mitsuba scenes. `scalar_rgb` has no Dr.Jit arrays for our kernels, so this renders
there, slowly. In tests it is an independent second opinion. Coats become `roughplastic`, which is
like our BSDF but not equal to it; diffuse scenes agree exactly.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F32, I32
from pbrs_farm.core.camera import Camera
from pbrs_farm.core.lighting import Group
from pbrs_farm.core.recipe import LightFields
from pbrs_farm.raycast.variant import mitsuba
from pbrs_farm.transport.scene_tables.material_rows import (
    ALPHA,
    F0,
    FIRST_TEXEL,
    GLASS,
    KD,
    KIND,
    MIRROR,
    NULL,
    TAU,
    TEXTURE_SIZE,
)
from pbrs_farm.transport.scene_tables.scene_tables import NO_LAMP, SceneTables
from pbrs_farm.transport.scene_tables.sky import Sky


class ReferenceScene:
    """A house in Mitsuba's plugins, one scene per light group. Textures are their mean colour."""

    def __init__(self, tables: SceneTables, sky: Sky, variant: str) -> None:
        self._variant = variant
        self._tables = tables
        self._sky = sky
        self._scenes: dict[Group, Any] = {}  # made at the first use of each group

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
        # Make a mesh of the faces that share a material and a lamp.
        for tag in np.unique(t.face_tags):
            faces = t.faces[t.face_tags == tag]
            row = _untextured(t.material_rows[int(tag & 0xFFFF)], t.texels)
            if int(row[KIND]) == NULL:
                continue
            fields: dict[str, Any] = {"bsdf": _bsdf(row)}
            if group is Group.INDOOR and tag >> 16 != NO_LAMP:
                radiance = [float(v) for v in t.lamp_rows[int(tag >> 16), :3]]
                fields["emitter"] = {"type": "area", "radiance": {"type": "rgb", "value": radiance}}
            shapes[f"mesh_{tag}"] = _mesh(mi, t.positions, faces, fields)
        return shapes


def _untextured(row: F32, texels: NDArray[np.uint32]) -> F32:
    """The material with its texture's mean colour in place of the texture."""
    first = int(row[FIRST_TEXEL : FIRST_TEXEL + 1].view(np.uint32)[0])
    if first == 0 or int(row[KIND]) == MIRROR:
        return row
    # Unpack the texels: squares of ten bits for each component.
    bits = texels[first : first + int(np.prod(row[TEXTURE_SIZE].astype(np.int64)))]
    mean = [np.mean(((bits >> shift & 1023) / 1023) ** 2) for shift in (0, 10, 20)]
    untextured = row.copy()
    untextured[KD] *= mean
    untextured[TAU] *= mean
    return untextured


def _mesh(mi: Any, positions: F32, faces: I32, fields: dict[str, Any]) -> Any:
    # Keep the vertices in use; a mesh takes its BSDF and emitter when it is made.
    used, renumbered = np.unique(faces, return_inverse=True)
    properties = mi.Properties()
    for name, plugin in fields.items():
        properties[name] = mi.load_dict(plugin)
    mesh = mi.Mesh("part", len(used), len(faces), props=properties)
    parameters = mi.traverse(mesh)
    parameters["vertex_positions"] = np.ascontiguousarray(positions[used], np.float32).ravel()
    parameters["faces"] = renumbered.astype(np.uint32).ravel()
    parameters.update()
    return mesh


def _bsdf(row: F32) -> dict[str, Any]:
    def rgb(values: F32) -> dict[str, Any]:
        return {"type": "rgb", "value": [float(v) for v in values]}

    # Choose the plugin by the kind of BSDF.
    if int(row[KIND]) == MIRROR:
        return {
            "type": "twosided",
            "nested": {"type": "conductor", "material": "none", "specular_reflectance": rgb(row[F0])},
        }  # fmt: skip
    if int(row[KIND]) == GLASS:
        pane = {"type": "thindielectric", "int_ior": 1.5, "ext_ior": 1.0}
        return pane | {"specular_transmittance": rgb(row[TAU])}
    if row[ALPHA] > 0:
        coat = {"type": "roughplastic", "alpha": float(row[ALPHA]), "nonlinear": False}
        return {"type": "twosided", "nested": coat | {"diffuse_reflectance": rgb(row[KD])}}
    return {"type": "twosided", "nested": {"type": "diffuse", "reflectance": rgb(row[KD])}}


def _outdoor(mi: Any, sky: Sky) -> dict[str, Any]:
    # Pass the dome as it is: Mitsuba's envmap has our axes, azimuth atan2(x, -z), row 0 up.
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
