"""Passes of `path` over a view: launch after launch, up to a number of samples, a noise or a time.

Effects: reads the clock where there is a time budget.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from pbrs_farm.core.camera import Camera
from pbrs_farm.core.recipe import LightFields
from pbrs_farm.transport.kernels.device_scene import DeviceScene
from pbrs_farm.transport.kernels.emitters import Emitters
from pbrs_farm.transport.light_result import result_from_sums
from pbrs_farm.transport.path_tracer import Lanes, SampleSums, sums_from_arrays, trace
from pbrs_farm.transport.render_checkpoint import Arrays, RenderCheckpoint
from pbrs_farm.transport.surface_noise import SurfaceStreams
from pbrs_farm.transport.time_budget import TimeBudget

MOST_PARTS: Final = 16
"""Number of instants in a motion-blurred picture."""
SAMPLES_PER_LAUNCH: Final = 1 << 26  # bounds how long one kernel runs
_SPP: Final = "spp"  # key in stored states: samples of each pixel so far


@dataclass(frozen=True, slots=True)
class SampledView:
    """A view to be sampled: the scene, its emitters with that view's weights, camera, fields and seed.

    The emitters must be those of this view now (`LightScene.emitters`): another view's
    weights leave the mean right, but the picture noisier.
    """

    scene: DeviceScene
    emitters: Emitters
    camera: Camera
    fields: LightFields
    seed: int
    streams: SurfaceStreams | None = None  # of each pixel's random numbers (surface_noise.py)
    splits_diffuse: bool = False  # sum what first surfaces would send if they were matte, too
    move: Callable[[float], None] | None = None
    """Puts what moves where it is at a share of the shutter's time; None: nothing moves while it is open."""


def path_sums(
    view: SampledView, checkpoint: RenderCheckpoint, *, n_lamps: int = 0
) -> tuple[SampleSums, int]:
    """(sums, samples per pixel) in passes of fields.spp up to the noise or time; n_lamps: to sum apart."""
    # Size the launches: by memory, by the pace so far, and one pass each when noise decides.
    camera, fields = view.camera, view.fields
    per_launch = samples_per_launch(camera.intrinsics.width_px * camera.intrinsics.height_px)
    budget = TimeBudget(fields.time_budget_s, checkpoint.spent_s)
    is_open = budget.is_limited or fields.noise > 0
    goal = max(fields.spp, fields.max_spp) if is_open else fields.spp
    if fields.noise > 0:
        per_launch = min(per_launch, fields.spp)
    total, spp = _kept_sums(checkpoint, "path")
    noise = _noise_left(total, spp, view)
    while spp < goal and noise > 1 and (n := budget.n_that_fit(min(per_launch, goal - spp))) > 0:
        total = _plus(total, _traced(view, spp, n, n_lamps=n_lamps))
        spp += n
        budget.record(n)
        noise = _noise_left(total, spp, view)
        share = max(spp / goal, budget.share, 1 / max(noise, 1) ** 2)
        checkpoint.keep("path", min(share, 1.0), _state_of(total, spp))
    assert total is not None, "a first launch always fits"
    return total, spp


def _noise_left(total: SampleSums | None, spp: int, view: SampledView) -> float:
    """The noise so far over the one asked for; infinite where samples alone decide."""
    if view.fields.noise <= 0 or total is None or spp < view.fields.spp:
        return np.inf
    return result_from_sums(total, view.camera, spp, {}).noise["sum"] / view.fields.noise


def direct_sums(
    view: SampledView, checkpoint: RenderCheckpoint, *, share: float = 1.0
) -> SampleSums:
    """Sums over fields.direct_spp samples of light that meets one surface; without any, one unlit, for guides."""
    # Depth counts a path's segments, the camera's among them: 2 is light that met one surface.
    n_samples, max_depth = (view.fields.direct_spp, 2) if view.fields.direct_spp > 0 else (1, 1)
    i = view.camera.intrinsics
    per_launch = samples_per_launch(i.width_px * i.height_px)
    total, spp = _kept_sums(checkpoint, "direct")
    # Launch by launch: sums over samples add up, and a launch must fit into memory.
    while spp < n_samples:
        n = min(per_launch, n_samples - spp)
        total = _plus(total, _traced(view, spp, n, max_depth=max_depth))
        spp += n
        checkpoint.keep("direct", share * spp / n_samples, _state_of(total, spp))
    assert total is not None
    return total


def _traced(
    view: SampledView, first: int, n: int, *, n_lamps: int = 0, max_depth: int | None = None
) -> SampleSums:
    """Sums over n samples of every pixel, from the first on."""
    i = view.camera.intrinsics
    total: SampleSums | None = None
    for start, count, camera in parts_of_shutter(view, first, n):
        lanes = Lanes(
            i.width_px,
            i.height_px,
            start,
            count,
            view.seed,
            n_lamps=n_lamps,
            streams=view.streams,
            splits_diffuse=view.splits_diffuse,
        )
        sums = trace(view.scene, view.emitters, camera, lanes, view.fields, max_depth=max_depth)
        total = _plus(total, sums)
    assert total is not None, "at least one sample is traced"
    return total


def parts_of_shutter(view: SampledView, first: int, n: int) -> Iterator[tuple[int, int, Camera]]:
    """(first sample, number, camera) of launches without motion inside; moves items before each.

    Without motions there is one. Otherwise a pass of fields.spp samples is divided among parts of the
    shutter's time, in proportion to samples; items are posed at the part's centre, the camera moves within
    it. A sample's part follows from its number alone.
    """
    spp, blur = view.fields.spp, view.camera.blur
    if view.move is None or blur is None:
        yield first, n, view.camera
        return
    length = shutter_part_spp(spp)
    order = _spread_order(-(-spp // length))
    begin = first
    while begin < first + n:
        place = begin % spp
        end = min(begin - place + min((place // length + 1) * length, spp), first + n)
        # A part is named by the samples of its place in the order, which are as many.
        part = order[place // length]
        low = part * length
        shares = low / spp, min(low + length, spp) / spp
        view.move(0.5 * sum(shares))
        yield begin, end - begin, replace(view.camera, blur=blur.part(*shares))
        begin = end


def shutter_part_spp(spp: int) -> int:
    """Samples per instant in a pass of spp: at least two, for at most MOST_PARTS instants."""
    return max(-(-spp // MOST_PARTS), min(2, spp))


def _spread_order(n: int) -> list[int]:
    """0 to n - 1, the last one last, so that the first few lie all over the time (van der Corput)."""
    bits = max((n - 2).bit_length(), 1)
    reversed_bits = [int(f"{k:0{bits}b}"[::-1], 2) for k in range(n - 1)]
    return [*sorted(range(n - 1), key=reversed_bits.__getitem__), n - 1]


def _plus(total: SampleSums | None, sums: SampleSums) -> SampleSums:
    return sums if total is None else total + sums


def _kept_sums(checkpoint: RenderCheckpoint, part: str) -> tuple[SampleSums | None, int]:
    """(sums, samples per pixel) of a part as they were kept."""
    arrays = checkpoint.kept(part)
    return (sums_from_arrays(arrays), int(arrays[_SPP])) if arrays else (None, 0)


def _state_of(total: SampleSums, spp: int) -> Callable[[], Arrays]:
    state: dict[str, Any] = {_SPP: np.int64(spp)}
    return lambda: total.arrays() | state


def samples_per_launch(n_pixels: int) -> int:
    """Samples of every pixel that fit into the memory of one launch."""
    return max(SAMPLES_PER_LAUNCH // n_pixels, 1)
