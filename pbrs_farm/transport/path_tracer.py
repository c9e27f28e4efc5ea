"""Unidirectional path tracing of both light groups from one trace; kernels, no effects.

A lane takes up the next sample of its pixel as soon as a path ends, so that no lane of a packet
waits for the longest path. A lane sums its samples in order: the same seed gives the same bits.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.camera import Camera
from pbrs_farm.core.recipe import LightFields
from pbrs_farm.transport.kernels.bsdf import luminance
from pbrs_farm.transport.kernels.device_scene import DeviceScene
from pbrs_farm.transport.kernels.emitters import Emitters
from pbrs_farm.transport.kernels.path_state import (
    DeviceCamera,
    DeviceFields,
    EmitterFilter,
    StepResult,
    camera_path,
    device_camera,
    device_fields,
    film_position,
)
from pbrs_farm.transport.kernels.path_step import advance
from pbrs_farm.transport.kernels.sampler import SobolSampler, stream_key


@dataclass(frozen=True, slots=True, eq=False)
class Sums:
    """Sums over the samples of each lane, numpy, (N, 3) float32.

    outdoor, indoor: radiance; *_even: of every second sample; albedo, normal: of the first
    surface that is neither mirror nor glass; n_bad: paths that were not finite, left out.
    lamps: (N, L, 3), indoor light by the lamp it comes from, when Lanes asks for it.
    """

    outdoor: NDArray[np.float32]
    indoor: NDArray[np.float32]
    outdoor_even: NDArray[np.float32]
    indoor_even: NDArray[np.float32]
    albedo: NDArray[np.float32]
    normal: NDArray[np.float32]
    n_bad: int
    lamps: NDArray[np.float32] | None = None

    def __add__(self, other: Sums) -> Sums:
        return Sums(
            self.outdoor + other.outdoor,
            self.indoor + other.indoor,
            self.outdoor_even + other.outdoor_even,
            self.indoor_even + other.indoor_even,
            self.albedo + other.albedo,
            self.normal + other.normal,
            self.n_bad + other.n_bad,
            None if self.lamps is None or other.lamps is None else self.lamps + other.lamps,
        )


@dataclass(frozen=True, slots=True)
class Lanes:
    """Which pixels to trace and how often.

    width, height: of the picture. first_sample, n_samples: of each pixel. n_only_*: 0, or the
    number of emitters that the pilot asks one by one: lane = pixel * n_only + emitter. n_lamps:
    0, or the number of all lamps, to sum the light of each by itself.
    """

    width: int
    height: int
    first_sample: int
    n_samples: int
    seed: int
    n_only_lamps: int = 0
    n_only_outdoor: int = 0
    n_lamps: int = 0

    @property
    def n_only(self) -> int:
        """Emitters asked one by one."""
        return self.n_only_lamps + self.n_only_outdoor

    @property
    def n_lanes(self) -> int:
        """Lanes of a launch."""
        return self.width * self.height * max(self.n_only, 1)


class ByLamp(NamedTuple):
    """Where a lane adds what each lamp brings: sums (lanes * lamps * 3,); first: its place there."""

    sums: Any
    first: Any


def trace(
    scene: DeviceScene,
    emitters: Emitters,
    camera: Camera,
    lanes: Lanes,
    fields: LightFields,
    *,
    max_depth: int | None = None,
) -> Sums:
    """Trace n_samples paths for every lane; max_depth replaces the fields' own."""
    lane = dr.arange(mi.UInt32, lanes.n_lanes)
    per_pixel = dr.opaque(mi.UInt32, max(lanes.n_only, 1))
    pixel, which = lane // per_pixel, mi.Int32(lane % per_pixel)
    n_lamps = dr.opaque(mi.Int32, lanes.n_only_lamps)
    asked = dr.opaque(mi.Bool, lanes.n_only > 0)
    is_lamp = which < n_lamps
    emitter_filter = EmitterFilter(
        indoor=dr.select(asked, dr.select(is_lamp, which, -2), -1),
        outdoor=dr.select(asked, dr.select(is_lamp, -2, which - n_lamps), -1),
    )
    by_lamp = None
    if lanes.n_lamps > 0:
        sums = dr.zeros(mi.Float, lanes.n_lanes * lanes.n_lamps * 3)
        by_lamp = ByLamp(sums, lane * dr.opaque(mi.UInt32, lanes.n_lamps * 3))
    out = _trace(
        scene,
        emitters,
        device_camera(camera),
        device_fields(fields, max_depth=max_depth),
        (pixel, dr.opaque(mi.UInt32, lanes.width)),
        dr.opaque(mi.UInt32, lanes.first_sample),
        dr.opaque(mi.UInt32, lanes.first_sample + lanes.n_samples),
        stream_key(lane, dr.opaque(mi.UInt32, lanes.seed & 0xFFFFFFFF)),
        emitter_filter,
        by_lamp,
    )
    dr.eval(*out)
    arrays = [np.ascontiguousarray(v.numpy().T, np.float32) for v in out[:6]]
    n_bad = int(np.sum(out[6].numpy(), dtype=np.int64))
    lamps = None
    if by_lamp is not None:
        lamps = by_lamp.sums.numpy().reshape(lanes.n_lanes, lanes.n_lamps, 3)
    return Sums(arrays[0], arrays[1], arrays[2], arrays[3], arrays[4], arrays[5], n_bad, lamps)


