"""Primary-sample-space Metropolis light transport over the camera path: `pssmlt-camera`.

Kelemen et al. 2002. A path is a function of a point u of the unit cube: two numbers for the film,
ten for each vertex (walk.py). With F(u) its radiance beyond direct light and I(u) its luminance,
each of many chains in parallel

    1. proposes u' : with chance p a fresh point (large step), else every number moved a little,
    2. accepts it with chance a = min(1, I(u') / I(u)),
    3. adds a F(u') / I(u') and (1 - a) F(u) / I(u) to the film (expected values),

so that the film converges to b F / I weighted by I / b, with b the mean of I, known from the
bootstrap and from all large steps. Chains start at bootstrap paths drawn in proportion to I.

A proposal is never stored: every number is mutated by a hash of (chain, step, dimension) when the
path asks for it, and again when it is accepted. Numbers beyond STORED_DIMS are fresh in every
proposal, which is a large step in those dimensions. A chain's numbers stay in local memory while
a launch runs; a lane starts its next mutation as soon as its path ends. No effects.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from pbrs_farm.camera import Camera
from pbrs_farm.lighting import Group
from pbrs_farm.recipe import LightFields
from pbrs_farm.transport.bsdf import luminance
from pbrs_farm.transport.emitters import Emitters
from pbrs_farm.transport.numbers import (
    CAMERA_DIMS,
    VERTEX_DIMS,
    HashedNumbers,
    hash32,
    stream_key,
    unit_float,
)
from pbrs_farm.transport.surface import Stage
from pbrs_farm.transport.walk import (
    CameraRow,
    FieldsRow,
    Only,
    advance,
    camera_row,
    fields_row,
    film_position,
    start,
)

STORED_DIMS: Final = CAMERA_DIMS + VERTEX_DIMS * 7
_SMALLEST, _LARGEST = 1 / 1024, 1 / 64
_FILM_STEP: Final = 2.0
_RR_DEPTH: Final = 4
_STEPS_PER_LAUNCH: Final = 32
_MIN_STEPS: Final = 64
_BOOTSTRAP: Final = (1 << 14, 1 << 18)


@dataclass(frozen=True, slots=True, eq=False)
class Estimate:
    """Light beyond direct of one group by Metropolis.

    halves: two (H, W, 3) float32 radiance pictures of independent chains. b: mean luminance of a
    path. acceptance: of small and large steps together. n_mutations; n_bad: paths not finite.
    """

    halves: tuple[NDArray[np.float32], NDArray[np.float32]]
    b: float
    acceptance: float
    n_mutations: int
    n_bad: int


class MutatedNumbers:
    """The numbers of a proposal: the chain's own, each moved a little, or all fresh."""

    def __init__(self, chain: Any, key: Any, is_large: Any) -> None:
        self._chain, self._key, self._is_large = chain, key, is_large

    def one(self, dim: Any) -> Any:
        """Float of one dimension."""
        dim = mi.UInt32(dim)
        fresh = unit_float(hash32(self._key ^ hash32(dim + 0x85EBCA6B)))
        stored = dim < STORED_DIMS
        old = self._chain.read(dr.minimum(dim, STORED_DIMS - 1))

        # Kelemen's step: between the smallest and the largest, small ones more often.
        up = fresh < 0.5
        v = dr.select(up, 2 * fresh, 2 * fresh - 1)
        reach = dr.select(dim < CAMERA_DIMS, _FILM_STEP, 1.0)
        step = reach * _LARGEST * dr.exp2(v * float(np.log2(_SMALLEST / _LARGEST)))
        moved = old + dr.select(up, step, -step)
        moved = moved - dr.floor(moved)
        return dr.minimum(dr.select(self._is_large | ~stored, fresh, moved), 1 - 2**-24)

    def two(self, dim: Any) -> Any:
        """Point2f of dimensions dim and dim + 1."""
        return mi.Point2f(self.one(dim), self.one(mi.UInt32(dim) + 1))


