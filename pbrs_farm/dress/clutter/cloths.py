"""Duvets on beds, throws over seats, clothes where they were dropped; effects: changes the house."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np
from scipy import ndimage

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.classes import BED, CLOTHES, OTHERPROP
from pbrs_farm.core.house import Material
from pbrs_farm.dress.clutter.drapes import (
    CELL_M,
    TOUCH_M,
    Folds,
    Ground,
    add_folds,
    drop_net,
    flat_net,
    sheet_of,
)
from pbrs_farm.dress.clutter.placing import Placing
from pbrs_farm.dress.style import Rgb, mix
from pbrs_farm.dress.things.assembly import standing_piece
from pbrs_farm.dress.things.materials import plain
from pbrs_farm.geometry.heights import highest_below
from pbrs_farm.geometry.plan_grid import PlanGrid
from pbrs_farm.geometry.scene_triangles import SceneTriangles

_AROUND_M: Final = 0.2  # margin around the cloth in which obstacle heights are sampled
_OVER_M: Final = 0.5  # obstacles that begin higher above the cloth's support are ignored
_LINEN: Final[Rgb] = (0.91, 0.9, 0.88)
_DUVET_M: Final = 0.03  # thick
_SUNK_M, _MOST_GAP_M = 0.01, 0.04
_BESIDE_M: Final = (
    0.15  # above the floor: what rises beside a bed keeps its duvet from hanging there
)
_SMALLER: Final = (1.0, 0.8, 0.6)  # sizes that clothes are tried at, by the first
_MOST_RISE_M: Final = 0.1  # clothes fall only where nothing below them is higher than this
_THREADS_M: Final = {"duvet": 0.065, "throw": 0.05, "clothes": 0.04}


def lay_duvet(
    placing: Placing, scene: SceneTriangles, index: int, grid: PlanGrid, sides: tuple[float, float],
    rows: tuple[float, float], level: float,
) -> F64:  # fmt: skip
    """Lay a duvet over a mattress between its sides and rows; its triangles (F, 3, 3).

    grid: the bed's, whose rows run from its head; sides, rows: metres in it. level: the mattress's.
    """
    rng = placing.rng
    ground, shift = _ground_under_cloth(placing, scene, grid, sides, rows, level, _DUVET_M)
    # It hangs over each side as far as nothing stands beside the bed.
    out = float(rng.uniform(0.1, 0.26))
    free = [
        _is_free_beside_bed(ground, shift, side, rows, sign, placing)
        for side, sign in zip(sides, (-1, 1), strict=True)
    ]
    low, high = (
        s + sign * (out if ok else 0.01) for s, sign, ok in zip(sides, (-1, 1), free, strict=True)
    )
    foot = rows[1] + (float(rng.uniform(0.0, 0.12)) if rng.random() < 0.5 else -0.03)
    size = (high - low, foot - rows[0])
    middle = ((low + high) / 2 + shift[0], level + _DUVET_M, (rows[0] + foot) / 2 + shift[1])
    mess = placing.house.mess
    net, threads = flat_net(
        size, _THREADS_M["duvet"], middle, float(rng.normal(0, 0.015 + 0.05 * mess))
    )
    folds = Folds(int(6 + 26 * mess), 0.018 + 0.03 * mess, 0.05, (0.3, 1.0))
    net = add_folds(drop_net(net, threads, ground, _DUVET_M), ground, _DUVET_M, folds, rng)
    tint = mix(
        _LINEN, placing.style.textiles[int(rng.integers(4))], float(rng.choice([0.0, 0.25, 0.6]))
    )
    return _put_cloth(placing, "duvet", net, ground, _DUVET_M, plain("duvet", tint, 0.95), BED)


def lay_throw(placing: Placing, scene: SceneTriangles, index: int, more: F64 | None = None) -> None:
    """Let a throw fall over items[index], where it was left. more: triangles that lie there, too."""
    rng = placing.rng
    (low, high), style = scene.bounds[index], placing.style
    across = float(max(high[0] - low[0], high[2] - low[2]))
    grid, sides, rows = _over(low, high, float(rng.uniform(-np.pi, np.pi)))
    at = low + (high - low) * rng.uniform(0.25, 0.75, 3)
    ground, _shift = _ground_under_cloth(
        placing, scene, grid, sides, rows, float(high[1]), 0.008, more
    )
    x, z = _local(ground, at)
    size = (min(1.3, 0.8 * across), min(0.9, 0.6 * across))
    net, threads = flat_net(size, _THREADS_M["throw"], (x, float(high[1]) + 0.05, z), 0.0)
    folds = Folds(10, 0.03, 0.03, (0.2, 0.7))
    net = add_folds(drop_net(net, threads, ground, 0.008), ground, 0.008, folds, rng)
    tint = style.textiles[int(rng.integers(len(style.textiles)))]
    _put_cloth(placing, "throw", net, ground, 0.008, plain("throw", tint, 1.0), OTHERPROP)


def drop_clothes(
    placing: Placing, scene: SceneTriangles, at: F64, level: float, *, napkin: bool = False
) -> None:
    """Let a garment, or a napkin, fall in a heap on what lies below a plan place.

    at: (2,) world (x, z), metres. level: world y of the support there, about. Refused, and counted, where
    it would hang on what rises beside it. Cloth that fell before in this room is met.
    """
    rng, style = placing.rng, placing.style
    near = np.array([[at[0] - 0.3, level, at[1] - 0.3], [at[0] + 0.3, level, at[1] + 0.3]])
    grid, sides, rows = _over(near[0], near[1], float(rng.uniform(-np.pi, np.pi)))
    ground, _shift = _ground_under_cloth(placing, scene, grid, sides, rows, level, 0.006)
    x, z = _local(ground, np.array([at[0], level, at[1]]))
    size = (float(rng.uniform(0.3, 0.42)), float(rng.uniform(0.24, 0.36)))
    size = (0.14, 0.12) if napkin else size
    factor = 0.35 if napkin else 1.0
    for smaller in _SMALLER:
        w, d = (side * smaller for side in size)
        net, threads = flat_net((w, d), factor * _THREADS_M["clothes"], (x, level + 0.15, z), 0.0)
        # An outline that nobody laid out.
        net[..., [0, 2]] += np.stack(
            [
                ndimage.gaussian_filter(rng.normal(0, 0.3 * factor * smaller, net.shape[:2]), 2.0)
                for _ in range(2)
            ],
            -1,
        )
        # Over the posts of a back rest a corner of it would stay up there, and the cloth with it.
        if (ground.at(net[..., 0], net[..., 2]) < level + _MOST_RISE_M).all():
            break
    else:
        placing.refuse("clothes would hang on what rises beside them")
        return
    folds = Folds(16, 0.05 * factor, 0.028 * factor, (0.12 * factor, 0.4 * factor))
    net = add_folds(drop_net(net, threads, ground, 0.006), ground, 0.006, folds, rng)
    r, g, b = (float(c) for c in rng.random(3))
    tint = mix((r, g, b), style.textiles[int(rng.integers(4))], 0.5)
    tint = mix(tint, _LINEN, 0.7 if napkin else 0.0)
    name, nyu40 = ("napkin", OTHERPROP) if napkin else ("crumpled_clothes", CLOTHES)
    _put_cloth(placing, name, net, ground, 0.006, plain(name, tint, 0.95), nyu40)


def _over(
    low: F64, high: F64, turn_rad: float
) -> tuple[PlanGrid, tuple[float, float], tuple[float, float]]:
    plan = np.array([[x, z] for x in (low[0], high[0]) for z in (low[2], high[2])])
    grid = PlanGrid.around(plan, turn_rad, CELL_M, 0.0)
    return grid, (0.0, grid.shape[1] * CELL_M), (0.0, grid.shape[0] * CELL_M)


def _local(ground: Ground, at: F64) -> tuple[float, float]:
    column, _y, row = ground.grid.local(at)
    return float(column * ground.grid.cell_m), float(row * ground.grid.cell_m)


def _ground_under_cloth(
    placing: Placing, scene: SceneTriangles, grid: PlanGrid, sides: tuple[float, float],
    rows: tuple[float, float], level: float, thick_m: float,
    more: F64 | None = None,
) -> tuple[Ground, tuple[float, float]]:  # fmt: skip
    """What lies under cloth between sides and rows of a grid, and how far the frame is shifted."""
    reach = _AROUND_M + 0.4
    corner = grid.plan_of((sides[0] - reach) / grid.cell_m, (rows[0] - reach) / grid.cell_m)
    n = [int(np.ceil((span[1] - span[0] + 2 * reach) / CELL_M)) for span in (rows, sides)]
    own = PlanGrid(corner, grid.turn_rad, CELL_M, (n[0], n[1]))
    ends = own.plan_of(np.array([0, n[1], 0, n[1]]), np.array([0, 0, n[0], n[0]]))
    floor_y = placing.room.floor_y
    low = np.array([ends[:, 0].min(), floor_y + 0.001, ends[:, 1].min()])
    high = np.array([ends[:, 0].max(), level + _OVER_M, ends[:, 1].max()])
    corners = scene.in_box(low, high)[0]
    corners = np.concatenate(
        [corners, *placing.laid_near(low, high), *([more] if more is not None else [])]
    )
    ground = Ground.of(own, corners, floor_y, level + _OVER_M, thick_m)
    return ground, (reach - sides[0], reach - rows[0])


def _is_free_beside_bed(
    ground: Ground, shift: tuple[float, float], side: float, rows: tuple[float, float], sign: int,
    placing: Placing,
) -> bool:  # fmt: skip
    """Whether nothing stands beside the mattress where a duvet would hang."""
    x = side + shift[0] + sign * np.arange(0.12, 0.3, CELL_M)
    z = np.arange(rows[0], rows[1], CELL_M) + shift[1]
    heights = ground.at(*np.meshgrid(x, z))
    return bool((heights < placing.room.floor_y + _BESIDE_M).mean() > 0.95)


def _gap_under_cloth(points: F64, ground: Ground) -> float:
    """How far cloth (N, 3) hangs over what it fell on, whose edges it was kept off; metres."""
    below = highest_below(points[:, [0, 2]], ground.corners, points[:, 1] + _SUNK_M)
    gap = float((points[:, 1] - np.maximum(below, points[:, 1] - 1.0)).min()) - TOUCH_M
    return min(max(gap, 0.0), _MOST_GAP_M)


def _put_cloth(
    placing: Placing, family: str, net: F64, ground: Ground, thick_m: float, material: Material,
    nyu40: int,
) -> F64:  # fmt: skip
    surface = sheet_of(family, net, ground, thick_m)
    thing = standing_piece(family, [(surface, material)], group="blanket", nyu40=nyu40)
    points = surface.positions.astype(np.float64)
    if family != "duvet":
        points[:, 1] -= _gap_under_cloth(points, ground)
        surface = replace(surface, positions=points.astype(np.float32))
    base = (points.min(0) + points.max(0)) / 2
    base[1] = points[:, 1].min()
    placing.put(thing, base, 0.0)
    corners = points[surface.faces]
    placing.laid.append(corners)
    return np.asarray(corners)
