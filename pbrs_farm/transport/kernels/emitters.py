"""Sampling and evaluating emitters: lamps, the sun, the sky's dome, portals; kernels.

Outdoor directions are drawn by one of several techniques: 0 the sun's disc, 1 the dome by its
brightness, 2 and above the window openings as portals (Bitterli et al. 2015). The probabilities of
lamps and techniques are per view (pilot.py); any positive weights are unbiased.
Effects: holds buffers on the device.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import drjit as dr
import mitsuba as mi
import numpy as np

from pbrs_farm.core.arrays import F32, F64, I64
from pbrs_farm.core.frames import LM_PER_W, LUMINANCE
from pbrs_farm.core.lighting import Group
from pbrs_farm.transport.kernels.arrival_rates import FIRST_LAMP, ArrivalRates
from pbrs_farm.transport.kernels.device_scene import DeviceScene
from pbrs_farm.transport.kernels.guiding_targets import GuidingTargets, TargetSampler, no_targets
from pbrs_farm.transport.kernels.lamp_guiding import (
    MAX_NEAR,
    NearbyLamps,
    NearbyLampSampler,
    ReferencePoint,
    sample_discrete,
)
from pbrs_farm.transport.kernels.outdoor_choice import OutdoorChoice, choose_technique
from pbrs_farm.transport.kernels.packets import colour, vector
from pbrs_farm.transport.kernels.sampler import (
    alias_rows,
    as_random,
    device_array,
    opaque3,
    sample_alias_table,
)
from pbrs_farm.transport.kernels.sun import SunDisc
from pbrs_farm.transport.kernels.sunlit_points import SunlitPoints
from pbrs_farm.transport.kernels.voxel_grid import VoxelGrid
from pbrs_farm.transport.scene_tables.portals import MAX_PORTALS
from pbrs_farm.transport.scene_tables.scene_tables import NO_LAMP, SceneTables
from pbrs_farm.transport.scene_tables.sky import Sky, solid_angles

if TYPE_CHECKING:
    from pbrs_farm.transport.kernels.outside import Outside
from pbrs_farm.transport.kernels.lamp_points import LampPointSampler, padded

SUN, DOME, FIRST_PORTAL = 0, 1, 2  # outdoor techniques; those from FIRST_PORTAL on are portals
# Share of lamp shadow rays chosen by position; the others are chosen by the view's weights alone
# (walls hide lamps). Where arrival rates are known the share is larger, in proportion to the nearby
# lamps' part of the view's weight.
NEARBY_SHARE, MAX_NEARBY_SHARE = 0.5, 0.9
_SEEN_SHARE, _ROOM_SHARE, _LAMPS_LX = 0.25, 0.02, 100.0  # of pane_odds
_PORTAL_PACKETS = 3  # corner, first edge, second edge


@dataclass(frozen=True, slots=True, eq=False)
class EmitterWeights:
    """Probabilities of lamps and of outdoor techniques; each sums to 1 (or is empty)."""

    lamps: F64  # (L,)
    outdoor: F64  # (2 + number of portals,)
    outdoor_by_place: F64 | None = None  # the same by voxel (outdoor_choice.py), None = everywhere
    is_guided: bool = True  # a part of the rays is guided into lamps
    # Luminance of outdoor and indoor light that a shadow ray must be able to bring, or it is cast by
    # chance (shadow_roulette.py); 0 = all are cast.
    shadow_thresholds: tuple[float, float] = (0.0, 0.0)
    arrival_rates: F64 | None = None  # (voxels, kinds) of arrival_rates.py, None = all rays arrive
    vertices: I64 | None = None  # (voxels,) of the pilot's paths, None = no sunlit points


class DirectionSample(NamedTuple):
    """A sampled direction to an emitter."""

    d: Any  # unit Vector3f
    distance: Any
    radiance: Any  # Color3f from there
    pdf: Any  # per solid angle, of all techniques that could have drawn it
    valid: Any
    kind: Any  # UInt32, of arrival_rates.py
    emitter: Any = None  # UInt32 number of the lamp, None for the sky


class Emitters:
    """The lamps and the sky of a scene on the device, with the weights of one view.

    Every method takes counted: the one lamp or outdoor technique that counts, lane by lane, or -1
    (the pilot asks for one at a time).
    """

    def __init__(
        self, tables: SceneTables, sky: Sky, portals: F64, weights: EmitterWeights
    ) -> None:
        self.outside: Outside | None = None  # outdoor surroundings, if any
        self.nearby = NearbyLampSampler(tables)
        grid = VoxelGrid(tables.positions)
        level = (sky.sky_lx + sky.sun_lx) / LM_PER_W / math.pi
        self.outdoor_choice = OutdoorChoice(grid, level if level > 0 else 1.0)
        self.arrival = ArrivalRates(grid)
        self.sun, self.sunlit = SunDisc(sky), SunlitPoints(grid, self.arrival)
        self.targets = TargetSampler(no_targets(len(tables.lamps)))
        self._set_lamps(tables, weights.lamps)
        self._set_dome(sky.dome, None)
        self.pane_odds = dr.opaque(mi.Float, pane_odds(level))
        self._set_portals(portals)
        self._set_outdoor_weights(weights)
        self._set_shadow_thresholds(weights)
        shines = bool(sky.dome.max() > 0 or sky.sun_irradiance.max() > 0)
        self.has_sky = dr.opaque(mi.Bool, shines)
        self._has_group = {Group.OUTDOOR: shines, Group.INDOOR: len(tables.lamps) > 0}

    def has_group(self, group: Group) -> bool:
        """Whether anything of a group shines: else its picture is black and need not be traced."""
        return self._has_group[group]

    def set_outside(self, outside: Outside, dome: F32) -> None:
        """Set the outdoor surroundings and their light.

        dome: from `Outside.light_dome`. Scattered rays and shadow rays use it instead of the sky's, with the
        sun where no outdoor object occludes it; other rays see the surroundings themselves.
        """
        self.outside = outside
        self.sun.outside = outside
        self._set_dome(dome, outside.sky.dome)

    def set_view(self, portals: F64, weights: EmitterWeights) -> None:
        """Set another view's portals (N, 4, 3), metres, at most MAX_PORTALS, and weights; nothing is compiled anew."""
        self._set_portals(portals)
        self.set_weights(weights)

    def set_weights(self, weights: EmitterWeights) -> None:
        """Set other weights for later passes of a view; what a picture converges to stays."""
        self._set_lamp_weights(weights.lamps, weights.arrival_rates)
        self._set_outdoor_weights(weights)
        self.nearby.set_guided(weights.is_guided)
        self.sunlit.set_view(weights.vertices)
        self._set_shadow_thresholds(weights)

    def set_targets(self, targets: GuidingTargets) -> None:
        """Set what guided rays aim at; `no_targets` takes them away again."""
        self.targets = TargetSampler(targets)
        self.nearby.set_targets(targets)

    def near_lamps(self, p: Any, n: Any, counted: Any, active: Any) -> NearbyLamps:
        """The strongest lamps at p on a surface with normal n; counted: the only technique to count, -1 for all."""
        rates = self.arrival.of_near_lamps(p, active)
        rates[0] = dr.select(counted >= 0, 1, rates[0])
        return self.nearby.at_vertex(p, n, counted, rates, active)

    def sample_lamp(
        self, scene: DeviceScene, near: NearbyLamps, u: Any, uv: Any, counted: Any, active: Any
    ) -> DirectionSample:
        """A point on a lamp: of a nearby one with probability _nearby_share, else by weight alone.

        u: Float, uv: Point2f in [0, 1). counted: a lamp's number to sample only that one, else -1. The
        radiance ignores occlusion: cast a shadow ray. valid is False if the point faces away from p or
        coincides with it.
        """
        # Choose a lamp both ways, and take one.
        active = active & self._has_lamps
        nearby_share = self._nearby_share(near.reference)
        is_near = u < nearby_share
        rest = as_random(
            dr.select(
                is_near, u / dr.maximum(nearby_share, 1e-6), (u - nearby_share) / (1 - nearby_share)
            )
        )
        lamp, v = sample_alias_table(self._lamp_alias, mi.UInt32(0), self._n_lamps, rest, active)
        near_lamp, near_v = sample_discrete(near.lamps, near.chances, near.reference.total, rest)
        lamp, u = dr.select(is_near, near_lamp, lamp), dr.select(is_near, near_v, v)
        lamp = dr.select(counted >= 0, mi.UInt32(counted), lamp)
        p = near.reference.p
        q, n, is_seen = self._lamp_points.sample(scene, lamp, p, u, uv, active)
        to = q - p
        distance = dr.norm(to)
        d = to / distance
        cos = dr.abs(dr.dot(n, d))
        valid = active & is_seen & (distance > 1e-5) & (cos > 1e-5)
        radiance, pdf = self._eval_lamp(lamp, near.reference, distance, cos, counted, valid)
        kind = self.nearby.slot(lamp, valid)[0] + FIRST_LAMP
        return DirectionSample(d, distance, radiance, pdf, valid, kind, lamp)

    def _nearby_share(self, reference: ReferencePoint) -> Any:
        """Chance that a lamp is chosen by where it is; 0 where none is nearby."""
        return dr.select(reference.total > 0, self._share_nearby, 0)

    def eval_lamp(
        self,
        lamp: Any,
        reference: ReferencePoint,
        distance: Any,
        cos: Any,
        counted: Any,
        active: Any,
    ) -> tuple[Any, Any]:
        """(radiance, pdf of sample_lamp) of a lamp that a ray from the reference point meets.

        lamp: NO_LAMP where the ray met none, which gives 0; cos: between ray and the lamp's normal,
        either sign. For multiple importance sampling: the pdf is per solid angle from the reference
        point.
        """
        active = active & (lamp != NO_LAMP)
        radiance, pdf = self._eval_lamp(lamp, reference, distance, dr.abs(cos), counted, active)
        return dr.select(active, radiance, 0), pdf

    def _eval_lamp(
        self,
        lamp: Any,
        reference: ReferencePoint,
        distance: Any,
        cos: Any,
        counted: Any,
        active: Any,
    ) -> tuple[Any, Any]:
        row = dr.gather(mi.Vector4f, self._lamp_rows, lamp, active)  # r g b area
        # Blend the chances of both ways to choose the lamp, per area, then per solid angle.
        weight = dr.gather(mi.Float, self._lamp_weights, lamp, active)
        importance, _guided = self.nearby.importance(
            lamp, reference.p, reference.n, counted, active
        )
        slot, factor = self.nearby.slot(lamp, active)
        rate = self.arrival.of_kind(reference.p, slot + FIRST_LAMP, active) * factor
        rate = dr.select(counted >= 0, 1, rate)
        nearby = importance * rate / dr.maximum(reference.total, 1e-30)
        weight = dr.lerp(weight, nearby, self._nearby_share(reference))
        weight = dr.select(counted >= 0, 1, weight)
        area = row[3] * self._lamp_points.area_share(lamp, reference.p, active)
        pdf = weight * dr.square(distance) / dr.maximum(area * cos, 1e-12)
        counts = (counted < 0) | (mi.UInt32(counted) == lamp)
        return dr.select(counts, colour(row), 0), pdf

    def sample_outdoor(self, p: Any, u: Any, uv: Any, counted: Any, active: Any) -> DirectionSample:
        """A direction of possible outdoor light at p.

        The sun, the dome or a portal, by the probabilities of p's voxel. The distance is infinite; occlusion
        is not tested. The pdf is over all techniques that can produce the direction.
        """
        active = active & self.has_sky
        chances = self.outdoor_choice.chances(p, active)
        technique, u = choose_technique(chances, u)
        technique = dr.select(counted >= 0, mi.UInt32(counted), technique)
        is_sun = technique == SUN
        # Draw a direction by every technique, and take one.
        texel, _u = sample_alias_table(self._dome_alias, mi.UInt32(0), self._n_texels, u, active)
        to_sun = self.sun.sample(uv)
        to_dome = self._texel_direction(texel, uv)
        to_portal = self._portal_direction(p, technique, uv, active)
        d = dr.select(is_sun, to_sun, dr.select(technique == DOME, to_dome, to_portal))
        # The sun and the dome are two emitters with separate pdfs.
        sun, sun_pdf = self.eval_sun(chances, d, counted)
        dome, dome_pdf = self.eval_dome(chances, p, d, counted, active)
        radiance, pdf = dr.select(is_sun, sun, dome), dr.select(is_sun, sun_pdf, dome_pdf)
        return DirectionSample(d, mi.Float(dr.inf), radiance, pdf, active, technique)

    def eval_sun(self, chances: list[Any], d: Any, counted: Any) -> tuple[Any, Any]:
        """(radiance of the sun's disc in direction d, pdf of sampling it by the techniques' chances)."""
        weight = dr.select(counted >= 0, 1, chances[SUN])
        counts = (counted < 0) | (counted == SUN)
        return dr.select(counts, self.sun.radiance(d), 0), weight * self.sun.pdf

    def eval_dome(
        self, chances: list[Any], p: Any, d: Any, counted: Any, active: Any, is_seen: Any = False
    ) -> tuple[Any, Any]:
        """(the dome's radiance in direction d, pdf from p, without the sun); is_seen: the sky itself is seen."""
        first = 0 if is_seen is False else dr.select(is_seen, self._first_seen, 0)
        radiance, texel_pdf = self._dome_row(d, active, first)
        free = counted < 0
        pdf = dr.select(free, chances[DOME], dr.select(counted == DOME, 1, 0)) * texel_pdf
        for k in range(MAX_PORTALS):
            is_counted = dr.select(counted == FIRST_PORTAL + k, 1, 0)
            weight = dr.select(free, chances[FIRST_PORTAL + k], is_counted)
            pdf += weight * self._portal_pdf(k, p, d)
        return dr.select(counted == SUN, 0, radiance), pdf

    def _portal_direction(self, p: Any, technique: Any, uv: Any, active: Any) -> Any:
        is_portal = active & (technique >= FIRST_PORTAL)
        corner, a, b = self._portal(technique - FIRST_PORTAL, is_portal)
        to = mi.Point3f(corner + uv.x * a + uv.y * b) - p
        length = dr.norm(to)
        return dr.select(length > 1e-6, to / length, mi.Vector3f(0, 1, 0))

    def _portal_pdf(self, k: int, p: Any, d: Any) -> Any:
        corner, a, b = self._portal_edges[k]
        # Intersect the ray with the portal's plane: q in its edges' coordinates.
        n = dr.cross(a, b)
        along = dr.dot(n, d)
        t = dr.dot(n, mi.Point3f(corner) - p) / along
        q = p + t * d - corner
        s, r = dr.dot(q, a) / dr.squared_norm(a), dr.dot(q, b) / dr.squared_norm(b)
        crosses = (t > 0) & (s >= 0) & (s <= 1) & (r >= 0) & (r <= 1) & (dr.abs(along) > 1e-9)
        # |n| is the portal's area: its pdf per area, times distance^2 / cosine.
        return dr.select(crosses, dr.square(t) / dr.abs(along), 0)

    def _portal(self, k: Any, active: Any) -> tuple[Any, ...]:
        """(corner, first edge, second edge) of a portal, another one for each lane."""
        first = k * _PORTAL_PACKETS
        rows = [dr.gather(mi.Vector4f, self._portals, first + j, active) for j in range(3)]
        return tuple(vector(row) for row in rows)

    def _texel_direction(self, texel: Any, uv: Any) -> Any:
        width = self._dome_width
        row, column = texel // width, texel % width
        phi = (mi.Float(column) + uv.x) * (2 * math.pi) / mi.Float(width)
        # Draw uniformly in solid angle inside the texel: uniform in the height of the row.
        step = math.pi / self._dome_height_f
        top = dr.cos(mi.Float(row) * step)
        bottom = dr.cos((mi.Float(row) + 1) * step)
        y = dr.lerp(top, bottom, uv.y)
        s = dr.safe_sqrt(1 - dr.square(y))
        sin_phi, cos_phi = dr.sincos(phi)
        return mi.Vector3f(s * sin_phi, y, -s * cos_phi)

    def _dome_row(self, d: Any, active: Any, first: Any) -> tuple[Any, Any]:
        """(radiance blended between texels, pdf of the dome's technique); first: texel of the dome."""
        # Look the pdf up in the nearest texel.
        w, h = mi.Int32(self._dome_width), mi.Int32(self._dome_height)
        phi = dr.atan2(d.x, -d.z)
        x = phi * (1 / (2 * math.pi))
        x = (x - dr.floor(x)) * mi.Float(self._dome_width)
        y = dr.safe_acos(d.y) * (1 / math.pi) * self._dome_height_f
        nearest_x = dr.clip(mi.Int32(x), 0, w - 1)
        nearest_y = dr.clip(mi.Int32(y), 0, h - 1)
        texel_index = mi.UInt32(nearest_y * w + nearest_x) + first
        pdf = dr.gather(mi.Vector4f, self._dome, texel_index, active)[3]
        # Blend the radiance of four texels; longitude repeats, latitude ends.
        fx, fy = dr.floor(x - 0.5), dr.floor(y - 0.5)
        tx, ty = x - 0.5 - fx, y - 0.5 - fy
        total = mi.Color3f(0)
        for dx, dy in ((0, 0), (1, 0), (0, 1), (1, 1)):
            column, row = mi.Int32(fx) + dx, dr.clip(mi.Int32(fy) + dy, 0, h - 1)
            column = dr.select(column < 0, column + w, dr.select(column >= w, column - w, column))
            texel_index = mi.UInt32(row * w + column) + first
            texel = dr.gather(mi.Vector4f, self._dome, texel_index, active)
            weight = (tx if dx else 1 - tx) * (ty if dy else 1 - ty)
            total += weight * colour(texel)
        return total, pdf

    def _set_lamps(self, tables: SceneTables, weights: F64) -> None:
        n = len(tables.lamps)
        self._n_lamps = dr.opaque(mi.UInt32, max(n, 1))
        self._has_lamps = dr.opaque(mi.Bool, n > 0)
        self._lamp_rows = padded(mi.Float, tables.lamp_rows.ravel(), np.ones(4, np.float32))
        self._lamp_points = LampPointSampler(tables)
        self._set_lamp_weights(weights, None)

    def _set_portals(self, portals: F64) -> None:
        rows = np.zeros((MAX_PORTALS, 4 * _PORTAL_PACKETS), np.float32)
        rows[: len(portals), 0:3] = portals[:, 0]
        rows[: len(portals), 4:7] = portals[:, 1] - portals[:, 0]
        rows[: len(portals), 8:11] = portals[:, 3] - portals[:, 0]
        self._portals = device_array(mi.Float, rows.ravel())
        # The same as numbers that all lanes share: cheaper than gathered ones.
        self._portal_edges = [
            tuple(opaque3(mi.Vector3f, row[4 * j : 4 * j + 3]) for j in range(_PORTAL_PACKETS))
            for row in rows
        ]

    def _set_lamp_weights(self, weights: F64, rates: F64 | None) -> None:
        self.arrival.set_rates(rates)
        self.nearby.set_weights(weights, by_flux=rates is not None)
        share = NEARBY_SHARE
        if rates is not None:
            strongest = float(np.sort(weights)[::-1][:MAX_NEAR].sum())
            share = min(max(round(strongest, 6), NEARBY_SHARE), MAX_NEARBY_SHARE)
        self._share_nearby = dr.opaque(mi.Float, share)
        padded = weights if len(weights) else np.ones(1)
        self._lamp_weights = device_array(mi.Float, padded.astype(np.float32))
        self._lamp_alias = device_array(mi.Float, alias_rows(padded).ravel())

    def _set_outdoor_weights(self, weights: EmitterWeights) -> None:
        by_place = weights.outdoor_by_place
        self.outdoor_choice.set_weights(weights.outdoor if by_place is None else by_place)

    def _set_shadow_thresholds(self, weights: EmitterWeights) -> None:
        outdoor, indoor = weights.shadow_thresholds
        self.shadow_thresholds = dr.opaque(mi.Float, outdoor), dr.opaque(mi.Float, indoor)

    def _set_dome(self, dome: F32, seen: F32 | None) -> None:
        height, width = dome.shape[:2]
        probability = dome_probabilities(dome)
        # The lighting dome, then the visible one if it differs.
        rows = np.empty((1 if seen is None else 2, height, width, 4), np.float32)  # r g b pdf
        rows[..., :3] = dome if seen is None else np.stack([dome, seen])
        rows[..., 3] = probability / solid_angles(height, width)[:, None]
        self._dome = device_array(mi.Float, rows.ravel())
        self._first_seen = dr.opaque(mi.UInt32, 0 if seen is None else height * width)
        self._dome_alias = device_array(mi.Float, alias_rows(probability.ravel()).ravel())
        self._n_texels = dr.opaque(mi.UInt32, height * width)
        self._dome_width = dr.opaque(mi.UInt32, width)
        self._dome_height = dr.opaque(mi.UInt32, height)
        self._dome_height_f = dr.opaque(mi.Float, float(height))


