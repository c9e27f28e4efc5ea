"""Unidirectional path tracing of both light groups from one trace; kernels, no effects.

A lane takes up the next sample of its pixel as soon as a path ends, so that no lane of a packet
waits for the longest path. A lane sums its samples in order: the same seed gives the same bits.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any, Final, NamedTuple

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F32
from pbrs_farm.core.camera import Camera
from pbrs_farm.core.recipe import LightFields
from pbrs_farm.transport.kernels.arrival_rates import ArrivalCounts
from pbrs_farm.transport.kernels.bsdf import luminance
from pbrs_farm.transport.kernels.camera_rays import DeviceCamera, LensCamera, device_camera
from pbrs_farm.transport.kernels.device_scene import DeviceScene
from pbrs_farm.transport.kernels.emitters import Emitters
from pbrs_farm.transport.kernels.guiding_targets import NO_FACE
from pbrs_farm.transport.kernels.outdoor_choice import TechniqueCounts
from pbrs_farm.transport.kernels.path_state import (
    ALL_EMITTERS,
    NO_EMITTERS,
    EmitterFilter,
    MirroredRay,
    PathContext,
    PathState,
    StepResult,
    camera_path,
    device_fields,
    film_position,
)
from pbrs_farm.transport.kernels.path_step import advance
from pbrs_farm.transport.kernels.sampler import SobolSampler, device_array, stream_key
from pbrs_farm.transport.surface_noise import SurfaceStreams

_NULLS_APART: Final = (
    12  # random dimensions, in vertices, between a reflection in glass and the path behind it
)


@dataclass(frozen=True, slots=True, eq=False)
class SampleSums:
    """Sums over the samples of each lane, numpy, (N, 3) float32."""

    outdoor: F32  # radiance
    indoor: F32
    outdoor_even: F32  # of every second sample
    indoor_even: F32
    albedo: F32  # of the first surface other than mirror and glass
    normal: F32  # the same surface's
    n_bad: int  # paths that were not finite, left out
    lamps: F32 | None = None  # (N, L, 3) indoor light by lamp, if asked for
    # On request, of a first surface that scatters: its radiance if it were matte, without its coat
    # or the
    # view through it; and its diffuse colour alone.
    diffuse_outdoor: F32 | None = None
    diffuse_indoor: F32 | None = None
    diffuse_albedo: F32 | None = None
    diffuse_lamps: F32 | None = None  # as lamps
    counts: NDArray[np.uint32] | None = None  # TechniqueCounts.numpy(), of the pilot
    arrivals: NDArray[np.uint32] | None = None  # ArrivalCounts.numpy(), of a trial

    def __add__(self, other: SampleSums) -> SampleSums:
        def total(name: str) -> Any:
            a, b = getattr(self, name), getattr(other, name)
            return None if a is None or b is None else a + b

        return SampleSums(**{field.name: total(field.name) for field in fields(self)})

    def arrays(self) -> dict[str, Any]:
        """Its arrays by name, as sums_from_arrays takes them."""
        rows = {field.name: getattr(self, field.name) for field in fields(self)}
        return {name: np.asarray(row) for name, row in rows.items() if row is not None}


def sums_from_arrays(arrays: Mapping[str, Any]) -> SampleSums:
    """The sums whose arrays these are, among others."""
    rows = {f.name: arrays[f.name] for f in fields(SampleSums) if f.name in arrays}
    return SampleSums(**rows | {"n_bad": int(rows["n_bad"])})


@dataclass(frozen=True, slots=True)
class Lanes:
    """Which pixels to trace and how often.

    With n_only_* a lane is a pixel's light of one emitter: lane = pixel * n_only + emitter. A trial has
    all pixels twice, with the same random numbers: plain, then as the emitters' weights guide.
    """

    width: int  # of the picture
    height: int
    first_sample: int
    n_samples: int  # of each pixel
    seed: int
    n_only_lamps: int = 0  # 0, or the lamps that the pilot asks for one by one
    n_only_outdoor: int = 0  # the same, outdoor techniques
    n_lamps: int = 0  # 0, or the number of all lamps, to sum the light of each separately
    is_trial: bool = False  # count the shadow rays that arrive, too
    streams: SurfaceStreams | None = None  # of the pixels' random numbers; None: their own
    splits_diffuse: bool = False  # sum what first surfaces would send if they were matte, too

    @property
    def n_only(self) -> int:
        """Emitters asked for one by one."""
        return self.n_only_lamps + self.n_only_outdoor

    @property
    def n_lanes(self) -> int:
        """Lanes of a launch."""
        return self.n_streams * (2 if self.is_trial else 1)

    @property
    def n_streams(self) -> int:
        """Streams of random numbers."""
        return self.width * self.height * max(self.n_only, 1)


class _Numbers(NamedTuple):
    """The random numbers of a lane."""

    key: Any  # UInt32
    shift: Any = None  # Point2f, as SurfaceStreams.shifts; None: no shift

    def of_sample(self, s: Any) -> tuple[SobolSampler, Any]:
        """The numbers of sample s, and its position within the pixel, in [0, 1)."""
        sampler = SobolSampler(self.key, s)
        place = sampler.get_2d(mi.UInt32(0))
        if self.shift is not None:
            place = place - self.shift
            wraps = mi.Point2f(dr.select(place.x < 0, 1, 0), dr.select(place.y < 0, 1, 0))
            place = dr.minimum(place + wraps, 1 - 2.0**-24)
        return sampler, place


class _LampSums(NamedTuple):
    """Where a lane adds what each lamp brings."""

    sums: Any  # (lanes * lamps * 3,)
    first: Any  # the lane's first place there


@dataclass
class _MirroredPath:
    """Reflection at a sample's first glass, followed after the path through it has ended."""

    o: mi.Point3f
    d: mi.Vector3f
    beta: mi.Color3f
    depth: mi.UInt32
    n_nulls: mi.UInt32
    rest: mi.Float  # share in the guides of this path
    share: mi.Float  # of the path under way
    waits: mi.Bool
    met: mi.Bool  # such glass was met by this sample

    def start(self, fresh: Any) -> None:
        """Begin a sample."""
        self.share = dr.select(fresh, mi.Float(1), self.share)
        self.met = self.met & ~fresh

    def keep(self, ray: MirroredRay | None, path: PathState) -> None:
        """Keep the ray of the first glass that a sample meets; path: behind it."""
        if ray is None:
            return
        first = ray.is_there & ~self.met
        self.o = dr.select(first, ray.o, self.o)
        self.d = dr.select(first, ray.d, self.d)
        self.beta = dr.select(first, ray.beta, self.beta)
        self.depth = dr.select(first, path.depth, self.depth)
        # Its vertices take other random dimensions than those behind the glass.
        self.n_nulls = dr.select(first, path.n_nulls + _NULLS_APART, self.n_nulls)
        self.rest = dr.select(first, ray.share, self.rest)
        self.share = dr.select(first, 1 - ray.share, self.share)
        self.waits, self.met = self.waits | (first & ray.is_followed), self.met | first

    def path(self, behind: PathState) -> PathState:
        """The path of the stored ray; behind: the ended one.

        Roulette compares its light with that of the pixel. A tenth of a room is all that a dark window
        shows: thinned out as a faint part of a bright pixel it had twice a mirror's noise.
        """
        return PathState(
            o=self.o,
            d=self.d,
            beta=self.beta,
            faintness=dr.select(self.rest > 0, dr.max(self.beta) / self.rest, 1),
            depth=self.depth,
            n_nulls=self.n_nulls,
            met_glass=mi.Bool(True),
            reference=behind.reference,
            bsdf_pdf=mi.Float(0),
            guiding_odds=mi.Float(0),
            target_face=mi.UInt32(NO_FACE),
        )

    def turn(self, turns: Any) -> None:
        """Continue with the stored ray."""
        self.share = dr.select(turns, self.rest, self.share)
        self.waits = self.waits & ~turns


