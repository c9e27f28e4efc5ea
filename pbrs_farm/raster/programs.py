"""Shader programs of the OpenGL modes, compiled from the .glsl files beside this module.

Effects: reads package resources, compiles on the given context.
"""

from __future__ import annotations

from importlib.resources import files
from typing import Any

from pbrs_farm.raster.lights import SOFT_M

DL_SCALE = 2 / 3
"""A white wall that faces the headlight (0.5) and the key light (1) is exactly white."""

IL_WHITE = 8.0
"""OpenGL-IL is compressed by x (1 + x / w^2) / (1 + x) with this w (Reinhard et al. 2002)."""

IL_HEADLIGHT = 0.06
"""Faint headlight of OpenGL-IL: what no lamp reaches is dim, not black."""

PANE_OPACITY = 0.08
PANE_MIRROR = 0.5
GLASS_MIRROR = 0.7

_VERSION = "#version 330\n"


def surface_program(context: Any, mode: str, kind: str, n_lights: int) -> Any:
    """Program that lights surfaces: mode "dl" or "il"; kind "plain", "cutout" or "see_through"."""
    defines = {
        f"MODE_{mode.upper()}": 1,
        "N_LIGHTS": n_lights,
        "SOFT2": SOFT_M**2,
        "DL_SCALE": DL_SCALE,
        "WHITE": IL_WHITE,
        "IL_HEADLIGHT": IL_HEADLIGHT,
        "PANE_OPACITY": PANE_OPACITY,
        "PANE_MIRROR": PANE_MIRROR,
        "GLASS_MIRROR": GLASS_MIRROR,
    }
    if kind != "plain":
        defines[kind.upper()] = 1
    head = _VERSION + "".join(f"#define {name} {value}\n" for name, value in defines.items())
    return context.program(
        vertex_shader=_VERSION + _source("surface.vert.glsl"),
        fragment_shader=head + _source("surface.frag.glsl"),
    )


def ids_program(context: Any) -> Any:
    """Program that writes depth_z and the item's id at pixel centres."""
    return context.program(
        vertex_shader=_VERSION + _source("surface.vert.glsl"),
        fragment_shader=_VERSION + _source("ids.frag.glsl"),
    )


def _source(name: str) -> str:
    return (files("pbrs_farm.raster") / name).read_text("utf-8")
