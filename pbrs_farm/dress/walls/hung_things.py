"""Framed pictures, canvases, posters, mirrors and clocks as items; no effects.

Wall items without a picture are in things/hung.py.

Shapes have their back at z = 0 and grow to +z, the centre of the lower edge at the origin.
"""

from __future__ import annotations

import hashlib
from dataclasses import replace
from typing import Final

import numpy as np

from pbrs_farm.core.arrays import F64, Srgb8Image
from pbrs_farm.core.classes import MIRROR, OTHERPROP, PICTURE
from pbrs_farm.core.house import Material, MaterialKind, Surface, Texture
from pbrs_farm.dress.content import content
from pbrs_farm.dress.models import Model, hanging_piece
from pbrs_farm.dress.style import Rgb, Style, shade
from pbrs_farm.dress.thing_materials import metal, plain
from pbrs_farm.geometry.solids import box, quads_surface
from pbrs_farm.images import jpeg_from_array

_UNIT = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]], np.float32)
_JPEG_QUALITY = 88


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
    rng: np.random.Generator,
    style: Style,
    width: float,
    height: float,
    print_: Texture,
    frame: Material,
) -> Model:
    """A print behind a moulding, with or without a mat; outer size in metres."""
    frame_m, depth = _moulding(rng, min(width, height))
    low, high = np.array([-width / 2, 0.0]), np.array([width / 2, height])
    shown = _printed(print_)
    parts = [(content().ring("frame", low, high, frame_m, depth), frame)]
    z = depth - 0.006
    mat = float(rng.uniform(0.1, 0.17)) * min(width, height) if rng.random() < 0.6 else 0.0
    inner_low, inner_high = low + frame_m, high - frame_m
    if mat:
        card = content().ring("mat", inner_low, inner_high, mat, z)
        parts.append((card, plain("mat", (0.93, 0.92, 0.89), 0.9)))
        inner_low, inner_high, z = (inner_low + mat - 0.002, inner_high - mat + 0.002, z - 0.002)
    face, back = faced_slab("print", inner_low, inner_high, (0.001, z))
    parts += [(face, shown), (back, plain("card", (0.6, 0.52, 0.42), 0.9))]
    return hanging_piece("framed_picture", "picture_frame", PICTURE, parts, [print_])


def canvas(width: float, height: float, print_: Texture, edge: Rgb) -> Model:
    """A stretched canvas."""
    low, high = np.array([-width / 2, 0.0]), np.array([width / 2, height])
    face, back = faced_slab(
        "canvas", low, high, (0.0, 0.025 if max(width, height) < 0.8 else 0.035)
    )
    parts = [(face, _printed(print_)), (back, plain("canvas edge", edge, 0.85))]
    return hanging_piece("canvas", "picture_frame", PICTURE, parts, [print_])


def poster(width: float, height: float, print_: Texture) -> Model:
    """A sheet of paper."""
    low, high = np.array([-width / 2, 0.0]), np.array([width / 2, height])
    face, back = faced_slab("poster", low, high, (0.0, 0.0015))
    parts = [(face, _printed(print_, 0.5)), (back, plain("paper", (0.92, 0.92, 0.9), 0.8))]
    return hanging_piece("poster", "picture_frame", PICTURE, parts, [print_])


def mirror(width: float, height: float, frame: Material | None, frame_m: float = 0.02) -> Model:
    """A mirror, framed or with a bare edge."""
    low, high = np.array([-width / 2, 0.0]), np.array([width / 2, height])
    glass = Material("mirror", MaterialKind.MIRROR, specular=(0.9, 0.9, 0.9))
    parts = []
    depth = 0.006
    if frame is not None:
        parts.append((content().ring("frame", low, high, frame_m, 0.022), frame))
        low, high, depth = low + frame_m, high - frame_m, 0.014
    face, back = faced_slab("mirror", low, high, (0.001 if frame else 0.0, depth))
    parts += [(face, glass), (back, plain("mirror edge", (0.35, 0.4, 0.4), 0.3))]
    return hanging_piece("mirror", "mirror", MIRROR, parts)


def clock(diameter: float, dial: Texture, frame: Material) -> Model:
    """A round wall clock with a printed dial."""
    r = diameter / 2
    rim = content().facing_disc(
        [(0, 0), (r, 0), (r, 0.035), (r - 0.012, 0.035), (r - 0.012, 0.024)], r
    )
    face = replace(content().facing_disc([(r - 0.012, 0.024), (0, 0.024)], r), name="dial")
    # Lay the dial's picture over the disc.
    uv = (face.positions[:, :2] - [0, r]) / (2 * (r - 0.012)) + 0.5
    parts = [
        (replace(rim, name="rim"), frame),
        (replace(face, uvs=uv.astype(np.float32)), _printed(dial, 0.4)),
    ]
    return hanging_piece("clock", "clock", OTHERPROP, parts, [dial])


def _moulding(rng: np.random.Generator, short: float) -> tuple[float, float]:
    # Width and depth of the frame: small pictures have slim ones.
    wide = rng.random() < 0.25
    frame_m = float(rng.uniform(0.03, 0.05) if wide else rng.uniform(0.012, 0.024))
    return min(frame_m, 0.09 * short + 0.008), float(rng.uniform(0.018, 0.032))


def _printed(texture: Texture, roughness: float = 0.7) -> Material:
    return Material(f"print {texture.id[:8]}", texture_id=texture.id, roughness=roughness)


CUPBOARD_FORMS: Final = 6
SWITCH_FORMS: Final = 6
