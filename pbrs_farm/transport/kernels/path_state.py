"""What a path through the scene is made of: the nouns of `path` and `metropolis`; no effects."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import drjit as dr
import mitsuba as mi
import numpy as np

from pbrs_farm.core.camera import Camera
from pbrs_farm.core.recipe import LightFields
from pbrs_farm.transport.guiding.guiding_targets import NO_FACE
from pbrs_farm.transport.guiding.nearby_lamps import NearbyLamps, ReferencePoint, no_reference
from pbrs_farm.transport.kernels.bsdf import Bsdf
from pbrs_farm.transport.kernels.device_scene import (
    DeviceScene,
    SurfaceInteraction,
    offset_ray_origin,
)
from pbrs_farm.transport.kernels.emitters import Emitters
from pbrs_farm.transport.kernels.sampler import opaque3
from pbrs_farm.transport.scene_tables.scene_tables import NO_LAMP


class DeviceCamera(NamedTuple):
    """A camera as opaque device values: another camera is no new kernel."""

    eye: Any
    d0: Any
    du: Any
    dv: Any


class DeviceFields(NamedTuple):
    """The recipe's numbers as opaque device values."""

    max_depth: Any
    rr_depth: Any
    is_tent: Any


class EmitterFilter(NamedTuple):
    """Which emitters count: -1 all of the group, -2 none, else that lamp or technique alone.

    None instead of a device value: none ever, the kernel is built without that group.
    """

    indoor: Any
    outdoor: Any


@dataclass
class PathState:
    """A path under way.

    o, d: its ray. beta: throughput. depth: vertices so far, glass passed and holes not counted;
    n_nulls: those. last, last_pdf: where and with which pdf of the surface's own the
    direction was drawn, 0 = behind the camera, a mirror or glass. aimed, target: what guide.kept
    asks for: chance of having aimed at a face over the pdf of all else, and that face.
    """

    o: mi.Point3f
    d: mi.Vector3f
    beta: mi.Color3f
    depth: mi.UInt32
    n_nulls: mi.UInt32
    reference: ReferencePoint
    bsdf_pdf: mi.Float
    guiding_odds: mi.Float
    target_face: mi.UInt32


class StepResult(NamedTuple):
    """What one step brought, throughput included.

    met_*: from an emitter the ray met, by `segments` = the walk's depth before + 1 segments;
    lit_*: from shadow rays at the new vertex, one segment more than its depth.
    is_rough: the vertex is neither mirror nor glass; albedo, normal: of it. missed: no surface.
    si: the vertex; ahead, pdf: the direction scattered to, 0 = nowhere; to_outdoor, to_indoor:
    where the shadow rays went; steady: the vertex was weighted by steady_pdf (tails.py).
    """

    emitted_outdoor: Any
    emitted_indoor: Any
    direct_outdoor: Any
    direct_indoor: Any
    is_rough: Any
    missed: Any
    albedo: Any
    normal: Any
    si: Any
    scattered_d: Any
    pdf: Any
    outdoor_sample: Any
    indoor_sample: Any
    is_view_independent: Any


class PathContext(NamedTuple):
    """What is asked of every path: the scene, the emitters that count, from how many segments."""

    scene: DeviceScene
    emitters: Emitters
    camera: DeviceCamera
    fields: DeviceFields
    emitter_filter: EmitterFilter
    segments: Any


class DirectLightSample(NamedTuple):
    """What one shadow ray brought: light scattered along the path, before throughput.

    d: towards the emitter; strength: its radiance times visibility and weight, over the pdf.
    lamp: the emitter's number, None for the sky.
    """

    light: Any
    d: Any
    strength: Any
    emitter: Any = None


def device_camera(camera: Camera) -> DeviceCamera:
    """Device values: the direction at pixel coordinates (u, v) is d0 + u du + v dv."""
    i, r = camera.intrinsics, camera.world_from_camera[:3, :3]
    d0 = r @ np.array([-i.cx / i.fx, i.cy / i.fy, -1.0])
    return DeviceCamera(
        opaque3(mi.Point3f, camera.eye),
        opaque3(mi.Vector3f, d0),
        opaque3(mi.Vector3f, r[:, 0] / i.fx),
        opaque3(mi.Vector3f, -r[:, 1] / i.fy),
    )


def device_fields(fields: LightFields, *, max_depth: int | None = None) -> DeviceFields:
    """Device values of the fields the kernels use; max_depth replaces the fields' own."""
    return DeviceFields(
        dr.opaque(mi.UInt32, fields.max_depth if max_depth is None else max_depth),
        dr.opaque(mi.UInt32, fields.rr_depth),
        dr.opaque(mi.Bool, fields.filter == "tent"),
    )


def film_position(u: Any, is_tent: Any) -> Any:
    """Position relative to a pixel's corner, spread by the reconstruction filter."""
    tent = mi.Point2f(_tent(u.x), _tent(u.y)) + 0.5
    return dr.select(is_tent, tent, u)


def camera_path(camera: DeviceCamera, x: Any, y: Any) -> PathState:
    """The walk that leaves the camera through film position (x, y), in pixels."""
    d = dr.normalize(camera.d0 + x * camera.du + y * camera.dv)
    return PathState(
        mi.Point3f(camera.eye),
        mi.Vector3f(d),
        mi.Color3f(1),
        mi.UInt32(0),
        mi.UInt32(0),
        no_reference(camera.eye),
        mi.Float(0),
        mi.Float(0),
        mi.UInt32(NO_FACE),
    )


def surface_path(p: Any, n: Any, d: Any, pdf: Any, near: NearbyLamps) -> PathState:
    """The walk that leaves a matte surface at p in direction d, drawn with a pdf."""
    return PathState(
        o=offset_ray_origin(p, n),
        d=d,
        beta=mi.Color3f(1),
        depth=mi.UInt32(1),
        n_nulls=mi.UInt32(0),
        reference=near.reference,
        bsdf_pdf=mi.Float(pdf),
        guiding_odds=mi.Float(0),
        target_face=mi.UInt32(NO_FACE),
    )


def white_interaction(p: Any, n: Any) -> SurfaceInteraction:
    """A white matte surface at p."""
    white = Bsdf(mi.Color3f(1), mi.Color3f(0), mi.Color3f(0), mi.Float(0), mi.UInt32(0))
    no, none = mi.Bool(False), mi.UInt32(NO_LAMP)
    return SurfaceInteraction(
        mi.Bool(True), p, n, n, n, none, white, no, mi.UInt32(0), mi.Float(0), none
    )


def _tent(u: Any) -> Any:
    return dr.select(u < 0.5, dr.sqrt(2 * u) - 1, 1 - dr.sqrt(dr.maximum(2 - 2 * u, 0)))
