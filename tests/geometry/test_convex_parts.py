"""Convex parts of items: they enclose the whole item, stay close to it, and leave hollows open."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.frames import rotation_y
from pbrs_farm.core.house import corners_of_surfaces
from pbrs_farm.geometry.convex_parts import close_parts, hull_volume, slabs
from pbrs_farm.geometry.solids import box


def solid(low: tuple[float, ...], high: tuple[float, ...]) -> F64:
    a, b = np.array(low, float), np.array(high, float)
    return corners_of_surfaces([box("box", (a + b) / 2, (b - a) / 2, 0)])


def is_in_any(parts: tuple[F64, ...], point: tuple[float, ...]) -> bool:
    planes = [ConvexHull(part).equations for part in parts]
    return any((p[:, :3] @ np.array(point) + p[:, 3]).max() < 1e-6 for p in planes)


def tray(wall: float = 0.02) -> F64:
    """A tray 0.4 x 0.2 x 0.3, open at the top, one closed mesh: outside, inside, rim."""
    outer = np.array([[x, y, z] for x in (0, 0.4) for y in (0, 0.2) for z in (0, 0.3)])
    inner = np.array(
        [[x, y, z] for x in (wall, 0.4 - wall) for y in (wall, 0.2) for z in (wall, 0.3 - wall)]
    )
    p = np.concatenate([outer, inner])
    # Corner (i, j, k) is 4 i + 2 j + k; those inside are 8 more.
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (0, 2, 6, 4), (1, 5, 7, 3)]
    quads += [tuple(8 + v for v in reversed(q)) for q in quads]
    quads += [(2, 3, 11, 10), (7, 6, 14, 15), (6, 2, 10, 14), (3, 7, 15, 11)]
    faces = [t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))]
    return p[np.array(faces)]


@pytest.mark.parametrize("turn", [0.0, 0.4, 1.2])
def test_a_tray_is_its_bottom_and_walls_and_stays_open(turn: float) -> None:
    matrix = rotation_y(turn)
    parts = close_parts(tray() @ matrix.T)
    volume = 0.4 * 0.2 * 0.3 - 0.36 * 0.18 * 0.26
    # Parts from cutting do not overlap: their volumes add up.
    assert sum(map(hull_volume, parts)) == pytest.approx(volume, rel=0.02)
    assert not is_in_any(parts, tuple(matrix @ (0.2, 0.1, 0.15)))
    assert is_in_any(parts, tuple(matrix @ (0.01, 0.1, 0.15)))
    assert is_in_any(parts, tuple(matrix @ (0.2, 0.01, 0.15)))


def test_a_tunnel_of_short_pieces_is_not_filled() -> None:
    rings = [[(-0.1, -0.1), (0.1, -0.1), (0.1, 0.1), (-0.1, 0.1)]]
    rings.append([(0.8 * x, 0.8 * y) for x, y in rings[0]])
    p = np.array([[x, y, z] for ring in rings for z in (0.0, 1.0) for x, y in ring])
    faces = []
    for k in range(4):
        n = (k + 1) % 4
        faces += [(k, n, n + 4), (k, n + 4, k + 4)]  # outside
        faces += [(8 + n, 8 + k, 12 + k), (8 + n, 12 + k, 12 + n)]  # inside
        faces += [(n, k, 8 + k), (n, 8 + k, 8 + n)]  # ends
        faces += [(4 + k, 4 + n, 12 + n), (4 + k, 12 + n, 12 + k)]
    parts = close_parts(p[np.array(faces)])
    assert not any(is_in_any(parts, (0, 0, z)) for z in (0.01, 0.26, 0.5, 0.99))
    assert sum(map(hull_volume, parts)) == pytest.approx(0.04 - 0.0256, rel=0.02)


def test_no_part_is_lost_if_there_are_more_than_the_limit() -> None:
    boxes = [solid((k * 0.1, 0, 0), (k * 0.1 + 0.02, 0.02, 0.02)) for k in range(50)]
    parts = close_parts(np.concatenate(boxes), most=8)
    assert len(parts) == 8
    assert all(is_in_any(parts, (k * 0.1 + 0.01, 0.01, 0.01)) for k in range(50))


def test_the_shelves_of_a_wide_bookcase_stay_open() -> None:
    # 40 boards, more than the parts that a closed mesh is cut into.
    boards = [
        solid(
            (0.5 * (k // 10), 0.2 * (k % 10), 0),
            (0.5 * (k // 10) + 0.48, 0.2 * (k % 10) + 0.02, 0.3),
        )
        for k in range(40)
    ]
    parts = close_parts(np.concatenate(boards))
    assert len(parts) == 40
    assert not is_in_any(parts, (0.2, 0.1, 0.1))


def test_a_slanting_sheet_is_a_millimetre_thick() -> None:
    slope = np.array([[[0.0, 0, 0], [1, 1, 0], [1, 1, 1]], [[0, 0, 0], [1, 1, 1], [0, 0, 1]]])
    (part,) = close_parts(slope)
    assert hull_volume(part) == pytest.approx(np.sqrt(2) * 1e-3, rel=1e-6)


def test_a_wall_with_a_window_has_slabs_around_it() -> None:
    sides = [((0, 0, 0), (1, 2.5, 0.1)), ((2, 0, 0), (3, 2.5, 0.1)), ((1, 0, 0), (2, 1, 0.1))]
    front = [t for a, b in (*sides, ((1, 2, 0), (2, 2.5, 0.1))) for t in solid(a, b)
             if np.ptp(t[:, 2]) == 0 and t[0, 2] > 0]  # fmt: skip
    parts = slabs(np.array(front), depth_m=0.02)
    assert sum(map(hull_volume, parts)) == pytest.approx(0.02 * (3 * 2.5 - 1), rel=1e-5)
    assert not is_in_any(parts, (1.5, 1.5, 0.09))
    assert is_in_any(parts, (0.5, 1.5, 0.09))
    assert not is_in_any(parts, (0.5, 1.5, 0.07))
    (whole,) = slabs(np.array([t for t in solid((0, 0, 0), (1, 1, 1)) if t[:, 1].min() == 1]))
    assert len(whole) == 8
