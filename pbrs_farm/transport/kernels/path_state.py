"""The types of a path and of its context, shared by `path` and `metropolis`; kernels, no effects."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import drjit as dr
import mitsuba as mi

from pbrs_farm.core.recipe import LightFields
from pbrs_farm.transport.kernels.bsdf import Bsdf
from pbrs_farm.transport.kernels.camera_rays import DeviceCamera, LensCamera, camera_ray
from pbrs_farm.transport.kernels.device_scene import (
    DeviceScene,
    SurfaceInteraction,
    offset_ray_origin,
)
from pbrs_farm.transport.kernels.emitters import Emitters
from pbrs_farm.transport.kernels.guiding_targets import NO_FACE
from pbrs_farm.transport.kernels.lamp_guiding import NearbyLamps, ReferencePoint, no_reference
from pbrs_farm.transport.kernels.sampler import CAMERA_DIMS, Sampler
from pbrs_farm.transport.kernels.sunlit_points import SunlitPoints
from pbrs_farm.transport.scene_tables.scene_tables import NO_LAMP

ALL_EMITTERS, NO_EMITTERS = -1, -2
_LEAST_DIFFUSE = 0.1
LEAST_KD = 0.002  # minimum diffuse albedo for splitting off white light: black surfaces carry no information


class DeviceFields(NamedTuple):
    """The recipe's numbers as opaque device values."""

    max_depth: Any  # vertices of a path
    rr_depth: Any  # first vertex with Russian roulette
    is_tent: Any  # Bool: tent filter, else box


class EmitterFilter(NamedTuple):
    """Which emitters count, lane by lane: ALL_EMITTERS, NO_EMITTERS, a number; None: no kernel for the group."""

    indoor: Any  # Int32, lamp
    outdoor: Any  # Int32, outdoor technique (emitters.py)


class PathContext(NamedTuple):
    """Shared by all paths of a launch: scene, emitters, limits and which emitters count."""

    scene: DeviceScene
    emitters: Emitters
    fields: DeviceFields
    emitter_filter: EmitterFilter
    sunlit: SunlitPoints | None = None  # where shadow rays go to sunlit points, too
    may_guide: Any = None  # Bool: lanes whose rays are guided where the view's are; None = all
    splits_glass: bool = False  # rays pass through glass, and the caller follows the reflection
    splits_white: bool = False  # tell what a white matte surface at each vertex would bring, too

    @property
    def least_diffuse(self) -> float:
        """Kd that counts in the choice of lobes at least (bsdf.py)."""
        return _LEAST_DIFFUSE if self.splits_white else 0.0


@dataclass
class PathState:
    """A path in progress: its ray and the sampling of that ray."""

    o: mi.Point3f
    d: mi.Vector3f
    beta: mi.Color3f  # throughput
    faintness: mi.Float  # factor of it that roulette ignores, of reflections in dark panes
    depth: mi.UInt32  # vertices so far, glass passed and cut-outs not counted
    n_nulls: mi.UInt32  # glass and cut-outs so far
    met_glass: mi.Bool  # glass so far
    reference: ReferencePoint  # the last rough vertex, where d was drawn
    bsdf_pdf: mi.Float  # of d by the surface there; 0 = by the camera, a mirror or glass
    guiding_odds: mi.Float  # share of rays aimed at targets, over the pdf of all other techniques
    target_face: mi.UInt32  # the face that the ray was aimed at, NO_FACE = none


class Vertex(NamedTuple):
    """A surface interaction as the vertex of a path."""

    si: SurfaceInteraction
    frame: Any  # shading frame
    wi: Any  # direction back along the ray, in that frame
    is_glass: Any
    is_mirror: Any
    is_rough: Any  # neither glass nor mirror nor cut-out
    depth: Any  # vertices of the path, this one counted
    dim: Any  # its first random dimension
    near: NearbyLamps | None  # None: lamps do not count
    is_pane: Any = None  # Bool: glass of a window; None for scenes without any
    is_inner: Any = None  # Bool: such glass between two rooms
    splits: Any = None  # Bool: glass at which rays go through and the caller follows the others
    is_behind: Any = None  # Bool: glass behind such, which neither mirrors nor dims


class ScatteredRay(NamedTuple):
    """Where a path goes on from a vertex: at most one of bounced, mirrored and passed."""

    d: Any  # direction drawn at a rough surface
    value: Any  # f |cos| of it
    pdf: Any  # of the surface drawing it
    is_guided: Any
    target_face: Any
    bounced: Any  # Bool: goes on in direction d
    mirrored: Any  # Bool: goes on in direction mirror_d
    mirror_d: Any
    passed: Any  # Bool: goes straight on, through glass or a cut-out


class DirectLightSample(NamedTuple):
    """Contribution of one shadow ray to a vertex."""

    light: Any  # Color3f scattered back along the path, before its throughput
    d: Any  # unit direction to the emitter
    incident: Any  # radiance times visibility and MIS weight, over the pdf
    emitter: Any = None  # number of the lamp, None for the sky
    kind: Any = None  # of the shadow ray (arrival_rates.py)
    is_cast: Any = False  # Bool
    arrives: Any = False  # Bool: unoccluded
    white: Any = None  # Color3f that a white matte surface would scatter; None = not asked for


