"""Facades with windows, houses with gables, parked cars, lamp posts, fences; no effects."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from pbrs_farm.core.arrays import F32, F64
from pbrs_farm.dress.surroundings.scenery import Rgb, Scenery, SceneryMaterial, lit, mottled, paved
from pbrs_farm.dress.textures.noise import noise

STOREY_M: Final = 3.0
_PX: Final = 512  # size of a facade's picture, which shows two bays by two storeys

_WALLS: Final[tuple[Rgb, ...]] = (
    (0.72, 0.66, 0.55), (0.62, 0.50, 0.36), (0.78, 0.76, 0.72), (0.50, 0.36, 0.28), (0.66, 0.58, 0.36),
    (0.45, 0.47, 0.46), (0.60, 0.42, 0.34), (0.70, 0.70, 0.62), (0.38, 0.17, 0.12), (0.34, 0.20, 0.15),
)  # fmt: skip
_BRICKS: Final = 8  # walls from here on are of bricks
_FRAMES: Final[tuple[Rgb, ...]] = ((0.75, 0.75, 0.72), (0.16, 0.12, 0.09), (0.08, 0.09, 0.10))
_ROOFS: Final[tuple[Rgb, ...]] = ((0.30, 0.10, 0.055), (0.11, 0.10, 0.10), (0.20, 0.10, 0.07))
_PAINTS: Final[tuple[Rgb, ...]] = (
    (0.55, 0.56, 0.58), (0.03, 0.03, 0.035), (0.20, 0.21, 0.22), (0.30, 0.03, 0.03), (0.05, 0.09, 0.20), (0.70, 0.70, 0.68),
)  # fmt: skip
# Dark glass, of the hue that a lamp behind it gives it.
_GLOWS: Final[tuple[Rgb, ...]] = ((0.45, 0.37, 0.25), (0.45, 0.40, 0.31), (0.42, 0.32, 0.20))


class Facade(NamedTuple):
    """How a building's front is divided and painted."""

    look: SceneryMaterial
    bay_m: float
    window: tuple[float, float, float, float]  # x0, y0, x1, y1 as shares of bay and storey


def facade(rng: np.random.Generator, number: int) -> Facade:
    """A facade of two bays by two storeys, each window a little different."""
    k = int(rng.integers(0, len(_WALLS)))
    wall, frame = _WALLS[k], _FRAMES[int(rng.integers(0, len(_FRAMES)))]
    bay_m = float(rng.uniform(2.5, 3.4))
    wide, high = rng.uniform(0.36, 0.52), rng.uniform(0.46, 0.6)
    low = rng.uniform(0.24, 0.3)
    window = (0.5 - wide / 2, low, 0.5 + wide / 2, low + high)
    picture = _facade_pixels(rng, wall, is_brick=k >= _BRICKS)
    half = _PX // 2
    surround = rng.random() < 0.5
    for row in range(2):
        for column in range(2):
            own = picture[row * half : (row + 1) * half, column * half : (column + 1) * half]
            _draw_window(rng, own, window, wall, frame, has_surround=surround)
    look = SceneryMaterial(f"facade {number}", picture=picture, size_m=(2 * bay_m, 2 * STOREY_M))
    return Facade(look, bay_m, window)


def _facade_pixels(rng: np.random.Generator, rgb: Rgb, *, is_brick: bool) -> F32:
    tone = 1 + 0.05 * noise(rng, (_PX, _PX), slope=1.6) + 0.03 * noise(rng, (_PX, _PX), slope=0.3)
    if is_brick:
        rows = np.arange(_PX) * 80 // _PX  # 7.5 cm each
        shift = (rows % 2)[:, None] * 10
        columns = (np.arange(_PX)[None] + shift) // 20
        bricks = rng.uniform(0.75, 1.2, (80, 64))
        tone = tone * bricks[rows[:, None], columns % 64]
        first = np.diff(rows, prepend=-1) > 0
        tone[first] *= 1.25
    return np.asarray(np.clip(tone[..., None] * np.array(rgb), 0, 0.9), np.float32)


