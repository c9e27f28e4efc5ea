"""The built-in home's furniture, made of boxes and turned profiles; no effects.

A piece is described in its own frame: centre of the base at the origin, x to its right, y up,
front towards +z; metres. `place` puts it into the world.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.frames import rotation_y
from pbrs_farm.core.house import Box, Item, ItemKind, LightPart, Surface
from pbrs_farm.core.lighting import PowerUnit
from pbrs_farm.geometry.solids import box_quads, lathe, quads_surface, sphere

Triple = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Part:
    """Boxes of one material."""

    material: str
    boxes: tuple[tuple[Triple, Triple], ...]  # low and high corner in the piece's frame


@dataclass(frozen=True, slots=True)
class BuiltinPiece:
    """A thing to place."""

    name: str
    nyu40: int
    parts: tuple[Part, ...] = ()
    # Turned profiles: material, (radius, height) from the bottom, a point of the axis.
    turned: tuple[tuple[str, tuple[tuple[float, float], ...], Triple], ...] = ()
    kind: ItemKind = ItemKind.OBJECT
    bulb: tuple[Triple, float, bool] | None = None  # its place, radius, whether it is a sphere


def legs(w: float, d: float, h: float, t: float = 0.05) -> tuple[tuple[Triple, Triple], ...]:
    """Four legs of thickness t under a w x d rectangle, h high."""
    xs = ((-w / 2, -w / 2 + t), (w / 2 - t, w / 2))
    zs = ((-d / 2, -d / 2 + t), (d / 2 - t, d / 2))
    return tuple(((x0, 0.0, z0), (x1, h, z1)) for x0, x1 in xs for z0, z1 in zs)


def slab(w: float, d: float, y0: float, y1: float) -> tuple[Triple, Triple]:
    """A w x d box between the heights y0 and y1, centred on the piece's axis."""
    return ((-w / 2, y0, -d / 2), (w / 2, y1, d / 2))


def place(
    piece: BuiltinPiece,
    item_id: str,
    room_id: str,
    at: Triple,
    turn_deg: float,
    materials: dict[str, int],
) -> Item:
    """The piece as an item, turned about +y and moved to at (3,)."""
    turn = rotation_y(np.radians(turn_deg))
    origin = np.asarray(at, np.float64)
    surfaces = [_boxes(part, turn, origin, materials) for part in piece.parts]
    for material, profile, axis in piece.turned:
        centre = turn @ np.asarray(axis) + origin
        surfaces.append(lathe(material, np.asarray(profile), centre, materials[material]))
    # Put the bulb in, as a sphere that emits or as a light alone.
    lights: tuple[LightPart, ...] = ()
    if piece.bulb is not None:
        local, radius, is_modelled = piece.bulb
        centre = turn @ np.asarray(local) + origin
        if is_modelled:
            surfaces.append(sphere("bulb", centre, radius, materials["bulb"]))
        emitting = (len(surfaces) - 1,) if is_modelled else ()
        x, y, z = (float(c) for c in centre)
        lights = (LightPart((x, y, z), radius, 0.5, PowerUnit.SWEETHOME3D, emitting=emitting),)
    item = Item(
        id=item_id,
        name=piece.name,
        kind=piece.kind,
        level_id="0",
        surfaces=tuple(surfaces),
        nyu40=piece.nyu40,
        source_class=f"builtin#{piece.name}",
        room_id=room_id,
        lights=lights,
    )
    return replace(item, box=_oriented_box(item, turn, origin))


def _boxes(part: Part, turn: F64, origin: F64, materials: dict[str, int]) -> Surface:
    quads = []
    for low, high in part.boxes:
        a, b = np.asarray(low, np.float64), np.asarray(high, np.float64)
        quads.append(box_quads((a + b) / 2, (b - a) / 2))
    world = np.concatenate(quads) @ turn.T + origin
    return quads_surface(part.material, world, materials[part.material])


def _oriented_box(item: Item, turn: F64, origin: F64) -> Box:
    world = np.concatenate([s.positions for s in item.surfaces]).astype(np.float64)
    local = (world - origin) @ turn
    low, high = local.min(0), local.max(0)
    return Box(turn @ ((low + high) / 2) + origin, (high - low) / 2, turn)


