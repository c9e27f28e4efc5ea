"""Pictures as things: framed, on canvas, as posters; mirrors, clocks and fittings; no effects.

Shapes have their back at z = 0 and grow to +z, the middle of the lower edge at the origin.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, replace

import numpy as np

from pbrs_farm.core.arrays import F64, Srgb8Image
from pbrs_farm.core.classes import CABINET, MIRROR, OTHERPROP, PICTURE, SHELVES
from pbrs_farm.core.house import Material, MaterialKind, Surface, Texture
from pbrs_farm.dress.style import Rgb, Style, shade
from pbrs_farm.dress.things.assembly import (
    Made,
    Part,
    any_colour,
    hung,
    metal,
    plain,
    slab,
    transformed,
    turned,
)
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


def ring(name: str, low: F64, high: F64, width: float, depth: float) -> Surface:
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


def round_mirror(diameter: float, frame: Material) -> Made:
    """A round mirror in a narrow ring."""
    r = diameter / 2
    glass = Material("mirror", MaterialKind.MIRROR, specular=(0.9, 0.9, 0.9))
    rim = np.array([[0, 0], [r, 0], [r, 0.02], [r - 0.014, 0.02], [r - 0.014, 0.012]])
    pane = np.array([[r - 0.014, 0.012], [0, 0.012]])
    parts = [(_disc("rim", rim, r), frame), (_disc("mirror", pane, r), glass)]
    return hung("round_mirror", "mirror", MIRROR, parts)


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


def wall_shelf(width: float, depth: float, boards: int, board: Material, bracket: Material) -> Made:
    """Boards above one another on two brackets each; the lowest board's top is at y = 0.04."""
    parts = []
    for k in range(boards):
        y = 0.028 + 0.32 * k
        centre = np.array([0.0, y, depth / 2])
        parts.append((box("board", centre, np.array([width / 2, 0.012, depth / 2]), 0), board))
        for side in (-1, 1):
            x = side * (width / 2 - 0.12)
            arm = box("bracket", np.array([x, y - 0.02, depth * 0.4]), np.array([0.01, 0.008, depth * 0.4]), 0)  # fmt: skip
            parts.append((arm, bracket))
    return hung("wall_shelf", "shelves", SHELVES, parts)


def plate(n_gangs: int, *, is_socket: bool, colour: Rgb) -> Made:
    """A socket or a switch of the usual 8 cm, n beside one another."""
    cover = plain("plate", colour, 0.3)
    dark = plain("plate hole", shade(colour, 0.25 if is_socket else 0.9), 0.5)
    parts = []
    width = 0.081 * n_gangs
    centre = np.array([0.0, 0.0405, 0.0045])
    parts.append((box("plate", centre, np.array([width / 2, 0.0405, 0.0045]), 0), cover))
    for k in range(n_gangs):
        x = (k - (n_gangs - 1) / 2) * 0.081
        if is_socket:
            r = 0.019
            well = np.array([[r + 0.003, 0.009], [r, 0.0093], [0, 0.0093]])
            parts.append((_moved(_disc("well", well, 0.0405), (x, 0.0, 0.0)), dark))
        else:
            half = np.array([0.029, 0.029, 0.002])
            parts.append((box("rocker", np.array([x, 0.0405, 0.0105]), half, 0), cover))
    name = "socket" if is_socket else "switch"
    return hung(f"wall_{name}", name, OTHERPROP, parts)


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


# What hangs over a kitchen's worktop: cupboards, open boxes, a rail with tools.
# Shapes have their back at z = 0 and grow to +z, the middle of the lower edge at the origin.


_BOARD_M = 0.018
_DEPTH_M = 0.32
_ROD_Z_M = 0.045  # of a rail before its wall
_OUT = np.array([[1.0, 0, 0], [0, 0, -1.0], [0, 1.0, 0]])  # turns +y to +z


@dataclass(frozen=True, slots=True)
class Fronts:
    """What a kitchen's cupboards are made of."""

    body: Material
    front: Material
    metal: Material


def wall_cupboard(
    fronts: Fronts, width: float, height: float, n_doors: int, d: float = _DEPTH_M
) -> Made:
    """A closed cupboard with its doors; d: its depth."""
    w = width / 2
    parts: list[Part] = [(slab((-w, 0.0, 0.0), (w, height, d)), fronts.body)]
    step = width / n_doors
    for k in range(n_doors):
        x = -w + k * step
        front = slab((x + 0.002, 0.002, d + 0.0005), (x + step - 0.002, height - 0.002, d + 0.0185))
        parts.append((front, fronts.front))
        # The handle is low, where the door opens.
        at = x + (step - 0.04 if k % 2 == 0 and n_doors > 1 else 0.04)
        parts.append(
            (slab((at - 0.005, 0.04, d + 0.0345), (at + 0.005, 0.2, d + 0.0425)), fronts.metal)
        )
        for y in (0.05, 0.185):
            foot = slab((at - 0.004, y, d + 0.0185), (at + 0.004, y + 0.008, d + 0.0345))
            parts.append((foot, fronts.metal))
    return hung("wall_cupboard", "upper_cabinet", CABINET, parts)