def _draw_window(
    rng: np.random.Generator, bay: F32, window: tuple[float, float, float, float], wall: Rgb,
    frame: Rgb, *, has_surround: bool,
) -> None:  # fmt: skip
    """Paint a window into a bay's picture, row 0 at its top."""
    n = len(bay)
    x0, x1 = round(window[0] * n), round(window[2] * n)
    y0, y1 = round((1 - window[3]) * n), round((1 - window[1]) * n)
    if has_surround:
        bay[y0 - 12 : y1 + 6, x0 - 12 : x1 + 12] = np.minimum(1.25 * np.array(wall), 0.85)
    # The reveal is dark above, the frame stands in it, glass shows some sky and curtains.
    bay[y0:y1, x0:x1] = 0.35 * np.array(wall)
    bay[y0 + 7 : y1, x0 + 3 : x1 - 3] = frame
    glass = bay[y0 + 13 : y1 - 6, x0 + 9 : x1 - 9]
    fall = np.linspace(1.0, 0.45, len(glass))[:, None, None]
    glass[:] = fall * np.array([0.10, 0.125, 0.15]) * rng.uniform(0.6, 1.5)
    curtain = rng.random()
    if curtain < 0.6:
        part = int(rng.uniform(0.12, 0.32) * glass.shape[1])
        cloth = np.array([0.45, 0.43, 0.40]) * rng.uniform(0.4, 0.9)
        folds = 1 + 0.18 * np.sin(np.arange(part) * 0.9)[None, :, None]
        glass[:, :part] = cloth * folds
        glass[:, glass.shape[1] - part :] = cloth * folds
    elif curtain < 0.78:
        glass[: int(rng.uniform(0.2, 0.8) * len(glass))] = np.array([0.5, 0.48, 0.44]) * rng.uniform(0.5, 0.9)  # fmt: skip
    middle = (x0 + x1) // 2
    bay[y0 + 7 : y1, middle - 3 : middle + 3] = frame
    if rng.random() < 0.6:
        cross = y0 + 13 + (y1 - y0) // 3
        bay[cross - 3 : cross + 3, x0 + 9 : x1 - 9] = frame
    bay[y1 : y1 + 6, x0 - 5 : x1 + 5] = 0.6 * np.array(wall)


class Front(NamedTuple):
    """Where a building's front stands: its left foot, along, outward (to the home), up."""

    foot: F64  # (3,)
    along: F64  # (3,) unit
    to_home: F64  # (3,) unit

    def at(self, s: F64 | float, y: F64 | float, out: F64 | float = 0.0) -> F64:
        """World places s along, y up, out towards the home."""
        s, y, out = np.broadcast_arrays(*(np.asarray(v, np.float64) for v in (s, y, out)))
        return np.asarray(
            self.foot
            + s[..., None] * self.along
            + y[..., None] * np.array([0.0, 1.0, 0.0])
            + out[..., None] * self.to_home
        )


def _rectangles(front: Front, s0: F64, y0: F64, s1: F64, y1: F64, out: F64 | float) -> F64:
    corners = [front.at(s, y, out) for s, y in ((s0, y0), (s1, y0), (s1, y1), (s0, y1))]
    return np.stack(corners, -2).reshape(-1, 4, 3)


def _front_box(
    scenery: Scenery, thing: str, look: SceneryMaterial, front: Front, s0: float, s1: float, y0: float, y1: float,
    out0: float, out1: float,
) -> None:  # fmt: skip
    low, high = np.array([s0, y0, out0]), np.array([s1, y1, out1])
    corners = np.array([[low[0], low[1], high[2]], [high[0], low[1], high[2]], [high[0], high[1], high[2]], [low[0], high[1], high[2]],
                        [low[0], low[1], low[2]], [high[0], low[1], low[2]], [high[0], high[1], low[2]], [low[0], high[1], low[2]]])  # fmt: skip
    world = front.at(corners[:, 0], corners[:, 1], corners[:, 2])
    scenery.add(thing, look, world[[[0, 1, 2, 3], [3, 2, 6, 7], [4, 0, 3, 7], [1, 5, 6, 2], [4, 5, 1, 0]]])  # fmt: skip


