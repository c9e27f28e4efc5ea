"""Cladding of walls: matchboard, level boards, planks of wood, slats, panels in frames; no effects."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from pbrs_farm.core.arrays import F32
from pbrs_farm.dress.noise import smoothstep
from pbrs_farm.dress.style import Rgb, Wood
from pbrs_farm.dress.surface_maps import SurfaceMaps, normals_from_height
from pbrs_farm.furnishings.textures.canvas import Canvas
from pbrs_farm.furnishings.textures.planks import BoardLayout, PlankLook, plank_maps, rows_of_planks

PANELS_M: Final = {
    "low": (0.62, 0.92),
    "middle": (0.7, 1.05),
    "high": (0.54, 1.35),
    "square": (0.5, 0.98),
}
"""Width of a panel and height of the panelling, by variant."""
_GROOVE_M, _GROOVE_DEEP_M = 0.0045, 0.0028  # half its width; how far it is cut
_LATH_M, _GAP_M, _LATH_DEEP_M = 0.027, 0.013, 0.009  # of slats
_RAIL_M, _CAP_M, _FOOT_M = 0.085, 0.055, 0.13  # of panels: between them, above, and below
_BEVEL_M, _SUNK_M = 0.028, 0.007  # the moulding round a panel


def board_maps(c: Canvas, tint: Rgb, *, upright: bool) -> SurfaceMaps:
    """Painted boards with grooves between them: matchboard where upright, else like a ship's side."""
    along = c.size_m[0] if upright else c.size_m[1]
    n = int(c.rng.choice([9, 11, 13] if upright else [7, 8, 10]))
    across = (np.arange(c.shape[1] if upright else c.shape[0]) + 0.5) * (
        along / c.shape[1 if upright else 0]
    )
    board = np.floor(across * n / along).astype(int)
    edge = np.minimum(across % (along / n), along / n - across % (along / n)).astype(np.float32)
    groove = smoothstep(_GROOVE_M, 0.0005, edge)
    if not upright:
        # The upper board laps over the lower one and shades it.
        groove = np.maximum(
            groove, 0.25 * smoothstep(0.02, 0.0, (across % (along / n)).astype(np.float32))
        )
    light = 1.0 + np.clip(c.rng.normal(0, 0.008, n), -0.02, 0.02).astype(np.float32)[board]
    groove, light = (
        np.broadcast_to(v if upright else v[:, None], c.shape) for v in (groove, light)
    )
    grain = c.noise(slope=1.2, stretch=(5.0, 1.0) if upright else (1.0, 5.0))
    tone = light * (1.0 - 0.42 * groove) + 0.006 * grain
    colour = np.array(tint, np.float32) * tone[..., None]
    height = np.asarray(-_GROOVE_DEEP_M * groove + 0.00004 * grain, np.float32)
    return c.maps(colour, 0.5, height, 0.3)


def wall_plank_maps(c: Canvas, wood: Wood, darkness: float, *, upright: bool) -> SurfaceMaps:
    """Planks of wood on a wall, each of another tone; upright or level. c.c: a square."""
    layout = rows_of_planks(c, int(c.rng.choice([13, 15, 18])), 1)
    look = PlankLook(joint_m=0.002, bevel_m=0.004, variation=0.07, roughness=0.55, gloss=0.3)
    maps = plank_maps(c, wood, layout, look, darkness)
    return _turned(maps) if upright else maps


