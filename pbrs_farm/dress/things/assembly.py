"""Parts of a generated thing put together as a piece of the catalogue and its shape; no effects."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from pbrs_farm.core.arrays import F64, I32, Bools
from pbrs_farm.core.catalogue import Piece, Place, Shape
from pbrs_farm.core.classes import OTHERPROP
from pbrs_farm.core.house import Material, MaterialKind, Surface, Texture
from pbrs_farm.dress.style import Rgb, Style, mix, shade
from pbrs_farm.geometry.solids import box

Part = tuple[Surface, Material]
Made = tuple[Piece, Shape]

GENERATED = "generated#"  # before the family, in the id of a generated piece


def made(
    family: str, parts: Sequence[Part], *, group: str = "", nyu40: int = OTHERPROP,
    place: Place = Place.SURFACE, textures: Iterable[Texture] = (),
) -> Made:  # fmt: skip
    """The parts as one piece, the middle of its base at the origin; one surface a material."""
    materials: list[Material] = []
    gathered: dict[tuple[int, bool], list[Surface]] = {}
    for surface, material in parts:
        if material not in materials:
            materials.append(material)
        key = (materials.index(material), surface.normals is None)
        gathered.setdefault(key, []).append(surface)
    joined = [_joined(surfaces, number) for (number, _), surfaces in gathered.items()]
    # Stand the whole on its base.
    points = np.concatenate([s.positions for s in joined]).astype(np.float64)
    low, high = points.min(0), points.max(0)
    base = np.array([(low[0] + high[0]) / 2, low[1], (low[2] + high[2]) / 2], np.float64)
    moved = tuple(replace(s, positions=(s.positions - base).astype(np.float32)) for s in joined)
    width, height, depth = (float(v) for v in high - low)
    piece = Piece(
        f"{GENERATED}{family}", family.replace("_", " ").capitalize(), group or family, place,
        nyu40, (width, depth, height), library="generated",
    )  # fmt: skip
    return piece, Shape(moved, tuple(materials), {t.id: t for t in textures})


def hung(
    family: str, group: str, nyu40: int, parts: Sequence[Part], textures: Sequence[Texture] = (),
    place: Place = Place.WALL,
) -> Made:  # fmt: skip
    """A generated piece that hangs, and its shape: unlike what stands, it keeps its own origin."""
    materials = tuple(dict.fromkeys(m for _s, m in parts))
    surfaces = tuple(replace(s, material=materials.index(m)) for s, m in parts)
    shape = Shape(surfaces, materials, {t.id: t for t in textures})
    w, h, d = (float(x) for x in np.diff(shape.bounds, axis=0)[0])
    name = family.replace("_", " ").capitalize()
    return Piece(f"{GENERATED}{family}", name, group, place, nyu40, (w, d, h)), shape


def transformed(surface: Surface, matrix: F64, offset: Sequence[float] = (0, 0, 0)) -> Surface:
    """The surface turned by a rotation (3, 3) and then moved, metres."""
    positions = surface.positions.astype(np.float64) @ matrix.T + np.asarray(offset, np.float64)
    normals = surface.normals
    if normals is not None:
        normals = (normals.astype(np.float64) @ matrix.T).astype(np.float32)
    return replace(surface, positions=positions.astype(np.float32), normals=normals)


def plain(name: str, colour: Rgb, roughness: float) -> Material:
    """An opaque material of one colour (sRGB); equal ones are shared in the house."""
    r, g, b = (round(float(min(max(c, 0.02), 0.95)), 3) for c in colour)
    return Material(name, diffuse=(r, g, b), roughness=roughness)


def metal(style: Style) -> Material:
    """The metal of the home's fittings."""
    return Material(
        style.metal.name, diffuse=(0.03, 0.03, 0.03), specular=style.metal.colour,
        shininess=40.0, roughness=style.metal.roughness,
    )  # fmt: skip


def glass(tint: Rgb = (1.0, 1.0, 1.0), opacity: float = 0.1) -> Material:
    """Thin glass."""
    return Material("glass", MaterialKind.GLASS, tint, (1.0, 1.0, 1.0), 200.0, opacity)