def block(
    scenery: Scenery, thing: str, rng: np.random.Generator, front: Front, own: Facade, n_bays: int,
    n_storeys: int, *, depth_m: float = 10.0, is_lit: float = 0.3, has_balconies: bool = False,
) -> None:  # fmt: skip
    """A building of several storeys: a front with windows, sides, a roof and what sticks out."""
    width, plinth = n_bays * own.bay_m, 0.5
    top = plinth + n_storeys * STOREY_M
    stone = SceneryMaterial("stone", picture=None, rgb=(0.46, 0.45, 0.43))
    u0, v0 = rng.integers(0, 2, 2) / 2
    uvs = np.array([[0, 0], [n_bays / 2, 0], [n_bays / 2, n_storeys / 2], [0, n_storeys / 2]])
    scenery.add(thing, own.look, _rectangles(front, np.array([0.0]), np.array([plinth]), np.array([width]), np.array([top]), 0.0), (uvs + np.array([u0, v0]))[None])  # fmt: skip
    _front_box(scenery, thing, stone, front, 0, width, -0.5, plinth, -0.1, 0.06)
    # Sides, without windows, in the facade's own colour.
    tint = own.look.picture
    assert tint is not None
    r, g, b = (float(c) for c in np.sqrt(np.median(tint.reshape(-1, 3), 0)))
    plain = SceneryMaterial(f"{own.look.name} plain", rgb=(r, g, b))
    for s in (0.0, width):
        side = np.stack([front.at(s, y, o) for y, o in ((-0.5, 0), (-0.5, -depth_m), (top, -depth_m), (top, 0))])  # fmt: skip
        scenery.add(thing, plain, side[None])
    _roof(scenery, thing, rng, front, width, top, depth_m)
    # Sills and a cornice throw shadows that a painted front lacks.
    _front_box(scenery, thing, stone, front, -0.15, width + 0.15, top - 0.05, top + 0.3, -0.1, 0.35)
    left, low, right, _high = windows = _windows(own, n_bays, n_storeys, plinth)
    over = np.stack([front.at(left - 0.08, low), front.at(right + 0.08, low), front.at(right + 0.08, low, 0.14), front.at(left - 0.08, low, 0.14)], -2)  # fmt: skip
    lip = _rectangles(front, left - 0.08, low - 0.07, right + 0.08, low, 0.14)
    scenery.add(thing, stone, np.concatenate([over, lip]))
    _lit_windows(scenery, thing, rng, front, windows, is_lit)
    if has_balconies:
        iron = SceneryMaterial("iron", rgb=(0.2, 0.2, 0.21))
        for k in np.flatnonzero((low > plinth + STOREY_M) & (rng.random(len(left)) < 0.4)):
            floor = float(low[k] - own.window[1] * STOREY_M)
            _front_box(scenery, thing, stone, front, left[k] - 0.3, right[k] + 0.3, floor - 0.12, floor, 0, 1.1)  # fmt: skip
            n = 9
            rods = np.linspace(left[k] - 0.3, right[k] + 0.3, n)
            scenery.add(thing, iron, _rectangles(front, rods - 0.02, np.full(n, floor), rods + 0.02, np.full(n, floor + 1.0), 1.08))  # fmt: skip
            scenery.add(thing, iron, _rectangles(front, rods[:1], np.array([floor + 0.96]), rods[-1:], np.array([floor + 1.02]), 1.09))  # fmt: skip


def _lit_windows(
    scenery: Scenery, thing: str, rng: np.random.Generator, front: Front,
    windows: tuple[F64, F64, F64, F64], share: float,
) -> None:  # fmt: skip
    """Light behind a share of the windows: two panes of a warm glow each."""
    left, low, right, high = windows
    on = np.flatnonzero(rng.random(len(left)) < share)
    glow = rng.integers(0, len(_GLOWS), len(on))
    for g in range(len(_GLOWS)):
        k = on[glow == g]
        middle = (left[k] + right[k]) / 2
        for a, b in ((left[k] + 0.09, middle - 0.03), (middle + 0.03, right[k] - 0.09)):
            quads = _rectangles(front, a, low[k] + 0.1, b, high[k] - 0.14, 0.015)
            scenery.add(thing, lit(_GLOWS[g], g), quads)


def _roof(
    scenery: Scenery, thing: str, rng: np.random.Generator, front: Front, width: float, top: float, depth: float
) -> None:  # fmt: skip
    rgb = _ROOFS[int(rng.integers(0, len(_ROOFS)))]
    look = SceneryMaterial(f"roof {rgb[0]:.2f}", rgb=tuple(float(c**0.5) for c in rgb))  # type: ignore[arg-type]
    ridge = top + rng.uniform(1.2, 3.2)
    a, b = front.at(-0.2, top, 0.3), front.at(width + 0.2, top, 0.3)
    c, d = front.at(width + 0.2, ridge, -depth / 2), front.at(-0.2, ridge, -depth / 2)
    e, f = front.at(width + 0.2, top, -depth), front.at(-0.2, top, -depth)
    scenery.add(thing, look, np.stack([np.stack([a, b, c, d]), np.stack([d, c, e, f])]))
    for s in rng.uniform(0.15, 0.85, int(rng.integers(1, 3))) * width:
        _front_box(scenery, thing, look, front, s, s + 0.6, ridge - 1.2, ridge + 0.9, -depth / 2 - 0.3, -depth / 2 + 0.4)  # fmt: skip