def _no_mirrored_path(path: PathState) -> _MirroredPath:
    return _MirroredPath(
        mi.Point3f(path.o),
        mi.Vector3f(path.d),
        mi.Color3f(0),
        mi.UInt32(0),
        mi.UInt32(0),
        mi.Float(0),
        mi.Float(1),
        mi.Bool(False),
        mi.Bool(False),
    )


@dataclass
class _DiffuseSums:
    """Sums of what first surfaces would send if they were matte, and of the path under way."""

    outdoor: mi.Color3f
    indoor: mi.Color3f
    albedo: mi.Color3f
    path_outdoor: mi.Color3f
    path_indoor: mi.Color3f
    onward: mi.Color3f  # by which what the path brings is to be multiplied
    looks: mi.Bool  # no surface has been met yet

    def start(self, fresh: Any) -> None:
        """Begin a sample."""
        for name in ("path_outdoor", "path_indoor", "onward"):
            setattr(self, name, dr.select(fresh, mi.Color3f(0), getattr(self, name)))
        self.looks = self.looks | fresh

    def add_step(self, result: StepResult, active: Any) -> tuple[Any, Any]:
        """Add what a step brings; its indoor light (what a ray meets, what shadow rays bring)."""
        assert result.white is not None
        si = result.si
        is_first = active & self.looks & result.is_rough
        kd = dr.select(is_first, si.bsdf.kd, 0)
        self.albedo += kd
        emitted = self.onward * result.emitted_indoor
        direct = kd * result.white.indoor + self.onward * result.direct_indoor
        self.path_outdoor += self.onward * (result.emitted_outdoor + result.direct_outdoor)
        self.path_outdoor += kd * result.white.outdoor
        self.path_indoor += emitted + direct
        self.onward = dr.select(is_first, kd * result.white.onward, self.onward)
        # Whatever is met first decides: a mirror, glass, the sky end the look; a hole does not.
        self.looks = self.looks & ~(active & (result.missed | (si.valid & ~si.is_cutout)))
        return emitted, direct

    def end(self, turns: Any) -> None:
        """Reflections in glass are not light of a surface."""
        self.onward = dr.select(turns, mi.Color3f(0), self.onward)
        self.looks = self.looks & ~turns

    def add_sample(self, done: Any) -> None:
        """Add the light of a path where it is done, if it is finite."""
        good = dr.isfinite(luminance(self.path_outdoor)) & dr.isfinite(luminance(self.path_indoor))
        self.outdoor += dr.select(done & good, self.path_outdoor, 0)
        self.indoor += dr.select(done & good, self.path_indoor, 0)