def open_box(fronts: Fronts, width: float, height: float, d: float = _DEPTH_M - 0.04) -> Made:
    """An open cupboard of one to three shelves; d: its depth."""
    w, t = width / 2, _BOARD_M
    parts: list[Part] = [
        (slab((-w, 0.0, 0.0), (-w + t, height, d)), fronts.body),
        (slab((w - t, 0.0, 0.0), (w, height, d)), fronts.body),
        (slab((-w + t, 0.0, 0.0), (w - t, height, 0.006)), fronts.body),
    ]
    n = max(1, round(height / 0.3))
    for y in np.linspace(0.0, height - t, n + 1):
        parts.append((slab((-w + t, float(y), 0.006), (w - t, float(y) + t, d)), fronts.body))
    return hung("open_cupboard", "shelves", SHELVES, parts)


def tool_rail(rng: np.random.Generator, style: Style, steel: Material, width: float) -> Made:
    """A bar on two holders with tools, pans and cups on hooks; the bar hangs above y = 0.3."""
    half, y = width / 2, 0.36
    bar = turned([(0.0, 0.0), (0.006, 0.0), (0.006, width), (0.0, width)], n=12)
    # Lay the bar along x.
    along = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    parts: list[Part] = [(transformed(bar, along, (-half, y, _ROD_Z_M)), steel)]
    for x in (-half + 0.03, half - 0.03):
        parts.append(
            (slab((x - 0.008, y - 0.008, 0.0), (x + 0.008, y + 0.008, _ROD_Z_M - 0.004)), steel)
        )
    x = -half + 0.1
    while x < half - 0.08:
        make = (_ladle, _turner, _pan, _cup)[int(rng.choice(4, p=[0.3, 0.3, 0.22, 0.18]))]
        parts += make(rng, style, steel, x, y - 0.006)
        x += float(rng.uniform(0.1, 0.15)) + (0.1 if make is _pan else 0.0)
    return hung("tool_rail", "kitchen_tool", OTHERPROP, parts)


def _hook(steel: Material, x: float, y: float) -> Part:
    # It reaches from the bar down to what hangs.
    return slab(
        (x - 0.0015, y - 0.03, _ROD_Z_M - 0.0015), (x + 0.0015, y + 0.001, _ROD_Z_M + 0.0015)
    ), steel


def _handle(rng: np.random.Generator, style: Style, steel: Material) -> Material:
    dark = plain("handle", (0.08, 0.08, 0.08), 0.5)
    wood = plain(f"handle {style.wood.name}", style.wood.mean, 0.6)
    return (steel, dark, wood)[int(rng.integers(3))]


def _stick(material: Material, x: float, top: float, low: float) -> Part:
    return slab((x - 0.006, low, _ROD_Z_M - 0.003), (x + 0.006, top, _ROD_Z_M + 0.003)), material


def _ladle(
    rng: np.random.Generator, style: Style, steel: Material, x: float, y: float
) -> list[Part]:
    r, low = float(rng.uniform(0.03, 0.042)), y - float(rng.uniform(0.24, 0.3))
    ball = [(0.0, -r), (0.7 * r, -0.7 * r), (r, 0.0), (0.7 * r, 0.7 * r), (0.0, r)]
    bowl = transformed(turned(ball, n=14), np.diag([1.0, 1.0, 0.55]), (x, low, _ROD_Z_M))
    return [
        _hook(steel, x, y),
        _stick(_handle(rng, style, steel), x, y - 0.028, low + 0.6 * r),
        (bowl, steel),
    ]


def _turner(
    rng: np.random.Generator, style: Style, steel: Material, x: float, y: float
) -> list[Part]:
    w, low = float(rng.uniform(0.028, 0.04)), y - float(rng.uniform(0.2, 0.24))
    handle = _handle(rng, style, steel)
    blade = slab((x - w, low - 0.1, _ROD_Z_M - 0.0015), (x + w, low + 0.002, _ROD_Z_M + 0.0015))
    return [
        _hook(steel, x, y),
        _stick(handle, x, y - 0.028, low),
        (blade, handle if rng.random() < 0.5 else steel),
    ]


def _pan(rng: np.random.Generator, style: Style, steel: Material, x: float, y: float) -> list[Part]:
    r, low = float(rng.uniform(0.08, 0.1)), y - 0.13
    black = plain("pan", (0.07, 0.07, 0.075), 0.4)
    profile = [
        (0.0, 0.0),
        (0.85 * r, 0.0),
        (r, 0.035),
        (0.96 * r, 0.035),
        (0.82 * r, 0.005),
        (0.0, 0.005),
    ]
    dish = transformed(turned(profile, n=24), _OUT, (x, low - r, 0.008))
    return [
        _hook(steel, x, y),
        (slab((x - 0.009, low - 0.004, 0.028), (x + 0.009, y - 0.024, 0.046)), black),
        (dish, black if rng.random() < 0.6 else steel),
    ]


def _cup(rng: np.random.Generator, style: Style, steel: Material, x: float, y: float) -> list[Part]:
    r, h = 0.038, 0.085
    colour = plain("hung cup", any_colour(rng, style), 0.25)
    profile = [(0.0, 0.0), (r, 0.0), (r, h), (r - 0.004, h), (r - 0.004, 0.004), (0.0, 0.004)]
    # It hangs by its handle, its mouth to the side.
    body = transformed(
        turned(profile, n=18),
        np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]),
        (x - h / 2, y - 0.03 - 0.018 - r, _ROD_Z_M),
    )
    ear = slab((x - 0.018, y - 0.05, _ROD_Z_M - 0.005), (x + 0.018, y - 0.026, _ROD_Z_M + 0.005))
    return [_hook(steel, x, y), (ear, colour), (body, colour)]
