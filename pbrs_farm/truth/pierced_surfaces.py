"""Layers depth_layers: the surfaces along the straight ray of each pixel, one behind the other; no effects.

A ray passes every surface straight through and meets both sides of a solid: a wall has a front and a back, a pane
of one sheet is one surface. A surface at most 0.1 mm behind a counted one, along the ray, belongs to it.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F32, I32, FirstHit, HitRecord
from pbrs_farm.core.camera import Camera
from pbrs_farm.core.house import Geometry
from pbrs_farm.raycast.hit_records import hit_record_from_faces

MOST_SURFACES: Final = 8
APART_M: Final = 1e-4  # along the ray: nearer surfaces are one
_MOST_CASTS: Final = 64  # of a ray, among them those that meet surfaces nearer than APART_M


class PiercedSurfaces(NamedTuple):
    """The first surfaces along each pixel's ray, nearest first; H x W pixels, K = MOST_SURFACES."""

    face: I32  # (H, W, K) index into Geometry.faces, -1 = none
    item: NDArray[np.uint32]  # (H, W, K) instance id, 0 = none
    depth_z: F32  # (H, W, K) metres, as of HitRecord, 0 = none


def pierced_surfaces(
    hit: HitRecord, camera: Camera, geometry: Geometry, first_hit: FirstHit | None
) -> PiercedSurfaces:
    """The up to eight surfaces along the pixels' rays, the first of which is that of hit.

    first_hit: of the caster that made hit; needed if anything is hit. Depth is computed like that of hit, from the
    face's plane in double precision.
    """
    shape = (*hit.face.shape, MOST_SURFACES)
    face, depth = np.full(shape, -1, np.int32), np.zeros(shape, np.float32)
    face[..., 0], depth[..., 0] = hit.face, hit.depth_z
    pixels = np.flatnonzero(hit.valid)
    if len(pixels) and first_hit is None:
        raise ValueError("surfaces behind the first need first_hit")
    eye, directions = camera.exact_rays()
    d = directions.reshape(-1, 3)[pixels]
    apart = APART_M / np.linalg.norm(d, axis=1)  # in lengths of d
    last = hit.depth_z.reshape(-1)[pixels].astype(np.float64)
    begin, n = last + apart, np.ones(len(pixels), np.int64)
    flat_face, flat_depth = face.reshape(-1, MOST_SURFACES), depth.reshape(-1, MOST_SURFACES)
    for _ in range(_MOST_CASTS):
        if first_hit is None or not len(pixels):
            break
        _t, met = first_hit(eye + begin[:, None] * d, d)
        picture = np.full(hit.face.shape, -1, np.int32)
        picture.reshape(-1)[pixels] = met
        t = hit_record_from_faces(geometry, camera, picture).depth_z.reshape(-1)[pixels]
        is_new = (met >= 0) & (t - last > apart)
        rows = pixels[is_new], n[is_new]
        flat_face[rows], flat_depth[rows] = met[is_new], t[is_new]
        n += is_new
        last = np.where(is_new, t, last)
        begin = np.where(is_new, last, np.maximum(begin, t)) + apart
        remains = (met >= 0) & (n < MOST_SURFACES)
        pixels, n, d = pixels[remains], n[remains], d[remains]
        apart, last, begin = apart[remains], last[remains], begin[remains]
    item = np.zeros(shape, np.uint32)
    item[face >= 0] = geometry.face_item[face[face >= 0]]
    return PiercedSurfaces(face, item, depth)