def _no_diffuse_sums() -> _DiffuseSums:
    return _DiffuseSums(
        mi.Color3f(0),
        mi.Color3f(0),
        mi.Color3f(0),
        mi.Color3f(0),
        mi.Color3f(0),
        mi.Color3f(0),
        mi.Bool(True),
    )


class _Beside(NamedTuple):
    """Where a lane adds values other than its pixel's sum."""

    lamps: _LampSums | None
    counts: TechniqueCounts
    arrivals: ArrivalCounts
    counts_arrivals: Any  # Bool
    diffuse_lamps: _LampSums | None = None


@dataclass
class _LaneSums:
    """Sums over the samples of a lane, as SampleSums."""

    outdoor: mi.Color3f
    indoor: mi.Color3f
    outdoor_even: mi.Color3f
    indoor_even: mi.Color3f
    albedo: mi.Color3f
    normal: mi.Vector3f
    n_bad: mi.UInt32

    def add_guides(self, result: StepResult, seen: Any, first_rough: Any, share: Any) -> None:
        """Add albedo and normal of the first rough surface, for the denoiser, times share."""
        self.albedo += dr.select(first_rough, share * result.albedo, 0)
        self.albedo += dr.select(result.missed & ~seen, share * result.sky_albedo, 0)
        self.normal += dr.select(first_rough, share * result.si.n, 0)

    def add_sample(self, l_out: Any, l_in: Any, sample: Any, done: Any) -> None:
        """Add the radiance of a path where it is done; count those that are not finite."""
        good = dr.isfinite(luminance(l_out)) & dr.isfinite(luminance(l_in))
        self.n_bad += dr.select(done & ~good, mi.UInt32(1), 0)
        even = done & good & ((sample & 1) == 0)
        self.outdoor += dr.select(done & good, l_out, 0)
        self.indoor += dr.select(done & good, l_in, 0)
        self.outdoor_even += dr.select(even, l_out, 0)
        self.indoor_even += dr.select(even, l_in, 0)


