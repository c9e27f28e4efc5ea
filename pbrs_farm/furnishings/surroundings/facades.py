"""Facades of buildings outside: walls, windows, doors, roofs, by style. Effect: reads facades.csv."""

from __future__ import annotations

from pathlib import Path
from typing import Final, Literal, NamedTuple

import numpy as np

from pbrs_farm.core.arrays import F32, F64
from pbrs_farm.core.record import Record, Several, Spaced, read_csv
from pbrs_farm.dress.noise import noise
from pbrs_farm.furnishings.surroundings.scenery import Rgb, SceneryMaterial

_PX: Final = 256  # of a wall's picture
COLUMNS: Final = 4  # windows side by side in a sheet of windows
ROWS: Final = 2
_CELL: Final = (136, 96)  # pixels of one
N_ROOMS: Final = 4  # lit rooms side by side in their picture
_GLASS: Final = (0.022, 0.027, 0.030)


class Style(Record):
    """A kind of building: a row of facades.csv."""

    where: Literal["town", "garden"]
    name: str
    wall: Literal["plaster", "brick", "stone", "panels", "boards"]
    colours: Several[Spaced[Rgb]]  # of the wall, linear
    trims: Several[Spaced[Rgb]]  # of sills, bands and what surrounds windows
    frames: Several[Spaced[Rgb]]
    roofs: Several[Spaced[Rgb]]
    bay_m: Spaced[tuple[float, float]]  # least and greatest
    window_m: Spaced[tuple[float, float]]  # width and height, about
    bars: Several[str]  # how its windows are divided
    surround_m: float  # width of the band about a window, 0 = none
    is_flat: bool = False  # of its roof
    shutters: float = 0.0  # share of facades with them
    balconies: float = 0.0  # share of its windows where a building has any
    cornice_m: float = 0.3


_STYLES: Final = read_csv(Path(__file__).with_name("facades.csv"), Style)
TOWN: Final = tuple(style for style in _STYLES if style.where == "town")
HOUSES: Final = tuple(style for style in _STYLES if style.where == "garden")


class Facade(NamedTuple):
    """Division and materials of a building's front."""

    style: Style
    wall: SceneryMaterial
    trim: SceneryMaterial
    windows: SceneryMaterial  # a sheet of COLUMNS by ROWS windows
    door: SceneryMaterial
    roof: SceneryMaterial
    shutter: SceneryMaterial | None
    bay_m: float
    window: tuple[float, float, float, float]  # x0, y0 in a bay, x1, y1 above its floor, metres


def facade(rng: np.random.Generator, number: int, styles: tuple[Style, ...]) -> Facade:
    """A facade of one of the styles."""
    style = styles[number % len(styles)]
    wall, frame = _weathered(rng, _one(rng, style.colours)), _one(rng, style.frames)
    bay = float(rng.uniform(*style.bay_m))
    wide, high = (float(v * rng.uniform(0.92, 1.1)) for v in style.window_m)
    low = 2.45 - high if high < 1.8 else 0.35
    name = f"facade {style.name} {number}"
    shutter = None
    if rng.random() < style.shutters and bay > 2 * wide + 0.3:
        rgb = _one(
            rng, ((0.05, 0.10, 0.08), (0.09, 0.13, 0.18), (0.16, 0.07, 0.045), (0.28, 0.27, 0.24))
        )
        shutter = SceneryMaterial(f"{name} shutter", picture=slats(rng, rgb), size_m=(0.6, 0.6))
    picture, size_m = _wall(rng, style.wall, wall)
    roof = _one(rng, style.roofs)
    return Facade(
        style=style,
        wall=SceneryMaterial(f"{name} wall", picture=picture, size_m=size_m),
        trim=SceneryMaterial(f"{name} trim", rgb=_encoded(_one(rng, style.trims))),
        windows=SceneryMaterial(
            f"{name} windows", picture=_windows(rng, style.bars, frame), is_glossy=True
        ),
        door=SceneryMaterial(f"{name} door", picture=_door(rng), is_glossy=True),
        roof=SceneryMaterial(f"{name} roof", picture=tiles(rng, roof), size_m=(1.8, 2.0)),
        shutter=shutter,
        bay_m=bay,
        window=(bay / 2 - wide / 2, low, bay / 2 + wide / 2, low + high),
    )


