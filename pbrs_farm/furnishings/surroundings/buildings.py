"""Buildings with windows, balconies and roofs, parked cars, lamp posts, fences; no effects."""

from __future__ import annotations

from typing import Any, Final, NamedTuple

import numpy as np

from pbrs_farm.core.arrays import F64
from pbrs_farm.furnishings.surroundings.facades import COLUMNS, N_ROOMS, ROWS, Facade
from pbrs_farm.furnishings.surroundings.scenery import (
    Rgb,
    SceneryMaterial,
    Site,
    grass,
    lit,
    mottled,
    paved,
)

# fmt: off
STOREY_M: Final = 3.0

_REVEAL_M: Final = 0.17  # that windows lie behind their front
_EAVES_M: Final = 0.45
_LIT: Final = 0.3  # share of windows with light behind them
_PLINTH_M: Final = 0.5
_DOOR_M: Final = (1.15, 2.45)
_PAINTS: Final[tuple[Rgb, ...]] = ((0.55, 0.56, 0.58), (0.03, 0.03, 0.035), (0.20, 0.21, 0.22),
    (0.30, 0.03, 0.03), (0.05, 0.09, 0.20), (0.70, 0.70, 0.68))
_IRON: Final = SceneryMaterial("iron", rgb=(0.2, 0.2, 0.21))


class Front(NamedTuple):
    """Frame of a building's front: its left foot, along, outward (to the home), up."""

    foot: F64  # (3,)
    along: F64  # (3,) unit
    to_home: F64  # (3,) unit
    site: Site

    @property
    def rng(self) -> np.random.Generator:
        """The source of its draws."""
        return self.site.rng

    def add(self, look: SceneryMaterial, quads: F64, uvs: F64 | None = None) -> None:
        """Add quads in the world, as `Scenery.add` does."""
        self.site.add(look, quads, uvs)

    def at(self, s: F64 | float, y: F64 | float, out: F64 | float = 0.0) -> F64:
        """World places s along, y up, out towards the home."""
        s, y, out = np.broadcast_arrays(*(np.asarray(v, np.float64) for v in (s, y, out)))
        return np.asarray(self.foot + s[..., None] * self.along + y[...,
            None] * np.array([0.0, 1.0, 0.0]) + out[..., None] * self.to_home)

    def rectangles(self, s0: F64, y0: F64, s1: F64, y1: F64, out: F64 | float) -> F64:
        """Upright rectangles (N, 4, 3) between two places along and two heights."""
        corners = [self.at(s, y, out) for s, y in ((s0, y0), (s1, y0), (s1, y1), (s0, y1))]
        return np.stack(corners, -2).reshape(-1, 4, 3)

    def box(self, look: SceneryMaterial, s0: float, s1: float, y0: float, y1: float, out0: float,
        out1: float) -> None:
        """Add a box without a back."""
        s, y = np.tile([s0, s1, s1, s0], 2), np.tile([y0, y0, y1, y1], 2)
        world = self.at(s, y, np.repeat([out1, out0], 4))
        self.add(look, world[[[0, 1, 2, 3], [3, 2, 6, 7], [4, 0, 3, 7], [1, 5, 6, 2], [4, 5, 1, 0]]])


class _Holes(NamedTuple):
    """The windows of a front, metres on it, (N,) each."""

    left: F64
    low: F64
    right: F64
    high: F64
    has_balcony: Any  # (N,) bool


def block(front: Front, facade: Facade, rooms: SceneryMaterial, n_bays: int, n_storeys: int, *,
    depth_m: float = 10.0, has_balconies: bool = False) -> None:
    """A building of several storeys: a front with windows, sides, a roof and what sticks out.

    rooms: the look of `lit_rooms`, for windows of lit rooms.
    """
    width = n_bays * facade.bay_m
    top = _PLINTH_M + n_storeys * STOREY_M
    _body(front, facade, width, top, depth_m)
    share = facade.style.balconies if has_balconies else 0.0
    holes = _front(front, facade, n_bays, n_storeys, share)
    _lit_windows(front, holes, rooms)
    cornice = facade.style.cornice_m
    front.box(facade.trim, -0.1, width + 0.1, top - 0.1, top + 0.22, -0.1, cornice)
    front.box(facade.trim, -0.05, width + 0.05, top - 0.32, top - 0.1, -0.1, 0.45 * cornice)
    if facade.style.surround_m:
        y = _PLINTH_M + STOREY_M
        front.box(facade.trim, 0, width, y - 0.1, y + 0.08, -0.05, 0.09)
    front.box(_IRON, 0.12, 0.22, 0, top, 0.02, 0.12)
    if facade.style.is_flat:
        _flat_roof(front, facade, width, top, depth_m)
    else:
        _roof(front, facade, width, top, depth_m)
    for k in np.flatnonzero(holes.has_balcony):
        _balcony(front, facade, holes.left[k] - 0.35, holes.right[k] + 0.35, holes.low[k] - 0.1)


