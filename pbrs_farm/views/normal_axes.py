"""Normals as stored (16 bits) -> unit vectors in camera axes by name; no effects.

Stored normals are round((n + 1) 65535 / 2) in the published axes (docs/formats/pixels.md).
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

# Name -> published axis (0 right, 1 forward, 2 up) and sign of each of x, y and z.
AXES: Final[dict[str, tuple[tuple[int, int], ...]]] = {
    "opencv": ((0, 1), (2, -1), (1, 1)),  # right, down, forward
    "opengl": ((0, 1), (2, 1), (1, -1)),  # right, up, backward
    "published": ((0, 1), (1, 1), (2, 1)),  # right, forward, up
}


def axes_from_published(axes: str) -> NDArray[np.float32]:
    """(3, 3) matrix: n in the axes of that name = matrix @ n in published axes.

    A signed permutation, so its transpose is its inverse. KeyError for a name that is not in AXES.
    """
    matrix = np.zeros((3, 3), np.float32)
    for row, (column, sign) in enumerate(AXES[axes]):
        matrix[row, column] = sign
    return matrix


def axes_from_axes(to: str, of: str) -> NDArray[np.float32]:
    """(3, 3) matrix for directions: n in the axes `to` = matrix @ n in the axes `of`.

    Names are those of AXES: "opencv", "opengl", "published".

        >>> axes_from_axes("opengl", "opencv").diagonal().tolist()
        [1.0, -1.0, -1.0]
    """
    return axes_from_published(to) @ axes_from_published(of).T


def decode_normal(
    stored: NDArray[np.uint16], valid: NDArray[np.bool_], axes: str
) -> NDArray[np.float32]:
    """(H, W, 3) float32 normals in the axes of that name, of unit length within 3e-5; 0 if not valid.

    stored: (H, W, 3) uint16, 0..65535 for -1..1 in published axes. valid: (H, W); other pixels become
    (0, 0, 0). KeyError for axes of an unknown name.
    """
    normal = np.empty(stored.shape, np.float32)
    # Each published channel becomes an axis, with its sign.
    for axis, (channel, sign) in enumerate(AXES[axes]):
        component = normal[..., axis]
        np.multiply(stored[..., channel], np.float32(sign * 2 / 65535), out=component)
        component -= np.float32(sign)
    if not valid.all():
        normal[~valid] = 0
    return normal
