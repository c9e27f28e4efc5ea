"""radiance.exr against a second tracing of its light. Effects: traces light."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import NamedTuple

import numpy as np
from scipy import ndimage, stats

from pbrs_farm.check.cases import ViewCase
from pbrs_farm.check.checks import Check
from pbrs_farm.check.colours import has_channels
from pbrs_farm.core import keys
from pbrs_farm.core.arrays import F64, Bools
from pbrs_farm.core.errors import BadInput, RenderFailed
from pbrs_farm.core.resampling import resized_by_area

_SHORT_PX = (
    48  # shorter side of the traced picture; each of its pixels is a block of the stored ones
)
_WINDOWS = (4, 8, 16)  # blocks a side, over which differences are averaged
_FALSE_ALARM = 1e-4  # probability that a true view fails
_FAR = 0.25  # relative difference that may be: integrators differ in rare paths
_FAINT = 0.1  # of the median light: darker windows are compared with this level


class _Window(NamedTuple):
    """The window of a size whose light differs most significantly."""

    sigmas: float  # mean difference in standard errors
    allowed: float  # the same at the level of the test
    row: int  # its middle, in blocks
    column: int
    ratio: float  # stored over traced light


def check_traced(case: ViewCase) -> None:
    """Compare means of windows with those of light traced again by other random numbers.

    The blocks of a window are pairs of stored and traced light, whose differences are judged by a t-test:
    it needs no model of the noise, and a firefly raises both mean and spread. _FALSE_ALARM is divided
    among all windows, groups, colours and sizes of a view (Bonferroni).
    """
    view, tracer = case.view, case.tracer
    if tracer is None or not has_channels(case.light, view.size, "outdoor indoor"):
        return
    stored_by = str(view.table.get("modes", {}).get("light", {}).get("variant"))
    if stored_by != tracer.variant:
        text = f"light was traced by {stored_by}, this machine has {tracer.variant}: not repeated"
        case.tally.note(f"{case.place}: {text}")
        return
    expect = case.expect("light traced", "radiance.exr")
    height, width = (max(round(n * min(_SHORT_PX / min(view.size), 1)), 1) for n in view.size)
    try:
        traced = tracer.light(case.house.id, view.folder.name, width, height)
    except (BadInput, RenderFailed) as error:
        expect(False, f"cannot be traced again: {error}")
        return
    is_whole = resized_by_area(_lit_pixels(case).astype(np.float32), width, height) > 1 - 1e-6
    level = _FALSE_ALARM / (len(traced) * 3 * len(_WINDOWS) * is_whole.size)
    for group, light in traced.items():
        for k, (colour, c) in enumerate({"red": "R", "green": "G", "blue": "B"}.items()):
            stored = resized_by_area(case.light[f"{group}.{c}"], width, height).astype(np.float64)
            windows = _windows(stored, light[..., k].astype(np.float64), is_whole, level)
            worst = max(windows, key=lambda w: w.sigmas / w.allowed, default=None)
            if worst is not None:
                row, column = (
                    round((b + 0.5) * n / m)
                    for b, n, m in zip(worst[2:4], view.size, (height, width), strict=True)
                )
                fault = (
                    f"{group} {colour} light around row {row}, column {column} is {worst.ratio:.2f} times that"
                    f" traced again ({worst.sigmas:.1f} standard errors, {worst.allowed:.1f} allowed)"
                )
                expect(worst.sigmas <= worst.allowed, fault)


def _lit_pixels(case: ViewCase) -> Bools:
    """(H, W) pixels with light: those with a ray, and of an object without context those that show it."""
    if keys.is_object(case.house.id):
        return np.asarray(case.arrays["instance"] > 0)
    return np.asarray(case.view.ray_grid().any(axis=-1))


def _windows(stored: F64, traced: F64, is_whole: Bools, level: float) -> Iterator[_Window]:
    """The worst window of each size; is_whole: (H, W), False for blocks to ignore."""
    faint = _FAINT * float(np.median(traced))
    for size in _WINDOWS:
        if size > min(stored.shape):
            continue
        mean = partial(ndimage.uniform_filter, size=size, mode="constant")
        difference = np.where(is_whole, stored - traced, 0.0)
        off, before, after = mean(difference), mean(stored), mean(traced)
        variance = np.maximum(mean(difference**2) - off**2, 0) / (size**2 - 1)
        is_far = np.abs(off) > _FAR * np.maximum(np.maximum(before, after), faint)
        is_far &= mean(is_whole.astype(float)) > 1 - 1e-6
        sigmas = np.where(is_far, np.abs(off) / np.sqrt(variance + 1e-24), 0.0)
        row, column = (int(n) for n in np.unravel_index(int(sigmas.argmax()), sigmas.shape))
        ratio = float(before[row, column] / max(after[row, column], 1e-12))
        allowed = float(stats.t.isf(level / 2, size**2 - 1))
        yield _Window(float(sigmas[row, column]), allowed, row, column, ratio)


CHECKS = (Check("light traced", "view", check_traced, 96, ("radiance",)),)
