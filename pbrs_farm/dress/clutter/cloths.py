"""Duvets on beds, throws over seats, clothes where they were dropped; effects: changes the house."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.classes import BED, CLOTHES, OTHERPROP
from pbrs_farm.core.house import Material
from pbrs_farm.dress.clutter.cloth_ground import CELL_M, TOUCH_M, Ground
from pbrs_farm.dress.clutter.drapes import Folds, Net, drape, flat_net, lie_flat, sheet_of
from pbrs_farm.dress.clutter.placing import Placing
from pbrs_farm.dress.models import standing_piece
from pbrs_farm.dress.style import Rgb, mix
from pbrs_farm.dress.supports import plan_turn
from pbrs_farm.dress.thing_materials import plain
from pbrs_farm.geometry.heights import highest_below
from pbrs_farm.geometry.plan_grid import PlanGrid
from pbrs_farm.geometry.scene_triangles import SceneTriangles

_AROUND_M: Final = 0.35  # margin around the cloth in which obstacle heights are sampled
_OVER_M: Final = 0.5  # obstacles that begin higher above the cloth's support are ignored
_LINEN: Final[Rgb] = (0.91, 0.9, 0.88)
_DUVET_M, _THROW_M, _GARMENT_M = 0.03, 0.008, 0.006  # thick
_SUNK_M, _MOST_GAP_M = 0.01, 0.04
_BESIDE_M: Final = (
    0.15  # above the floor: what rises beside a bed keeps its duvet from hanging there
)
_INSIDE_M: Final = 0.03  # from the mattress's edge, where a duvet does not hang over it
_BOARD_M: Final = 0.02  # above the mattress: what rises more at its foot is a board
_SMALLER: Final = (1.0, 0.8, 0.6)  # sizes that clothes and throws are tried at, by the first
_TRIES: Final = 4  # places on a seat where a throw is tried, at each size
_FALLS: Final = 2  # attempts to drop a throw; then it is laid flat
_MOST_RISE_M: Final = 0.1  # clothes fall only where nothing below them is higher than this
_THREADS_M: Final = {"duvet": 0.065, "throw": 0.05, "clothes": 0.04}


def lay_duvet(
    placing: Placing,
    scene: SceneTriangles,
    index: int,
    grid: PlanGrid,
    sides: tuple[float, float],
    rows: tuple[float, float],
    level: float,
) -> F64 | None:
    """Lay a duvet over a mattress between its sides and rows; its triangles (F, 3, 3), None: left out.

    grid: the bed's, whose rows run from its head; sides, rows: metres in it. level: the mattress's.
    """
    rng = placing.rng
    ground, shift = _ground_under_cloth(
        placing, scene, grid, sides, rows, level, _THREADS_M["duvet"]
    )
    # It hangs over each side of the bed that has free space.
    out = float(rng.uniform(0.1, 0.26))
    free = [
        _is_free_beside_bed(ground, shift, side, rows, sign, placing)
        for side, sign in zip(sides, (-1, 1), strict=True)
    ]
    low, high = (
        s + sign * (out if ok else -_INSIDE_M)
        for s, sign, ok in zip(sides, (-1, 1), free, strict=True)
    )
    over = float(rng.uniform(0.0, 0.12)) if rng.random() < 0.5 else -_INSIDE_M
    foot = rows[1] + (-_INSIDE_M if _has_footboard(ground, shift, sides, rows[1], level) else over)
    size = (high - low, foot - rows[0])
    middle = ((low + high) / 2 + shift[0], level + _DUVET_M, (rows[0] + foot) / 2 + shift[1])
    mess = placing.house.mess
    net = flat_net(size, _THREADS_M["duvet"], middle, float(rng.normal(0, 0.015 + 0.05 * mess)))
    folds = Folds(int(16 + 26 * mess), 0.024 + 0.03 * mess, 0.06, (0.3, 1.0))
    tint = mix(
        _LINEN, placing.style.textiles[int(rng.integers(4))], float(rng.choice([0.0, 0.25, 0.6]))
    )
    duvet = drape(net, ground, _DUVET_M, folds, rng)
    duvet = duvet or _laid_flat(placing, "duvet", net, ground, _DUVET_M)
    if duvet is None:
        return None
    return _put_cloth(placing, "duvet", duvet, ground, _DUVET_M, plain("duvet", tint, 0.95), BED)


def lay_throw(placing: Placing, scene: SceneTriangles, index: int, more: F64 | None = None) -> None:
    """Let a throw fall over items[index] and more triangles; refused, and counted, if it would be held up."""
    rng = placing.rng
    (low, high), style = scene.bounds[index], placing.style
    across = float(max(high[0] - low[0], high[2] - low[2]))
    # Its frame is the seat's own, whose straight sides are then straight in cells.
    item_turn = plan_turn(scene.items[index], scene.of_item(index).reshape(-1, 3))
    grid, sides, rows = _over(low, high, item_turn)
    level = float(high[1])
    ground, _shift = _ground_under_cloth(
        placing, scene, grid, sides, rows, level, _THREADS_M["throw"], more
    )
    tint = style.textiles[int(rng.integers(len(style.textiles)))]
    folds, throw, n = Folds(20, 0.03, 0.035, (0.2, 0.7)), None, 0
    for smaller in np.repeat(_SMALLER, _TRIES):
        x, z = _local(ground, low + (high - low) * rng.uniform(0.25, 0.75, 3))
        size = (smaller * min(1.3, 0.8 * across), smaller * min(0.9, 0.6 * across))
        turn = float(rng.uniform(-np.pi, np.pi))
        net = flat_net(size, _THREADS_M["throw"], (x, level + 0.05, z), turn)
        # On a shelf beside the sofa a corner of it would stay up there.
        if (ground.at(net.points[..., 0], net.points[..., 2]) > level + _MOST_RISE_M / 2).any():
            continue
        throw, n = drape(net, ground, _THROW_M, folds, rng), n + 1
        if throw is not None or n == _FALLS:
            break
    if n == 0:
        placing.refuse("a throw would hang on what rises beside the seat")
        return
    throw = throw or _laid_flat(placing, "throw", net, ground, _THROW_M)
    if throw is not None:
        _put_cloth(placing, "throw", throw, ground, _THROW_M, plain("throw", tint, 1.0), OTHERPROP)


def drop_clothes(
    placing: Placing, scene: SceneTriangles, at: F64, level: float, *, napkin: bool = False
) -> None:
    """Drop a garment or napkin in a heap at (2,) metres near y level; refused, and counted, if held up."""
    rng, style = placing.rng, placing.style
    near = np.array([[at[0] - 0.3, level, at[1] - 0.3], [at[0] + 0.3, level, at[1] + 0.3]])
    grid, sides, rows = _over(near[0], near[1], float(rng.uniform(-np.pi, np.pi)))
    ground, _shift = _ground_under_cloth(
        placing, scene, grid, sides, rows, level, _THREADS_M["clothes"]
    )
    x, z = _local(ground, np.array([at[0], level, at[1]]))
    size = (float(rng.uniform(0.3, 0.42)), float(rng.uniform(0.24, 0.36)))
    size = (0.14, 0.12) if napkin else size
    factor = 0.35 if napkin else 1.0
    for smaller in _SMALLER:
        w, d = (side * smaller for side in size)
        net = flat_net((w, d), factor * _THREADS_M["clothes"], (x, level + 0.15, z), 0.0)
        # Over the posts of a back rest a corner of it would stay up there, and the cloth with it.
        under = ground.at(net.points[..., 0], net.points[..., 2])
        if (under < level + _MOST_RISE_M).all():
            break
    else:
        placing.refuse("clothes would hang on what rises beside them")
        return
    folds = Folds(14, 0.04 * factor, 0.04 * factor, (0.12 * factor, 0.4 * factor))
    r, g, b = (float(c) for c in rng.random(3))
    tint = mix((r, g, b), style.textiles[int(rng.integers(4))], 0.5)
    tint = mix(tint, _LINEN, 0.7 if napkin else 0.0)
    name, nyu40 = ("napkin", OTHERPROP) if napkin else ("crumpled_clothes", CLOTHES)
    cloth = drape(net, ground, _GARMENT_M, folds, rng)
    cloth = cloth or _laid_flat(placing, name, net, ground, _GARMENT_M)
    if cloth is not None:
        _put_cloth(placing, name, cloth, ground, _GARMENT_M, plain(name, tint, 0.95), nyu40)


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
    placing: Placing,
    scene: SceneTriangles,
    grid: PlanGrid,
    sides: tuple[float, float],
    rows: tuple[float, float],
    level: float,
    thread_m: float,
    more: F64 | None = None,
) -> tuple[Ground, tuple[float, float]]:
    """Ground below cloth between sides and rows of a grid, and the shift of its frame."""
    reach = _AROUND_M
    corner = grid.plan_of((sides[0] - reach) / grid.cell_m, (rows[0] - reach) / grid.cell_m)
    n = [int(np.ceil((span[1] - span[0] + 2 * reach) / CELL_M)) for span in (rows, sides)]
    fine_grid = PlanGrid(corner, grid.turn_rad, CELL_M, (n[0], n[1]))
    ends = fine_grid.plan_of(np.array([0, n[1], 0, n[1]]), np.array([0, 0, n[0], n[0]]))
    floor_y = placing.room.floor_y
    low = np.array([ends[:, 0].min(), floor_y + 0.001, ends[:, 1].min()])
    high = np.array([ends[:, 0].max(), level + _OVER_M, ends[:, 1].max()])
    corners = scene.in_box(low, high)[0]
    corners = np.concatenate(
        [corners, *placing.laid_near(low, high), *([more] if more is not None else [])]
    )
    ground = Ground.of(fine_grid, corners, floor_y, level + _OVER_M, thread_m / 2)
    return ground, (reach - sides[0], reach - rows[0])


def _is_free_beside_bed(
    ground: Ground,
    shift: tuple[float, float],
    side: float,
    rows: tuple[float, float],
    sign: int,
    placing: Placing,
) -> bool:
    """True if the space beside the mattress, where a duvet would hang, is free."""
    x = side + shift[0] + sign * np.arange(0.12, 0.3, CELL_M)
    z = np.arange(rows[0], rows[1], CELL_M) + shift[1]
    heights = ground.at(*np.meshgrid(x, z))
    return bool((heights < placing.room.floor_y + _BESIDE_M).mean() > 0.95)


def _has_footboard(
    ground: Ground,
    shift: tuple[float, float],
    sides: tuple[float, float],
    foot: float,
    level: float,
) -> bool:
    """Whether something rises over the mattress where a duvet would hang over its foot."""
    x = np.arange(sides[0], sides[1], CELL_M) + shift[0]
    z = foot + shift[1] + np.arange(-0.02, 0.15, CELL_M)
    return bool((ground.at(*np.meshgrid(x, z)) > level + _BOARD_M).any())


def _gap_under_cloth(points: F64, ground: Ground) -> float:
    """Gap between cloth (N, 3) and its ground, ignoring the clearance at edges; metres."""
    below = highest_below(points[:, [0, 2]], ground.corners, points[:, 1] + _SUNK_M)
    gap = float((points[:, 1] - np.maximum(below, points[:, 1] - 1.0)).min()) - TOUCH_M
    return min(max(gap, 0.0), _MOST_GAP_M)


def _laid_flat(
    placing: Placing, family: str, net: Net, ground: Ground, thick_m: float
) -> Net | None:
    """Cloth that failed to drop, laid flat; None if that fails too. Both are counted."""
    cloth = lie_flat(net, ground, thick_m)
    placing.refuse(f"{family} found no way to fall, {'left out' if cloth is None else 'lies flat'}")
    return cloth


def _put_cloth(
    placing: Placing,
    family: str,
    net: Net,
    ground: Ground,
    thick_m: float,
    material: Material,
    nyu40: int,
) -> F64:
    """Add dropped cloth to the house; returns its triangles (F, 3, 3)."""
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
