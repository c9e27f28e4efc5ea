"""Squared error times CPU of two ways to render, from independent pictures alone: no reference; no effects."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Run:
    """Pictures of one way to render: (N, H, W) luminance, of N seeds; cpu_s: of one, in the mean."""

    pictures: F64
    cpu_s: float


@dataclass(frozen=True, slots=True, eq=False)
class Errors:
    """What one picture of a run lacks: mean squared relative error, and that of the median pixel's root."""

    relmse: float
    median: float


@dataclass(frozen=True, slots=True, eq=False)
class Comparison:
    """Two runs at equal CPU. Ratios are the first over the second, below 1 favours the first."""

    first: Errors
    second: Errors
    relmse_ratio: float  # of relMSE x CPU
    median_ratio: float  # of the median pixel's error x sqrt(CPU)
    relmse_without: F64  # (N,) the same ratios with the k-th picture of both left out
    median_without: F64
    truth: F64  # (H, W) the mean of all pictures, each run by its noise
    truth_relmse: float  # what is left of the noise in it


def compared(first: Run, second: Run) -> Comparison:
    """The errors of two runs of the same light, as variances between their own pictures.

    Error is relative: divided by t^2 + 1e-3 mean(t)^2, t the mean of all pictures. Variance falls with
    1 / CPU, so a ratio is that at equal CPU. Raises ValueError unless both have N >= 3 pictures of one shape.
    """
    if first.pictures.shape != second.pictures.shape or len(first.pictures) < 3:
        shapes = f"{first.pictures.shape} and {second.pictures.shape}"
        raise ValueError(f"pictures are {shapes}: expected three or more of each, as many of both")
    truth, truth_relmse = _mean_of_both(first.pictures, second.pictures)
    scale = _scale(truth)
    one, other = (_errors(run.pictures, scale) for run in (first, second))
    times = first.cpu_s / second.cpu_s
    relmse_ratio, median_ratio = _ratios(one, other, times)

    # Each pair of pictures left out in turn, for the ratios' own spread.
    without = []
    for k in range(len(first.pictures)):
        a, b = (_errors(np.delete(run.pictures, k, 0), scale) for run in (first, second))
        without.append(_ratios(a, b, times))
    relmse_without, median_without = np.array(without).T
    return Comparison(
        one, other, relmse_ratio, median_ratio, relmse_without, median_without, truth, truth_relmse
    )


def relative_spread(without: F64) -> float:
    """Standard error of a positive statistic as a share of it, by the jackknife on its logarithm.

    without: (N,) the statistic with one of N independent inputs left out.
    """
    logs = np.log(without)
    return float(np.sqrt((len(logs) - 1) * logs.var()))


def relmse_of(pictures: F64, truth: F64) -> float:
    """Mean squared relative error of (N, H, W) pictures, the biased ones too, against a truth (H, W)."""
    return float(np.mean((pictures - truth) ** 2 / _scale(truth)))


def _mean_of_both(first: F64, second: F64) -> tuple[F64, float]:
    """(mean of two runs' means, each weighted by the other's variance; its own relMSE)."""
    means = [p.mean(0) for p in (first, second)]
    scale = _scale(0.5 * (means[0] + means[1]))
    a, b = (_errors(p, scale).relmse for p in (first, second))
    if a + b == 0:
        return means[0], 0.0
    return (b * means[0] + a * means[1]) / (a + b), a * b / (a + b) / len(first)


def _scale(truth: F64) -> F64:
    """What squared errors are divided by: the squared light, dark pixels held up."""
    return np.asarray(truth**2 + 1e-3 * truth.mean() ** 2)


def _errors(pictures: F64, scale: F64) -> Errors:
    relative = pictures.var(0, ddof=1) / scale
    return Errors(float(relative.mean()), float(np.sqrt(np.median(relative))))


def _ratios(first: Errors, second: Errors, times: float) -> tuple[float, float]:
    return (
        first.relmse / second.relmse * times,
        first.median / second.median * float(np.sqrt(times)),
    )