SOFA = BuiltinPiece(
    "sofa",
    6,
    (
        Part("cloth_blue", (slab(2.0, 0.85, 0.1, 0.42), ((-1.0, 0.42, -0.425), (1.0, 0.8, -0.2)))),
        Part("cloth_navy", (((-1.0, 0.42, -0.2), (-0.82, 0.6, 0.425)), ((0.82, 0.42, -0.2), (1.0, 0.6, 0.425)))),
        Part("wood_dark", legs(1.9, 0.75, 0.1)),
    ),
)  # fmt: skip
ARMCHAIR = BuiltinPiece(
    "armchair",
    5,
    (
        Part("cloth_red", (slab(0.75, 0.75, 0.12, 0.42), ((-0.375, 0.42, -0.375), (0.375, 0.85, -0.2)))),
        Part("wood_dark", legs(0.7, 0.7, 0.12)),
    ),
)  # fmt: skip
COFFEE_TABLE = BuiltinPiece(
    "coffee table",
    7,
    (Part("wood", (slab(1.0, 0.55, 0.37, 0.41),)), Part("wood_dark", legs(0.92, 0.47, 0.37))),
)
BOWL = BuiltinPiece(
    "bowl",
    40,
    turned=(
        (
            "glass",
            ((0.0, 0.0), (0.06, 0.0), (0.14, 0.09), (0.13, 0.09), (0.05, 0.015), (0.0, 0.015)),
            (0.0, 0.0, 0.0),
        ),
    ),
)
TV_BENCH = BuiltinPiece(
    "tv bench",
    3,
    (
        Part("wood_dark", (slab(1.5, 0.4, 0.06, 0.45),)),
        Part("white", (((-0.72, 0.1, 0.2), (-0.02, 0.41, 0.215)), ((0.02, 0.1, 0.2), (0.72, 0.41, 0.215)))),
    ),
)  # fmt: skip
TV = BuiltinPiece(
    "tv",
    25,
    (Part("black", (slab(1.05, 0.05, 0.06, 0.66), slab(0.4, 0.18, 0.0, 0.02), slab(0.06, 0.04, 0.02, 0.06))),),
)  # fmt: skip
DINING_TABLE = BuiltinPiece(
    "dining table",
    7,
    (Part("wood", (slab(1.2, 0.8, 0.71, 0.75),)), Part("wood", legs(1.12, 0.72, 0.71, 0.06))),
)
CHAIR = BuiltinPiece(
    "chair",
    5,
    (
        Part("wood", (slab(0.42, 0.42, 0.43, 0.46), *legs(0.42, 0.42, 0.43, 0.04))),
        Part("wood", (((-0.21, 0.46, -0.21), (-0.17, 0.9, -0.17)), ((0.17, 0.46, -0.21), (0.21, 0.9, -0.17)),
                      ((-0.17, 0.7, -0.2), (0.17, 0.88, -0.18)))),
    ),
)  # fmt: skip
BOOKSHELF = BuiltinPiece(
    "bookshelf",
    10,
    (
        Part("white", (((-0.45, 0.0, -0.15), (-0.42, 1.9, 0.15)), ((0.42, 0.0, -0.15), (0.45, 1.9, 0.15)),
                       ((-0.42, 0.0, -0.15), (0.42, 1.9, -0.135)),
                       *(((-0.42, 0.02 + 0.37 * k, -0.135), (0.42, 0.045 + 0.37 * k, 0.15)) for k in range(6)))),
        Part("cloth_red", tuple(((-0.40 + 0.05 * k, 0.415, -0.1), (-0.36 + 0.05 * k, 0.66 + 0.01 * (k % 3), 0.1)) for k in range(9))),
        Part("cloth_navy", tuple(((-0.1 + 0.06 * k, 1.155, -0.1), (-0.05 + 0.06 * k, 1.38 + 0.02 * (k % 2), 0.09)) for k in range(7))),
    ),
)  # fmt: skip
FLOOR_LAMP = BuiltinPiece(
    "floor lamp",
    35,
    turned=(
        ("metal", ((0.0, 0.0), (0.15, 0.0), (0.15, 0.02), (0.015, 0.03), (0.015, 1.35), (0.0, 1.35)), (0, 0, 0)),
        ("shade", ((0.2, 1.33), (0.13, 1.63), (0.127, 1.63), (0.197, 1.33), (0.2, 1.33)), (0, 0, 0)),
    ),
    kind=ItemKind.LAMP,
    bulb=((0.0, 1.42, 0.0), 0.035, True),
)  # fmt: skip
PENDANT = BuiltinPiece(
    "pendant lamp",
    35,
    turned=(
        ("metal", ((0.0, 0.32), (0.006, 0.32), (0.006, 0.6), (0.0, 0.6)), (0, 0, 0)),
        ("metal", ((0.22, 0.0), (0.2, 0.1), (0.06, 0.3), (0.0, 0.32)), (0, 0, 0)),
        ("white", ((0.0, 0.315), (0.057, 0.296), (0.197, 0.098), (0.22, 0.0)), (0, 0, 0)),
    ),
    kind=ItemKind.LAMP,
    bulb=((0.0, 0.1, 0.0), 0.04, False),
)
RUG = BuiltinPiece("rug", 20, (Part("rug", (slab(2.2, 1.5, 0.002, 0.012),)),))
PICTURE = BuiltinPiece(
    "picture",
    11,
    (Part("wood_dark", (slab(0.9, 0.03, 0.0, 0.6),)), Part("picture", (((-0.41, 0.04, 0.015), (0.41, 0.56, 0.017)),))),
)  # fmt: skip
PLANT = BuiltinPiece(
    "plant",
    40,
    (Part("leaf", tuple(((-0.02 + 0.05 * c, 0.3, -0.02 + 0.05 * s), (0.02 + 0.09 * c, 0.75, 0.02 + 0.09 * s))
                        for c, s in ((0, 0), (1, 0.3), (-1, 0.5), (0.2, -1), (-0.4, 1)))),),
    turned=(("clay", ((0.0, 0.0), (0.12, 0.0), (0.16, 0.3), (0.0, 0.3)), (0, 0, 0)),),
    kind=ItemKind.PLANT,
)  # fmt: skip
BED = BuiltinPiece(
    "bed",
    4,
    (
        Part("wood", (slab(1.5, 2.0, 0.12, 0.3), ((-0.75, 0.3, -1.0), (0.75, 0.95, -0.95)), *legs(1.4, 1.9, 0.12, 0.07))),
        Part("white", (((-0.72, 0.3, -0.94), (0.72, 0.5, 0.97)),)),
        Part("cloth_blue", (((-0.74, 0.5, -0.35), (0.74, 0.54, 0.98)),)),
    ),
)  # fmt: skip
PILLOW = BuiltinPiece("pillow", 18, (Part("white", (slab(0.55, 0.38, 0.0, 0.11),)),))
NIGHT_STAND = BuiltinPiece(
    "night stand",
    32,
    (Part("wood", (slab(0.42, 0.38, 0.0, 0.5),)), Part("wood_dark", (((-0.18, 0.28, 0.19), (0.18, 0.46, 0.2)),))),
)  # fmt: skip
WARDROBE = BuiltinPiece(
    "wardrobe",
    3,
    (
        Part("white", (slab(1.2, 0.6, 0.0, 2.05),)),
        Part("wood", (((-0.59, 0.06, 0.3), (-0.01, 2.0, 0.315)), ((0.01, 0.06, 0.3), (0.59, 2.0, 0.315)))),
    ),
)  # fmt: skip
DESK = BuiltinPiece(
    "desk",
    14,
    (Part("wood", (slab(1.2, 0.6, 0.7, 0.74),)), Part("white", legs(1.16, 0.56, 0.7)), Part("white", (((0.2, 0.5, -0.25), (0.55, 0.7, 0.28)),))),
)  # fmt: skip
MIRROR = BuiltinPiece(
    "mirror",
    19,
    (Part("wood_dark", (slab(0.6, 0.03, 0.0, 1.1),)), Part("mirror", (((-0.27, 0.03, 0.015), (0.27, 1.07, 0.018)),))),
)  # fmt: skip
