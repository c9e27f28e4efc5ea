"""Distances between two sets of pictures, with bootstrap intervals.

Pictures of one home are alike, so the bootstrap resamples groups, not pictures, and two pictures of
one group never form a pair. Resamples repeat groups, which makes their histograms rougher: the
interval is shifted so that the mean of the resamples is the figure.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F64, I64
from pbrs_farm.selection.similarity import intersection

_Figure = Callable[[F64, F64], F64]  # counts of each group in two sets -> (draws,) figures
_DRAWS: Final = 1_000
_LEVEL: Final = 0.9
LEAST_GROUPS: Final = 3
KERNEL_SCALE: Final = 1_000  # unit of kernel distances: thousandths


@dataclass(frozen=True, slots=True)
class Estimate:
    """A figure and its 90 % interval."""

    value: float
    low: float
    high: float


@dataclass(frozen=True, slots=True, eq=False)
class Grouped:
    """A row of numbers per picture, and the group of each picture."""

    rows: F64  # (n, k)
    groups: tuple[str, ...]  # (n,) names

    @property
    def names(self) -> tuple[str, ...]:
        """Each group once, in order."""
        return tuple(dict.fromkeys(self.groups))

    def members(self) -> F64:
        """(n, groups) 1 for the group of each picture, else 0."""
        return np.asarray(np.array(self.groups)[:, None] == np.array(self.names)[None], np.float64)


def groups_to_draw(groups: Sequence[str], ids: Sequence[str]) -> tuple[str, ...]:
    """The group of each picture, or its id if there are fewer than three groups."""
    return tuple(groups if len(set(groups)) >= LEAST_GROUPS else ids)


def kernel_distance(a: Grouped, b: Grouped) -> Estimate:
    """Kernel distance of features (Binkowski et al. 2018), in thousandths; 0 for equal distributions.

    The unbiased estimate of the squared maximum mean discrepancy for the kernel (x y / k + 1)^3; it
    may be slightly negative. Groups of one name are one group, also across the sets.

        >>> rows = np.random.default_rng(0).normal(size=(40, 8))
        >>> names = tuple(map(str, range(40)))
        >>> kernel_distance(Grouped(rows, names), Grouped(rows, names)).value
        0.0
        >>> kernel_distance(Grouped(rows, names), Grouped(rows + 1, names)).value > 100
        True
    """
    same = np.array(a.names)[:, None] == np.array(b.names)[None]
    parts = [
        _Pairs.of(a, a, np.eye(len(a.names), dtype=bool)),
        _Pairs.of(b, b, np.eye(len(b.names), dtype=bool)),
        _Pairs.of(a, b, same),
    ]

    def distance(u: F64, v: F64) -> F64:
        """(draws,) distances for counts of each group (draws, groups)."""
        within_a, within_b, across = parts
        return KERNEL_SCALE * (within_a.mean(u, u) + within_b.mean(v, v) - 2 * across.mean(u, v))

    return _estimate(distance, len(a.names), len(b.names))


@dataclass(frozen=True, slots=True, eq=False)
class _Pairs:
    """Sum of the kernel and number of pairs for every two groups; 0 for a group with itself."""

    sums: F64  # (groups of a, groups of b)
    counts: F64

    @classmethod
    def of(cls, a: Grouped, b: Grouped, same: NDArray[np.bool_]) -> _Pairs:
        kernel = (a.rows @ b.rows.T / a.rows.shape[1] + 1) ** 3
        in_a, in_b = a.members(), b.members()
        counts = in_a.sum(0)[:, None] * in_b.sum(0)[None]
        return cls(np.where(same, 0, in_a.T @ kernel @ in_b), np.where(same, 0, counts))

    def mean(self, u: F64, v: F64) -> F64:
        """(draws,) means over the pairs for counts of each group; NaN without a pair."""
        n = ((u @ self.counts) * v).sum(-1)
        total = ((u @ self.sums) * v).sum(-1)
        return np.where(n > 0, total / np.maximum(n, 1), np.nan)


def shared_histogram(a: Grouped, b: Grouped) -> Estimate:
    """Histogram intersection of the sets' mean histograms: 1 = equal, 0 = disjoint."""
    sums_a, sums_b = (_by_group(each) for each in (a, b))

    def shared(u: F64, v: F64) -> F64:
        mean_a, mean_b = u @ sums_a, v @ sums_b
        return intersection(
            mean_a / np.maximum(mean_a.sum(-1, keepdims=True), 1e-12),
            mean_b / np.maximum(mean_b.sum(-1, keepdims=True), 1e-12),
        )

    estimate = _estimate(shared, len(sums_a), len(sums_b))
    return Estimate(estimate.value, max(estimate.low, 0.0), min(estimate.high, 1.0))


def shared_of_halves(a: Grouped, draws: int = 100) -> float | None:
    """Mean intersection of two random halves of one set, an upper limit; None below four groups."""
    sums = _by_group(a)
    if len(sums) < 4:
        return None
    dice, overlaps = np.random.default_rng(0), []
    for _ in range(draws):
        order = dice.permutation(len(sums))
        halves = [sums[part].sum(0) for part in np.array_split(order, 2)]
        overlaps.append(float(intersection(*(half / max(half.sum(), 1e-12) for half in halves))))
    return float(np.mean(overlaps))


def nearest_of(a: F64, b: F64, *, leave_out_self: bool = False) -> tuple[F64, I64]:
    """(n,) distance of each row of a to the nearest (other, if leave_out_self) row of b, and (n,) its index."""
    squares = (a**2).sum(1)[:, None] + (b**2).sum(1)[None] - 2 * a @ b.T
    if leave_out_self:
        np.fill_diagonal(squares, np.inf)
    nearest = squares.argmin(1)
    return np.sqrt(np.maximum(squares[np.arange(len(a)), nearest], 0)), nearest.astype(np.int64)


def _by_group(a: Grouped) -> F64:
    """(groups, k) sums of each group's rows."""
    return np.asarray(a.members().T @ a.rows)


def _estimate(figure: _Figure, n_a: int, n_b: int) -> Estimate:
    dice = np.random.default_rng(0)
    value = figure(np.ones((1, n_a)), np.ones((1, n_b)))
    drawn = figure(
        dice.multinomial(n_a, np.full(n_a, 1 / n_a), _DRAWS).astype(np.float64),
        dice.multinomial(n_b, np.full(n_b, 1 / n_b), _DRAWS).astype(np.float64),
    )
    low, high = np.nanquantile(drawn, [(1 - _LEVEL) / 2, (1 + _LEVEL) / 2])
    move = float(value[0]) - float(np.nanmean(drawn))
    return Estimate(float(value[0]), float(low) + move, float(high) + move)