def any_colour(rng: np.random.Generator, style: Style) -> Rgb:
    """A colour for a small thing: of the style, calm or loud, or any at all."""
    # Three of ten are of textiles, a quarter of any hue, the rest accent, small things, wall.
    kind = rng.random()
    if kind < 0.3:
        return style.textiles[int(rng.integers(len(style.textiles)))]
    if kind < 0.45:
        return style.accent
    if kind < 0.6:
        return style.palette[4]
    if kind < 0.75:
        return shade(style.palette[0], float(rng.uniform(0.9, 1.05)))
    hue = rng.random(3)
    return mix((float(hue[0]), float(hue[1]), float(hue[2])), (0.6, 0.58, 0.55), 0.45)


def _joined(surfaces: list[Surface], material: int) -> Surface:
    # Shift each part's faces by the number of points before it.
    starts = np.cumsum([0, *(len(s.positions) for s in surfaces)])
    faces = np.concatenate([s.faces + n for s, n in zip(surfaces, starts[:-1], strict=True)])
    uvs = [s.uvs if s.uvs is not None else np.zeros((len(s.positions), 2)) for s in surfaces]
    normals = None
    if surfaces[0].normals is not None:
        normals = np.concatenate([s.normals for s in surfaces if s.normals is not None])
    return Surface(
        surfaces[0].name,
        np.concatenate([s.positions for s in surfaces]).astype(np.float32),
        faces.astype(np.int32),
        material,
        np.concatenate(uvs).astype(np.float32),
        normals,
    )


# Smooth bodies: profiles turned about the vertical, cushions, boxes on low and high.


_SHARP_RAD = np.radians(50)  # a profile that turns by more has an edge there


def turned(profile: Sequence[tuple[float, float]] | F64, *, n: int = 16) -> Surface:
    """The (radius, height) profile (P, 2) turned about the vertical, n sides, smooth normals.

    The profile runs upwards outside; down again inside for a vessel. Where it turns by more than
    50 degrees there is an edge. Closed where both ends are on the axis.
    """
    points = np.asarray(profile, np.float64)
    steps = np.diff(points, axis=0)
    steps /= np.maximum(np.linalg.norm(steps, axis=1, keepdims=True), 1e-12)
    outward = np.stack([steps[:, 1], -steps[:, 0]], -1)
    # Average the normals of two stretches at a soft corner.
    soft = (outward[:-1] * outward[1:]).sum(1) > np.cos(_SHARP_RAD)
    both = outward[:-1] + outward[1:]
    both /= np.maximum(np.linalg.norm(both, axis=1, keepdims=True), 1e-12)
    begin, end = outward.copy(), outward.copy()
    begin[1:][soft] = both[soft]
    end[:-1][soft] = both[soft]
    angles = 2 * np.pi * np.arange(n + 1) / n
    around = np.stack([np.cos(angles), np.zeros(n + 1), -np.sin(angles)], -1)
    around[-1] = around[0]
    # Each stretch has a ring of points at its begin and one at its end.
    ends = np.stack([points[:-1], points[1:]], 1).reshape(-1, 2)
    slopes = np.stack([begin, end], 1).reshape(-1, 2)
    positions, normals = (_rings(around, rows).astype(np.float32) for rows in (ends, slopes))
    return Surface("turned", positions, _ring_faces(points[:, 0] > 0, n), 0, None, normals)


def _rings(around: F64, rows: F64) -> F64:
    # (R * (n + 1), 3): for each (radius, height) the unit ring, so wide and so high.
    rings = around * rows[:, 0, None, None]
    rings += np.stack([np.zeros(len(rows)), rows[:, 1], np.zeros(len(rows))], -1)[:, None]
    return np.asarray(rings.reshape(-1, 3))


def _ring_faces(is_wide: Bools, n: int) -> I32:
    # Of each stretch two triangles a side, or one where it ends on the axis.
    has_low, has_high = is_wide[:-1], is_wide[1:]
    i = (
        np.arange(n, dtype=np.int32)
        + 2 * (n + 1) * np.arange(len(has_low), dtype=np.int32)[:, None]
    )
    j = i + np.int32(n + 1)
    faces = np.empty((len(has_low), 2, n, 3), np.int32)
    faces[:, 0] = np.stack([i, i + 1, j + has_high[:, None]], -1)
    faces[:, 1] = np.stack([i, j + 1, j], -1)
    return np.asarray(faces[np.stack([has_low, has_high], 1)].reshape(-1, 3))


