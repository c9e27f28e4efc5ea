"""Input names of surface shaders: UsdPreviewSurface and those of MaterialX. No effects.

MaterialX's nodes are called ND_<name>_surfaceshader; Arnold's standard_surface has the same inputs. Other
shaders are not supported: their material is a matte grey, with a note.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

from pbrs_farm.core.record import Record, read_csv


class SurfaceWords(Record):
    """Names of a surface shader's inputs ("" = none), and their defaults."""

    shader: str
    colour: str
    roughness: str
    metallic: str
    opacity: str
    normal: str
    glow: str
    colour_times: str = ""  # a number that multiplies the colour
    glow_times: str = ""  # and one for what shines, 0 where nothing says it
    transmission: str = ""
    default_colour: float = 0.8
    default_roughness: float = 0.5
    default_metallic: float = 0.0


_BY_NAME: Final = {
    row.shader: row
    for row in read_csv(Path(__file__).with_name("surface_shaders.csv"), SurfaceWords)
}
_CONTEXTS: Final = ("", "mtlx")  # render contexts in order of preference, the shared one first


def surface_of(material: Any) -> tuple[Any, SurfaceWords | None]:
    """(surface shader or None of a UsdShade.Material, its input names or None if it is unsupported)."""
    first = None
    outputs = (o.GetBaseName().rpartition(":")[0] for o in material.GetSurfaceOutputs())
    for context in dict.fromkeys((*_CONTEXTS, *outputs)):
        shader = material.ComputeSurfaceSource(context)[0]
        if not shader:
            continue
        first = first or shader
        kind = str(shader.GetIdAttr().Get() or "")
        name = kind.removeprefix("ND_").removesuffix("_surfaceshader").rpartition(":")[2]
        if name in _BY_NAME:
            return shader, _BY_NAME[name]
    return first, None


def is_picture(kind: str) -> bool:
    """Whether a node of that id reads a picture from a file."""
    return kind.startswith(("UsdUVTexture", "ND_UsdUVTexture", "ND_image_", "ND_tiledimage_")) or (
        kind.startswith("ND_gltf_") and "image" in kind
    )


WRAPS: Final = {"clamp": 33071, "black": 33071, "constant": 33071, "mirror": 33648}
"""How a picture goes on beyond its edges, in words of USD and MaterialX -> glTF's number; others repeat."""