class Film(NamedTuple):
    """Size of the picture, opaque; splats: (2 * pixels * 3,) sums of the two halves."""

    width: Any
    height: Any
    splats: Any


class Chains(NamedTuple):
    """Where every chain stands. numbers: (STORED_DIMS * N,), dimension by dimension."""

    numbers: Any
    light: Any
    level: Any
    pixel: Any


def metropolis(
    stage: Stage,
    emitters: Emitters,
    camera: Camera,
    group: Group,
    fields: LightFields,
    seed: int,
    *,
    min_segments: int = 3,
    deadline: float | None = None,
) -> Estimate:
    """Light of paths of min_segments or more (3: all but direct light) of one group.

    fields.mutations_per_pixel counts unless deadline (time.monotonic()) is given: then mutations
    go on until it has passed.
    """
    i = camera.intrinsics
    n_pixels = i.width_px * i.height_px
    wanted = fields.mutations_per_pixel * n_pixels
    n_chains = int(np.clip(wanted // _MIN_STEPS, 16, fields.chains)) & ~1
    splats = dr.zeros(mi.Float, 2 * n_pixels * 3)
    film = Film(dr.opaque(mi.UInt32, i.width_px), dr.opaque(mi.UInt32, i.height_px), splats)
    off = dr.opaque(mi.Int32, -2)
    on = dr.opaque(mi.Int32, -1)
    only = Only(on, off) if group is Group.INDOOR else Only(off, on)
    # Roulette late: where it ends a path early, the path's neighbours are lost to the chain too.
    late = fields.model_copy(update={"rr_depth": max(fields.rr_depth, _RR_DEPTH)})
    scene = (stage, emitters, camera_row(camera), fields_row(late), only)
    segments = dr.opaque(mi.UInt32, min_segments)

    # Bootstrap: independent paths; chains start at some of them, drawn in proportion to I.
    n_bootstrap = int(np.clip(wanted // 4, *_BOOTSTRAP))
    key = stream_key(dr.arange(mi.UInt32, n_bootstrap), dr.opaque(mi.UInt32, seed & 0xFFFFFFFF))
    light, pixel = _paths(*scene, film, segments, HashedNumbers(key, mi.UInt32(0)))
    level = luminance(light)
    level = dr.select(dr.isfinite(level), level, 0)
    dr.eval(light, pixel, level)
    levels = level.numpy().astype(np.float64)
    black = np.zeros((i.height_px, i.width_px, 3), np.float32)
    if levels.sum() <= 0:
        return Estimate((black, black), 0.0, 0.0, 0, 0)
    offsets = (np.arange(n_chains) + np.random.default_rng(seed).random()) / n_chains
    chosen = np.searchsorted(np.cumsum(levels) / levels.sum(), offsets)
    chosen = np.random.default_rng(seed + 1).permutation(np.minimum(chosen, n_bootstrap - 1))
    chains = _chains_at(mi.UInt32(chosen.astype(np.uint32)), key, light, level, pixel)

    n_steps = -(-wanted // n_chains)
    total, n_total = levels.sum(), float(n_bootstrap)
    accepted, n_bad, done = 0.0, 0, 0
    while done < n_steps if deadline is None else (done == 0 or time.monotonic() < deadline):
        n = min(_STEPS_PER_LAUNCH, n_steps - done) if deadline is None else _STEPS_PER_LAUNCH
        steps = dr.opaque(mi.UInt32, done), dr.opaque(mi.UInt32, done + n)
        p_large = dr.opaque(mi.Float, fields.large_step)
        chains, sums = _mutate(*scene, film, segments, chains, steps, p_large, seed_of(seed))
        dr.eval(*chains, sums, film.splats)
        total += float(np.sum(sums[0].numpy(), dtype=np.float64))
        n_total += float(np.sum(sums[1].numpy(), dtype=np.float64))
        accepted += float(np.sum(sums[2].numpy(), dtype=np.float64))
        n_bad += int(np.sum(sums[3].numpy(), dtype=np.int64))
        done += n
    b = float(total / n_total)
    splat = film.splats.numpy().reshape(2, i.height_px, i.width_px, 3)
    scale = b * n_pixels / (done * n_chains / 2)
    halves = (splat[0] * np.float32(scale), splat[1] * np.float32(scale))
    return Estimate(halves, b, accepted / (done * n_chains), done * n_chains, n_bad)


def seed_of(seed: int) -> Any:
    """The seed of the mutations, apart from the bootstrap's."""
    return dr.opaque(mi.UInt32, (seed ^ 0x3C6EF372) & 0xFFFFFFFF)


@dr.syntax
def _mutate(
    stage: Stage,
    emitters: Emitters,
    camera: CameraRow,
    fields: FieldsRow,
    only: Only,
    film: Film,
    segments: Any,
    chains: Chains,
    steps: tuple[Any, Any],
    p_large: Any,
    seed: Any,
) -> tuple[Chains, tuple[Any, ...]]:
    n_chains = dr.width(chains.level)
    lane = dr.arange(mi.UInt32, n_chains)
    numbers = dr.alloc_local(mi.Float, STORED_DIMS)
    dim = mi.UInt32(0)
    while dim < STORED_DIMS:
        numbers.write(dr.gather(mi.Float, chains.numbers, dim * n_chains + lane), dim)
        dim += 1

    # x is where a chain stands, y what it proposes.
    x_light, x_level, x_pixel = chains.light, chains.level, chains.pixel
    x_weight = mi.Float(0)
    y_light = mi.Color3f(0)
    large_sum, large_count = mi.Float(0), mi.Float(0)
    n_accepted, n_bad = mi.Float(0), mi.UInt32(0)
    step = mi.UInt32(steps[0])
    chain_key = stream_key(lane, seed)
    walk = start(camera, mi.Float(0) * mi.Float(lane), mi.Float(0))
    fresh = mi.Bool(True)
    active = step < steps[1]

    while active:
        # 1. Propose; the path's first ray leaves through the film position of dimensions 0 and 1.
        key = hash32(chain_key ^ hash32(step + 0x9E3779B9))
        is_large = unit_float(hash32(key ^ 0x51ED270B)) < p_large
        proposal = MutatedNumbers(numbers, key, is_large)
        y_pixel, at = _film_point(film, proposal.two(mi.UInt32(0)), fields.is_tent)
        walk = dr.select(fresh, start(camera, at.x, at.y), walk)
        y_light = dr.select(fresh, mi.Color3f(0), y_light)
        before = walk.depth
        walk, found, alive = advance(stage, emitters, fields, proposal, walk, only, active)
        met, lit = before + 1 >= segments, walk.depth + 1 >= segments
        y_light += dr.select(met, found.met_outdoor + found.met_indoor, 0)
        y_light += dr.select(lit, found.lit_outdoor + found.lit_indoor, 0)
        done = active & ~alive

        # 2. Accept or stay.
        good = dr.isfinite(luminance(y_light))
        n_bad += dr.select(done & ~good, mi.UInt32(1), 0)
        y_light = dr.select(good, y_light, 0)
        y_level = luminance(y_light)
        a = dr.select(x_level > 0, dr.minimum(y_level / x_level, 1), 1)
        accept = done & (unit_float(hash32(key ^ 0x2545F491)) < a)
        n_accepted += dr.select(accept, mi.Float(1), 0)
        large_sum += dr.select(done & is_large, y_level, 0)
        large_count += dr.select(done & is_large, mi.Float(1), 0)

        # 3. Splat what is left behind: the old point with all it has gathered, or the refused one.
        x_weight += dr.select(done, 1 - a, 0)
        _splat(
            film,
            lane,
            dr.select(accept, x_pixel, y_pixel),
            dr.select(accept, x_light, y_light),
            dr.select(accept, x_level, y_level),
            dr.select(accept, x_weight, a),
            done,
        )
        x_pixel = dr.select(accept, y_pixel, x_pixel)
        x_light = dr.select(accept, y_light, x_light)
        x_level = dr.select(accept, y_level, x_level)
        x_weight = dr.select(accept, a, x_weight)
        dim = mi.UInt32(0)
        updating = mi.Bool(accept)
        while updating:
            numbers.write(proposal.one(dim), dim)
            dim += 1
            updating = updating & (dim < STORED_DIMS)

        step += dr.select(done, mi.UInt32(1), 0)
        fresh = mi.Bool(done)
        active = step < steps[1]

    _splat(film, lane, x_pixel, x_light, x_level, x_weight, mi.Bool(True))
    kept = dr.empty(mi.Float, STORED_DIMS * n_chains)
    dim = mi.UInt32(0)
    while dim < STORED_DIMS:
        dr.scatter(kept, numbers.read(dim), dim * n_chains + lane)
        dim += 1
    sums = large_sum, large_count, n_accepted, n_bad
    return Chains(kept, x_light, x_level, x_pixel), sums


@dr.syntax
def _paths(
    stage: Stage,
    emitters: Emitters,
    camera: CameraRow,
    fields: FieldsRow,
    only: Only,
    film: Film,
    segments: Any,
    numbers: HashedNumbers,
) -> tuple[Any, Any]:
    """(light beyond direct, pixel) of one path per lane."""
    pixel, at = _film_point(film, numbers.two(mi.UInt32(0)), fields.is_tent)
    walk = start(camera, at.x, at.y)
    light = mi.Color3f(0)
    active = mi.Bool(True)
    while active:
        before = walk.depth
        walk, found, alive = advance(stage, emitters, fields, numbers, walk, only, active)
        met, lit = before + 1 >= segments, walk.depth + 1 >= segments
        light += dr.select(active & met, found.met_outdoor + found.met_indoor, 0)
        light += dr.select(active & lit, found.lit_outdoor + found.lit_indoor, 0)
        active = active & alive
    return light, pixel


def _chains_at(chosen: Any, key: Any, light: Any, level: Any, pixel: Any) -> Chains:
    """Chains that stand at the chosen bootstrap paths."""
    n = len(chosen)
    index = dr.arange(mi.UInt32, STORED_DIMS * n)
    keys = dr.gather(mi.UInt32, key, dr.gather(mi.UInt32, chosen, index % n))
    numbers = HashedNumbers(keys, mi.UInt32(0)).one(index // n)
    chains = Chains(
        numbers,
        dr.gather(mi.Color3f, light, chosen),
        dr.gather(mi.Float, level, chosen),
        dr.gather(mi.UInt32, pixel, chosen),
    )
    dr.eval(*chains)
    return chains


def _film_point(film: Film, u: Any, is_tent: Any) -> tuple[Any, Any]:
    """(pixel index, film position in pixels spread by the filter) of two numbers."""
    x, y = u.x * mi.Float(film.width), u.y * mi.Float(film.height)
    column = dr.minimum(mi.UInt32(x), film.width - 1)
    row = dr.minimum(mi.UInt32(y), film.height - 1)
    inside = mi.Point2f(dr.clip(x - mi.Float(column), 0, 1), dr.clip(y - mi.Float(row), 0, 1))
    at = film_position(inside, is_tent) + mi.Point2f(mi.Float(column), mi.Float(row))
    return row * film.width + column, at


def _splat(
    film: Film, lane: Any, pixel: Any, light: Any, level: Any, weight: Any, active: Any
) -> None:
    active = active & (level > 0) & (weight > 0)
    value = light * (weight / dr.select(level > 0, level, 1))
    base = ((lane & 1) * (film.width * film.height) + pixel) * 3
    for c in range(3):
        dr.scatter_add(film.splats, value[c], base + c, active)
