"""Occlusion and crease edges from stored depth and normals, up to their rounding; no effects.

docs/formats/layer_rules.md has the rules. Depth is known to half a millimetre and normals to 16 bits: where a rule
depends on less, either value is right.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pbrs_farm.check.axes import camera_normals, dot
from pbrs_farm.check.cases import ViewCase
from pbrs_farm.check.checks import Check
from pbrs_farm.core.arrays import F64, Bools

_GAP_M, _GAP_SHARE = 0.03, 0.02  # least step of an occlusion, and as a share of the nearer depth
_CREASE_COSINE = float(np.cos(np.radians(30)))
_OWNER, _HIDDEN = 255, 128
_ROUNDING_M = 0.0012  # of two depths in whole mm
_NORMAL_ERROR = 1e-4  # of a component stored in 16 bits, and float32
_COSINE_ERROR = 2e-4
_FARTHEST_MM = 65535  # largest depth that 16 bits hold, and every larger one


class _Sides(NamedTuple):
    """One of the two pixels of each pair."""

    z: F64
    normal: F64
    ray: F64


def check_typed_boundaries(case: ViewCase) -> None:
    """Judge boundary_occlusion and boundary_crease; a pixel that rounding may change is right either way."""
    view, arrays = case.view, case.arrays
    height, width = view.size
    rays = view.ray_grid() @ view.world_from_camera[:3, :3]
    normal = camera_normals(arrays["normal"])
    z = arrays["depth"] / 1000
    # Steps beyond what 16 bits hold are unknown.
    far = arrays["depth"] >= _FARTHEST_MM
    least, most = np.zeros((height, width), int), np.zeros((height, width), int)
    creases: list[tuple[Bools, Bools]] = []
    for first, second in ((np.s_[:, :-1], np.s_[:, 1:]), (np.s_[:-1], np.s_[1:])):
        a, b = (_Sides(z[s], normal[s], rays[s]) for s in (first, second))
        gap, may_be_gap = _gaps(a, b)
        is_open = far[first] | far[second]
        gap, may_be_gap = gap & ~is_open, may_be_gap | is_open
        nearer = _is_nearer(a.z, b.z)
        for side, is_near in ((first, nearer), (second, ~nearer)):
            mark = np.where(is_near, _OWNER, _HIDDEN)
            least[side] = np.maximum(least[side], np.where(gap, mark, 0))
            may_be = np.where(may_be_gap, np.where(is_open, _OWNER, mark), 0)
            most[side] = np.maximum(most[side], may_be)
        cosine = dot(a.normal, b.normal)
        hit = (a.z > 0) & (b.z > 0)
        crease = hit & ~may_be_gap & (cosine < _CREASE_COSINE - _COSINE_ERROR)
        creases.append((crease, hit & ~gap & (cosine < _CREASE_COSINE + _COSINE_ERROR)))
    if "boundary_occlusion" in arrays:
        stored = arrays["boundary_occlusion"].astype(int)
        right = np.isin(stored, (0, _HIDDEN, _OWNER)) & (least <= stored) & (stored <= most)
        case.tally.pixels("boundary_occlusion", case.place, right)
    if "boundary_crease" in arrays:
        stored = arrays["boundary_crease"]
        crease, may_be_crease = (_in_blocks(across, down) for across, down in zip(*creases))
        right = np.where(stored == 255, may_be_crease, (stored == 0) & ~crease)
        case.tally.pixels("boundary_crease", case.place, right)


def _gaps(a: _Sides, b: _Sides) -> tuple[Bools, Bools]:
    """(N,) depth steps between the pixels of each pair for sure; and it may."""
    near = np.minimum(a.z, b.z)
    limit = np.maximum(_GAP_M, _GAP_SHARE * near)
    step = np.abs(a.z - b.z)
    (miss_b, slack_b), (miss_a, slack_a) = _miss(a, b), _miss(b, a)
    sizes, slacks = np.abs([miss_a, miss_b]), np.array([slack_a, slack_b])
    # No step if a plane goes on to the other pixel, or both planes meet between the two.
    on_plane = (sizes + slacks).min(0) <= limit - _ROUNDING_M
    may_be_on = (sizes - slacks).min(0) <= limit + _ROUNDING_M
    a_before, b_before = miss_a < -slack_a, miss_b < -slack_b
    a_behind, b_behind = miss_a > slack_a, miss_b > slack_b
    meet = (a_before & b_before) | (a_behind & b_behind)
    part = (a_before & b_behind) | (a_behind & b_before)
    hit = near > 0
    is_gap = (step > limit + _ROUNDING_M) & ~(hit & (may_be_on | ~part))
    may_be_gap = (step > limit - _ROUNDING_M) & ~(hit & (on_plane | meet))
    return is_gap, may_be_gap


def _miss(side: _Sides, other: _Sides) -> tuple[F64, F64]:
    """Distance of the other's depth from the plane here, and its rounding error; metres."""
    cosine = dot(side.normal, side.ray)
    other_cosine = dot(side.normal, other.ray)
    with np.errstate(divide="ignore", invalid="ignore"):
        predicted = side.z * cosine / other_cosine
        size = np.abs(predicted)
        slack = _ROUNDING_M * (1 + np.abs(predicted / np.maximum(side.z, 1e-6)))
        slack += _NORMAL_ERROR * size * (2 / np.abs(other_cosine) + 1)
    # A plane that grazes the ray may be met in front of the eye or far behind.
    graze = ~(np.abs(other_cosine) > 4 * _NORMAL_ERROR)
    ahead = np.where(predicted > 0, predicted, np.inf)
    miss = np.nan_to_num(ahead - other.z, nan=0.0, posinf=1e9)
    return miss, np.where(graze, np.inf, np.nan_to_num(slack, nan=np.inf, posinf=np.inf))


def _is_nearer(a: F64, b: F64) -> Bools:
    """The first depth is nearer than the second, where 0 is infinitely far."""
    return np.asarray(np.where(a > 0, a, np.inf) < np.where(b > 0, b, np.inf), bool)


def _in_blocks(across: Bools, down: Bools) -> Bools:
    """(H, W) any edge within the block of a pixel and its neighbours right and below."""
    edge = np.zeros((across.shape[0], down.shape[1]), bool)
    edge[:, :-1] |= across
    edge[:-1, :] |= down
    edge[:-1, :-1] |= across[1:, :] | down[:, 1:]
    return edge


CHECKS = (
    Check(
        "typed boundaries",
        "view",
        check_typed_boundaries,
        14,
        ("boundary_occlusion", "boundary_crease"),
    ),
)