def slat_maps(c: Canvas, wood: Wood, darkness: float) -> SurfaceMaps:
    """Upright slats of wood before black felt. c.c: a square."""
    n = round(c.size_m[1] / (_LATH_M + _GAP_M))
    layout = rows_of_planks(c, n, 1)
    # A slat's side edges count, not its ends, which nobody sees.
    side = _side_m(layout, c.size_m)
    maps = plank_maps(c, wood, layout, PlankLook(joint_m=0.0, variation=0.05), darkness)
    is_gap = smoothstep(_GAP_M / 2 + 0.001, _GAP_M / 2 - 0.001, side)
    edge = smoothstep(_GAP_M / 2 + 0.004, _GAP_M / 2, side)
    felt = np.array((0.05, 0.05, 0.052), np.float32) * 255
    colour = maps.colour.astype(np.float32) * (1.0 - 0.25 * edge)[..., None]
    colour += is_gap[..., None] * (felt - colour)
    return _turned(
        replace(
            maps,
            colour=colour.astype(np.uint8),
            roughness=0.55,
            normal=normals_from_height(-_LATH_DEEP_M * edge, c.size_m),
        )
    )


def panel_maps(c: Canvas, tint: Rgb) -> SurfaceMaps:
    """One painted panel in its frame under a cap, repeated side by side, the foot at v = 0."""
    width, height = c.size_m
    x = (np.arange(c.shape[1], dtype=np.float32) + 0.5) * np.float32(width / c.shape[1])
    y = height - (np.arange(c.shape[0], dtype=np.float32) + 0.5) * np.float32(height / c.shape[0])
    rail = _RAIL_M * float(c.rng.uniform(0.85, 1.15))
    # distance inside the panel's opening, negative on the frame
    across = np.minimum(x, width - x) - rail / 2
    up = np.minimum(y - _FOOT_M, height - _CAP_M - rail - y)
    inside = np.minimum(across[None], up[:, None])
    slope = smoothstep(0.0, _BEVEL_M, inside)
    field = smoothstep(_BEVEL_M + 0.03, _BEVEL_M + 0.05, inside) * bool(c.rng.random() < 0.5)
    line = smoothstep(0.0025, 0.0, np.abs(inside)) + 0.6 * smoothstep(
        0.0025, 0.0, np.abs(inside - _BEVEL_M)
    )
    # The cap projects, with a shade below it and a light edge above.
    below = smoothstep(_CAP_M + 0.012, _CAP_M, height - y) * (height - y > _CAP_M)
    cap = smoothstep(_CAP_M + 0.005, _CAP_M - 0.003, height - y)
    lip = np.asarray(0.5 * smoothstep(0.006, 0.0, np.abs(height - y - 0.022)), np.float32)
    relief = _SUNK_M * (field - slope) + (0.006 * cap - 0.002 * lip)[:, None]
    grain = c.noise(slope=1.0)
    tone = 1.0 - 0.3 * np.clip(line, 0, 1) - 0.22 * below[:, None] - 0.1 * lip[:, None]
    tone = tone - 0.015 * slope + 0.004 * grain
    colour = np.array(tint, np.float32) * np.asarray(tone, np.float32)[..., None]
    return c.maps(colour, 0.45, np.asarray(relief, np.float32), 0.35)


def _side_m(layout: BoardLayout, size_m: tuple[float, float]) -> F32:
    """(H, W) metres to the nearer long edge of each plank."""
    rows = layout.plank.shape[0]
    first = layout.across[:, 0] == 0
    starts = np.append(np.flatnonzero(first), rows)
    tall = np.repeat(np.diff(starts), np.diff(starts))[:, None]
    side_px = np.minimum(layout.across + 0.5, tall - layout.across - 0.5)
    return np.asarray(side_px * (size_m[1] / rows), np.float32)


def _turned(maps: SurfaceMaps) -> SurfaceMaps:
    """The surface turned by a quarter to the left: what ran along u runs along v."""
    normal = maps.normal
    if normal is not None:
        turned = np.rot90(normal)
        normal = np.stack([255 - turned[..., 1], turned[..., 0], turned[..., 2]], -1)
    rough = maps.roughness
    return replace(
        maps,
        colour=np.ascontiguousarray(np.rot90(maps.colour)),
        normal=normal,
        roughness=rough if isinstance(rough, float) else np.ascontiguousarray(np.rot90(rough)),
        size_m=(maps.size_m[1], maps.size_m[0]),
    )