def trace(
    scene: DeviceScene,
    emitters: Emitters,
    camera: Camera,
    lanes: Lanes,
    light: LightFields,
    *,
    max_depth: int | None = None,
) -> SampleSums:
    """The sums over lanes.n_samples paths of every lane, from lanes.first_sample on.

    Sums of consecutive ranges of samples add up to those of the whole range, so a render can be cut
    into launches. max_depth: segments of a path, the
    camera's among them, instead of the recipe's: 2 is light that met one surface. Equal
    arguments give equal bits on one machine.
    """
    # The pilot samples one technique at a time, and sunlit points are not one of them. Trace them
    # before
    # any part of the kernel exists, or the kernel would differ between scenes with and without
    # points.
    sunlit, n_samples = emitters.sunlit, lanes.n_lanes * lanes.n_samples
    seed = (lanes.seed + 0x9E3779B9 * lanes.first_sample) & 0xFFFFFFFF
    sunlit.trace(scene, emitters.sun, n_samples if lanes.n_only == 0 else 0, seed)
    # A lane is a pixel, or a pixel and an emitter filter; of a trial, the first half stay plain.
    lane = dr.arange(mi.UInt32, lanes.n_lanes)
    stream = lane % dr.opaque(mi.UInt32, lanes.n_streams)
    may_guide = lane >= dr.opaque(mi.UInt32, lanes.n_streams if lanes.is_trial else 0)
    pixel, emitter_filter = _pixels_and_emitters(stream, lanes)
    lamp_sums = _no_lamp_sums(lane, lanes)
    diffuse_lamps = _no_lamp_sums(lane, lanes) if lanes.splits_diffuse else None
    counts, arrivals = emitters.outdoor_choice.no_counts(), emitters.arrival.no_counts()
    counts_arrivals = dr.opaque(mi.Bool, lanes.is_trial)
    # Opaque numbers are arguments of the kernel: another seed compiles nothing anew.
    depth_fields = device_fields(light, max_depth=max_depth)
    total, diffuse = _trace(
        PathContext(
            scene,
            emitters,
            depth_fields,
            emitter_filter,
            sunlit,
            may_guide,
            splits_glass=True,
            splits_white=lanes.splits_diffuse,
        ),
        device_camera(camera),
        (pixel, dr.opaque(mi.UInt32, lanes.width)),
        dr.opaque(mi.UInt32, lanes.first_sample),
        dr.opaque(mi.UInt32, lanes.first_sample + lanes.n_samples),
        _numbers(stream, lanes),
        _Beside(lamp_sums, counts, arrivals, counts_arrivals, diffuse_lamps),
    )
    dr.eval(total, diffuse, counts, arrivals)
    rows = {f.name: _channels(getattr(total, f.name)) for f in fields(total) if f.name != "n_bad"}
    if diffuse is not None:
        for name in ("outdoor", "indoor", "albedo"):
            rows[f"diffuse_{name}"] = _channels(getattr(diffuse, name))
    if lamp_sums is not None:
        rows["lamps"] = lamp_sums.sums.numpy().reshape(lanes.n_lanes, lanes.n_lamps, 3)
    if diffuse_lamps is not None:
        by_lamp = diffuse_lamps.sums.numpy().reshape(lanes.n_lanes, lanes.n_lamps, 3)
        rows["diffuse_lamps"] = by_lamp
    n_bad = int(np.sum(total.n_bad.numpy(), dtype=np.int64))
    of_pilot = counts.numpy() if lanes.n_only_outdoor > 0 else None
    of_trial = arrivals.numpy() if lanes.is_trial else None
    return SampleSums(**rows, n_bad=n_bad, counts=of_pilot, arrivals=of_trial)


