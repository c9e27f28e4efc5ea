"""Histogram intersection, and the exact best match of many histograms against a set; no effects.

For histograms that sum to 1, the sum of bin-wise minima is 1 - L1 / 2: the best match is the
nearest neighbour under L1, which faiss finds exactly and fast; without faiss numpy does.
"""

from __future__ import annotations

import importlib.util
from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F32, F64, I64
from pbrs_farm.core.record import Record
from pbrs_farm.selection.histograms import coarser_colour, coarser_depth, normalised

Shares = F32  # (n, bins), rows sum to 1, or to 0 where nothing was counted

_BLOCK: Final = 32  # queries of numpy's search at once
_CACHE_BYTES: Final = 512 * 1024  # references that are searched at once


def intersection(a: NDArray[np.floating], b: NDArray[np.floating]) -> F64:
    """(...) sum over the last axis of bin-wise minima (paper section 3.3), in double precision."""
    return np.asarray(np.minimum(a, b).sum(axis=-1, dtype=np.float64))


def best_match(
    queries: Shares, references: Shares, *, leave_out_self: bool = False, library: str | None = None
) -> tuple[F64, I64]:
    """(n,) largest intersection of each query over all references, and (n,) that reference.

    leave_out_self: queries are the references, and none may match itself (needs two at least).
    library: "faiss" or "numpy"; faiss where it is installed when None. The score is computed
    again in double precision for the match that was found. An empty query scores 0.
    """
    if len(references) <= leave_out_self or queries.shape[1] != references.shape[1]:
        raise ValueError(f"cannot match {queries.shape} against {references.shape}")
    # Find the nearest by single precision.
    library = library or ("faiss" if importlib.util.find_spec("faiss") else "numpy")
    q, r = _on_support(queries, references)
    search = _faiss_nearest if library == "faiss" else _numpy_nearest
    nearest = np.empty(0, np.int64)
    if len(q):
        nearest = search(q, r, leave_out_self)
    return intersection(queries, references[nearest]), nearest


def _on_support(queries: Shares, references: Shares) -> tuple[Shares, Shares]:
    """Both without the bins that no reference has: their minimum is 0 whatever the query holds."""
    used = references.any(axis=0)
    if used.all():
        return np.ascontiguousarray(queries, np.float32), np.ascontiguousarray(references)
    return np.ascontiguousarray(queries[:, used]), np.ascontiguousarray(references[:, used])


