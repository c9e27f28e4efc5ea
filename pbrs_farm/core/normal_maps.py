"""Normal maps as glTF 2.0 has them: pictures of normals in tangent space; no effects."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F32, F64, Bools

MIN_Z = 0.1  # of a unit normal: steeper than 84 degrees is noise of the picture


def normals_from_picture(pixels: NDArray[np.uint8] | F32, scale: float) -> F32:
    """(..., 3) unit normals (x along u, y along v, z out of the surface) of (..., 3 or 4) bytes.

    A byte b is 2 b / 255 - 1; scale multiplies x and y before the normal is made of unit length
    (glTF 2.0, section 3.9.3). z is at least MIN_Z.
    """
    # Decode channel by channel: pictures are large.
    x, y, z = (pixels[..., k] * np.float32(2 / 255) - np.float32(1) for k in range(3))
    is_black = (x <= -1) & (y <= -1) & (z <= -1)
    x *= np.float32(scale)
    y *= np.float32(scale)
    # Lift normals that lean into the surface; black pixels, which say nothing, are flat.
    across = np.sqrt(x * x + y * y)
    z = np.maximum(z, np.float32(MIN_Z) * np.maximum(across, np.float32(1e-6)))
    for component, flat in ((x, 0), (y, 0), (z, 1)):
        component[is_black] = flat
    length = np.sqrt(x * x + y * y + z * z)
    return np.asarray(np.stack([x / length, y / length, z / length], -1), np.float32)


def tangents(corners: F64, uvs: F64) -> tuple[F64, F64, Bools]:
    """(dp/du, side, whether both are defined) of triangles: (N, 3), (N,), (N,).

    corners (N, 3, 3) in metres, uvs (N, 3, 2) with v up. dp/du is of any length. side is 1 if the texture is
    not mirrored from the triangle's front, else -1: dp/dv points to the side of cross(n, dp/du) times side.
    Neither is defined if the uvs span no area.
    """
    e1, e2 = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    a, b = uvs[:, 1] - uvs[:, 0], uvs[:, 2] - uvs[:, 0]
    # Solve e = du dp/du + dv dp/dv for both edges.
    area = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    side = np.sign(area)
    dp_du = (b[:, 1:] * e1 - a[:, 1:] * e2) * side[:, None]
    is_defined = np.abs(area) > 1e-6 * ((a * a).sum(1) + (b * b).sum(1))
    return dp_du, side, is_defined


def perturbed_normals(normals: F64, dp_du: F64, side: F64, mapped: F64) -> F64:
    """(N, 3) unit normals of a map in the shading normals' frame; unchanged where a tangent vanishes."""
    # Make dp/du orthogonal to the shading normal (Gram-Schmidt).
    tangent = dp_du - normals * (normals * dp_du).sum(1, keepdims=True)
    length = np.linalg.norm(tangent, axis=1, keepdims=True)
    tangent /= np.maximum(length, 1e-30)
    bitangent = np.cross(normals, tangent) * side[:, None]
    x, y, z = mapped[:, :1], mapped[:, 1:2], mapped[:, 2:]
    bent = x * tangent + y * bitangent + z * normals
    bent /= np.linalg.norm(bent, axis=1, keepdims=True)
    return np.where(length > 1e-20, bent, normals)
