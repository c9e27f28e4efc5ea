"""How far two sets of pictures are from each other, with intervals; no effects.

Pictures of one home are alike, and so are those of one room: groups are drawn anew for an interval,
not pictures, and two pictures of one group are never a pair. A resample repeats groups, so that its
histograms are rougher than the sets': the interval is that of the resamples, moved so that their mean
is the figure.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F64, I64
from pbrs_farm.selection.similarity import intersection

_Figure = Callable[[F64, F64], F64]  # (draws,) of how often each group of two sets is taken
_DRAWS: Final = 1_000
_LEVEL: Final = 0.9
LEAST_GROUPS: Final = 3
KERNEL_SCALE: Final = 1_000  # kernel distances are told in thousandths


@dataclass(frozen=True, slots=True)
class Estimate:
    """A figure and the interval that 90 % of resamples lie in."""

    value: float
    low: float
    high: float


@dataclass(frozen=True, slots=True, eq=False)
class Grouped:
    """Rows of numbers, a picture each, and which pictures belong together."""

    rows: F64  # (n, k)
    groups: tuple[str, ...]  # (n,) names

    @property
    def names(self) -> tuple[str, ...]:
        """Each group once, in order."""
        return tuple(dict.fromkeys(self.groups))

    def members(self) -> F64:
        """(n, groups) 1 where a picture is of a group."""
        return np.asarray(np.array(self.groups)[:, None] == np.array(self.names)[None], np.float64)


def groups_to_draw(groups: Sequence[str], ids: Sequence[str]) -> tuple[str, ...]:
    """The group of each picture; each picture its own where there are fewer than three."""
    return tuple(groups if len(set(groups)) >= LEAST_GROUPS else ids)


def kernel_distance(a: Grouped, b: Grouped) -> Estimate:
    """Kernel distance of features (Binkowski et al. 2018), in thousandths: 0 where nothing tells the sets apart.

    The squared maximum mean discrepancy for the kernel (x y / k + 1)^3, estimated without bias,
    so that small sets are not farther than large ones; it may be a little below 0. Groups of one
    name are one group, in whichever set they are.

        >>> rows = np.random.default_rng(0).normal(size=(40, 8))
        >>> names = tuple(map(str, range(40)))
        >>> kernel_distance(Grouped(rows, names), Grouped(rows, names)).value
        0.0
        >>> kernel_distance(Grouped(rows, names), Grouped(rows + 1, names)).value > 100
        True
    """
    same = np.array(a.names)[:, None] == np.array(b.names)[None]
    parts = [_Pairs.of(a, a, np.eye(len(a.names), dtype=bool)), _Pairs.of(b, b, np.eye(len(b.names), dtype=bool)), _Pairs.of(a, b, same)]  # fmt: skip

    def distance(u: F64, v: F64) -> F64:
        """(draws,) of how often each group is taken (draws, groups)."""
        within_a, within_b, across = parts
        return KERNEL_SCALE * (within_a.mean(u, u) + within_b.mean(v, v) - 2 * across.mean(u, v))

    return _estimate(distance, len(a.names), len(b.names))


@dataclass(frozen=True, slots=True, eq=False)
class _Pairs:
    """The kernel of two sets' pictures, and how many pairs, of each two groups; 0 for one and the same."""

    sums: F64  # (groups of a, groups of b)
    counts: F64

    @classmethod
    def of(cls, a: Grouped, b: Grouped, same: NDArray[np.bool_]) -> _Pairs:
        kernel = (a.rows @ b.rows.T / a.rows.shape[1] + 1) ** 3
        in_a, in_b = a.members(), b.members()
        counts = in_a.sum(0)[:, None] * in_b.sum(0)[None]
        return cls(np.where(same, 0, in_a.T @ kernel @ in_b), np.where(same, 0, counts))

    def mean(self, u: F64, v: F64) -> F64:
        """(draws,) over the pairs of groups taken so often; NaN where there is no pair."""
        n = ((u @ self.counts) * v).sum(-1)
        total = ((u @ self.sums) * v).sum(-1)
        return np.where(n > 0, total / np.maximum(n, 1), np.nan)


def shared_histogram(a: Grouped, b: Grouped) -> Estimate:
    """Histogram intersection of the sets' mean histograms: 1 = equal, 0 = nothing shared."""
    sums_a, sums_b = (_by_group(each) for each in (a, b))

    def shared(u: F64, v: F64) -> F64:
        mean_a, mean_b = u @ sums_a, v @ sums_b
        return intersection(
            mean_a / np.maximum(mean_a.sum(-1, keepdims=True), 1e-12),
            mean_b / np.maximum(mean_b.sum(-1, keepdims=True), 1e-12),
        )

    found = _estimate(shared, len(sums_a), len(sums_b))
    return Estimate(found.value, max(found.low, 0.0), min(found.high, 1.0))


def shared_of_halves(a: Grouped, draws: int = 100) -> float | None:
    """What two halves of one set share, on average: as much as another set can. None below four groups."""
    sums = _by_group(a)
    if len(sums) < 4:
        return None
    dice, found = np.random.default_rng(0), []
    for _ in range(draws):
        order = dice.permutation(len(sums))
        halves = [sums[part].sum(0) for part in np.array_split(order, 2)]
        found.append(float(intersection(*(half / max(half.sum(), 1e-12) for half in halves))))
    return float(np.mean(found))


def nearest_of(a: F64, b: F64, *, leave_out_self: bool = False) -> tuple[F64, I64]:
    """(n,) distance of each row of a to its nearest of b, and (n,) which that is.

    leave_out_self: b is a, and no row is its own nearest.
    """
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
