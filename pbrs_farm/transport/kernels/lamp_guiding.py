"""Importances of the lamps near a vertex, for shadow rays and guided rays; kernels, no effects.

A home has a dozen lamps. The pilot's weights (pilot.py) tell their importance for a view, not for a
position in it. Here the strongest few are weighted again at every vertex: by distance, by orientation
and, in views with a trial, by flux and arrival rate (outdoor_choice.py). Inside a shade its own bulb is
nearly always chosen.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

import drjit as dr
import mitsuba as mi
import numpy as np

from pbrs_farm.core.arrays import F32, F64
from pbrs_farm.core.frames import LUMINANCE
from pbrs_farm.transport.kernels.guiding_targets import GuidingTargets, no_targets
from pbrs_farm.transport.kernels.packets import point
from pbrs_farm.transport.kernels.sampler import as_random, device_array
from pbrs_farm.transport.scene_tables.scene_tables import SceneTables, bounding_spheres

MAX_NEAR: Final = 8  # lamps weighted by position
_MIN_RADIUS_M: Final = 0.03
_MAX_SIN2: Final = 0.98  # of half a cone's opening; wider, the vertex counts as inside
_CONE_EDGE: Final = 5e-4  # tolerance of a cone's height, against float32 at its edge


@dataclass
class ReferencePoint:
    """A vertex that emitters are sampled from, with the sums of NearbyLamps."""

    p: mi.Point3f
    n: mi.Vector3f  # normal, 0 where light may come from both sides
    total: mi.Float  # sum of the chances of shadow rays
    guided_total: mi.Float  # sum of guided importances


class Cones(NamedTuple):
    """The cones in which a vertex sees the lamp interiors, a list entry per lamp."""

    importances: list[Any]  # 0 where the vertex is inside
    total: Any  # sum of importances
    axes: list[Any]  # Vector3f
    heights: list[Any]  # 1 - cosine of half the opening


class NearbyLamps(NamedTuple):
    """The strongest lamps as a vertex sees them, a list entry per lamp."""

    reference: ReferencePoint
    lamps: list[Any]  # UInt32
    closeness: Any  # sum of importances: weight of the view times closeness
    chances: list[Any]  # of shadow rays to each: importance times how often such a ray arrives
    guided: list[Any]  # importances times the share of light that guided rays can find
    cones: Cones
    is_guided: Any  # Bool: rays of this view are guided at all


class _Slot(NamedTuple):
    """One of the strongest lamps of a view, as numbers that all lanes share."""

    lamp: Any  # UInt32
    counts: Any  # 0 where the house has fewer lamps
    rows: _LampRows


class _LampRows(NamedTuple):
    """Data of a lamp, in packets of four floats."""

    sphere: Any
    strength: Any  # weight, guided share, slot or MAX_NEAR, flux over weight
    interior: Any


class NearbyLampSampler:
    """Bounding spheres of all lamps on the device, with the weights of one view."""

    def __init__(self, tables: SceneTables) -> None:
        spheres = bounding_spheres(tables)
        spheres[:, 3] = np.maximum(spheres[:, 3], _MIN_RADIUS_M)
        self._n = len(spheres)
        self._host_spheres = _pad_slots(spheres)
        self._spheres = device_array(mi.Float, self._host_spheres.ravel())
        self._fluxes = (
            tables.lamp_rows[:, :3].astype(np.float64) @ LUMINANCE * tables.lamp_rows[:, 3]
        )
        self._weights, self._by_flux = np.zeros(self._n), False
        self.set_guided(True)
        self.set_targets(no_targets(self._n))

    def set_weights(self, weights: F64, *, by_flux: bool = False) -> None:
        """Set the weights of another view, (L,).

        by_flux: shadow rays go by the lamps' flux instead, since it is known which of them arrive.
        """
        self._weights, self._by_flux = weights, by_flux
        self._update()

    def set_guided(self, is_guided: bool) -> None:
        """Whether the rays of this view are guided."""
        self._is_guided = dr.opaque(mi.Bool, is_guided)

    def set_targets(self, targets: GuidingTargets) -> None:
        """Set the surfaces of each lamp's light that guided rays aim at."""
        self._shares = targets.shares
        self._host_interiors = _pad_slots(targets.interiors)
        self._interiors = device_array(mi.Float, self._host_interiors.ravel())
        self._update()

    def _update(self) -> None:
        # Keep the strongest lamps of the view; the others have importance 0.
        order = np.argsort(-self._weights, kind="stable")[:MAX_NEAR]
        rows = np.zeros((self._n, 4))  # as _LampRows.strength
        rows[:, 2] = MAX_NEAR
        rows[order, 2] = np.arange(len(order))
        rows[:, 3] = 1
        if self._by_flux:
            rows[order, 3] = self._fluxes[order] / np.maximum(self._weights[order], 1e-12)
        rows[order, 0] = self._weights[order]
        rows[:, 1] = self._shares
        strengths = _pad_slots(rows)
        self._strengths = device_array(mi.Float, strengths.ravel())
        # Let all lanes share their numbers: cheaper than gathered ones.
        chosen = np.append(order, np.zeros(MAX_NEAR - len(order), order.dtype))
        tables = self._host_spheres, strengths, self._host_interiors
        self._slots = [
            _Slot(
                dr.opaque(mi.UInt32, int(lamp)),
                dr.opaque(mi.Float, float(k < len(order))),
                _LampRows(*(_shared_packet(table[lamp]) for table in tables)),
            )
            for k, lamp in enumerate(chosen)
        ]

    def at_vertex(self, p: Any, n: Any, counted: Any, rates: list[Any], active: Any) -> NearbyLamps:
        """The lamps from p on a surface of normal n.

        counted: the one lamp that counts, or -1. rates: of shadow rays to each that arrive.
        """
        lamps, chances, guided, interiors = [], [], [], []
        closeness, total, guided_total = mi.Float(0), mi.Float(0), mi.Float(0)
        for k in range(MAX_NEAR):
            lamp, counts, rows = self._slot(k, counted, active)
            importance, aimed = _importance(rows, lamp, p, n, counted, active)
            lamps.append(lamp)
            interiors.append(rows.interior)
            importance *= counts
            closeness += importance
            chances.append(importance * rates[k] * dr.select(counted >= 0, 1, rows.strength[3]))
            guided.append(counts * aimed)
            total += chances[-1]
            guided_total += guided[-1]
        reference = ReferencePoint(mi.Point3f(p), n, total, guided_total)
        cones = _cones(p, interiors, guided)
        return NearbyLamps(reference, lamps, closeness, chances, guided, cones, self._is_guided)

    def importance(self, lamp: Any, p: Any, n: Any, counted: Any, active: Any) -> tuple[Any, Any]:
        """(importance, guided importance) of one lamp as in NearbyLamps; 0 for lamps outside the strongest.

        lamp: UInt32; p, n: of the vertex, as for `Emitters.near_lamps`; counted: the only technique to
        count, -1 for all.
        """
        sphere = dr.gather(mi.Vector4f, self._spheres, lamp, active)
        strength = dr.gather(mi.Vector4f, self._strengths, lamp, active)
        rows = _LampRows(sphere, strength, None)
        return _importance(rows, lamp, p, n, counted, active)

    def slot(self, lamp: Any, active: Any) -> tuple[Any, Any]:
        """(slot of a lamp among the strongest or MAX_NEAR, factor from its importance to a probability).

        MAX_NEAR stands for all lamps outside the strongest.
        """
        row = dr.gather(mi.Vector4f, self._strengths, lamp, active)
        return mi.UInt32(row[2]), row[3]

    def _slot(self, k: int, counted: Any, active: Any) -> _Slot:
        """A slot; if only one lamp counts, the first slot is that lamp and the others are empty."""
        slot, is_asked = self._slots[k], counted >= 0
        if k > 0:
            return slot._replace(counts=dr.select(is_asked, 0.0, slot.counts))
        lamp = dr.select(is_asked, mi.UInt32(counted), slot.lamp)
        tables = self._spheres, self._strengths, self._interiors
        counted_rows = (dr.gather(mi.Vector4f, table, lamp, active & is_asked) for table in tables)
        rows = (dr.select(is_asked, a, b) for a, b in zip(counted_rows, slot.rows, strict=True))
        return _Slot(lamp, dr.select(is_asked, 1.0, slot.counts), _LampRows(*rows))