@dr.syntax
def _trace(
    scene: DeviceScene,
    emitters: Emitters,
    camera: DeviceCamera,
    fields: DeviceFields,
    pixel_width: tuple[Any, Any],
    first: Any,
    last: Any,
    key: Any,
    emitter_filter: EmitterFilter,
    by_lamp: ByLamp | None,
) -> tuple[Any, ...]:
    # Sums over samples, and the light of the path that is under way.
    outdoor, indoor = mi.Color3f(0), mi.Color3f(0)
    outdoor_even, indoor_even = mi.Color3f(0), mi.Color3f(0)
    albedo, normal = mi.Color3f(0), mi.Vector3f(0)
    n_bad = mi.UInt32(0)
    l_out, l_in = mi.Color3f(0), mi.Color3f(0)
    s = mi.UInt32(first)
    seen = mi.Bool(False)
    active = s < last
    x0, y0 = mi.Float(pixel_width[0] % pixel_width[1]), mi.Float(pixel_width[0] // pixel_width[1])
    path = camera_path(camera, x0, y0)
    fresh = mi.Bool(True)

    while active:
        # Start the next sample where the last path has ended.
        sampler = SobolSampler(key, s)
        at = film_position(sampler.get_2d(mi.UInt32(0)), fields.is_tent)
        path = dr.select(fresh, camera_path(camera, x0 + at.x, y0 + at.y), path)
        l_out, l_in = dr.select(fresh, mi.Color3f(0), l_out), dr.select(fresh, mi.Color3f(0), l_in)
        seen = seen & ~fresh

        path, result, alive = advance(
            scene, emitters, fields, sampler, path, emitter_filter, active
        )
        l_out += result.emitted_outdoor + result.direct_outdoor
        l_in += result.emitted_indoor + result.direct_indoor
        _add_by_lamp(by_lamp, result, active)

        # What the denoiser is told of the first surface that is not a mirror or glass.
        first_rough = result.is_rough & ~seen
        albedo += dr.select(first_rough, result.albedo, 0)
        albedo += dr.select(result.missed & ~seen, mi.Color3f(1), 0)
        normal += dr.select(first_rough, result.normal, 0)
        seen = seen | first_rough

        # Close the sample where the path ends.
        done = active & ~alive
        good = dr.isfinite(luminance(l_out)) & dr.isfinite(luminance(l_in))
        n_bad += dr.select(done & ~good, mi.UInt32(1), 0)
        even = done & good & ((s & 1) == 0)
        outdoor += dr.select(done & good, l_out, 0)
        indoor += dr.select(done & good, l_in, 0)
        outdoor_even += dr.select(even, l_out, 0)
        indoor_even += dr.select(even, l_in, 0)
        s = s + dr.select(done, mi.UInt32(1), 0)
        fresh = mi.Bool(done)
        active = s < last

    return outdoor, indoor, outdoor_even, indoor_even, albedo, normal, n_bad


def _add_by_lamp(by_lamp: ByLamp | None, result: StepResult, active: Any) -> None:
    """Add what a step found to the lamps it came from; what is not finite is left out."""
    if by_lamp is None:
        return
    met, lit = (
        (result.emitted_indoor, result.si.emitter),
        (result.direct_indoor, result.indoor_sample.emitter),
    )
    for light, lamp in (met, lit):
        level = luminance(light)
        brings = active & (level > 0) & dr.isfinite(level)
        for c in range(3):
            # A lane's place is its own: no copy of the sums for each thread.
            at = by_lamp.first + lamp * 3 + c
            dr.scatter_add(by_lamp.sums, light[c], at, brings, mode=dr.ReduceMode.NoConflicts)
