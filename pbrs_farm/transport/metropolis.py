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
from pbrs_farm.transport.film import Film, film_point, level_of, splat
from pbrs_farm.transport.numbers import (
    CAMERA_DIMS,
    VERTEX_DIMS,
    HashedNumbers,
    Numbers,
    device_array,
    hash32,
    stream_key,
    unit_float,
)
from pbrs_farm.transport.surface import Stage
from pbrs_farm.transport.tails import (
    NEAR_M,
    TAIL_FLOATS,
    close_tail,
    deal,
    first_vertices,
    show_tails,
    write_tail,
)
from pbrs_farm.transport.walk import (
    CameraRow,
    FieldsRow,
    Only,
    Walk,
    advance,
    camera_row,
    fields_row,
    start,
)

STORED_DIMS: Final = CAMERA_DIMS + VERTEX_DIMS * 7
_SMALLEST, _LARGEST = 1 / 1024, 1 / 64
_FILM_STEP: Final = 2.0
_RR_DEPTH: Final = 3
_STEPS_PER_LAUNCH: Final = 8
_MIN_STEPS: Final = 64
_TAIL_SEGMENTS: Final = 3
_BOOTSTRAP_SHARE: Final = 4
_ROUNDS_PER_HEAD: Final = 4
_PATHS_PER_TILE: Final = 256
_FLOOR: Final = 0.05
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


class Chains(NamedTuple):
    """Where every chain stands. numbers: (STORED_DIMS * N,), dimension by dimension.

    is_shared: whether its tail can be shown from other pixels; tails: (TAIL_FLOATS * N,),
    number by number.
    """

    numbers: Any
    light: Any
    level: Any
    pixel: Any
    is_shared: Any
    tails: Any


@dataclass
class Trial:
    """A path under way, in two parts: up to its second vertex, and beyond.

    walk: beyond the second vertex with a throughput of its own. light: of the first part; head:
    throughput up to the second vertex; tail: light from beyond, head not counted. is_straight:
    the first vertex is rough and nothing was passed since; is_shared: see tails.py.
    """

    walk: Walk
    light: mi.Color3f
    head: mi.Color3f
    tail: mi.Color3f
    is_straight: mi.Bool
    is_shared: mi.Bool