def vessel(outside: Sequence[tuple[float, float]], wall_m: float, *, n: int = 16) -> Surface:
    """A vessel open at the top: the outer profile from the axis to the rim, and its inside."""
    outer = np.asarray(outside, np.float64)
    inner = outer[::-1].copy()
    inner[:, 0] = np.maximum(inner[:, 0] - wall_m, 0.0)
    inner[:, 1] = np.maximum(inner[:, 1], outer[0, 1] + wall_m)
    inner[0, 1] = outer[-1, 1]
    inner[-1, 0] = 0.0
    # Leave out what the floor of the inside flattens.
    keep = np.ones(len(inner), np.bool_)
    keep[1:-1] = inner[1:-1, 0] > 0
    profile = np.concatenate([outer, inner[keep]])
    moves = np.concatenate([[True], np.linalg.norm(np.diff(profile, axis=0), axis=1) > 1e-6])
    return turned(profile[moves], n=n)


def slab(low: Sequence[float], high: Sequence[float]) -> Surface:
    """An axis-aligned closed box between two corners, metres."""
    a, b = np.asarray(low, np.float64), np.asarray(high, np.float64)
    return box("box", (a + b) / 2, (b - a) / 2, 0)


def bulged(
    size: tuple[float, float, float], *, n: int = 12, edge: float = 0.0, bulge: float = 2.2
) -> Surface:
    """A closed cushion (width, thickness, depth) about the origin, its corners drawn in.

    edge: share of the thickness that its rim has: 0 for a pillow, 1 for a folded cloth.
    bulge: how fast it rises from the rim; 2 is round, 6 boxy.
    """
    # Cells lie closer towards the rim, where it bends most.
    t = np.sin(np.linspace(-1, 1, n + 1) * np.pi / 2)
    u, v = np.meshgrid(t, t)
    rise = ((1 - np.abs(u) ** bulge) * (1 - np.abs(v) ** bulge)).clip(0, 1) ** 0.5
    thick = edge + (1 - edge) * rise
    # Draw the middle of the sides in a little: cloth pulls.
    pull = 1 - 0.06 * (1 - edge) * (1 - np.abs(v) ** 2)
    pull_v = 1 - 0.06 * (1 - edge) * (1 - np.abs(u) ** 2)
    x, z = u * pull * size[0] / 2, v * pull_v * size[2] / 2
    y = thick * size[1] / 2
    top = np.stack([x, y, z], -1).reshape(-1, 3)
    low = np.stack([x, -y, z], -1).reshape(-1, 3)
    m = n + 1
    i = (np.arange(n)[:, None] * m + np.arange(n)).ravel()
    quads = np.stack([i, i + m, i + m + 1, i + 1], -1)
    faces = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    below = faces[:, ::-1] + m * m
    positions = np.concatenate([top, low])
    faces = np.concatenate([faces, below, _rim(n)])
    # Join the two sheets where they meet, so that it is closed and smooth there.
    return _welded(positions, faces)


def _rim(n: int) -> F64:
    # The band between the rims of both sheets.
    m = n + 1
    k = np.arange(n)
    loop = np.concatenate([k, k * m + n, n * m + n - k, (n - k) * m])
    after = np.roll(loop, -1)
    low = m * m
    return np.concatenate(
        [np.stack([loop, after, after + low], -1), np.stack([loop, after + low, loop + low], -1)]
    )


def _welded(positions: F64, faces: F64) -> Surface:
    _, first, number = np.unique(
        np.round(positions, 7), axis=0, return_index=True, return_inverse=True
    )
    points, faces = positions[first], number.ravel()[faces]
    a, b, c = (faces[:, k] for k in range(3))
    faces = faces[(a != b) & (b != c) & (c != a)]
    return smooth("cushion", points, faces.astype(np.int32))


def smooth(name: str, points: F64, faces: I32) -> Surface:
    """A surface whose shading normals are the mean of its faces', by area."""
    corners = points[faces]
    n = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals = np.zeros_like(points)
    for k in range(3):
        np.add.at(normals, faces[:, k], n)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    return Surface(
        name, points.astype(np.float32), faces.astype(np.int32), 0, None, normals.astype(np.float32)
    )