def house(
    scenery: Scenery, thing: str, rng: np.random.Generator, front: Front, own: Facade, *, is_lit: float = 0.3
) -> None:  # fmt: skip
    """A house of one or two storeys with a gable."""
    n_bays, n_storeys = int(rng.integers(3, 5)), int(rng.integers(1, 3))
    width, depth = n_bays * own.bay_m, float(rng.uniform(7, 10))
    top = 0.4 + n_storeys * STOREY_M
    ridge = top + rng.uniform(0.32, 0.48) * width if rng.random() < 0.5 else 0.0
    uvs = np.array([[0, 0], [n_bays / 2, 0], [n_bays / 2, n_storeys / 2], [0, n_storeys / 2]])
    scenery.add(thing, own.look, _rectangles(front, np.array([0.0]), np.array([0.4]), np.array([width]), np.array([top]), 0.0), uvs[None])  # fmt: skip
    assert own.look.picture is not None
    r, g, b = (float(c) for c in np.sqrt(np.median(own.look.picture.reshape(-1, 3), 0)))
    plain = SceneryMaterial(f"{own.look.name} plain", rgb=(r, g, b))
    _front_box(scenery, thing, plain, front, 0, width, -0.5, 0.4, -0.2, 0.02)
    for s in (0.0, width):
        scenery.add(thing, plain, np.stack([front.at(s, y, o) for y, o in ((-0.5, 0), (-0.5, -depth), (top, -depth), (top, 0))])[None])  # fmt: skip
    if ridge:
        # The gable looks at the home.
        middle = width / 2
        gable = np.stack([front.at(0, top), front.at(width, top), front.at(middle, ridge), front.at(middle, ridge)])  # fmt: skip
        scenery.add(thing, plain, gable[None])
        rgb = _ROOFS[int(rng.integers(0, len(_ROOFS)))]
        look = SceneryMaterial(f"roof {rgb[0]:.2f}", rgb=tuple(float(c**0.5) for c in rgb))  # type: ignore[arg-type]
        for s in (-0.4, width + 0.4):
            eave = top - 0.2
            slope = np.stack([front.at(s, eave, 0.35), front.at(middle, ridge + 0.05, 0.35), front.at(middle, ridge + 0.05, -depth), front.at(s, eave, -depth)])  # fmt: skip
            scenery.add(thing, look, slope[None])
    else:
        _roof(scenery, thing, rng, front, width, top, depth)
    _lit_windows(scenery, thing, rng, front, _windows(own, n_bays, n_storeys, 0.4), is_lit)


def _windows(own: Facade, n_bays: int, n_storeys: int, plinth: float) -> tuple[F64, F64, F64, F64]:
    """Left, lower, right and upper edge of every window of a front, metres on it."""
    x0, y0, x1, y1 = own.window
    bays, storeys = np.indices((n_bays, n_storeys), np.float64).reshape(2, -1)
    left, low = (bays + x0) * own.bay_m, plinth + (storeys + y0) * STOREY_M
    return left, low, left + (x1 - x0) * own.bay_m, low + (y1 - y0) * STOREY_M


