"""Shader programs compiled from the .glsl files beside this module, on the given context."""

from __future__ import annotations

from collections.abc import Iterable
from enum import IntFlag
from importlib.resources import files
from typing import Any

from pbrs_farm.core.house import House, Material, MaterialKind
from pbrs_farm.core.lighting import LightForm
from pbrs_farm.raster.light_choice import SOFTENING_M

DL_SCALE = 2 / 3  # a white wall that faces the headlight (0.5) and the key light (1) is just white
IL_WHITE = 8.0  # w of OpenGL-IL's tone curve x (1 + x / w^2) / (1 + x) (Reinhard et al. 2002)
IL_HEADLIGHT = 0.06  # faint headlight of OpenGL-IL: what no lamp reaches is dim, not black
MAX_PANE_OPACITY = 0.08  # maximum opacity of a window pane
PANE_MIRROR = 0.5  # share of the sky's colour in a pane's reflection
GLASS_MIRROR = 0.7  # and in that of other glass
_VERSION = "#version 330\n"


def surface_program(context: Any, features: Iterable[str], n_lights: int, n_samples: int) -> Any:
    """Program that lights surfaces. features: MODE_DL or MODE_IL, and any of shader_features.

    n_lights: of a block of lights; n_samples: of the target. Compiled on each call: keep programs
    by their features. The driver's message is in the error where it does not compile.
    """
    # Pass constants and features as #defines, so that code without use is not compiled in.
    defines = {
        "N_LIGHTS": n_lights,
        "N_SAMPLES": n_samples,
        "SOFTENING2": SOFTENING_M**2,
        "DL_SCALE": DL_SCALE,
        "WHITE": IL_WHITE,
        "IL_HEADLIGHT": IL_HEADLIGHT,
        "PANE_OPACITY": MAX_PANE_OPACITY,
        "PANE_MIRROR": PANE_MIRROR,
        "GLASS_MIRROR": GLASS_MIRROR,
    }
    defines |= dict.fromkeys(features, 1)
    head = _VERSION + "".join(f"#define {name} {value}\n" for name, value in defines.items())
    return context.program(
        vertex_shader=_VERSION + _shader_source("surface.vert.glsl"),
        fragment_shader=head + _shader_source("surface.frag.glsl"),
    )


def depth_program(context: Any) -> Any:
    """Program that writes depth alone."""
    return context.program(
        vertex_shader=_VERSION + _shader_source("surface.vert.glsl"),
        fragment_shader=_VERSION + _shader_source("depth.frag.glsl"),
    )


def _shader_source(name: str) -> str:
    return (files("pbrs_farm.raster") / name).read_text("utf-8")


class Feature(IntFlag):
    """Capabilities of a surface's shader, its #defines, so that each draw has the smallest program."""

    GLOSSY = 1  # a specular highlight
    ALPHA_CUTOUT = 2  # the texture's alpha discards fragments
    TRANSPARENT = 4  # blended: glass, panes, opacity below 1
    TEXTURED = 8  # the texture multiplies the diffuse colour


def features_of_material(material: Material, *, is_textured: bool = True) -> int:
    """Features of a material as bits; is_textured: False if its picture is unreadable."""
    features = Feature.TEXTURED if is_textured and material.texture_id is not None else Feature(0)
    if material.shininess > 0 and any(material.specular):
        features |= Feature.GLOSSY
    if material.kind in (MaterialKind.GLASS, MaterialKind.PANE) or material.opacity < 1:
        features |= Feature.TRANSPARENT
    if material.alpha_cutout:
        features |= Feature.ALPHA_CUTOUT
    return int(features)


def feature_names(features: int) -> list[str]:
    """The shader's #defines of a sum of bits."""
    return [str(f.name) for f in Feature if f & features]


def light_features(house: House) -> list[str]:
    """The shader's #defines of the forms of light that the house has beside points."""
    forms = {part.form for item in house.items for part in item.lights}
    names = {"WITH_SPOTS": LightForm.SPOT, "WITH_LINES": LightForm.LINE}
    return [name for name, form in names.items() if form in forms]
