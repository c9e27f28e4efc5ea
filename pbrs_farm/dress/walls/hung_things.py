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
from pbrs_farm.dress.models import Model, Part, hanging_piece
from pbrs_farm.dress.style import Rgb, Style, shade
from pbrs_farm.dress.thing_materials import metal, plain
from pbrs_farm.geometry.bodies import square_tube
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


# Profiles of mouldings, (share of the width, share of the depth) from the outer edge to the inner one.
# fmt: off
_PROFILES: Final[dict[str, tuple[tuple[float, float], ...]]] = {
    "flat": ((0, 0), (0, 0.92), (0.1, 1), (0.9, 1), (1, 0.92), (1, 0)),
    "square": ((0, 0), (0, 1), (1, 1), (1, 0)),
    "sloping out": ((0, 0), (0, 0.5), (0.85, 1), (1, 0.95), (1, 0)),
    "sloping in": ((0, 0), (0, 0.95), (0.12, 1), (1, 0.5), (1, 0)),
    "round": ((0, 0), (0, 0.5), (0.12, 0.8), (0.32, 0.97), (0.5, 1), (0.68, 0.97), (0.88, 0.8), (1, 0.5), (1, 0)),
    "scoop": ((0, 0), (0, 1), (0.2, 1), (0.35, 0.75), (0.55, 0.58), (0.8, 0.5), (1, 0.5), (1, 0)),
    "plate": ((0, 0), (0, 0.95), (0.05, 1), (0.25, 1), (0.25, 0.7), (0.75, 0.7), (0.75, 0.85), (1, 0.85), (1, 0)),
    "steps": ((0, 0), (0, 0.5), (0.35, 0.5), (0.35, 0.78), (0.7, 0.78), (0.7, 1), (1, 1), (1, 0)),
    "ogee": ((0, 0), (0, 0.55), (0.15, 0.6), (0.35, 0.85), (0.55, 1), (0.7, 1), (0.7, 0.8), (0.9, 0.62), (1, 0.6), (1, 0)),
}
# fmt: on
_MOUNTS: Final = ("none", "none", "mat", "mat", "double mat", "lip", "float")
_RELIEF_M: Final = 0.006  # from the front of a frame back to its print or mount
_BEHIND_M: Final = {"lip": 0.002, "mat": 0.002, "double mat": 0.004, "float": 0.004}
"""From the front of a mount to what is behind it."""
_BACK_M: Final = 0.001  # from the wall to the card behind a print


def ring(
    name: str, low: F64, high: F64, width: float, depth: float, kind: str = "square"
) -> Surface:
    """A frame along a rectangle, of a kind of moulding; low, high (2,) are its outer corners."""
    profile = [(width * x, depth * z) for x, z in _PROFILES[kind]]
    return content().moulding(name, low, high, profile)


def framed(
    rng: np.random.Generator,
    style: Style,
    width: float,
    height: float,
    print_: Texture,
    frame: Material,
) -> Model:
    """A print behind one of nine mouldings and in one of five mounts; outer size in metres."""
    frame_m, depth = moulding_size(rng, min(width, height))
    kinds = list(_PROFILES)[: 4 if frame_m < 0.02 else None]
    kind, mount = str(rng.choice(kinds)), str(rng.choice(_MOUNTS))
    low, high = np.array([-width / 2, 0.0]), np.array([width / 2, height])
    parts = [(ring("frame", low, high, frame_m, depth, kind), frame)]
    if kind == "plate" and rng.random() < 0.5:
        parts += [(b, frame) for b in _corner_blocks(low, high, frame_m, depth)]
    # The inner edge of a moulding may lie below its front.
    z = depth * _PROFILES[kind][-2][1] - _RELIEF_M
    z = max(z, 2 * _BACK_M + _BEHIND_M.get(mount, 0.0))
    low, high = low + frame_m, high - frame_m
    white = plain("mat", (0.93, 0.92, 0.89), 0.9)
    mat = float(rng.uniform(0.1, 0.17)) * min(width, height)
    if mount == "lip":
        parts.append((ring("lip", low, high, 0.006, z + 0.004, "round"), metal(style)))
        low, high, z = low + 0.005, high - 0.005, z - 0.002
    elif mount in ("mat", "double mat"):
        for card in (white, plain("mat", shade(style.accent, 0.9), 0.9))[: 1 + (mount != "mat")]:
            parts.append((ring("mat", low, high, mat, z), card))
            low, high, z, mat = low + mat - 0.002, high - mat + 0.002, z - 0.002, 0.008
    elif mount == "float":
        face, back = faced_slab("card", low, high, (_BACK_M, z - 0.004))
        parts += [(face, white), (back, white)]
        low, high = low + 0.6 * mat, high - 0.6 * mat
    face, back = faced_slab("print", low, high, (_BACK_M, z))
    parts += [(face, _printed(print_)), (back, plain("card", (0.6, 0.52, 0.42), 0.9))]
    return hanging_piece("framed_picture", "picture_frame", PICTURE, parts, [print_])


