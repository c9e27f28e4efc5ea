"""Histogram intersection, and the exact best match of many histograms against a set; no effects.

For histograms that sum to 1, the sum of bin-wise minima is 1 - L1 / 2: the best match is the
nearest neighbour under L1, which faiss finds exactly and fast; without faiss numpy does.
"""

from __future__ import annotations

import importlib.util
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F32, F64, I64

Shares = F32  # (n, bins), rows sum to 1, or to 0 if nothing was counted
_BLOCK: Final = 32  # queries per block of numpy's search
CACHE_BYTES: Final = 512 * 1024  # size of a block of references in the search


def intersection(a: NDArray[np.floating], b: NDArray[np.floating]) -> F64:
    """Histogram intersection (paper section 3.3): the sum over bins of the smaller share.

    a, b: (..., bins), broadcast against each other; of shares that sum to 1 it is 1 for equal
    histograms and 0 for disjoint ones. The result (...) is in double precision.

        >>> intersection(np.array([0.5, 0.5]), np.array([1.0, 0.0]))
        array(0.5)
    """
    return np.asarray(np.minimum(a, b).sum(axis=-1, dtype=np.float64))


def best_match(
    queries: Shares, references: Shares, *, leave_out_self: bool = False, library: str | None = None
) -> tuple[F64, I64]:
    """(n,) largest intersection of each query over all references, and (n,) that reference.

    leave_out_self: queries are the references, and none may match itself (needs two at least).
    library: "faiss" or "numpy"; None for faiss if it is installed. The score of the match is
    recomputed in double precision. An empty query scores 0.
    """
    if len(references) <= leave_out_self or queries.shape[1] != references.shape[1]:
        raise ValueError(f"cannot match {queries.shape} against {references.shape}")
    # Find the nearest in single precision.
    library = library or ("faiss" if importlib.util.find_spec("faiss") else "numpy")
    q, r = _on_support(queries, references)
    search = _faiss_nearest if library == "faiss" else _numpy_nearest
    nearest = np.empty(0, np.int64)
    if len(q):
        nearest = search(q, r, leave_out_self)
    return intersection(queries, references[nearest]), nearest


def _on_support(queries: Shares, references: Shares) -> tuple[Shares, Shares]:
    """Both without bins empty in all references: their minimum is 0 for any query."""
    used = references.any(axis=0)
    if used.all():
        return np.ascontiguousarray(queries, np.float32), np.ascontiguousarray(references)
    return np.ascontiguousarray(queries[:, used]), np.ascontiguousarray(references[:, used])


def _faiss_nearest(q: Shares, r: Shares, leave_out_self: bool) -> I64:
    import faiss

    # Nearest in L1 is best intersection if all references have equal sums; an extra column, zero in
    # the queries, fills up the sum of an empty reference.
    short = 1 - r.sum(axis=1, keepdims=True)
    if short.max(initial=0) > 1e-5:
        q = np.ascontiguousarray(np.hstack([q, np.zeros((len(q), 1), np.float32)]))
        r = np.ascontiguousarray(np.hstack([r, short]))
    knn: Any = faiss.knn
    if leave_out_self:
        # Skip an image among its own two nearest; a duplicate may come before it.
        _, index = knn(q, r, 2, metric=faiss.METRIC_L1)
        first_is_self = index[:, 0] == np.arange(len(q))
        return np.asarray(np.where(first_is_self, index[:, 1], index[:, 0]), np.int64)

    # Process the references in blocks that fit the cache: each is read once for every query.
    n_rows = max(CACHE_BYTES // (4 * r.shape[1]), 1)
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
        # Intersect a block of queries with all references.
        block = q[start : start + _BLOCK]
        score = np.minimum(block[:, None], r[None]).sum(axis=2)
        if leave_out_self:
            score[np.arange(len(block)), np.arange(start, start + len(block))] = -1
        nearest[start : start + len(block)] = score.argmax(axis=1)
    return nearest
