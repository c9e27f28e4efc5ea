"""Boundary layers: the published instance boundary, occlusion and crease edges; no effects."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F32, HitRecord, Mask
from pbrs_farm.core.camera import Camera

OCCLUSION_GAP_M = 0.03  # least step in depth of an occlusion boundary
OCCLUSION_GAP_SHARE = 0.02  # the same as a share of the nearer depth: far pixels are far apart
CREASE_RAD = float(np.radians(30))  # least angle between normals of a crease
OWNER, HIDDEN = 255, 128  # the side that owns the occluding edge, the occluded side


def instance_boundary(instance: NDArray[Any]) -> NDArray[np.uint8]:
    """(H, W) uint8, 255 on boundaries: the published definition (docs/spec/suncg.md section 5).

    Pixel (r, c) is boundary when any adjacent pair inside its 2 x 2 block (r..r+1, c..c+1) has
    different ids; in the last row when it differs from its right, in the last column from its
    lower neighbour; the bottom right corner never is.
    """
    right = instance[:, :-1] != instance[:, 1:]
    down = instance[:-1, :] != instance[1:, :]
    return np.where(block_edges(right, down), 255, 0).astype(np.uint8)


def block_edges(right: Mask, down: Mask) -> Mask:
    """(H, W) bool from edges to the right (H, W - 1) and down (H - 1, W): any inside the block."""
    edge = np.zeros((right.shape[0], down.shape[1]), bool)
    edge[:, :-1] |= right  # the block's upper pair
    edge[:-1, :] |= down  # its left pair
    edge[:-1, :-1] |= right[1:, :] | down[:, 1:]  # its lower and its right pair
    return edge


def typed_boundaries(hit: HitRecord, camera: Camera) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    """(H, W) occlusion and (H, W) crease boundaries.

    Occlusion: two neighbours whose depths differ by more than 3 cm and 2 % of the nearer one, and of which neither is
    that near to the other's tangent plane, nor do the planes meet between the two. OWNER (255) on the nearer side,
    whose edge it is, HIDDEN (128) on the farther; something before nothing counts.
    Crease, 255 in the block sense of instance_boundary: neighbours without occlusion whose geometric normals differ by
    more than 30 degrees.
    """
    _, rays = camera.rays()
    occlusion = np.zeros(hit.face.shape, np.uint8)
    creases = []
    for axis in (1, 0):  # pairs along rows, then along columns
        first, second = _neighbours(axis)
        gap = _is_gap(hit, rays, first, second)
        # Mark both sides of an occlusion; of a pixel in several pairs the owner's mark wins.
        near_first = _nearer(hit.depth_z[first], hit.depth_z[second])
        for side, is_near in ((first, near_first), (second, ~near_first)):
            mark = np.where(gap, np.where(is_near, OWNER, HIDDEN), 0).astype(np.uint8)
            occlusion[side] = np.maximum(occlusion[side], mark)
        # Mark creases where one surface, or two that touch, turn.
        normal = hit.geo_normal_world
        cosine = np.einsum("...i,...i->...", normal[first], normal[second])
        both_valid = hit.valid[first] & hit.valid[second]
        creases.append(both_valid & ~gap & (cosine < np.cos(CREASE_RAD)))
    return occlusion, np.where(block_edges(*creases), 255, 0).astype(np.uint8)


def _neighbours(axis: int) -> tuple[tuple[slice, ...], tuple[slice, ...]]:
    """Slices of the first and second pixel of every pair along an axis of (H, W)."""
    low, high, whole = slice(None, -1), slice(1, None), slice(None)
    return ((whole, low), (whole, high)) if axis == 1 else ((low, whole), (high, whole))


def _is_gap(hit: HitRecord, rays: F32, first: tuple[slice, ...], second: tuple[slice, ...]) -> Mask:
    """Whether depth steps between the pixels of each pair, and no plane explains the step."""
    # Ask for a step above the absolute and the relative threshold.
    z_first, z_second = hit.depth_z[first], hit.depth_z[second]
    nearer = np.minimum(z_first, z_second)
    threshold = np.maximum(np.float32(OCCLUSION_GAP_M), np.float32(OCCLUSION_GAP_SHARE) * nearer)
    gap: Mask = np.abs(z_first - z_second) > threshold

    # Extend the tangent plane of either side to the other pixel's ray, where depths differ.
    candidates = np.nonzero(gap & (nearer > 0))
    ends = [
        (
            hit.geo_normal_world[side][candidates],
            hit.depth_z[side][candidates],
            rays[side][candidates],
        )
        for side in (first, second)
    ]
    miss_second, miss_first = _plane_miss(*ends), _plane_miss(*ends[::-1])
    # Drop steps that a plane explains: the surface goes on, seen at a grazing angle.
    near = np.minimum(np.abs(miss_first), np.abs(miss_second)) <= threshold[candidates]
    # Drop corners: if both planes are behind the visible surface, or both in front, they meet
    # between the
    # pixels.
    meet = (miss_first > 0) == (miss_second > 0)
    gap[candidates] = ~(near | meet)
    return gap


_End = tuple[F32, F32, F32]


def _plane_miss(at: _End, other: _End) -> F32:
    """(N,) distance of the other depth from the tangent plane here; an end: normal, depth, ray."""
    normal, depth, ray = at
    # Intersect the other pixel's ray with this pixel's plane n x = n (depth ray).
    with np.errstate(divide="ignore", invalid="ignore"):
        along = np.einsum("ni,ni->n", normal, ray)
        predicted = depth * along / np.einsum("ni,ni->n", normal, other[2])
    # Count a plane that the ray meets behind the camera, or never, as infinitely far.
    ahead = np.where(predicted > 0, predicted, np.float32(np.inf))
    return np.asarray(ahead - other[1], np.float32)


def _nearer(a: F32, b: F32) -> Mask:
    """The first is nearer than the second, where 0 is infinitely far."""
    infinity = np.float32(np.inf)
    return np.where(a > 0, a, infinity) < np.where(b > 0, b, infinity)
