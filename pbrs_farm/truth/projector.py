"""Dots of an infrared projector (Intel's D400, a first Kinect), as the camera beside it sees them; no effects."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F64, Bools, FirstHit, HitRecord
from pbrs_farm.core.camera import Camera
from pbrs_farm.core.frames import linear_from_srgb, srgb_from_linear
from pbrs_farm.truth.optical_flow import reaches

BESIDE_M: Final = 0.05  # to the right of a camera without a partner
CELL_RAD: Final = (
    0.006  # of the grid that holds at most one dot a cell: some 30,000 in 70 x 50 degrees
)
DOT_SHARE: Final = 0.4  # of the cells that hold one
DOT_RAD: Final = 0.0012  # where a dot has e^-1/2 of its middle
FULL_M: Final = 2.5  # a white wall there, seen straight on, has 255 in a dot's middle


def projector_label(
    hit: HitRecord,
    camera: Camera,
    partner: Camera | None,
    albedo: NDArray[np.uint8],
    first_hit: FirstHit,
) -> NDArray[np.uint8]:
    """(H, W) uint8: light of the dots that returns to the camera, by reflectance, slant and distance.

    The projector is in the middle of a stereo pair (partner: the other camera), else BESIDE_M to the right, and has the
    camera's direction: both pictures of a pair show the same dots on the same surfaces. albedo: (H, W, 3) uint8 sRGB;
    dyes are bright in infrared, so that the brightest channel is taken. Encoded as sRGB is. 0 between the dots, in the
    projector's shadow, and where nothing is hit.
    """
    pixels = np.flatnonzero(hit.valid.ravel())
    points = hit.points.position_world.reshape(-1, 3)[pixels].astype(np.float64)
    right, up, back = camera.world_from_camera[:3, :3].T
    eye = camera.eye + BESIDE_M * right if partner is None else (camera.eye + partner.eye) / 2
    to = points - eye
    along, distance = -(to @ back), np.linalg.norm(to, axis=1)
    lit = along > 0
    # Only rays that carry light are tried against the room.
    light = np.zeros(len(pixels))
    angles = np.arctan2((to @ np.stack([right, up], 1)), along[:, None])
    light[lit] = _dots(angles[lit])
    lit &= light > 0.5 / 255
    reached = _reached(eye, camera, points, hit.face.ravel()[pixels], lit, first_hit)
    normal = hit.geo_normal_world.reshape(-1, 3)[pixels]
    cosine = np.abs((normal * to).sum(1)) / np.maximum(distance, 1e-6)
    infrared = linear_from_srgb(albedo.reshape(-1, 3)[pixels].max(1) / 255.0)
    falloff = (FULL_M / np.maximum(distance, 1e-3)) ** 2
    out = np.zeros(hit.face.size, np.uint8)
    back_light = srgb_from_linear(np.clip(light * infrared * cosine * falloff, 0, 1))
    out[pixels] = np.where(reached, np.rint(255 * back_light), 0)
    return out.reshape(hit.face.shape)


def _reached(
    eye: F64, camera: Camera, points: F64, faces: NDArray[np.int32], lit: Bools, first_hit: FirstHit
) -> Bools:
    world = camera.world_from_camera.copy()
    world[:3, 3] = eye
    reached = np.zeros(len(points), bool)
    reached[lit] = reaches(points[lit], faces[lit], Camera(camera.intrinsics, world), first_hit)
    return reached


def _dots(angles: F64) -> F64:
    """(N,) brightness 0..1 of directions (N, 2), radians: a hash decides if a cell has a dot in its middle half."""
    cell = np.floor(angles / CELL_RAD)
    key = (cell.astype(np.int64) & 0xFFFF).astype(np.uint64)
    mixed = _hash(key[:, 0] << np.uint64(16) | key[:, 1])
    share, x, y = ((mixed >> np.uint64(s) & np.uint64(0xFFFF)) / 65535.0 for s in (0, 16, 32))
    middle = (cell + 0.25 + 0.5 * np.stack([x, y], 1)) * CELL_RAD
    squared = ((angles - middle) ** 2).sum(1) / DOT_RAD**2
    return np.asarray(np.where(share < DOT_SHARE, np.exp(-squared / 2), 0.0))


def _hash(value: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """splitmix64 (Steele, Lea and Flood 2014): 64 bits that look random, of 64."""
    z = value + np.uint64(0x9E3779B97F4A7C15)
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return z ^ (z >> np.uint64(31))
