"""Recipes for small pictures."""

from __future__ import annotations

from pbrs_farm.core.layers import MOST_VARIANTS
from pbrs_farm.core.recipe import Recipe, recipe_from_name


def small() -> Recipe:
    return recipe_from_name(
        "preview",
        {
            "image.width_px": "96",
            "image.height_px": "72",
            "light.spp": "4",
            "light.pilot_spp": "0",
            "tone.variants": str(MOST_VARIANTS),
            "cameras.cell_m": "1.0",
            "cameras.score_width_px": "160",
            "cameras.score_height_px": "120",
        },
    )