def _corner_blocks(low: F64, high: F64, side: float, depth: float) -> list[Surface]:
    """A square block on each corner of a frame."""
    half = np.array([side / 2, side / 2, 0.003])
    return [
        box("block", np.array([x, y, depth + 0.002]), half, 0)
        for x in (low[0] + side / 2, high[0] - side / 2)
        for y in (low[1] + side / 2, high[1] - side / 2)
    ]


def canvas(
    rng: np.random.Generator,
    width: float,
    height: float,
    print_: Texture,
    edge: Rgb,
    frame: Material,
) -> Model:
    """A stretched canvas, half of them in a frame with a gap of shadow."""
    low, high = np.array([-width / 2, 0.0]), np.array([width / 2, height])
    depth, parts = 0.025 if max(width, height) < 0.8 else 0.035, []
    if rng.random() < 0.5:
        parts = [(ring("frame", low, high, 0.008, depth + 0.006, "flat"), frame)]
        back = box(
            "back",
            np.array([0.0, height / 2, 0.002]),
            np.array([width / 2 - 0.007, height / 2 - 0.007, 0.002]),
            0,
        )
        parts.append((back, plain("floater", (0.05, 0.05, 0.05), 0.9)))
        low, high = low + 0.016, high - 0.016
    face, sides = faced_slab("canvas", low, high, (0.0 if not parts else 0.004, depth))
    parts += [(face, _printed(print_)), (sides, plain("canvas edge", edge, 0.85))]
    return hanging_piece("canvas", "picture_frame", PICTURE, parts, [print_])


def poster(
    rng: np.random.Generator, width: float, height: float, print_: Texture, frame: Material
) -> Model:
    """A sheet of paper: bare, taped at its corners, in clips, or between two rods on a cord."""
    form, parts = int(rng.integers(4)), []
    low, high = np.array([-width / 2, 0.0]), np.array([width / 2, height])
    z = 0.0015
    x, tape = width / 2, plain("tape", (0.85, 0.8, 0.62), 0.6)
    match form:
        case 1:
            corners = [
                (a * (x - 0.012), b, 0.0018) for a in (-1, 1) for b in (0.012, height - 0.012)
            ]
            parts = [
                (box("tape", np.array(p), np.array([0.02, 0.009, 0.0006]), 0), tape)
                for p in corners
            ]
        case 2:
            z = 0.006
            clips = [(a * 0.6 * x, b, 0.0045) for a in (-1, 1) for b in (0.007, height - 0.007)]
            half = np.array([0.008, 0.01, 0.0045])
            parts = [
                (box("clip", np.array(p), half, 0), plain("clip", (0.6, 0.6, 0.6), 0.3))
                for p in clips
            ]
        case 3:
            low, high = low + np.array([0.006, 0.0]), high - np.array([0.006, 0.12 * width])
            half = np.array([x, 0.011, 0.007])
            rods = [
                box("rod", np.array([0.0, y, 0.007]), half, 0) for y in (0.011, high[1] - 0.011)
            ]
            top = np.array([0.0, height - 0.003, 0.006])
            cords = [
                square_tube((a * 0.9 * x, high[1], 0.006), tuple(top), 0.002, 0.002)
                for a in (-1, 1)
            ]
            parts = [
                *((rod, frame) for rod in rods),
                *((c, plain("cord", (0.6, 0.5, 0.38), 0.9)) for c in cords),
            ]
    face, back = faced_slab("poster", low, high, (0.0, z))
    parts = [(face, _printed(print_, 0.5)), (back, plain("paper", (0.92, 0.92, 0.9), 0.8)), *parts]
    return hanging_piece("poster", "picture_frame", PICTURE, parts, [print_])


