"""Points of a view followed into its partner's picture, by Embree and view.json's cameras; no effects."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pbrs_farm.check.cases import Pixels
from pbrs_farm.check.embree_caster import Rays, is_visible
from pbrs_farm.check.lens_rays import PlacedCamera, StoredCamera
from pbrs_farm.check.stored_view import StoredView
from pbrs_farm.core.arrays import F64, I64, Bools

SEEN, OUTSIDE, HIDDEN = 0, 128, 255
BORDER_PX = 0.01  # within this of the other picture's border a point is in or out
_REACH = 1e-5  # tolerance of a ray's end before a point, as a share of the distance, and in metres
_JITTER_PX = 0.02  # around a point: if its surroundings differ, either state is right

Carry = Callable[[F64], F64]
"""Positions (N, 3) at the partner's time of points (N, 3)."""


def stay(points: F64) -> F64:
    """Static points."""
    return points


def partner_of(view: StoredView, relation: str) -> PlacedCamera | None:
    """The partner of that relation in view.json, or None; KeyError or ValueError for a damaged row."""
    row = view.table.get("partners", {}).get(relation)
    if row is None:
        return None
    pose = np.array(row["world_from_camera_opencv"], np.float64)
    return PlacedCamera(np.array(row["K"], np.float64), pose, view.size, view.lens)


def is_seen(points: F64, other: StoredCamera, rays: Rays, slack_m: float = 0) -> Bools:
    """(N,) True if nothing is between the other eye and a point, beyond the error of 32-bit rays."""
    distance = np.linalg.norm(points - other.eye, axis=1)
    return is_visible(rays, other.eye, points, slack_m + _REACH * (1 + distance))


@dataclass(frozen=True, slots=True, eq=False)
class Followed:
    """N points of a view in its partner's picture."""

    motion: F64  # (N, 2) px right and down; NaN behind the other camera
    state: I64  # (N,) SEEN, OUTSIDE or HIDDEN


def follow_points(
    view: StoredView, other: StoredCamera, pixels: Pixels, z: F64, rays: Rays, carry: Carry = stay
) -> Followed:
    """Follow the surfaces at depth z (N,) metres behind pixels' centres into the other picture.

    rays: of the house at the other view's time. Motion is in px from the pixel's centre.
    """
    rows, columns = pixels
    points, px, margin = _points_of(view, other, pixels, z, carry)
    state = np.full(len(rows), OUTSIDE, np.int64)
    inside = np.nonzero(margin >= 0)[0]
    state[inside] = np.where(is_seen(points[inside], other, rays), SEEN, HIDDEN)
    return Followed(px - np.stack([columns + 0.5, rows + 0.5], axis=1), state)


def near_edge(
    view: StoredView, other: StoredCamera, pixels: Pixels, z: F64, rays: Rays, carry: Carry = stay
) -> Bools:
    """(N,) True near the other picture's border or an obstacle, where another state is right, too; five casts."""
    rows, columns = pixels
    points, _px, margin = _points_of(view, other, pixels, z, carry)
    is_tie = np.asarray(np.abs(margin) <= BORDER_PX, bool)
    visible = is_seen(points, other, rays, slack_m=0.01)
    for dx, dy in ((1, 0), (-1, 0), (0, 1), (0, -1)):
        origin, beside = view.rays(rows + _JITTER_PX * dy, columns + _JITTER_PX * dx)
        moved = carry(origin + beside * z[:, None])
        is_tie |= is_seen(moved, other, rays, slack_m=0.01) != visible
    return is_tie


def _points_of(
    view: StoredView, other: StoredCamera, pixels: Pixels, z: F64, carry: Carry
) -> tuple[F64, F64, F64]:
    """(N, 3) surface points, their (N, 2) px in the other picture, (N,) px inside its border."""
    origin, directions = view.rays(*pixels)
    points = carry(origin + directions * z[:, None])
    px, _depth = other.pixels(points)
    return points, px, other.margin(px)