class Rules(NamedTuple):
    """What is asked of every path: the scene, the emitters that count, from how many segments."""

    stage: Stage
    emitters: Emitters
    camera: CameraRow
    fields: FieldsRow
    only: Only
    segments: Any


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
    black = np.zeros((i.height_px, i.width_px, 3), np.float32)
    if not emitters.has_group(group):
        return Estimate((black, black), 0.0, 0.0, 0, 0)
    n_pixels = i.width_px * i.height_px
    wanted = fields.mutations_per_pixel * n_pixels
    n_chains = int(np.clip(wanted // _MIN_STEPS, 16, fields.chains)) & ~1
    splats = dr.zeros(mi.Float, 2 * n_pixels * 3)
    flat = device_array(mi.Float, np.ones(n_pixels, np.float32))
    film = Film(dr.opaque(mi.UInt32, i.width_px), dr.opaque(mi.UInt32, i.height_px), splats, flat)
    on = dr.opaque(mi.Int32, -1)
    only = Only(on, None) if group is Group.INDOOR else Only(None, on)
    # Roulette late: where it ends a path early, the path's neighbours are lost to the chain too.
    late = fields.model_copy(update={"rr_depth": max(fields.rr_depth, _RR_DEPTH)})
    segments = dr.opaque(mi.UInt32, min_segments)
    rules = Rules(stage, emitters, camera_row(camera), fields_row(late), only, segments)

    n_bootstrap = int(np.clip(wanted // _BOOTSTRAP_SHARE, *_BOOTSTRAP))
    pilot = _drawn(rules, film, n_bootstrap // 4, seed ^ 0x5BD1E995)
    shape = (i.height_px, i.width_px)
    importance = importance_of(shape, pilot.pixel.numpy(), pilot.level.numpy())
    film = film._replace(importance=device_array(mi.Float, importance.ravel()))
    chains, total = _started(rules, film, n_bootstrap, n_chains, seed)
    if chains is None:
        return Estimate((black, black), 0.0, 0.0, 0, 0)

    n_heads = fields.tail_pixels if min_segments >= _TAIL_SEGMENTS else 0
    n_steps = -(-wanted // n_chains)
    n_total = float(n_bootstrap)
    accepted, n_bad, done = 0.0, 0, 0
    n_rounds, heads = 0, None
    p_large = dr.opaque(mi.Float, fields.large_step)
    while done < n_steps if deadline is None else (done == 0 or time.monotonic() < deadline):
        n = min(_STEPS_PER_LAUNCH, n_steps - done) if deadline is None else _STEPS_PER_LAUNCH
        steps = dr.opaque(mi.UInt32, done), dr.opaque(mi.UInt32, done + n)
        shares = dr.opaque(mi.Bool, n_heads > 0)
        chains, sums = _mutate(rules, film, chains, steps, p_large, seed_of(seed), shares)
        dr.eval(*chains, sums, film.splats)
        if n_heads > 0:
            if n_rounds % _ROUNDS_PER_HEAD == 0:
                heads = first_vertices(
                    *rules[:2], rules.fields, rules.camera, film, n_pixels, seed + done
                )
            groups = deal(i.width_px, i.height_px, n_heads, seed + done)
            weight = dr.opaque(mi.Float, n)
            show_tails(
                stage, film, heads, groups, chains.tails, chains.pixel, chains.is_shared, weight
            )
            n_rounds += 1
        total += float(np.sum(sums[0].numpy(), dtype=np.float64))
        n_total += float(np.sum(sums[1].numpy(), dtype=np.float64))
        accepted += float(np.sum(sums[2].numpy(), dtype=np.float64))
        n_bad += int(np.sum(sums[3].numpy(), dtype=np.int64))
        done += n
    b = float(total / n_total)
    halves = splats.numpy().reshape(2, i.height_px, i.width_px, 3)
    scale = np.float32(b * n_pixels / (done * n_chains / 2))
    halves = (halves[0] * scale, halves[1] * scale)
    return Estimate(halves, b, accepted / (done * n_chains), done * n_chains, n_bad)


def importance_of(
    shape: tuple[int, int], pixels: NDArray[np.uint32], levels: NDArray[np.float32]
) -> NDArray[np.float32]:
    """(H, W) what a unit of luminance counts: about 1 / the light expected at a pixel.

    Without it chains go where the picture is bright; with it every pixel gets its share (Veach's
    two stages, 1997). From N paths, their pixels and luminances: means over tiles of about
    PATHS_PER_TILE, blended between tiles, held above FLOOR of the mean. Any positive values are
    unbiased.
    """
    height, width = shape
    side = max(int(np.sqrt(_PATHS_PER_TILE * height * width / len(pixels))), 1)
    rows, columns = -(-height // side), -(-width // side)
    tile = (pixels // width // side) * columns + pixels % width // side
    count = np.bincount(tile, minlength=rows * columns)
    total = np.bincount(tile, levels.astype(np.float64), rows * columns)
    grid = (total / np.maximum(count, 1)).reshape(rows, columns)
    mean = grid.mean()
    if not mean > 0:
        return np.ones(shape, np.float32)
    y, x = (_between(n, side, m) for n, m in ((height, rows), (width, columns)))
    light = y @ grid @ x.T
    return np.asarray(mean / (light + _FLOOR * mean), np.float32)


def _between(n: int, side: int, n_tiles: int) -> NDArray[np.float64]:
    """(n, n_tiles) linear weights of tiles of `side` pixels at each of n pixels."""
    at = np.clip((np.arange(n) + 0.5) / side - 0.5, 0, n_tiles - 1)
    return np.maximum(1 - np.abs(at[:, None] - np.arange(n_tiles)[None]), 0)


def _path_keys(n: int, seed: int) -> Any:
    return stream_key(dr.arange(mi.UInt32, n), dr.opaque(mi.UInt32, seed & 0xFFFFFFFF))


def _drawn(rules: Rules, film: Film, n: int, seed: int) -> Chains:
    """n independent paths."""
    found = _paths(rules, film, HashedNumbers(_path_keys(n, seed), mi.UInt32(0)))
    dr.eval(*found)
    return found


def _started(
    rules: Rules, film: Film, n_bootstrap: int, n_chains: int, seed: int
) -> tuple[Chains | None, float]:
    """(chains at independent paths, drawn in proportion to I; sum of I over n_bootstrap paths).

    None where no path brings light.
    """
    found = _drawn(rules, film, n_bootstrap, seed)
    key = _path_keys(n_bootstrap, seed)
    levels = found.level.numpy().astype(np.float64)
    if levels.sum() <= 0:
        return None, 0.0
    offsets = (np.arange(n_chains) + np.random.default_rng(seed).random()) / n_chains
    chosen = np.searchsorted(np.cumsum(levels) / levels.sum(), offsets)
    chosen = np.random.default_rng(seed + 1).permutation(np.minimum(chosen, n_bootstrap - 1))
    at = mi.UInt32(chosen.astype(np.uint32))
    index = dr.arange(mi.UInt32, STORED_DIMS * n_chains)
    keys = dr.gather(mi.UInt32, key, dr.gather(mi.UInt32, at, index % n_chains))
    index_tail = dr.arange(mi.UInt32, TAIL_FLOATS * n_chains)
    source = index_tail // n_chains * n_bootstrap + dr.gather(mi.UInt32, at, index_tail % n_chains)
    chains = Chains(
        HashedNumbers(keys, mi.UInt32(0)).one(index // n_chains),
        dr.gather(mi.Color3f, found.light, at),
        dr.gather(mi.Float, found.level, at),
        dr.gather(mi.UInt32, found.pixel, at),
        dr.gather(mi.Bool, found.is_shared, at),
        dr.gather(mi.Float, found.tails, source),
    )
    dr.eval(*chains)
    return chains, float(levels.sum())


def seed_of(seed: int) -> Any:
    """The seed of the mutations, apart from the bootstrap's."""
    return dr.opaque(mi.UInt32, (seed ^ 0x3C6EF372) & 0xFFFFFFFF)


@dr.syntax
def _mutate(
    rules: Rules,
    film: Film,
    chains: Chains,
    steps: tuple[Any, Any],
    p_large: Any,
    seed: Any,
    shares: Any,
) -> tuple[Chains, tuple[Any, ...]]:
    n_chains = dr.width(chains.level)
    lane = dr.arange(mi.UInt32, n_chains)
    numbers = dr.alloc_local(mi.Float, STORED_DIMS)
    x_tail = dr.alloc_local(mi.Float, TAIL_FLOATS)
    y_tail = dr.alloc_local(mi.Float, TAIL_FLOATS)
    dim = mi.UInt32(0)
    while dim < STORED_DIMS:
        numbers.write(dr.gather(mi.Float, chains.numbers, dim * n_chains + lane), dim)
        dim += 1
    dim = mi.UInt32(0)
    while dim < TAIL_FLOATS:
        x_tail.write(dr.gather(mi.Float, chains.tails, dim * n_chains + lane), dim)
        dim += 1

    # x is where a chain stands, y what it proposes.
    x_light, x_level, x_pixel = chains.light, chains.level, chains.pixel
    x_shared = mi.Bool(chains.is_shared)
    x_weight = mi.Float(0)
    large_sum, large_count = mi.Float(0), mi.Float(0)
    n_accepted, n_bad = mi.Float(0), mi.UInt32(0)
    step = mi.UInt32(steps[0])
    chain_key = stream_key(lane, seed)
    y = _trial(rules.camera, mi.Float(0) * mi.Float(lane), mi.Float(0))
    fresh = mi.Bool(True)
    active = step < steps[1]

    while active:
        # 1. Propose; the path's first ray leaves through the film position of dimensions 0 and 1.
        key = hash32(chain_key ^ hash32(step + 0x9E3779B9))
        is_large = unit_float(hash32(key ^ 0x51ED270B)) < p_large
        proposal = MutatedNumbers(numbers, key, is_large)
        y_pixel, at = film_point(film, proposal.two(mi.UInt32(0)), rules.fields.is_tent)
        y = dr.select(fresh, _trial(rules.camera, at.x, at.y), y)
        y, alive = _onward(rules, proposal, y, y_tail, active)
        done = active & ~alive

        # 2. Accept or stay.
        y_light = y.light + y.head * y.tail
        good = dr.isfinite(luminance(y_light))
        n_bad += dr.select(done & ~good, mi.UInt32(1), 0)
        y_light = dr.select(good, y_light, 0)
        y_level = level_of(film, y_pixel, y_light)
        y_shared = y.is_shared & shares
        a = dr.select(x_level > 0, dr.minimum(y_level / x_level, 1), 1)
        accept = done & (unit_float(hash32(key ^ 0x2545F491)) < a)
        n_accepted += dr.select(accept, mi.Float(1), 0)
        large_sum += dr.select(done & is_large, y_level, 0)
        large_count += dr.select(done & is_large, mi.Float(1), 0)

        # 3. Splat what is left behind: the old point with all it has gathered, or the refused one.
        #    What is shared waits for the launch's end (tails.py).
        x_weight += dr.select(done, 1 - a, 0)
        splat(
            film,
            lane,
            dr.select(accept, x_pixel, y_pixel),
            dr.select(accept, x_light, y_light),
            dr.select(accept, x_level, y_level),
            dr.select(accept, x_weight, a),
            done & ~dr.select(accept, x_shared, y_shared),
        )
        close_tail(y_tail, y_light, y.tail, accept & y_shared)
        x_pixel = dr.select(accept, y_pixel, x_pixel)
        x_light = dr.select(accept, y_light, x_light)
        x_level = dr.select(accept, y_level, x_level)
        x_shared = dr.select(accept, y_shared, x_shared)
        x_weight = dr.select(accept, a, x_weight)
        dim = mi.UInt32(0)
        updating = mi.Bool(accept)
        while updating:
            numbers.write(proposal.one(dim), dim)
            dim += 1
            updating = updating & (dim < STORED_DIMS)
        dim = mi.UInt32(0)
        updating = accept & y_shared
        while updating:
            x_tail.write(y_tail.read(dim), dim)
            dim += 1
            updating = updating & (dim < TAIL_FLOATS)

        step += dr.select(done, mi.UInt32(1), 0)
        fresh = mi.Bool(done)
        active = step < steps[1]

    splat(film, lane, x_pixel, x_light, x_level, x_weight, ~x_shared)
    kept = dr.empty(mi.Float, STORED_DIMS * n_chains)
    dim = mi.UInt32(0)
    while dim < STORED_DIMS:
        dr.scatter(kept, numbers.read(dim), dim * n_chains + lane)
        dim += 1
    kept_tails = dr.empty(mi.Float, TAIL_FLOATS * n_chains)
    dim = mi.UInt32(0)
    while dim < TAIL_FLOATS:
        dr.scatter(kept_tails, x_tail.read(dim), dim * n_chains + lane)
        dim += 1
    sums = large_sum, large_count, n_accepted, n_bad
    return Chains(kept, x_light, x_level, x_pixel, x_shared, kept_tails), sums


@dr.syntax
def _paths(rules: Rules, film: Film, numbers: HashedNumbers) -> Chains:
    """One path per lane, as where a chain stands; its numbers are not kept."""
    pixel, at = film_point(film, numbers.two(mi.UInt32(0)), rules.fields.is_tent)
    tail = dr.alloc_local(mi.Float, TAIL_FLOATS)
    y = _trial(rules.camera, at.x, at.y)
    active = mi.Bool(True)
    while active:
        y, alive = _onward(rules, numbers, y, tail, active)
        active = active & alive
    light = y.light + y.head * y.tail
    level = level_of(film, pixel, light)
    level = dr.select(dr.isfinite(level), level, 0)
    close_tail(tail, light, y.tail, y.is_shared)
    lane = dr.arange(mi.UInt32, dr.width(pixel))
    rows = dr.empty(mi.Float, TAIL_FLOATS * dr.width(pixel))
    dim = mi.UInt32(0)
    while dim < TAIL_FLOATS:
        dr.scatter(rows, tail.read(dim), dim * dr.width(pixel) + lane)
        dim += 1
    return Chains(mi.Float(0), light, level, pixel, y.is_shared, rows)


def _trial(camera: CameraRow, x: Any, y: Any) -> Trial:
    """The path that leaves the camera through film position (x, y), in pixels."""
    none, one = mi.Color3f(0), mi.Color3f(1)
    return Trial(start(camera, x, y), none, one, mi.Color3f(0), mi.Bool(False), mi.Bool(False))


def _onward(
    rules: Rules, numbers: Numbers, trial: Trial, tail: Any, active: Any
) -> tuple[Trial, Any]:
    """(the path one vertex on, whether it goes on); its tail is kept in local memory."""
    walk, only = trial.walk, rules.only
    before = walk.depth
    may_be_steady = trial.is_straight & (before == 1)
    following, found, alive = advance(
        rules.stage, rules.emitters, rules.fields, numbers, walk, only, active, may_be_steady
    )
    met = dr.select(before + 1 >= rules.segments, found.met_outdoor + found.met_indoor, 0)
    lit = dr.select(following.depth + 1 >= rules.segments, found.lit_outdoor + found.lit_indoor, 0)
    is_beyond = before >= 2
    is_second = active & (before < 2) & (following.depth == 2)
    write_tail(tail, found, walk, only, is_second & found.steady)
    head = dr.select(is_second, following.beta, trial.head)
    following.beta = dr.select(is_second, 1, following.beta)
    is_far = dr.squared_norm(found.hit.p - walk.last_p) > NEAR_M**2
    can_share = found.steady & (found.density > 0) & is_far
    return (
        Trial(
            following,
            trial.light + dr.select(is_beyond, 0, met + lit),
            head,
            trial.tail + dr.select(is_beyond, met + lit, 0),
            dr.select(before == 0, found.is_rough, trial.is_straight & (following.depth > before)),
            dr.select(is_second, can_share, trial.is_shared),
        ),
        alive,
    )