def _channels(colour: Any) -> F32:
    """(N, 3), read channel by channel: Dr.Jit would copy all three by a separate kernel."""
    return np.stack([c.numpy() for c in colour], axis=-1)


def _no_lamp_sums(lane: Any, lanes: Lanes) -> _LampSums | None:
    if lanes.n_lamps == 0:
        return None
    sums = dr.zeros(mi.Float, lanes.n_lanes * lanes.n_lamps * 3)
    return _LampSums(sums, lane * dr.opaque(mi.UInt32, lanes.n_lamps * 3))


def _numbers(stream: Any, lanes: Lanes) -> _Numbers:
    """The random numbers of each lane: arguments of the kernel, wherever they come from."""
    seed, shift = dr.opaque(mi.UInt32, lanes.seed & 0xFFFFFFFF), None
    if lanes.streams is not None:
        stream = device_array(mi.UInt32, lanes.streams.names)
        x, y = (np.ascontiguousarray(axis) for axis in lanes.streams.shifts.T)
        shift = mi.Point2f(device_array(mi.Float, x), device_array(mi.Float, y))
    numbers = _Numbers(stream_key(stream, seed), shift)
    dr.eval(numbers)
    return numbers


def _pixels_and_emitters(stream: Any, lanes: Lanes) -> tuple[Any, EmitterFilter]:
    """(pixel, emitters that count) of each stream: all of them, or for the pilot a single one."""
    per_pixel = dr.opaque(mi.UInt32, max(lanes.n_only, 1))
    pixel, number = stream // per_pixel, mi.Int32(stream % per_pixel)
    n_lamps = dr.opaque(mi.Int32, lanes.n_only_lamps)
    is_single, is_lamp = dr.opaque(mi.Bool, lanes.n_only > 0), number < n_lamps
    indoor = dr.select(is_lamp, number, NO_EMITTERS)
    outdoor = dr.select(is_lamp, NO_EMITTERS, number - n_lamps)
    return pixel, EmitterFilter(
        indoor=dr.select(is_single, indoor, ALL_EMITTERS),
        outdoor=dr.select(is_single, outdoor, ALL_EMITTERS),
    )


