"""A stored view under other strengths of lamps and daylight, from its EXR; effects: reads files."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from pbrs_farm.errors import BadInput
from pbrs_farm.lighting import Mode
from pbrs_farm.recipe import Recipe
from pbrs_farm.transport.develop import Negative, develop


def negative_from_exr(radiance_exr: bytes, place: str) -> Negative:
    """What `light` stored of a view; BadInput names the place when a layer is missing."""
    from pbrs_farm.images import layers_from_exr

    exr = layers_from_exr(radiance_exr, f"{place}/radiance.exr")
    try:
        outdoor, indoor, albedo = (
            np.stack([exr[f"{name}.{c}"] for c in "RGB"], -1)
            for name in ("outdoor", "indoor", "albedo")
        )
        normal = np.stack([exr[f"normal.{c}"] for c in "XYZ"], -1)
    except KeyError as error:
        raise BadInput(f"{place}/radiance.exr", str(error), "no such layer") from None
    return Negative(outdoor, indoor, albedo, normal)


def relit(view: Path, *, indoor: float, outdoor: float, denoise: bool) -> bytes:
    """PNG of mode mlt_il_ol with each light group times its factor; the root's recipe tones it.

    view: the folder of a view in an output root. Raises BadInput when a file is missing.
    """
    from pbrs_farm.images import png_from_array

    root = view.resolve().parents[3] if len(view.resolve().parents) > 3 else view
    negative = negative_from_exr(_read(view / "radiance.exr"), str(view))
    tone = Recipe.model_validate_json(_read(root / "recipe.json")).tone
    prints = develop(negative, tone, denoise=denoise, indoor=indoor, outdoor=outdoor)
    return png_from_array(prints[Mode.MLT_IL_OL.value].rgb_srgb8)


def _read(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise BadInput(path, "", f"cannot be read: {error.strerror}") from None
