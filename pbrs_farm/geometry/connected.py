"""Connected parts of triangle meshes whose corners are numbered by place; no effects."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from pbrs_farm.core.arrays import I64


def connected_places(faces: NDArray[np.integer], n: int) -> I64:
    """(n,) number, from 0, of the connected part of each of n places; faces: (F, 3) join places."""
    start, end = faces[:, :2].ravel(), faces[:, 1:].ravel()
    links = coo_array((np.ones(len(start), np.int8), (start, end)), shape=(n, n))
    return np.asarray(connected_components(links, directed=False)[1], np.int64)


def connected_faces(faces: NDArray[np.integer]) -> I64:
    """(F,) number of the connected part of each face (F, 3) of places, in the order of the places."""
    part = connected_places(faces, int(faces.max(initial=-1)) + 1)
    return np.asarray(part[faces[:, 0]], np.int64)
