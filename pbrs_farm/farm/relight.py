"""A stored view under other strengths of lamps and daylight, from its EXR; effects: reads files."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from pbrs_farm.errors import BadInput
from pbrs_farm.lighting import Mode
from pbrs_farm.recipe import Recipe
from pbrs_farm.transport.develop import Negative, develop


def negative_from_files(radiance_exr: bytes, normal_png: bytes, place: str) -> Negative:
    """What `light` and `truth` stored of a view; BadInput names the place when a layer is missing."""
    from pbrs_farm.images import array_from_png, layers_from_exr

    exr = layers_from_exr(radiance_exr, f"{place}/radiance.exr")
    try:
        groups = [
            np.stack([exr[f"{name}.{c}"] for c in "RGB"], -1)
            for name in ("outdoor", "indoor", "albedo")
        ]
    except KeyError as error:
        raise BadInput(f"{place}/radiance.exr", str(error), "no such layer") from None
    encoded = array_from_png(normal_png, f"{place}/normal.png").astype(np.float32)
    outdoor, indoor, albedo = groups
    return Negative(outdoor, indoor, albedo, encoded * np.float32(2 / 65535) - 1)


def relit(view: Path, *, indoor: float, outdoor: float, denoise: bool) -> bytes:
    """PNG of mode mlt_il_ol with each light group times its factor; the root's recipe tones it.

    view: the folder of a view in an output root. Raises BadInput when a file is missing.
    """
    from pbrs_farm.images import png_from_array

    root = view.resolve().parents[3] if len(view.resolve().parents) > 3 else view
    negative = negative_from_files(
        _read(view / "radiance.exr"), _read(view / "normal.png"), str(view)
    )
    tone = Recipe.model_validate_json(_read(root / "recipe.json")).tone
    pictures = develop(negative, tone, denoise=denoise, indoor=indoor, outdoor=outdoor)
    return png_from_array(pictures[Mode.MLT_IL_OL.value])


def _read(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise BadInput(path, "", f"cannot be read: {error.strerror}") from None
