"""The panorama of a house: a file of the recipe's folder, by the house's id. Effects: reads files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.assets.skies import fetch_skies
from pbrs_farm.core.errors import BadRecipe
from pbrs_farm.core.recipe import Recipe
from pbrs_farm.regular_files import fault_of, read_regular

SUFFIXES = (".exr", ".hdr")


def panorama_for_house(recipe: Recipe, house_id: str) -> tuple[str, NDArray[np.floating]] | None:
    """(name, (H, W, 3) linear radiance) of a house's sky; None when the recipe wants no panorama.

    Without a folder in the recipe those of Debian's blender-data are taken (skies.py).

    Raises BadRecipe when the folder is missing or holds no outdoor panorama.
    """
    if recipe.sky.kind != "panorama":
        return None
    from pbrs_farm.images import decode_radiance
    from pbrs_farm.transport.scene_tables.sky import choose_panorama

    folder = Path(recipe.sky.panoramas) if recipe.sky.panoramas else fetch_skies()
    if not folder.is_dir():
        hint = "`pbrs-farm skies` fetches four; or --set sky.kind=sunsky"
        raise BadRecipe(f"sky.panoramas: {folder} is no folder of panoramas", hint=hint)
    # Choose by name and house, not by the folder's order: each machine takes the same.
    files = {p.name: p for p in folder.iterdir() if p.suffix.lower() in SUFFIXES}
    name = choose_panorama(list(files), house_id, recipe.seed)
    return name, decode_radiance(_bytes(files[name]), name)


def _bytes(file: Path) -> bytes:
    try:
        return read_regular(file)
    except OSError as error:
        raise BadRecipe(f"sky.panoramas: {file} {fault_of(error)}") from None
