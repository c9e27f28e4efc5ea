"""Connected parts of graphs, and of triangle meshes whose corners are numbered by place; no effects."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from pbrs_farm.core.arrays import I64


def connected_nodes(start: NDArray[np.integer], end: NDArray[np.integer], n: int) -> I64:
    """(n,) number, from 0, of the connected part of each of n nodes; start, end: (L,) nodes that links join."""
    links = coo_array((np.ones(len(start), np.int8), (start, end)), shape=(n, n))
    return np.asarray(connected_components(links, directed=False)[1] if n else [], np.int64)


def connected_places(faces: NDArray[np.integer], n: int) -> I64:
    """(n,) number, from 0, of the connected part of each of n places; faces: (F, 3) join places."""
    return connected_nodes(faces[:, :2].ravel(), faces[:, 1:].ravel(), n)


def connected_faces(faces: NDArray[np.integer]) -> I64:
    """(F,) number of the connected part of each face (F, 3) of places, in the order of the places."""
    part = connected_places(faces, int(faces.max(initial=-1)) + 1)
    return np.asarray(part[faces[:, 0]], np.int64)
