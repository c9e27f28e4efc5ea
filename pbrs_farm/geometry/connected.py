"""Connected parts of graphs, and of triangle meshes whose corners are numbered by place; no effects."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import I64


def connected_nodes(start: NDArray[np.integer], end: NDArray[np.integer], n: int) -> I64:
    """(n,) number of the connected part of each of n nodes, from 0 in the order of their first nodes.

    start, end: (L,) nodes that links join, in any direction. Half of the time of scipy's csgraph for a few
    hundred links, and the same numbers.
    """
    first = np.arange(n)
    while len(start):
        # Join the first nodes of both ends, then let each node point to the first one of its part.
        a, b = first[start], first[end]
        apart = a != b
        start, end, a, b = start[apart], end[apart], a[apart], b[apart]
        np.minimum.at(first, np.maximum(a, b), np.minimum(a, b))
        while (first != (above := first[first])).any():
            first = above
    is_first = first == np.arange(n)
    return np.asarray((np.cumsum(is_first) - 1)[first], np.int64)


def connected_places(faces: NDArray[np.integer], n: int) -> I64:
    """(n,) number, from 0, of the connected part of each of n places; faces: (F, 3) join places."""
    return connected_nodes(faces[:, :2].ravel(), faces[:, 1:].ravel(), n)


def connected_faces(faces: NDArray[np.integer]) -> I64:
    """(F,) number of the connected part of each face (F, 3) of places, in the order of the places."""
    part = connected_places(faces, int(faces.max(initial=-1)) + 1)
    return np.asarray(part[faces[:, 0]], np.int64)
