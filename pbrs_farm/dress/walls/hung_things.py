"""Pictures as things: framed, on canvas, as posters; mirrors and clocks; no effects.

What needs no picture is described in things/hung_things.toml.

Shapes have their back at z = 0 and grow to +z, the middle of the lower edge at the origin.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from pbrs_farm.core.arrays import F64, Srgb8Image
from pbrs_farm.core.classes import MIRROR, OTHERPROP, PICTURE
from pbrs_farm.core.house import Material, MaterialKind, Surface, Texture
from pbrs_farm.dress.style import Rgb, Style, shade
from pbrs_farm.dress.things.assembly import Made, hung, metal, plain, smooth
from pbrs_farm.dress.things.things import things_of
from pbrs_farm.geometry.solids import box, lathe, quads_surface
from pbrs_farm.images import jpeg_from_array

_UNIT = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]], np.float32)
_JPEG_QUALITY = 88
# Turns what stands upright so that its top looks along +z.
_LYING = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])


def jpeg_texture(name: str, pixels: Srgb8Image) -> Texture:
    """The pixels as a texture; its id is that of its bytes."""
    data = jpeg_from_array(pixels, _JPEG_QUALITY)
    return Texture(hashlib.sha256(data).hexdigest()[:16], f"{name}.jpg", "image/jpeg", data)


def frame_material(rng: np.random.Generator, style: Style) -> Material:
    """Wood of the home, black, white or metal."""
    kind = rng.random()
    if kind < 0.4:
        return plain(f"frame {style.wood.name}", style.wood.mean, 0.4)
    if kind < 0.62:
        return plain("frame black", (0.07, 0.07, 0.07), 0.35)
    if kind < 0.82:
        return plain("frame white", (0.9, 0.9, 0.88), 0.35)
    if kind < 0.92:
        return metal(style)
    return plain("frame dark", shade(style.wood.dark, 0.6), 0.35)


def ring(
    name: str, low: Sequence[float] | F64, high: Sequence[float] | F64, width: float, depth: float
) -> Surface:
    """A closed rectangular moulding with mitred corners; low, high (2,) are its outer corners."""
    outer = np.array([[low[0], low[1]], [high[0], low[1]], [high[0], high[1]], [low[0], high[1]]])
    inner = outer + width * np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]])
    quads = []
    for k in range(4):
        a, b, c, d = outer[k], outer[(k + 1) % 4], inner[(k + 1) % 4], inner[k]
        front, back = [_at(p, depth) for p in (a, b, c, d)], [_at(p, 0.0) for p in (a, b, c, d)]
        quads.append(front)
        quads.append([back[1], back[0], back[3], back[2]])
        quads.append([back[0], back[1], front[1], front[0]])
        quads.append([back[2], back[3], front[3], front[2]])
    return quads_surface(name, np.array(quads), 0)


def faced_slab(name: str, low: F64, high: F64, z: tuple[float, float]) -> tuple[Surface, Surface]:
    """A thin box: its front, with a picture's texture coordinates, and the five other sides."""
    x0, y0, x1, y1 = float(low[0]), float(low[1]), float(high[0]), float(high[1])
    front = np.array([[x0, y0, z[1]], [x1, y0, z[1]], [x1, y1, z[1]], [x0, y1, z[1]]])
    face = replace(quads_surface(name, front[None], 0), uvs=_UNIT.copy())
    centre = np.array([(x0 + x1) / 2, (y0 + y1) / 2, (z[0] + z[1]) / 2])
    whole = box(f"{name} back", centre, np.array([x1 - x0, y1 - y0, z[1] - z[0]]) / 2, 0)
    # The box's last quad is its front.
    corners = whole.positions[whole.faces].astype(np.float64)
    keep = ~(np.abs(corners[:, :, 2] - z[1]) < 1e-6).all(1)
    return face, replace(whole, faces=whole.faces[keep])


def framed(
    rng: np.random.Generator, style: Style, width: float, height: float, print_: Texture,
    frame: Material,
) -> Made:  # fmt: skip
    """A print behind a moulding, with or without a mat; outer size in metres."""
    bar, depth = _moulding(rng, min(width, height))
    low, high = np.array([-width / 2, 0.0]), np.array([width / 2, height])
    shown = _printed(print_)
    parts = [(ring("frame", low, high, bar, depth), frame)]
    at = depth - 0.006
    mat = float(rng.uniform(0.1, 0.17)) * min(width, height) if rng.random() < 0.6 else 0.0
    inner_low, inner_high = low + bar, high - bar
    if mat:
        card = ring("mat", inner_low, inner_high, mat, at)
        parts.append((card, plain("mat", (0.93, 0.92, 0.89), 0.9)))
        inner_low, inner_high, at = inner_low + mat - 0.002, inner_high - mat + 0.002, at - 0.002
    face, back = faced_slab("print", inner_low, inner_high, (0.001, at))
    parts += [(face, shown), (back, plain("card", (0.6, 0.52, 0.42), 0.9))]
    return hung("framed_picture", "picture_frame", PICTURE, parts, [print_])


def canvas(width: float, height: float, print_: Texture, edge: Rgb) -> Made:
    """A stretched canvas."""
    low, high = np.array([-width / 2, 0.0]), np.array([width / 2, height])
    face, back = faced_slab(
        "canvas", low, high, (0.0, 0.025 if max(width, height) < 0.8 else 0.035)
    )
    parts = [(face, _printed(print_)), (back, plain("canvas edge", edge, 0.85))]
    return hung("canvas", "picture_frame", PICTURE, parts, [print_])


