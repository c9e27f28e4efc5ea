"""How many edge pixels of two maps can be paired one to one within a distance; no effects."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import maximum_flow
from scipy.spatial import cKDTree

from pbrs_farm.core.arrays import Mask


def n_matched(predicted: Mask, truth: Mask, max_distance_px: float) -> int:
    """The most pairs of edge pixels, one of each map, no pixel twice, none farther apart than that.

    The benchmark's min-cost assignment (Martin et al. 2004) gives an unpaired pixel a hundred
    times the cost of the farthest pair: it pairs as many pixels as possible. Their number is what
    precision and recall need, and a maximum matching has the same.
    """
    ours, theirs = _pixels(predicted), _pixels(truth)
    if not len(ours) or not len(theirs):
        return 0
    # Join every two pixels that are near enough.
    near: list[list[int]] = list(
        cKDTree(ours).query_ball_point(theirs, max_distance_px + 1e-9, return_sorted=False)  # type: ignore[arg-type]
    )
    degrees = np.array([len(row) for row in near], np.intp)
    if not degrees.any():
        return 0
    pairs = np.concatenate([np.asarray(row, np.intp) for row in near if row])
    # Let one unit flow from a source through each of theirs, a pair, one of ours, to a sink: the
    # largest flow is the largest matching. Dinic's algorithm takes 0.05 s where scipy's own
    # matching of 8,000 pixels to 8,400 ran for minutes.
    of_theirs = np.arange(1, len(theirs) + 1)
    of_ours = np.arange(len(theirs) + 1, len(theirs) + 1 + len(ours))
    sink = len(theirs) + len(ours) + 1
    starts = np.concatenate([np.zeros_like(of_theirs), np.repeat(of_theirs, degrees), of_ours])
    ends = np.concatenate([of_theirs, of_ours[pairs], np.full_like(of_ours, sink)])
    units = np.ones(len(starts), np.int32)
    graph = csr_array((units, (starts, ends)), shape=(sink + 1, sink + 1))
    return int(maximum_flow(graph, 0, sink, method="dinic").flow_value)


def _pixels(edges: Mask) -> NDArray[np.float64]:
    return np.argwhere(edges).astype(np.float64)