def car(scenery: Scenery, thing: str, rng: np.random.Generator, front: Front) -> None:
    """A parked car, its flank to the home; foot is its left end on the road."""
    paint = _PAINTS[int(rng.integers(0, len(_PAINTS)))]
    body = SceneryMaterial(
        f"paint {paint[0]:.2f}{paint[2]:.2f}",
        rgb=tuple(float(c**0.45) for c in paint),  # type: ignore[arg-type]
    )
    glass, tyre = (
        SceneryMaterial("car glass", rgb=(0.2, 0.23, 0.26)),
        SceneryMaterial("tyre", rgb=(0.12, 0.12, 0.12)),
    )
    scale = rng.uniform(0.94, 1.12)
    flank = np.array([[0, 0.3], [0.05, 0.72], [0.75, 0.88], [3.9, 0.9], [4.2, 0.7], [4.2, 0.3]]) * scale  # fmt: skip
    cabin = np.array([[0.85, 0.87], [1.5, 1.42], [3.0, 1.45], [3.75, 0.89]]) * scale
    for outline, look, inset in ((flank, body, 0.0), (cabin, glass, 0.14)):
        near, far = -inset, -1.72 * scale + inset
        for out in (near, far):
            points = front.at(outline[:, 0], outline[:, 1], out)
            for k in range(1, len(points) - 2, 2):
                scenery.add(thing, look, points[[0, k, k + 1, k + 2]][None])
            if len(points) % 2:
                scenery.add(thing, look, points[[0, -2, -1, -1]][None])
        a, b = (
            front.at(outline[:, 0], outline[:, 1], near),
            front.at(outline[:, 0], outline[:, 1], far),
        )
        scenery.add(thing, look, np.stack([a[:-1], a[1:], b[1:], b[:-1]], 1))
    roof = front.at(cabin[1:3, 0], cabin[1:3, 1] + 0.01, np.array(-0.13))
    back = front.at(cabin[1:3, 0], cabin[1:3, 1] + 0.01, np.array(-1.72 * scale + 0.13))
    scenery.add(thing, body, np.stack([roof[0], roof[1], back[1], back[0]])[None])
    turn = np.linspace(0, np.pi, 5)
    for x in (0.8 * scale, 3.35 * scale):
        rim = np.stack([x + 0.33 * np.cos(turn), 0.33 + 0.33 * np.sin(turn)], 1)
        low = np.stack([rim[:, 0], 0.66 - rim[:, 1]], 1)
        ring_a, ring_b = front.at(rim[:, 0], rim[:, 1], 0.02), front.at(low[:, 0], low[:, 1], 0.02)
        scenery.add(thing, tyre, np.stack([ring_a[:-1], ring_a[1:], ring_b[1:], ring_b[:-1]], 1))


def lamp_post(scenery: Scenery, thing: str, front: Front) -> None:
    """A street lamp, which shines."""
    iron = SceneryMaterial("iron", rgb=(0.2, 0.2, 0.21))
    _front_box(scenery, thing, iron, front, -0.05, 0.05, 0, 5.0, -0.05, 0.05)
    _front_box(scenery, thing, iron, front, -0.04, 0.04, 4.9, 5.0, -1.2, 0.0)
    _front_box(scenery, thing, lit((0.9, 0.82, 0.68), 9), front, -0.1, 0.1, 4.82, 4.9, -1.3, -0.8)


def fence(
    scenery: Scenery, thing: str, rng: np.random.Generator, front: Front, length: float, height: float
) -> None:  # fmt: skip
    """A fence of boards along the front's line."""
    wood = SceneryMaterial(
        "fence boards", picture=mottled(rng, (0.10, 0.07, 0.045), (0.30, 0.22, 0.15))
    )
    s = np.arange(0, length, 0.14)
    tall = height * rng.uniform(0.97, 1.0, len(s))
    scenery.add(thing, wood, _rectangles(front, s, np.full(len(s), 0.05), s + 0.115, tall, 0.0))
    for y in (0.25 * height, 0.75 * height):
        _front_box(scenery, thing, wood, front, 0, length, y, y + 0.08, -0.06, -0.01)


def railing(scenery: Scenery, thing: str, front: Front, length: float) -> None:
    """A railing 1 m high along the front's line."""
    iron = SceneryMaterial("railing", rgb=(0.16, 0.16, 0.17))
    for y in (0.08, 0.98):
        _front_box(scenery, thing, iron, front, 0, length, y, y + 0.035, 0, 0.03)
    s = np.linspace(0.01, length - 0.01, max(round(length / 0.11), 2))
    scenery.add(thing, iron, _rectangles(front, s - 0.008, np.full(len(s), 0.1), s + 0.008, np.full(len(s), 0.98), 0.015))  # fmt: skip


def ground_looks(rng: np.random.Generator) -> dict[str, SceneryMaterial]:
    """What the ground is made of."""
    return {
        "lawn": SceneryMaterial("lawn", picture=mottled(rng, (0.035, 0.07, 0.014), (0.10, 0.17, 0.04), size=192), size_m=(2.3, 2.3)),
        "asphalt": SceneryMaterial("asphalt", picture=mottled(rng, (0.045, 0.045, 0.048), (0.10, 0.10, 0.10), slope=0.6), size_m=(3.1, 3.1)),
        "slabs": SceneryMaterial("slabs", picture=paved(rng, (0.33, 0.31, 0.28), 4), size_m=(2.0, 2.0)),
        "gravel": SceneryMaterial("gravel", picture=mottled(rng, (0.14, 0.13, 0.11), (0.42, 0.39, 0.34), slope=0.1), size_m=(1.0, 1.0)),
        "kerb": SceneryMaterial("kerb", rgb=(0.58, 0.57, 0.55)),
        "line": SceneryMaterial("road line", rgb=(0.85, 0.85, 0.83)),
    }  # fmt: skip
