"""Shader programs of the OpenGL modes, compiled from the .glsl files beside this module.

Effects: reads package resources, compiles on the given context.
"""

from __future__ import annotations

from collections.abc import Iterable
from importlib.resources import files
from typing import Any

from pbrs_farm.raster.light_choice import SOFT_M

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


def surface_program(context: Any, features: Iterable[str], n_lights: int, n_samples: int) -> Any:
    """Program that lights surfaces. features: one of MODE_DL, MODE_IL; then any of GLOSSY, CUTOUT,
    SEE_THROUGH, WITH_SPOTS, WITH_LINES: on a CPU what is not needed must not be there."""
    defines = {
        "N_LIGHTS": n_lights,
        "N_SAMPLES": n_samples,
        "SOFT2": SOFT_M**2,
        "DL_SCALE": DL_SCALE,
        "WHITE": IL_WHITE,
        "IL_HEADLIGHT": IL_HEADLIGHT,
        "PANE_OPACITY": PANE_OPACITY,
        "PANE_MIRROR": PANE_MIRROR,
        "GLASS_MIRROR": GLASS_MIRROR,
    }
    defines |= dict.fromkeys(features, 1)
    head = _VERSION + "".join(f"#define {name} {value}\n" for name, value in defines.items())
    return context.program(
        vertex_shader=_VERSION + _source("surface.vert.glsl"),
        fragment_shader=head + _source("surface.frag.glsl"),
    )


def plain_program(context: Any, name: str) -> Any:
    """Program "ids" (writes depth_z and the item's id at pixel centres) or "depth" (only depth)."""
    return context.program(
        vertex_shader=_VERSION + _source("surface.vert.glsl"),
        fragment_shader=_VERSION + _source(f"{name}.frag.glsl"),
    )


def _source(name: str) -> str:
    return (files("pbrs_farm.raster") / name).read_text("utf-8")