def _importance(
    rows: _LampRows, lamp: Any, p: Any, n: Any, counted: Any, active: Any
) -> tuple[Any, Any]:
    """(importance, guided importance) of a lamp from p on a surface of normal n."""
    sphere, row = rows.sphere, rows.strength
    alone = dr.select(mi.UInt32(counted) == lamp, mi.Float(1), 0)
    weight = dr.select(counted >= 0, alone, row[0])
    # Weigh by 1 / distance^2, held at the sphere's radius, and by the part in front.
    to = point(sphere) - p
    d = dr.sqrt(dr.maximum(dr.squared_norm(to), dr.square(sphere[3])))
    is_two_sided = dr.squared_norm(n) < 0.5
    cos = dr.select(is_two_sided, 1, dr.maximum(dr.dot(n, to) + sphere[3], 0) / d)
    importance = dr.select(active, weight * cos / dr.square(d), 0)
    return importance, importance * row[1]


def _cones(p: Any, interiors: list[Any], guided: list[Any]) -> Cones:
    """The cones from p around lamp interiors (centre, radius), by what guided rays find there."""
    importances, axes, heights = [], [], []
    total = mi.Float(0)
    for sphere, aimed in zip(interiors, guided, strict=True):
        to = point(sphere) - p
        d2 = dr.maximum(dr.squared_norm(to), 1e-8)
        sin2 = dr.square(sphere[3]) / d2
        importances.append(dr.select((sin2 > 0) & (sin2 < _MAX_SIN2), aimed, 0))
        total += importances[-1]
        axes.append(to * dr.rsqrt(d2))
        # 1 - cosine without the digits that float32 loses near 1.
        heights.append(sin2 / (1 + dr.safe_sqrt(1 - sin2)))
    return Cones(importances, total, axes, heights)