def _one(rng: np.random.Generator, rows: tuple[Rgb, ...]) -> Rgb:
    return rows[int(rng.integers(0, len(rows)))]


def _weathered(rng: np.random.Generator, rgb: Rgb) -> Rgb:
    """A paint after years of weather: darker and greyer, by more or less."""
    grey, value = sum(rgb) / 3, float(rng.uniform(0.58, 0.95))
    r, g, b = (value * (c + float(rng.uniform(0.05, 0.45)) * (grey - c)) for c in rgb)
    return r, g, b


def _encoded(rgb: Rgb) -> Rgb:
    r, g, b = (float(c ** (1 / 2.2)) for c in rgb)
    return r, g, b


def _wall(rng: np.random.Generator, kind: str, rgb: Rgb) -> tuple[F32, tuple[float, float]]:
    """(picture of a wall, linear, the metres that it covers)."""
    tone = 1 + 0.035 * noise(rng, (_PX, _PX), slope=1.8) + 0.03 * noise(rng, (_PX, _PX), slope=0.2)
    picture = tone[..., None] * np.array(rgb)
    y, x = np.arange(_PX)[:, None], np.arange(_PX)[None]
    match kind:
        case "brick":
            return _laid(rng, picture, 28, 8, joint=1.5, spread=0.17, mortar=(0.34, 0.31, 0.27)), (
                2.0,
                2.1,
            )
        case "stone":
            mortar = tuple(0.62 * c for c in rgb)
            return _laid(rng, picture, 6, 4, joint=1.2, spread=0.07, mortar=mortar), (2.4, 2.0)  # type: ignore[arg-type]
        case "panels":
            picture[(y % (_PX // 2) < 2) | (x % (_PX // 2) < 2)] *= 0.45
            return np.asarray(picture, np.float32), (6.0, 6.0)
        case "boards":
            board = y * 16 // _PX
            shade = rng.uniform(0.86, 1.08, 16)[board]
            grain = 1 + 0.1 * noise(rng, (_PX, _PX), slope=1.2, stretch=(1.0, 12.0))
            picture *= (shade * grain)[..., None]
            picture[(y % (_PX // 16) < 2)[:, 0]] *= 0.45
            return np.asarray(np.clip(picture, 0, 0.85), np.float32), (2.4, 2.4)
        case _:
            stains = np.clip(noise(rng, (_PX, _PX), slope=2.6, stretch=(6.0, 1.0)), -2, 2)
            clouds = np.clip(noise(rng, (_PX, _PX), slope=2.2), -2, 2)
            picture *= (1 + 0.05 * stains + 0.05 * clouds)[..., None]
            return np.asarray(np.clip(picture, 0, 0.85), np.float32), (3.0, 3.0)


def _laid(
    rng: np.random.Generator,
    picture: F64,
    n_rows: int,
    n_columns: int,
    *,
    joint: float,
    spread: float,
    mortar: Rgb,
) -> F32:
    """The picture as stones laid in running bond with mortar between."""
    middles = np.arange(_PX) + 0.5
    row = (middles * n_rows / _PX).astype(int)
    shifted = middles[None] * n_columns / _PX + 0.5 * (row % 2)[:, None]
    column = shifted.astype(int) % n_columns
    laid = (
        picture
        * rng.normal(1, spread, (n_rows, n_columns)).clip(0.45, 1.5)[row[:, None], column][
            ..., None
        ]
    )
    warm = rng.normal(0, 0.25 * spread, (n_rows, n_columns))[row[:, None], column]
    laid *= 1 + np.stack([warm, 0 * warm, -warm], -1)
    in_row, in_column = middles * n_rows / _PX % 1 * _PX / n_rows, shifted % 1 * _PX / n_columns
    gap = (in_row < joint)[:, None] | (in_column < joint)
    laid[gap] = np.array(mortar) * rng.normal(1, 0.08, (int(gap.sum()), 1))
    return np.asarray(np.clip(laid, 0, 0.85), np.float32)


def tiles(rng: np.random.Generator, rgb: Rgb) -> F32:
    """(192, 192, 3) linear: rows of roof tiles, each throws a shadow on the next."""
    n, rows, columns = 192, 8, 9
    middles = np.arange(n) + 0.5
    row = (middles * rows / n).astype(int)
    shifted = middles[None] * columns / n + 0.5 * (row % 2)[:, None]
    tone = rng.normal(1, 0.16, (rows, columns))[row[:, None], shifted.astype(int) % columns]
    along, across = (middles * rows / n % 1)[:, None], shifted % 1
    shade = (0.75 + 0.3 * np.sin(np.pi * across)) * np.where(along > 0.86, 0.4, 1.05 - 0.2 * along)
    grain = 1 + 0.08 * noise(rng, (n, n), slope=0.8)
    return np.asarray(
        np.clip((tone * shade * grain)[..., None] * np.array(rgb), 0, 0.8), np.float32
    )


def slats(rng: np.random.Generator, rgb: Rgb) -> F32:
    """(64, 64, 3) linear: slats of shutters or fences, level."""
    shade = 0.55 + 0.5 * (np.arange(64) % 8) / 7
    grain = 1 + 0.06 * noise(rng, (64, 64), slope=1.0)
    return np.asarray(
        np.clip((shade[:, None] * grain)[..., None] * np.array(rgb), 0, 0.8), np.float32
    )


def _windows(rng: np.random.Generator, bars: tuple[str, ...], frame: Rgb) -> F32:
    """The sheet of windows, linear: COLUMNS by ROWS, each with something else behind its panes."""
    kind = bars[int(rng.integers(0, len(bars)))]
    high, wide = _CELL
    sheet = np.empty((ROWS * high, COLUMNS * wide, 3), np.float32)
    for row in range(ROWS):
        for column in range(COLUMNS):
            tile = sheet[row * high : (row + 1) * high, column * wide : (column + 1) * wide]
            _draw_behind(rng, tile)
            _draw_bars(tile, kind, frame)
    return sheet


def _draw_behind(rng: np.random.Generator, pane: F32) -> None:
    """The view in the panes of a window: a dark room, curtains, blinds, plants."""
    high, wide = pane.shape[:2]
    y, x = np.arange(high)[:, None] / high, np.arange(wide)[None] / wide
    # The room is a little lighter towards its ceiling and where its far wall is.
    depth = 0.7 + 0.6 * np.exp(-(((y - 0.25) / 0.22) ** 2)) + 0.25 * (x > rng.uniform(0.3, 0.7))
    pane[:] = (depth * rng.uniform(0.7, 1.5))[..., None] * np.array(_GLASS)
    cloth = np.array(
        ((0.42, 0.41, 0.38), (0.34, 0.28, 0.20), (0.25, 0.26, 0.28), (0.40, 0.36, 0.29))[
            int(rng.integers(0, 4))
        ]
    )
    folds = 0.75 + 0.25 * np.sin(x * rng.uniform(60, 100) + 2 * np.sin(7 * x + rng.uniform(0, 6)))
    kind = rng.random()
    if kind < 0.3:  # drapes at both sides
        reach = rng.uniform(0.14, 0.3)
        side = (x < reach) | (x > 1 - reach * rng.uniform(0.6, 1.1))
        drawn = np.broadcast_to(side, (high, wide))
        pane[drawn] = (folds * np.ones((high, 1)))[drawn][:, None] * cloth * 0.55
    elif kind < 0.55:  # a thin curtain before all, or before the lower part
        drawn = np.broadcast_to(y > (0.0 if rng.random() < 0.7 else 0.45), (high, wide))
        pane[drawn] += (0.5 * folds * np.ones((high, 1)))[drawn][:, None] * np.array(
            [0.36, 0.36, 0.34]
        )
    elif kind < 0.75:  # a blind drawn part of the way
        drawn = np.broadcast_to(y < rng.uniform(0.25, 0.9), (high, wide))
        lines = 0.8 + 0.2 * ((y * high) % 5 < 3.5) if rng.random() < 0.5 else np.ones((high, 1))
        pane[drawn] = (lines * np.ones((1, wide)))[drawn][:, None] * cloth * 0.8
    if rng.random() < 0.3:  # something green on the sill
        for _ in range(int(rng.integers(3, 8))):
            spot = rng.uniform(0.1, 0.9), 1 - rng.uniform(0.05, 0.2)
            leaf = ((x - spot[0]) / 0.09) ** 2 + ((y - spot[1]) / 0.09) ** 2 < 1
            pane[leaf] = np.array([0.02, 0.045, 0.015]) * rng.uniform(0.7, 1.8)


def _draw_bars(pane: F32, kind: str, frame: Rgb) -> None:
    """The frame and its bars: light from above left, so that each has an edge and throws a shadow."""
    high, wide = pane.shape[:2]
    bars = {
        "one": (),
        "two": ((0, 0.5, 1, 0.5),),
        "transom": ((0, 0.5, 1, 0.5), (0.3, 0, 0.3, 1)),
        "sash": ((0.5, 0, 0.5, 1), (0, 0.5, 1, 0.5)),
    }[kind]
    body, line = 7, 6
    rows = [
        (0, body, 0, wide),
        (high - body, high, 0, wide),
        (0, high, 0, body),
        (0, high, wide - body, wide),
    ]
    for y0, x0, y1, x1 in bars:
        a, b, c, d = (round(v * n) for v, n in ((y0, high), (y1, high), (x0, wide), (x1, wide)))
        half = line // 2
        rows.append((max(a - half, 0), min(b + half, high), max(c - half, 0), min(d + half, wide)))
    for a, b, c, d in rows:  # shadows first
        pane[a : b + 3, c : d + 3] *= 0.5
    rgb = np.array(frame)
    for a, b, c, d in rows:
        pane[a:b, c:d] = rgb
    for a, b, c, d in rows[4:]:
        upright = b - a > d - c
        edge = (slice(a, b), slice(d - 2, d)) if upright else (slice(b - 2, b), slice(c, d))
        pane[edge] = 0.6 * rgb
    pane[:2], pane[:, :2] = 0.7 * rgb, 0.7 * rgb


def _door(rng: np.random.Generator) -> F32:
    """(160, 80, 3) linear: a house's door with panels and a light above."""
    rgb = np.array(
        (
            (0.10, 0.05, 0.025),
            (0.03, 0.06, 0.09),
            (0.20, 0.025, 0.02),
            (0.03, 0.07, 0.045),
            (0.30, 0.30, 0.28),
        )[int(rng.integers(0, 5))]
    )
    door = np.broadcast_to(rgb, (160, 80, 3)).astype(np.float32)
    door[:30] = np.array(_GLASS) * 1.4
    door[:4], door[28:34], door[:, :4], door[:, -4:] = rgb, rgb, 0.7 * rgb, 0.7 * rgb
    for a, b in ((42, 88), (96, 148)):
        for c, d in ((11, 36), (44, 69)):
            door[a:b, c:d] *= 0.75
            door[a : a + 2, c:d], door[a:b, c : c + 2] = 0.45 * rgb, 0.45 * rgb
            door[b - 2 : b, c:d] = 1.35 * rgb
    door[90:95, 66:72] = (0.35, 0.30, 0.18)
    return np.clip(door, 0, 0.8)


def lit_rooms(rng: np.random.Generator) -> F32:
    """(64, N_ROOMS * 64, 3) linear: rooms with a lamp on, as seen through their panes."""
    n = 64
    y, x = np.arange(n)[:, None] / n, np.arange(n)[None] / n
    rooms = []
    for _ in range(N_ROOMS):
        warm = np.array([0.20, rng.uniform(0.145, 0.17), rng.uniform(0.075, 0.12)])
        lamp = rng.uniform(0.25, 0.75), rng.uniform(0.1, 0.4)
        glow = 0.35 + 0.75 * np.exp(-(((x - lamp[0]) / 0.4) ** 2) - ((y - lamp[1]) / 0.45) ** 2)
        glow = np.where(y > rng.uniform(0.65, 0.85), 0.35 * glow, glow)  # furniture below
        reach = rng.uniform(0.1, 0.28)
        curtain = (x < reach) | (x > 1 - reach)
        glow = np.where(curtain, glow * (0.6 + 0.2 * np.sin(90 * x)), glow)
        rooms.append(np.minimum(glow, 1)[..., None] * warm)
    return np.asarray(np.concatenate(rooms, 1), np.float32)