def house(front: Front, facade: Facade, rooms: SceneryMaterial) -> None:
    """A house of one or two storeys with a gable."""
    rng = front.rng
    n_bays, n_storeys = int(rng.integers(3, 5)), int(rng.integers(1, 3))
    width, depth = n_bays * facade.bay_m, float(rng.uniform(7, 10))
    top = _PLINTH_M + n_storeys * STOREY_M
    ridge = top + rng.uniform(0.32, 0.48) * width if rng.random() < 0.5 else 0.0
    _body(front, facade, width, top, depth)
    holes = _front(front, facade, n_bays, n_storeys, 0.0)
    _lit_windows(front, holes, rooms)
    front.box(_IRON, width - 0.22, width - 0.12, 0, top, 0.02, 0.12)
    if not ridge:
        _roof(front, facade, width, top, depth)
        return
    # The gable looks at the home, under slopes that reach over it.
    middle = width / 2
    gable = np.stack(
        [front.at(0, top), front.at(width, top), front.at(middle, ridge), front.at(middle, ridge)]
    )
    uvs = np.array([[0, top], [width, top], [middle, ridge], [middle, ridge]])
    front.add(facade.wall, gable[None], (uvs / facade.wall.size_m)[None])
    for s in (-_EAVES_M, width + _EAVES_M):
        eave = top - (ridge - top) * _EAVES_M / middle
        a, b = front.at(s, eave, _EAVES_M), front.at(middle, ridge + 0.05, _EAVES_M)
        c, d = front.at(middle, ridge + 0.05, -depth), front.at(s, eave, -depth)
        _slope(front, facade, d, a, b, c)
        low = np.stack([a, b, b - [0, 0.2, 0], a - [0, 0.2, 0]])
        front.add(facade.trim, low[None])


def _body(front: Front, facade: Facade, width: float, top: float, depth: float) -> None:
    """Sides without windows, and a plinth."""
    stone = SceneryMaterial("stone", rgb=(0.46, 0.45, 0.43))
    front.box(stone, 0, width, -0.5, _PLINTH_M, -0.1, 0.05)
    for s in (0.0, width):
        side = np.stack(
            [front.at(s, y, o) for y, o in ((-0.5, 0), (-0.5, -depth), (top, -depth), (top, 0))]
        )
        uvs = np.array([[0, -0.5], [depth, -0.5], [depth, top], [0, top]]) / facade.wall.size_m
        front.add(facade.wall, side[None], uvs[None])


