"""Share of one view's surface visible in another one, for each pair of views of a room; no effects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from pbrs_farm.core.arrays import F64, FirstHit
from pbrs_farm.core.camera import View
from pbrs_farm.truth.optical_flow import inside_picture, project_points, reaches

POINTS_SIZE: Final = (32, 24)
"""Width and height of the grid of rays that samples a view's surface."""


@dataclass(frozen=True, slots=True)
class ViewPairRow:
    """Two views of one room, the first before the second in cameras.json."""

    room: str
    view_a: str
    view_b: str
    a_in_b: float  # share of the surface points of a that b sees
    b_in_a: float
    common: float  # their mean
    baseline_m: float  # between the eyes
    angle_deg: float  # between the directions of view


def pair_rows(views: Sequence[View], first_hit: FirstHit) -> list[ViewPairRow]:
    """A row for each pair of views of a room, in order; time grows with the square of its views."""
    rooms: dict[str, list[View]] = {}
    for view in views:
        rooms.setdefault(view.room_id, []).append(view)
    rows = []
    for room, room_views in rooms.items():
        shares = shared_surface(room_views, first_hit)
        for a in range(len(room_views)):
            rows += [
                _pair_row(room, room_views, a, b, shares) for b in range(a + 1, len(room_views))
            ]
    return rows


def shared_surface(views: Sequence[View], first_hit: FirstHit) -> F64:
    """(N, N) share of the surface points of view a visible, by a ray, in view b; 0 if a shows nothing."""
    shares = np.eye(len(views))
    small = [view.camera.with_size(*POINTS_SIZE) for view in views]
    for a, camera in enumerate(small):
        # Find where a's rays end.
        origin, directions = camera.exact_rays()
        flat = directions.reshape(-1, 3)
        t, face = first_hit(np.broadcast_to(origin, flat.shape), flat)
        hit = face >= 0
        points, faces = origin + t[hit, None].astype(np.float64) * flat[hit], face[hit]
        for b, partner in enumerate(small):
            if a != b and len(points):
                px, z = project_points(points, partner)
                inside = inside_picture(px, z, partner)
                visible = reaches(points[inside], faces[inside], partner, first_hit)
                shares[a, b] = visible.sum() / len(points)
    return shares


def _pair_row(room: str, views: Sequence[View], a: int, b: int, shares: F64) -> ViewPairRow:
    first, second = views[a].camera, views[b].camera
    cosine = float(np.clip(first.towards @ second.towards, -1, 1))
    a_in_b, b_in_a = float(shares[a, b]), float(shares[b, a])
    return ViewPairRow(
        room,
        views[a].id,
        views[b].id,
        a_in_b,
        b_in_a,
        (a_in_b + b_in_a) / 2,
        float(np.linalg.norm(first.eye - second.eye)),
        float(np.degrees(np.arccos(cosine))),
    )