@dr.syntax
def _trace(
    context: PathContext,
    camera: DeviceCamera | LensCamera,
    pixel_width: tuple[Any, Any],
    first: Any,
    last: Any,
    numbers: _Numbers,
    beside: _Beside,
) -> tuple[_LaneSums, _DiffuseSums | None]:
    sums = _LaneSums(
        mi.Color3f(0),
        mi.Color3f(0),
        mi.Color3f(0),
        mi.Color3f(0),
        mi.Color3f(0),
        mi.Vector3f(0),
        mi.UInt32(0),
    )
    l_out, l_in = mi.Color3f(0), mi.Color3f(0)  # light of the path under way
    s = mi.UInt32(first)  # its sample
    is_past_rough = mi.Bool(False)  # whether it has met a rough surface
    fresh = mi.Bool(True)  # whether it has yet to start
    active = s < last
    x0, y0 = mi.Float(pixel_width[0] % pixel_width[1]), mi.Float(pixel_width[0] // pixel_width[1])
    corner = mi.Point2f(x0, y0)
    path = camera_path(camera, corner, mi.Point2f(0))
    pane = _no_mirrored_path(path)
    diffuse: Any = None
    if dr.hint(context.splits_white, mode="scalar"):
        diffuse = _no_diffuse_sums()

    # Constants are excluded from the state of the loop, or Dr.Jit traces its code twice.
    while dr.hint(active, exclude=[context, camera, corner, last, numbers, beside]):
        # Start the next sample where the last path has ended.
        sampler, place = numbers.of_sample(s)
        sample = film_position(place, context.fields.is_tent)
        path = dr.select(fresh, camera_path(camera, corner, sample, sampler), path)
        l_out, l_in = dr.select(fresh, mi.Color3f(0), l_out), dr.select(fresh, mi.Color3f(0), l_in)
        is_past_rough = is_past_rough & ~fresh
        pane.start(fresh)
        if dr.hint(context.splits_white, mode="scalar"):
            diffuse.start(fresh)

        # Go on by a vertex, and add what that brings.
        path, result, alive = advance(context, sampler, path, active)
        l_out += result.emitted_outdoor + result.direct_outdoor
        l_in += result.emitted_indoor + result.direct_indoor
        _add_by_lamp(beside.lamps, result, (result.emitted_indoor, result.direct_indoor), active)
        if dr.hint(context.splits_white, mode="scalar"):
            brought = diffuse.add_step(result, active)
            _add_by_lamp(beside.diffuse_lamps, result, brought, active)
        _count_techniques(beside.counts, context, result, active)
        _count_arrivals(beside, context, result, active)
        first_rough = result.is_rough & ~is_past_rough
        sums.add_guides(result, is_past_rough, first_rough, pane.share)
        is_past_rough = is_past_rough | first_rough

        # Where the path ends, follow what glass has mirrored; close the sample where it has not.
        done = active & ~alive
        if dr.hint(result.mirrored is not None, mode="scalar"):
            pane.keep(result.mirrored, path)
            turns = done & pane.waits
            path = dr.select(turns, pane.path(path), path)
            pane.turn(turns)
            is_past_rough, done = is_past_rough & ~turns, done & ~turns
            if dr.hint(context.splits_white, mode="scalar"):
                diffuse.end(turns)
        if dr.hint(context.splits_white, mode="scalar"):
            diffuse.add_sample(done)
        sums.add_sample(l_out, l_in, s, done)
        s = s + dr.select(done, mi.UInt32(1), 0)
        fresh = mi.Bool(done)
        active = s < last

    return sums, diffuse


def _count_techniques(
    counts: TechniqueCounts, context: PathContext, result: StepResult, active: Any
) -> None:
    """Count the vertices of a lane that asks for one outdoor technique, and what that brings."""
    technique = context.emitter_filter.outdoor
    brought = luminance(result.direct_outdoor)
    choice = context.emitters.outdoor_choice
    choice.count(counts, result.si.p, technique, active & result.is_rough, brought)


def _count_arrivals(beside: _Beside, context: PathContext, result: StepResult, active: Any) -> None:
    """Count the shadow rays that a step has cast, and those that arrived."""
    for sample in (result.outdoor_sample, result.indoor_sample, result.sunlit_sample):
        if sample.kind is not None:
            is_cast = active & beside.counts_arrivals & sample.is_cast
            arrival = context.emitters.arrival
            arrival.count(beside.arrivals, result.si.p, sample.kind, is_cast, sample.arrives)


def _add_by_lamp(
    lamp_sums: _LampSums | None, result: StepResult, brought: tuple[Any, Any], active: Any
) -> None:
    """Add what a step brought (of what its ray met, by shadow rays) to the lamps it came from.

    What is not finite is left out.
    """
    if lamp_sums is None:
        return
    emitted = brought[0], result.si.emitter
    direct = brought[1], result.indoor_sample.emitter
    for light, lamp in (emitted, direct):
        y = luminance(light)
        is_lit = active & (y > 0) & dr.isfinite(y)
        for c in range(3):
            # A lane's place is its own: no copy of the sums for each thread.
            place = lamp_sums.first + lamp * 3 + c
            dr.scatter_add(lamp_sums.sums, light[c], place, is_lit, mode=dr.ReduceMode.NoConflicts)