def pane_odds(level: float) -> float:
    """Approximate ratio of the radiance seen through a pane to that reflected in it.

    level: luminance over LM_PER_W of white ground under the open sky. A room is assumed to have 100 lx of
    lamps and some skylight. Only affects how often rays are reflected, never the converged picture.
    """
    outside = _SEEN_SHARE * level
    return outside / (_LAMPS_LX / LM_PER_W / math.pi * _SEEN_SHARE + _ROOM_SHARE * outside)


def dome_probabilities(dome: F32) -> F64:
    """(H, W) probability of each texel: brightness (of it and its neighbours) times solid angle.

    dome: (H, W, 3) float32 radiance, equirectangular. The sum is 1. A twentieth goes to all
    directions alike, so that none is impossible; a black dome gives that alone.
    """
    height, width = dome.shape[:2]
    luminance = np.asarray(dome, np.float64) @ LUMINANCE
    # Take the brightest of the texels that the radiance is blended from.
    widest = luminance
    for shift in (-1, 1):
        widest = np.maximum(widest, np.roll(luminance, shift, 1))
    rows = np.pad(widest, ((1, 1), (0, 0)), mode="edge")
    widest = np.maximum(np.maximum(rows[:-2], rows[2:]), widest)
    weight = widest * solid_angles(height, width)[:, None]
    total = weight.sum()
    uniform = np.broadcast_to(solid_angles(height, width)[:, None], weight.shape) / (4 * math.pi)
    return np.asarray(uniform if total <= 0 else 0.95 * weight / total + 0.05 * uniform)