def mirror(
    rng: np.random.Generator,
    width: float,
    height: float,
    frame: Material | None,
    frame_m: float = 0.02,
) -> Model:
    """A mirror in one of nine mouldings, or with a bare edge on clips, a shelf or nothing seen."""
    low, high = np.array([-width / 2, 0.0]), np.array([width / 2, height])
    glass = Material("mirror", MaterialKind.MIRROR, specular=(0.9, 0.9, 0.9))
    chrome = plain("clip", (0.72, 0.72, 0.73), 0.2)
    parts: list[Part] = []
    depth, form = 0.006, int(rng.integers(3))
    if frame is not None:
        kind = str(rng.choice(list(_PROFILES)))
        frame_m *= 1.6 if kind in list(_PROFILES)[4:] else 1.0
        parts.append((ring("frame", low, high, frame_m, 0.024, kind), frame))
        extra = str(rng.choice(["none", "blocks", "lip", "band"]))
        if extra == "blocks":
            parts += [(b, frame) for b in _corner_blocks(low, high, frame_m, 0.024)]
        low, high = low + frame_m, high - frame_m
        depth = 0.024 * _PROFILES[kind][-2][1] - 0.003
        if extra in ("lip", "band"):
            narrow, made_of = (0.005, chrome) if extra == "lip" else (0.03, frame)
            profile = "round" if extra == "lip" else "square"
            parts.append((ring(extra, low, high, narrow, depth + 0.002, profile), made_of))
            low, high = low + narrow - 0.001, high - narrow + 0.001
    elif form == 1:
        half, y = np.array([0.008, 0.006, 0.004]), (0.005, height - 0.005)
        places = [(x * 0.3 * width, b, 0.005) for x in (-1, 1) for b in y]
        parts = [(box("clip", np.array(p), half, 0), chrome) for p in places]
    elif form == 2:
        half = np.array([width / 2, 0.004, 0.05])
        parts.append((box("shelf", np.array([0.0, 0.004, 0.05]), half, 0), chrome))
        low = low + np.array([0.0, 0.008])
    face, back = faced_slab("mirror", low, high, (0.001 if frame else 0.0, depth))
    parts += [(face, glass), (back, plain("mirror edge", (0.35, 0.4, 0.4), 0.3))]
    return hanging_piece("mirror", "mirror", MIRROR, parts)


def clock(diameter: float, dial: Texture, frame: Material, form: int = 0, marks: int = 0) -> Model:
    """A round wall clock with a printed dial, in one of CLOCK_RIMS; marks: number of raised hours."""
    r = diameter / 2
    profile = [(r - inset, z) for inset, z in CLOCK_RIMS[form]]
    rim = content().facing_disc([(0, 0), *profile], r)
    inner, z = profile[-1]
    face = replace(content().facing_disc([(inner, z), (0, z)], r), name="dial")
    # Lay the dial's picture over the disc.
    uv = (face.positions[:, :2] - [0, r]) / (2 * inner) + 0.5
    parts = [
        (replace(rim, name="rim"), frame),
        (replace(face, uvs=uv.astype(np.float32)), _printed(dial, 0.4)),
    ]
    for k in range(marks):
        way = np.array([np.sin(2 * np.pi * k / marks), np.cos(2 * np.pi * k / marks), 0.0])
        middle = way * (inner - 0.016) + (0.0, r, z + 0.0015)
        half = np.array([0.004, 0.012, 0.002])
        axes = np.array([[way[1], way[0], 0], [-way[0], way[1], 0], [0, 0, 1]])
        parts.append((box("mark", middle, half, 0, axes=axes), frame))
    return hanging_piece("clock", "clock", OTHERPROP, parts, [dial])


def moulding_size(rng: np.random.Generator, short: float) -> tuple[float, float]:
    # Width and depth of the frame: small pictures have slim ones.
    wide = rng.random() < 0.25
    frame_m = float(rng.uniform(0.03, 0.05) if wide else rng.uniform(0.012, 0.024))
    return min(frame_m, 0.09 * short + 0.008), float(rng.uniform(0.018, 0.032))


def _printed(texture: Texture, roughness: float = 0.7) -> Material:
    return Material(f"print {texture.id[:8]}", texture_id=texture.id, roughness=roughness)


CUPBOARD_FORMS: Final = 6
SWITCH_FORMS: Final = 6
SOCKET_FORMS: Final = 5  # national standards
PLATE_FORMS: Final = 4
CLOCK_RIMS: Final = (
    ((0.0, 0.0), (0.0, 0.035), (0.012, 0.035), (0.012, 0.024)),
    ((0.0, 0.0), (0.0, 0.02), (0.01, 0.03), (0.03, 0.036), (0.036, 0.024)),
    ((0.0, 0.0), (0.0, 0.012), (0.004, 0.026), (0.012, 0.032), (0.02, 0.026), (0.022, 0.018)),
    ((0.0, 0.0), (0.0, 0.022)),
)
"""Profiles of a wall clock's rim: inset from its edge and distance from the wall, metres."""