def _faiss_nearest(q: Shares, r: Shares, leave_out_self: bool) -> I64:
    import faiss

    # Nearest in L1 is best intersection where references hold equal shares; a column that the
    # queries lack makes up for what an empty reference is short of.
    short = 1 - r.sum(axis=1, keepdims=True)
    if short.max(initial=0) > 1e-5:
        q = np.ascontiguousarray(np.hstack([q, np.zeros((len(q), 1), np.float32)]))
        r = np.ascontiguousarray(np.hstack([r, short]))
    knn: Any = faiss.knn
    if leave_out_self:
        # An image among its own two nearest is left out; a twin of it may stand before it.
        _, index = knn(q, r, 2, metric=faiss.METRIC_L1)
        first_is_self = index[:, 0] == np.arange(len(q))
        return np.asarray(np.where(first_is_self, index[:, 1], index[:, 0]), np.int64)

    # Take the references in blocks that stay in the cache: each is read once for every query.
    n_rows = max(_CACHE_BYTES // (4 * r.shape[1]), 1)
    nearest = np.zeros(len(q), np.int64)
    least = np.full(len(q), np.inf, np.float32)
    for start in range(0, len(r), n_rows):
        distance, index = knn(q, r[start : start + n_rows], 1, metric=faiss.METRIC_L1)
        closer = distance[:, 0] < least
        least[closer] = distance[closer, 0]
        nearest[closer] = index[closer, 0] + start
    return nearest


def _numpy_nearest(q: Shares, r: Shares, leave_out_self: bool) -> I64:
    nearest = np.empty(len(q), np.int64)
    for start in range(0, len(q), _BLOCK):
        # Intersect a block of queries with all references at once.
        block = q[start : start + _BLOCK]
        score = np.minimum(block[:, None], r[None]).sum(axis=2)
        if leave_out_self:
            score[np.arange(len(block)), np.arange(start, start + len(block))] = -1
        nearest[start : start + len(block)] = score.argmax(axis=1)
    return nearest


# Which binning fits a reference set: five are tried on the set itself, each image left out in
# turn.
# No effects. Merging bins can only raise an intersection, so the finest binning that passes is
# well defined: every coarser one passes too.


MIN_PASSING: Final = 0.95  # share of the reference's own images that pass at the chosen binning


class Binning(Record):
    """Bins that are compared: colour per channel, jointly, and depth over the range of settings."""

    colour: tuple[int, int, int]  # bins of each channel
    depth: int

    @property
    def n_colour(self) -> int:
        """Colour bins in all."""
        return self.colour[0] * self.colour[1] * self.colour[2]


# Coarse to fine; each is an exact sum of the bins of the next.
BINNINGS: Final = tuple(
    Binning(colour=colour, depth=depth)
    for colour, depth in (
        ((2, 2, 2), 8), ((4, 4, 2), 16), ((4, 4, 4), 32), ((8, 8, 4), 64), ((8, 8, 8), 128),
    )
)  # fmt: skip


class BinningRow(Record):
    """How a reference's own images score at one binning, each left out in turn."""

    binning: Binning
    colour_passing: float  # share of the images above the threshold
    colour_median: float  # median best intersection
    depth_passing: float
    depth_median: float


def binning_table(
    colour: NDArray[np.integer], depth: NDArray[np.integer], *, min_colour: float, min_depth: float
) -> tuple[BinningRow, ...]:
    """A row for each of BINNINGS that the counts colour (n, bins) and depth (n, bins) can be summed to.

    Raises ValueError for fewer than two images.
    """
    if len(colour) < 2:
        raise ValueError("a reference needs two images at least: each is compared with the others")
    rows = []
    for binning in BINNINGS:
        # Leave out binnings that are finer than what was counted.
        if max(binning.colour) ** 3 > colour.shape[1] or binning.depth > depth.shape[1]:
            continue
        c = normalised(coarser_colour(colour, binning.colour))
        d = normalised(coarser_depth(depth, binning.depth))
        # Match every image with all the others.
        c_best, _ = best_match(c, c, leave_out_self=True)
        d_best, _ = best_match(d, d, leave_out_self=True)
        rows.append(
            BinningRow(
                binning=binning,
                colour_passing=float((c_best > min_colour).mean()),
                colour_median=float(np.median(c_best)),
                depth_passing=float((d_best > min_depth).mean()),
                depth_median=float(np.median(d_best)),
            )
        )
    return tuple(rows)


def finest_passing(rows: Sequence[BinningRow]) -> Binning:
    """The finest colour bins and the finest depth bins, each by itself, that enough images pass.

    Where not even the coarsest passes, the coarsest.
    """
    # Rows run from coarse to fine, so the last that passes is the finest.
    colour = [r.binning.colour for r in rows if r.colour_passing >= MIN_PASSING]
    depth = [r.binning.depth for r in rows if r.depth_passing >= MIN_PASSING]
    coarsest = rows[0].binning
    return Binning(
        colour=colour[-1] if colour else coarsest.colour,
        depth=depth[-1] if depth else coarsest.depth,
    )


def table_text(rows: Sequence[BinningRow], chosen: Binning) -> str:
    """The table as text: "*" marks what was chosen for colour and for depth."""
    lines = ["colour bins      pass  median    depth bins  pass  median"]
    for r in rows:
        c = "*" if r.binning.colour == chosen.colour else " "
        d = "*" if r.binning.depth == chosen.depth else " "
        name = "x".join(str(k) for k in r.binning.colour)
        lines.append(
            f"{c} {name:<8}{r.binning.n_colour:>5} {100 * r.colour_passing:>5.1f} % "
            f"{r.colour_median:>6.3f}  {d} {r.binning.depth:>8} {100 * r.depth_passing:>5.1f} % "
            f"{r.depth_median:>6.3f}"
        )
    # Say where not even the coarsest binning lets enough images pass.
    coarsest = rows[0]
    for name, passing in (("colour", coarsest.colour_passing), ("depth", coarsest.depth_passing)):
        if passing < MIN_PASSING:
            lines.append(f"no binning lets {MIN_PASSING:.0%} pass by {name}: the coarsest is taken")
    return "\n".join(lines)