def no_reference(p: Any) -> ReferencePoint:
    """Where no emitter is sampled: the camera."""
    return ReferencePoint(mi.Point3f(p), mi.Vector3f(0), mi.Float(0), mi.Float(0))


def sample_discrete(values: list[Any], weights: list[Any], total: Any, u: Any) -> tuple[Any, Any]:
    """(one of values in proportion to its weight, u stretched to be uniform again).

    values, weights: lists of equal length, weights >= 0, total their sum. u in [0, 1); its remainder may
    be used for the next choice. If rounding leaves no candidate, returns the first one.
    """
    x = u * total
    value, again, below = values[0], mi.Float(0), mi.Float(0)
    for candidate, weight in zip(values, weights, strict=True):
        is_it = (x >= below) & (x < below + weight)
        value = dr.select(is_it, candidate, value)
        again = dr.select(is_it, (x - below) / dr.maximum(weight, 1e-30), again)
        below += weight
    return value, as_random(again)


def sample_cones(cones: Cones, u: Any, uv: Any) -> Any:
    """A direction uniform in one of the cones.

    u: Float, uv: Point2f in [0, 1). A cone is chosen by its importance; cones may overlap, which
    `cone_pdf` sums over.
    """
    height, _u = sample_discrete(cones.heights, cones.importances, cones.total, u)
    axis, _u = sample_discrete(cones.axes, cones.importances, cones.total, u)
    h = uv.x * height
    s = dr.safe_sqrt(h * (2 - h))
    sin_phi, cos_phi = dr.sincos(2 * math.pi * uv.y)
    return mi.Frame3f(axis).to_world(mi.Vector3f(s * cos_phi, s * sin_phi, 1 - h))


def cone_pdf(cones: Cones, d: Any) -> Any:
    """Pdf of sample_cones() per solid angle; 0 without cones.

    d: unit. Slightly wider than the cones, so that a direction drawn at the edge never has pdf 0.
    """
    pdf = mi.Float(0)
    for importance, axis, height in zip(cones.importances, cones.axes, cones.heights, strict=True):
        # |d - axis|^2 is twice the height; directions drawn at the edge must count as inside.
        inside = dr.squared_norm(d - axis) <= (2 + _CONE_EDGE) * height
        solid_angle = 2 * math.pi * dr.maximum(height, 1e-9)
        pdf += dr.select(inside & (importance > 0), importance / solid_angle, 0)
    return pdf / dr.maximum(cones.total, 1e-30)


def _pad_slots(rows: F64) -> F32:
    """(L + 1, 4) rows: one more, so that a house without lamps has a row, too."""
    return np.append(rows, np.zeros((1, 4)), 0).astype(np.float32)


def _shared_packet(row: F32) -> Any:
    """A packet of four floats that all lanes share."""
    return mi.Vector4f(*(dr.opaque(mi.Float, float(x)) for x in row))
