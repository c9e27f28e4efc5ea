"""Occlusion and crease edges from stored depth and normals, as far as their rounding lets one say; no effects.

docs/formats/layer_rules.md tells the rules. Depth is known to half a millimetre and normals to 16 bits: where a rule
hangs on less, either value is right.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.check.certificate import Tally
from pbrs_farm.check.embree_caster import Floats
from pbrs_farm.check.stored_view import StoredView

Bools = NDArray[np.bool_]
GAP_M, GAP_SHARE = 0.03, 0.02  # least step of an occlusion, and as a part of the nearer depth
CREASE_COSINE = float(np.cos(np.radians(30)))
OWNER, HIDDEN = 255, 128
ROUNDING_M = 0.0012  # of two depths in whole mm
NORMAL_ERROR = 1e-4  # of a component stored in 16 bits, and float32
COSINE_ERROR = 2e-4
FARTHEST_MM = 65535  # and what is farther


@dataclass(frozen=True, slots=True, eq=False)
class _Sides:
    """One of the two pixels of each pair."""

    z: Floats
    normal: Floats
    ray: Floats


def check_typed_boundaries(
    view: StoredView, arrays: Mapping[str, NDArray[Any]], tally: Tally
) -> None:
    """Judge boundary_occlusion and boundary_crease over the whole picture, where the view has them.

    arrays has depth and normal, too. A pixel is right where a rule that rounding does not touch says
    so, or where rounding leaves it open.
    """
    if not {"boundary_occlusion", "boundary_crease"} & arrays.keys():
        return
    height, width = view.size
    rows, columns = (g.reshape(-1) for g in np.mgrid[0:height, 0:width])
    _, rays = view.rays(rows, columns)
    rays = (rays @ view.world_from_camera[:3, :3]).reshape(height, width, 3)
    decoded = arrays["normal"] * (2 / 65535) - 1
    normal = np.stack([decoded[..., 0], -decoded[..., 2], decoded[..., 1]], axis=-1)
    z = arrays["depth"] / 1000
    # Beyond what 16 bits hold a step is unknown.
    far = arrays["depth"] >= FARTHEST_MM
    sure, may = np.zeros((height, width), int), np.zeros((height, width), int)
    creases: list[tuple[Bools, Bools]] = []
    for axis in (1, 0):
        low, high, whole = slice(None, -1), slice(1, None), slice(None)
        first, second = (
            ((whole, low), (whole, high)) if axis == 1 else ((low, whole), (high, whole))
        )
        a, b = (_Sides(z[s], normal[s], rays[s]) for s in (first, second))
        gap, maybe = _gaps(a, b)
        open_ = far[first] | far[second]
        gap, maybe = gap & ~open_, maybe | open_
        nearer = _is_nearer(a.z, b.z)
        for side, is_near in ((first, nearer), (second, ~nearer)):
            mark = np.where(is_near, OWNER, HIDDEN)
            sure[side] = np.maximum(sure[side], np.where(gap, mark, 0))
            may[side] = np.maximum(may[side], np.where(maybe, np.where(open_, OWNER, mark), 0))
        cosine = np.einsum("...i,...i->...", a.normal, b.normal)
        both = (a.z > 0) & (b.z > 0)
        creases.append(
            (
                both & ~maybe & (cosine < CREASE_COSINE - COSINE_ERROR),
                both & ~gap & (cosine < CREASE_COSINE + COSINE_ERROR),
            )
        )
    if "boundary_occlusion" in arrays:
        stored = arrays["boundary_occlusion"].astype(int)
        right = np.isin(stored, (0, HIDDEN, OWNER)) & (sure <= stored) & (stored <= may)
        _tally(view, "boundary_occlusion", right, tally)
    if "boundary_crease" in arrays:
        stored = arrays["boundary_crease"]
        least, most = (_in_blocks(creases[0][k], creases[1][k]) for k in (0, 1))
        right = np.where(stored == 255, most, (stored == 0) & ~least)
        _tally(view, "boundary_crease", right, tally)


def _gaps(a: _Sides, b: _Sides) -> tuple[Bools, Bools]:
    """Whether depth steps between the pixels of each pair for sure, and whether it may."""
    near = np.minimum(a.z, b.z)
    limit = np.maximum(GAP_M, GAP_SHARE * near)
    step = np.abs(a.z - b.z)
    (miss_b, slack_b), (miss_a, slack_a) = _miss(a, b), _miss(b, a)
    sizes, slacks = np.abs([miss_a, miss_b]), np.array([slack_a, slack_b])
    # A plane goes on to the other pixel, or both planes meet between the two: no step.
    on_plane = (sizes + slacks).min(0) <= limit - ROUNDING_M
    may_be_on = (sizes - slacks).min(0) <= limit + ROUNDING_M
    before, behind = (
        ((miss_a < -slack_a), (miss_b < -slack_b)),
        ((miss_a > slack_a), (miss_b > slack_b)),
    )
    meet = (before[0] & before[1]) | (behind[0] & behind[1])
    part = (before[0] & behind[1]) | (behind[0] & before[1])
    asked = near > 0
    sure = (step > limit + ROUNDING_M) & ~(asked & (may_be_on | ~part))
    maybe = (step > limit - ROUNDING_M) & ~(asked & (on_plane | meet))
    return sure, maybe


def _miss(at: _Sides, other: _Sides) -> tuple[Floats, Floats]:
    """How far the other's depth lies from the plane here, and what rounding makes of it; metres."""
    here = np.einsum("...i,...i->...", at.normal, at.ray)
    there = np.einsum("...i,...i->...", at.normal, other.ray)
    with np.errstate(divide="ignore", invalid="ignore"):
        predicted = at.z * here / there
        slack = ROUNDING_M * (1 + np.abs(predicted / np.maximum(at.z, 1e-6)))
        slack += 2 * NORMAL_ERROR * np.abs(predicted) / np.abs(there) + NORMAL_ERROR * np.abs(
            predicted
        )
    # A plane that grazes the ray may be met before the eye or far behind.
    graze = ~(np.abs(there) > 4 * NORMAL_ERROR)
    ahead = np.where(predicted > 0, predicted, np.inf)
    return np.nan_to_num(ahead - other.z, nan=0.0, posinf=1e9), np.where(
        graze, np.inf, np.nan_to_num(slack, nan=np.inf, posinf=np.inf)
    )


def _is_nearer(a: Floats, b: Floats) -> Bools:
    """The first is nearer than the second, where 0 is infinitely far."""
    return np.asarray(np.where(a > 0, a, np.inf) < np.where(b > 0, b, np.inf), bool)


def _in_blocks(right: Bools, down: Bools) -> Bools:
    """(H, W) any edge within the block of a pixel and its neighbours right and below."""
    edge = np.zeros((right.shape[0], down.shape[1]), bool)
    edge[:, :-1] |= right
    edge[:-1, :] |= down
    edge[:-1, :-1] |= right[1:, :] | down[:, 1:]
    return edge


def _tally(view: StoredView, check: str, right: Bools, tally: Tally) -> None:
    tally.add(check, right.size)
    if not right.all():
        row, column = np.argwhere(~right)[0]
        tally.fail(check, view.place, f"row {row}, column {column}", int((~right).sum()))