@dataclass
class DirectionPdfs:
    """How a path's direction out of a vertex was drawn; pdfs per solid angle."""

    bsdf: mi.Float  # by the surface alone, 0 = it does not go on
    share: mi.Float  # of the scattered rays, those that the surface draws itself
    techniques: mi.Float  # by surface and cones together, with their shares


class MirroredRay(NamedTuple):
    """The ray that glass sends back, where the path itself has gone through."""

    is_there: Any  # Bool: the path is at such glass
    is_followed: Any  # Bool
    o: Any
    d: Any
    beta: Any  # throughput
    share: Any  # of the reflection in the guides; 0 if it is followed by chance


class WhiteSplit(NamedTuple):
    """Contribution of a vertex if it were white and matte, including throughput."""

    outdoor: Any  # by shadow rays
    indoor: Any
    onward: Any  # Color3f by which what the path brings later is to be multiplied


class StepResult(NamedTuple):
    """Contribution of one step of a path, including throughput."""

    # From an emitter that the ray meets, by one segment more than the depth before the step.
    emitted_outdoor: Any
    emitted_indoor: Any
    # From shadow rays at the new vertex, by one segment more than the depth after the step.
    direct_outdoor: Any
    direct_indoor: Any
    is_rough: Any  # Bool: the vertex is neither mirror nor glass
    missed: Any  # Bool: the ray met no surface
    sky_albedo: Any  # Color3f of what such a ray shows, white where that is the sky
    albedo: Any
    si: SurfaceInteraction
    scattered_d: Any  # direction drawn at the vertex
    pdfs: DirectionPdfs  # of drawing it
    guided_weight: Any  # of the ray that met the vertex; `path` has it in its throughput
    pass_probability: Any  # of passing straight through the surface, 1 unless it is glass
    outdoor_sample: DirectLightSample
    indoor_sample: DirectLightSample
    sunlit_sample: DirectLightSample
    is_view_independent: Any  # Bool: weighted by view_independent_pdf (bsdf.py)
    mirrored: MirroredRay | None = None  # where rays at glass are split
    white: WhiteSplit | None = None  # where white is split off


def device_fields(fields: LightFields, *, max_depth: int | None = None) -> DeviceFields:
    """Opaque device values of the kernels' fields; max_depth replaces the fields' own."""
    return DeviceFields(
        dr.opaque(mi.UInt32, fields.max_depth if max_depth is None else max_depth),
        dr.opaque(mi.UInt32, fields.rr_depth),
        dr.opaque(mi.Bool, fields.filter == "tent"),
    )


def film_position(u: Any, is_tent: Any) -> Any:
    """Position relative to a pixel's corner, spread by the box or tent filter; u: Point2f in [0, 1)^2."""
    tent = mi.Point2f(_tent(u.x), _tent(u.y)) + 0.5
    return dr.select(is_tent, tent, u)


def camera_path(
    camera: DeviceCamera | LensCamera, corner: Any, offset: Any, sampler: Sampler | None = None
) -> PathState:
    """The path that leaves the camera at a pixel's corner plus an offset, px; sampler: of pupil and time."""
    origin, d = camera_ray(camera, corner, offset, sampler)
    reference = no_reference(mi.Point3f(origin))
    return _first_ray(origin, mi.Vector3f(d), mi.UInt32(0), reference, mi.Float(0))


def surface_path(vertex: Vertex, d: Any, pdf: Any) -> PathState:
    """The path from a vertex, which knows its lamps (near), in direction d with a pdf per solid angle."""
    assert vertex.near is not None
    origin = offset_ray_origin(vertex.si.p, vertex.si.ng)
    path = _first_ray(origin, d, mi.UInt32(1), vertex.near.reference, mi.Float(pdf))
    # A number of Python is no state of a loop, which would be traced twice for what never changes.
    return replace(path, faintness=1.0)  # type: ignore[arg-type]


def _first_ray(o: Any, d: Any, depth: Any, reference: ReferencePoint, pdf: Any) -> PathState:
    white, one, none = mi.Color3f(1), mi.Float(1), mi.UInt32(0)
    has_met, unguided = mi.Bool(False), mi.UInt32(NO_FACE)
    return PathState(o, d, white, one, depth, none, has_met, reference, pdf, mi.Float(0), unguided)


def white_vertex(p: Any, n: Any, near: NearbyLamps) -> Vertex:
    """A vertex on a white matte surface at p with unit normal n, for illuminance and light maps."""
    white = Bsdf(mi.Color3f(1), mi.Color3f(0), mi.Color3f(0), mi.Float(0), mi.UInt32(0))
    no, yes, none = mi.Bool(False), mi.Bool(True), mi.UInt32(NO_LAMP)
    si = SurfaceInteraction(yes, p, n, n, n, none, white, no, mi.UInt32(0), mi.Float(0), none)
    up, dim = mi.Vector3f(0, 0, 1), mi.UInt32(CAMERA_DIMS)
    return Vertex(si, mi.Frame3f(n), up, no, no, yes, mi.UInt32(1), dim, near)


def _tent(u: Any) -> Any:
    return dr.select(u < 0.5, dr.sqrt(2 * u) - 1, 1 - dr.sqrt(dr.maximum(2 - 2 * u, 0)))