def poster(width: float, height: float, print_: Texture) -> Made:
    """A sheet of paper."""
    low, high = np.array([-width / 2, 0.0]), np.array([width / 2, height])
    face, back = faced_slab("poster", low, high, (0.0, 0.0015))
    parts = [(face, _printed(print_, 0.5)), (back, plain("paper", (0.92, 0.92, 0.9), 0.8))]
    return hung("poster", "picture_frame", PICTURE, parts, [print_])


def mirror(width: float, height: float, frame: Material | None, bar: float = 0.02) -> Made:
    """A mirror, framed or with a bare edge."""
    low, high = np.array([-width / 2, 0.0]), np.array([width / 2, height])
    glass = Material("mirror", MaterialKind.MIRROR, specular=(0.9, 0.9, 0.9))
    parts = []
    depth = 0.006
    if frame is not None:
        parts.append((ring("frame", low, high, bar, 0.022), frame))
        low, high, depth = low + bar, high - bar, 0.014
    face, back = faced_slab("mirror", low, high, (0.001 if frame else 0.0, depth))
    parts += [(face, glass), (back, plain("mirror edge", (0.35, 0.4, 0.4), 0.3))]
    return hung("mirror", "mirror", MIRROR, parts)


def clock(diameter: float, dial: Texture, frame: Material) -> Made:
    """A round wall clock with a printed dial."""
    r = diameter / 2
    rim = np.array([[0, 0], [r, 0], [r, 0.035], [r - 0.012, 0.035], [r - 0.012, 0.024]])
    face = _disc("dial", np.array([[r - 0.012, 0.024], [0, 0.024]]), r)
    # Lay the dial's picture over the disc.
    uv = (face.positions[:, :2] - [0, r]) / (2 * (r - 0.012)) + 0.5
    parts = [
        (_disc("rim", rim, r), frame),
        (replace(face, uvs=uv.astype(np.float32)), _printed(dial, 0.4)),
    ]
    return hung("clock", "clock", OTHERPROP, parts, [dial])


def _moulding(rng: np.random.Generator, short: float) -> tuple[float, float]:
    # Width and depth of the bars, small pictures have slim ones.
    wide = rng.random() < 0.25
    bar = float(rng.uniform(0.03, 0.05) if wide else rng.uniform(0.012, 0.024))
    return min(bar, 0.09 * short + 0.008), float(rng.uniform(0.018, 0.032))


def _printed(texture: Texture, roughness: float = 0.7) -> Material:
    return Material(f"print {texture.id[:8]}", texture_id=texture.id, roughness=roughness)


def _disc(name: str, profile: F64, up: float) -> Surface:
    """A profile (radius, height) turned about +z, its middle at y = up."""
    upright = lathe(name, profile, np.zeros(3), 0, n=40)
    normals = upright.normals
    assert normals is not None
    turned = replace(
        upright,
        positions=(upright.positions @ _LYING.T.astype(np.float32)).astype(np.float32),
        normals=(normals @ _LYING.T.astype(np.float32)).astype(np.float32),
    )
    return _moved(turned, (0.0, up, 0.0))


def _moved(surface: Surface, offset: tuple[float, float, float]) -> Surface:
    return replace(surface, positions=(surface.positions + np.array(offset)).astype(np.float32))


def _at(p: F64, z: float) -> list[float]:
    return [float(p[0]), float(p[1]), z]


def _draped(wide: float, long: float, deep: float, phase: float) -> Surface:
    """A closed hanging bag of cloth, its top at y = 0: pinched above, folded below."""
    n, rows = 22, 9
    angles = 2 * np.pi * np.arange(n) / n
    v = np.linspace(0, 1, rows)
    # Widen from the collar to the shoulders, then slowly to the hem.
    grow = np.interp(v, [0.0, 0.06, 0.14, 0.5, 1.0], [0.25, 0.62, 0.9, 0.85, 1.0])
    fold = 1 + 0.22 * v[:, None] * np.sin(5 * angles + phase + 0.8 * v[:, None])
    x = wide / 2 * grow[:, None] * np.cos(angles)
    z = deep / 2 * np.minimum(grow + 0.1, 1.0)[:, None] * np.sin(angles) * fold
    y = np.broadcast_to(-long * v[:, None], x.shape)
    ring = np.stack([x, y, z], -1).reshape(-1, 3)
    points = np.concatenate([ring, [[0.0, 0.0, 0.0]], [[0.0, -long, 0.0]]])
    k, after = np.arange(n), (np.arange(n) + 1) % n
    faces = [np.stack([np.full(n, rows * n), after, k], -1)]
    for r in range(rows - 1):
        a, b = r * n, (r + 1) * n
        faces += [
            np.stack([a + k, a + after, b + after], -1),
            np.stack([a + k, b + after, b + k], -1),
        ]
    last = (rows - 1) * n
    faces.append(np.stack([np.full(n, rows * n + 1), last + k, last + after], -1))
    return smooth("coat", points, np.concatenate(faces).astype(np.int32))


HUNG_THINGS: Final = things_of(
    "hung_things",
    diagonal=lambda *scale: np.diag(scale),
    disc=lambda profile, up, x=0.0: _moved(_disc("disc", np.array(profile), up), (x, 0.0, 0.0)),
    ring=lambda low, high, width, depth: ring("ring", low, high, width, depth),
    draped=_draped,
    mirror_glass=Material("mirror", MaterialKind.MIRROR, specular=(0.9, 0.9, 0.9)),
)
"""What hangs on walls and needs no picture: most take their sizes and materials."""
CUPBOARD_FORMS: Final = 6
SWITCH_FORMS: Final = 6