def _front(front: Front, facade: Facade, n_bays: int, n_storeys: int, balconies: float) -> _Holes:
    """The wall of a front, with windows that lie in it, and a door; the windows are returned."""
    x0, y0, x1, y1 = facade.window
    bay, storey = np.indices((n_bays, n_storeys), np.float64).reshape(2, -1)
    n = len(bay)
    left, right = bay * facade.bay_m + x0, bay * facade.bay_m + x1
    floor = _PLINTH_M + storey * STOREY_M
    has_balcony = (storey > 0) & (front.rng.random(n) < balconies)
    # Windows of a balcony are doors, so they begin at its floor.
    low, high = floor + np.where(has_balcony, 0.1, y0), floor + y1
    is_door = (storey == 0) & (bay == int(front.rng.integers(0, n_bays)))
    middle = (left + right) / 2
    left, right = (
        np.where(is_door, middle - _DOOR_M[0] / 2, left),
        np.where(is_door, middle + _DOOR_M[0] / 2, right),
    )
    low, high = np.where(is_door, 0.06, low), np.where(is_door, 0.06 + _DOOR_M[1], high)
    # The wall about each window of a bay, from the storey's floor to its ceiling.
    a, b = bay * facade.bay_m, (bay + 1) * facade.bay_m
    bottom, top = np.where(storey == 0, _PLINTH_M, floor), floor + STOREY_M
    at_sill = np.maximum(low, bottom)
    for s0, t0, s1, t1 in ((a, bottom, left, top), (right, bottom, b, top),
        (left, bottom, right, at_sill), (left, high, right, top)):
        _add_wall(front, facade.wall, s0, t0, s1, t1)
    # reveals and their contents
    inner = facade.trim if facade.style.surround_m else facade.wall
    for p, q, r, t in ((left, low, left, high), (right, high, right, low),
        (left, high, right, high), (right, low, left, low)):
        reveal = np.stack([front.at(p, q), front.at(r, t), front.at(r, t, -_REVEAL_M),
            front.at(p, q, -_REVEAL_M)], -2)
        front.add(inner, reveal)
    is_glass = ~is_door
    cells = front.rng.integers(0, COLUMNS * ROWS, n)
    corner = np.stack([cells % COLUMNS / COLUMNS, cells // COLUMNS / ROWS], -1)
    unit = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
    uvs = corner[:, None] + unit * [1 / COLUMNS, 1 / ROWS]
    panes = front.rectangles(left, low, right, high, -_REVEAL_M)
    front.add(facade.windows, panes[is_glass], uvs[is_glass])
    if is_door.any():
        front.add(facade.door, panes[is_door], unit[None].astype(np.float64))
    _about_windows(front, facade, left[is_glass], low[is_glass], right[is_glass], high[is_glass])
    corners = left, low, right, high, has_balcony
    return _Holes(*(v[is_glass] for v in corners))


def _add_wall(front: Front, look: SceneryMaterial, s0: F64, y0: F64, s1: F64, y1: F64) -> None:
    """Rectangles of a front, its picture in metres on it."""
    corners = [
        np.stack(np.broadcast_arrays(s, y), -1) for s, y in ((s0, y0), (s1, y0), (s1, y1), (s0, y1))
    ]
    front.add(look, front.rectangles(s0, y0, s1, y1, 0.0), np.stack(corners, -2) / look.size_m)


def _about_windows(front: Front, facade: Facade, left: F64, low: F64,
    right: F64, high: F64) -> None:
    """Sills, bands about windows or lintels over them, and shutters."""
    over = np.stack([front.at(left - 0.08, low), front.at(right + 0.08, low),
        front.at(right + 0.08, low, 0.1), front.at(left - 0.08, low, 0.1)], -2)
    lip = front.rectangles(left - 0.08, low - 0.07, right + 0.08, low, 0.1)
    front.add(facade.trim, np.concatenate([over, lip]))
    band = facade.style.surround_m
    if band:
        for s0, t0, s1, t1 in ((left - band, low, left, high + band),
            (right, low, right + band, high + band), (left, high, right, high + band)):
            front.add(facade.trim, front.rectangles(s0, t0, s1, t1, 0.025))
    elif facade.style.wall == "brick":
        front.add(facade.trim, front.rectangles(left - 0.12, high, right + 0.12, high + 0.2, 0.015))
    if facade.shutter is not None:
        half = (right - left) / 2
        for s0, s1 in ((left - band - half, left - band), (right + band, right + band + half)):
            front.add(facade.shutter, front.rectangles(s0, low, s1, high, 0.05))


def _balcony(front: Front, facade: Facade, s0: float, s1: float, floor: float) -> None:
    """A slab with a railing of bars, of a modern building with a parapet."""
    out = 1.15
    front.box(facade.trim, s0, s1, floor - 0.16, floor, 0, out)
    if facade.style.is_flat:
        front.box(facade.wall, s0, s1, floor, floor + 0.95, out - 0.08, out)
        return
    rods = np.arange(s0, s1, 0.12)
    n = len(rods)
    front.add(_IRON, front.rectangles(rods - 0.009, np.full(n, floor), rods + 0.009,
        np.full(n, floor + 1.0), out - 0.03))
    front.box(_IRON, s0, s1, floor + 0.97, floor + 1.02, out - 0.05, out - 0.01)
    for s in (s0, s1):
        depth = np.linspace(0.1, out - 0.03, 8)
        sides = np.stack([front.at(s, floor, depth - 0.009), front.at(s, floor, depth + 0.009),
            front.at(s, floor + 1.0, depth + 0.009), front.at(s, floor + 1.0, depth - 0.009)], -2)
        front.add(_IRON, sides)


def _lit_windows(front: Front, holes: _Holes, rooms: SceneryMaterial) -> None:
    """Light behind a share of the windows, in both halves of their frames."""
    on = np.flatnonzero(front.rng.random(len(holes.left)) < _LIT)
    room = front.rng.integers(0, N_ROOMS, len(on))
    left, low, right, high = holes.left[on], holes.low[on], holes.right[on], holes.high[on]
    frame = 0.075 * (right - left)
    middle = (left + right) / 2
    unit = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
    for half, (a, b) in enumerate(
        ((left + frame, middle - 0.5 * frame), (middle + 0.5 * frame, right - frame))
    ):
        quads = front.rectangles(a, low + frame, b, high - frame, 0.012 - _REVEAL_M)
        first = (room + 0.5 * half) / N_ROOMS
        uvs = np.stack([first, 0 * first], -1)[:, None] + unit * [0.5 / N_ROOMS, 1.0]
        front.add(rooms, quads, uvs)


def _slope(front: Front, facade: Facade, a: F64, b: F64, c: F64, d: F64) -> None:
    """A slope of tiles, a to b along its eaves."""
    long_, up = float(np.linalg.norm(b - a)), float(np.linalg.norm(c - b))
    uvs = np.array([[0, 0], [long_, 0], [long_, up], [0, up]]) / facade.roof.size_m
    front.add(facade.roof, np.stack([a, b, c, d])[None], uvs[None])


def _flat_roof(front: Front, facade: Facade, width: float, top: float, depth: float) -> None:
    """A roof that is not seen from below, and a housing on it."""
    front.add(facade.trim, np.stack([front.at(s, top + 0.1, o) for s,
        o in ((0, 0), (width, 0), (width, -depth), (0, -depth))])[None])
    front.box(facade.wall, 0.35 * width, 0.35 * width + 2.6, top, top + 2.2, -5.5, -3.0)


def _roof(front: Front, facade: Facade, width: float, top: float, depth: float) -> None:
    """Two slopes over eaves with a gutter, and chimneys."""
    ridge = top + front.rng.uniform(2.2, 3.6)
    drop = _EAVES_M * (ridge - top) / (depth / 2)
    a, b = (front.at(s, top + 0.2 - drop, _EAVES_M) for s in (-0.2, width + 0.2))
    c, d = front.at(width + 0.2, ridge, -depth / 2), front.at(-0.2, ridge, -depth / 2)
    e, f = (front.at(s, top + 0.2 - drop, -depth - _EAVES_M) for s in (width + 0.2, -0.2))
    _slope(front, facade, a, b, c, d)
    _slope(front, facade, e, f, d, c)
    y = top + 0.2 - drop
    front.box(_IRON, -0.2, width + 0.2, y - 0.09, y + 0.03, _EAVES_M - 0.02, _EAVES_M + 0.1)
    for s in (0.0, width):
        gable = np.stack([front.at(s, top, 0), front.at(s, top, -depth),
            front.at(s, ridge, -depth / 2), front.at(s, ridge, -depth / 2)])
        uvs = np.array([[0, top], [depth, top], [depth / 2, ridge], [depth / 2, ridge]])
        front.add(facade.wall, gable[None], (uvs / facade.wall.size_m)[None])
    for s in front.rng.uniform(0.15, 0.85, int(front.rng.integers(1, 3))) * width:
        front.box(facade.wall, s, s + 0.7, ridge - 1.4, ridge + 0.9,
            -depth / 2 - 0.3, -depth / 2 + 0.4)


def car(front: Front) -> None:
    """A parked car, its flank to the home; foot is its left end on the road."""
    paint = _PAINTS[int(front.rng.integers(0, len(_PAINTS)))]
    body = SceneryMaterial(
        f"paint {paint[0]:.2f}{paint[2]:.2f}",
        rgb=tuple(float(c**0.45) for c in paint),  # type: ignore[arg-type]
        is_glossy=True,
    )
    glass, tyre = (
        SceneryMaterial("car glass", rgb=(0.2, 0.23, 0.26), is_glossy=True),
        SceneryMaterial("tyre", rgb=(0.12, 0.12, 0.12)),
    )
    scale = front.rng.uniform(0.94, 1.12)
    flank = (
        np.array([[0, 0.3], [0.05, 0.72], [0.75, 0.88], [3.9, 0.9], [4.2, 0.7], [4.2, 0.3]]) * scale
    )
    cabin = np.array([[0.85, 0.87], [1.5, 1.42], [3.0, 1.45], [3.75, 0.89]]) * scale
    for outline, look, inset in ((flank, body, 0.0), (cabin, glass, 0.14)):
        near, far = -inset, -1.72 * scale + inset
        for out in (near, far):
            points = front.at(outline[:, 0], outline[:, 1], out)
            for k in range(1, len(points) - 2, 2):
                front.add(look, points[[0, k, k + 1, k + 2]][None])
            if len(points) % 2:
                front.add(look, points[[0, -2, -1, -1]][None])
        a, b = (
            front.at(outline[:, 0], outline[:, 1], near),
            front.at(outline[:, 0], outline[:, 1], far),
        )
        front.add(look, np.stack([a[:-1], a[1:], b[1:], b[:-1]], 1))
    roof = front.at(cabin[1:3, 0], cabin[1:3, 1] + 0.01, -0.13)
    back = front.at(cabin[1:3, 0], cabin[1:3, 1] + 0.01, -1.72 * scale + 0.13)
    front.add(body, np.stack([roof[0], roof[1], back[1], back[0]])[None])
    turn = np.linspace(0, np.pi, 5)
    for x in (0.8 * scale, 3.35 * scale):
        rim = np.stack([x + 0.33 * np.cos(turn), 0.33 + 0.33 * np.sin(turn)], 1)
        low = np.stack([rim[:, 0], 0.66 - rim[:, 1]], 1)
        ring_a, ring_b = front.at(rim[:, 0], rim[:, 1], 0.02), front.at(low[:, 0], low[:, 1], 0.02)
        front.add(tyre, np.stack([ring_a[:-1], ring_a[1:], ring_b[1:], ring_b[:-1]], 1))


def lamp_post(front: Front) -> None:
    """A street lamp, which shines."""
    front.box(_IRON, -0.05, 0.05, 0, 5.0, -0.05, 0.05)
    front.box(_IRON, -0.04, 0.04, 4.9, 5.0, -1.2, 0.0)
    front.box(lit("lamp", (0.9, 0.82, 0.68)), -0.1, 0.1, 4.82, 4.9, -1.3, -0.8)


def fence(front: Front, length: float, height: float) -> None:
    """A fence of boards along the front's line."""
    wood = SceneryMaterial("fence boards", picture=mottled(front.rng, (0.10, 0.07, 0.045), (0.30,
        0.22, 0.15)))
    s = np.arange(0, length, 0.14)
    tall = height * front.rng.uniform(0.97, 1.0, len(s))
    front.add(wood, front.rectangles(s, np.full(len(s), 0.05), s + 0.115, tall, 0.0))
    for y in (0.25 * height, 0.75 * height):
        front.box(wood, 0, length, y, y + 0.08, -0.06, -0.01)


def railing(front: Front, length: float) -> None:
    """A railing 1 m high along the front's line."""
    iron = SceneryMaterial("railing", rgb=(0.16, 0.16, 0.17))
    for y in (0.08, 0.98):
        front.box(iron, 0, length, y, y + 0.035, 0, 0.03)
    s = np.linspace(0.01, length - 0.01, max(round(length / 0.11), 2))
    front.add(iron, front.rectangles(s - 0.008, np.full(len(s), 0.1), s + 0.008,
        np.full(len(s), 0.98), 0.015))


def ground_looks(rng: np.random.Generator) -> dict[str, SceneryMaterial]:
    """Materials of the ground."""
    return {"lawn": SceneryMaterial("lawn", picture=grass(rng), size_m=(9.0, 9.0)),
        "asphalt": SceneryMaterial("asphalt", picture=mottled(rng, (0.045, 0.045, 0.048),
        (0.10, 0.10, 0.10), slope=0.6), size_m=(3.1, 3.1)), "slabs": SceneryMaterial("slabs",
        picture=paved(rng, (0.33, 0.31, 0.28), 4), size_m=(2.0, 2.0)),
        "gravel": SceneryMaterial("gravel", picture=mottled(rng, (0.14, 0.13, 0.11),
        (0.42, 0.39, 0.34), slope=0.1), size_m=(1.0, 1.0)), "kerb": SceneryMaterial("kerb",
        rgb=(0.58, 0.57, 0.55)), "line": SceneryMaterial("road line", rgb=(0.85, 0.85, 0.83))}
