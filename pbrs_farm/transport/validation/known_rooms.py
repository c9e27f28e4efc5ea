"""Small houses of boxes in which radiance is known or hard to estimate; built in code, no effects."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.camera import Camera, Intrinsics
from pbrs_farm.core.house import (
    House,
    Item,
    ItemKind,
    Level,
    LightPart,
    Material,
    MaterialKind,
    Opening,
    Room,
    Source,
    Surface,
)
from pbrs_farm.core.lighting import PowerUnit

Triple = tuple[float, float, float]


def encoded(linear: float) -> float:
    """sRGB-encoded value of a linear one."""
    return 12.92 * linear if linear <= 0.0031308 else 1.055 * linear ** (1 / 2.4) - 0.055


def matte(name: str, *albedo: float) -> Material:
    """A diffuse material of linear albedo."""
    rgb = albedo if len(albedo) == 3 else (albedo[0],) * 3
    return Material(name, diffuse=(encoded(rgb[0]), encoded(rgb[1]), encoded(rgb[2])))


def quad(corners: Sequence[Triple], material: int, name: str = "quad") -> Surface:
    """Two triangles."""
    return Surface(
        name,
        np.array(corners, np.float32),
        np.array([[0, 1, 2], [0, 2, 3]], np.int32),
        material,
        uvs=np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32),
    )


def box(low: Triple, high: Triple, material: int, name: str = "box") -> Surface:
    """A closed box, flat shaded, faces outwards."""
    x, y, z = zip(low, high, strict=True)
    # Number the corners by the bits of x, y, z.
    points = np.array([(x[i & 1], y[i >> 1 & 1], z[i >> 2]) for i in range(8)], np.float32)
    quads = [(0, 4, 6, 2), (1, 3, 7, 5), (0, 1, 5, 4), (2, 6, 7, 3), (0, 2, 3, 1), (4, 5, 7, 6)]
    faces = [f for a, b, c, d in quads for f in ((a, b, c), (a, c, d))]
    return Surface(name, points, np.array(faces, np.int32), material)


def sphere(centre: Triple, radius: float, material: int, *, n: int = 24) -> Surface:
    """A latitude-longitude sphere with smooth normals, faces outwards."""
    # Place the vertices by polar angle and azimuth.
    theta = np.linspace(0, np.pi, n // 2 + 1)
    phi = np.linspace(0, 2 * np.pi, n + 1)
    around, height = np.sin(theta)[:, None], np.cos(theta)[:, None]
    level = np.broadcast_to(height, (len(theta), len(phi)))
    way = np.stack([around * np.cos(phi), level, around * np.sin(phi)], -1).reshape(-1, 3)
    # Cut each quad into two triangles, one at the poles.
    faces = []
    for i in range(n // 2):
        for j in range(n):
            a, b = i * (n + 1) + j, (i + 1) * (n + 1) + j
            faces += [(a, a + 1, b + 1)] * (i > 0) + [(a, b + 1, b)] * (i < n // 2 - 1)
    positions = (np.array(centre) + radius * way).astype(np.float32)
    triangles, normals = np.array(faces, np.int32), way.astype(np.float32)
    return Surface("sphere", positions, triangles, material, normals=normals)


def panel(
    low: Triple, high: Triple, opening: tuple[float, float, float, float], material: int
) -> list[Surface]:
    """A box, thin along z, with a rectangular opening (x0, y0, x1, y1)."""
    # Leave four boxes around the opening: left, right, below, above.
    x0, y0, x1, y1 = opening
    z0, z1 = low[2], high[2]
    return [
        box(low, (x0, high[1], z1), material),
        box((x1, low[1], z0), high, material),
        box((x0, low[1], z0), (x1, y0, z1), material),
        box((x0, y1, z0), (x1, high[1], z1), material),
    ]


def shell(
    size: Triple, material: int, thickness: float = 0.1, *, front: bool = True
) -> list[Surface]:
    """Six (five without the front, z = 0) solid walls around 0..size."""
    (x, y, z), t = size, thickness
    walls = [
        box((-t, -t, -t), (x + t, 0, z + t), material, "floor"),
        box((-t, y, -t), (x + t, y + t, z + t), material, "ceiling"),
        box((-t, 0, -t), (0, y, z + t), material, "west"),
        box((x, 0, -t), (x + t, y, z + t), material, "east"),
        box((0, 0, z), (x, y, z + t), material, "back"),
    ]
    if front:
        walls.append(box((0, 0, -t), (x, y, 0), material, "front"))
    return walls


def bulb(centre: Triple, material: int, lumen: float, *, radius: float = 0.05) -> Item:
    """A lamp: a sphere that emits."""
    part = LightPart(
        centre, radius, lumen, PowerUnit.LUMEN, rgb_linear=(1, 0.8, 0.6), emitting=(0,)
    )
    return Item(
        f"bulb_{centre}",
        "bulb",
        ItemKind.LAMP,
        "0",
        (sphere(centre, radius, material),),
        lights=(part,),
        room_id="0_0",
    )


BULB = Material("bulb", kind=MaterialKind.BULB, diffuse=(0.0, 0.0, 0.0))


def house(
    surfaces: Sequence[Surface],
    materials: Sequence[Material],
    *,
    lamps: Sequence[Item] = (),
    size: Triple = (4.0, 2.5, 4.0),
    openings: Sequence[F64] = (),
) -> House:
    """A house of one item with those surfaces, and lamps."""
    x, _y, z = size
    floor = np.array([[0, 0], [x, 0], [x, z], [0, z]], np.float64)
    room = Room("0_0", "room", "0", floor, 0.0, size[1])
    # Openings matter by their quads alone: nothing is cut here.
    cutter = box((0, 0, 0), (1, 1, 1), 0)
    windows = (
        Opening(f"o{k}", "0", None, True, cutter, q, np.array([0, 0, 1.0]))
        for k, q in enumerate(openings)
    )
    walls = Item("walls", "walls", ItemKind.WALL, "0", tuple(surfaces), room_id="0_0")
    return House(
        id="test",
        name="test",
        source=Source("builtin", "test", "0" * 64),
        levels=(Level("0", "ground", 0.0, size[1]),),
        rooms=(room,),
        items=(walls, *lamps),
        materials=tuple(materials),
        textures={},
        openings=tuple(windows),
        is_repaired=True,
    )


def camera(
    eye: Triple, target: Triple, width: int = 32, height: int = 24, hfov_rad: float = 1.2
) -> Camera:
    """A camera at eye that looks at target."""
    towards = np.array(target, np.float64) - np.array(eye, np.float64)
    return Camera.look(
        Intrinsics.from_hfov(width, height, hfov_rad), np.array(eye, np.float64), towards
    )


def window_room(
    albedo: float = 0.7, *, lumen: float = 0.0, pane: bool = False
) -> tuple[House, Camera]:
    """4 x 2.5 x 4 m with a window of 1.4 x 1.2 m in the wall z = 0, a table, and a bulb or none."""
    materials = [matte("wall", albedo), BULB, Material("pane", kind=MaterialKind.PANE, opacity=0.3)]
    opening = (1.3, 0.9, 2.7, 2.1)
    surfaces = shell((4.0, 2.5, 4.0), 0, front=False)
    surfaces += panel((0, 0, -0.1), (4.0, 2.5, 0.0), opening, 0)
    surfaces.append(box((1.5, 0.6, 2.2), (2.5, 0.65, 2.9), 0, "table"))
    x0, y0, x1, y1 = opening
    # Its rectangle is in the centre of the wall, as portal and as pane.
    corners = [(x0, y0, -0.05), (x1, y0, -0.05), (x1, y1, -0.05), (x0, y1, -0.05)]
    rectangle = np.array(corners, np.float64)
    if pane:
        surfaces.append(quad(corners, 2, "pane"))
    lamps = [bulb((2.0, 2.2, 2.0), 1, lumen)] if lumen > 0 else []
    view = camera((0.4, 1.5, 3.7), (2.6, 0.8, 0.6))
    return house(surfaces, materials, lamps=lamps, openings=[rectangle]), view


def furnace(albedo: float) -> tuple[House, Camera]:
    """A closed box whose walls emit luminance 1 and reflect albedo: everywhere 1 + albedo + albedo^2 + ..."""
    walls = box((0, 0, 0), (4, 2.5, 4), 0)
    # Give the lamp the flux that makes its radiance 1 W m-2 sr-1: 179 lm/W x pi x area.
    area = 2 * (4 * 2.5 + 4 * 2.5 + 4 * 4)
    part = LightPart(
        (0, 0, 0), 1, 179 * math.pi * area, PowerUnit.LUMEN, rgb_linear=(1, 0.5, 0.2), emitting=(0,)
    )
    lamp = Item("walls", "walls", ItemKind.LAMP, "0", (walls,), lights=(part,))
    return (
        house([], [matte("wall", albedo)]).with_items([lamp]),
        camera((1, 1, 1), (3, 1.5, 3), 16, 12),
    )


def door_ajar(gap: float = 0.06) -> tuple[House, Camera]:
    """Two rooms, a lamp in the far one, and a door ajar by gap metres: all light of the near one is reflected."""
    size = (4.0, 2.5, 8.2)
    surfaces = shell(size, 0)
    # Part the rooms by a wall 10 cm thick, and let the door leave the gap free.
    doorway = (1.5, 0.0, 2.4, 2.05)
    surfaces += panel((0.0, 0.0, 4.05), (4.0, 2.5, 4.15), doorway, 0)
    surfaces.append(box((1.5 + gap, 0.0, 4.08), (2.4, 2.05, 4.12), 1, "door"))
    surfaces.append(box((2.6, 0.0, 1.2), (3.4, 0.5, 2.2), 2, "block"))
    materials = [matte("wall", 0.75), matte("door", 0.5, 0.35, 0.2), matte("block", 0.2, 0.3, 0.7)]
    materials.append(BULB)
    view = camera((0.6, 1.5, 0.5), (2.4, 0.9, 4.0))
    return house(surfaces, materials, lamps=[bulb((3.2, 1.2, 6.5), 3, 1600.0)], size=size), view
