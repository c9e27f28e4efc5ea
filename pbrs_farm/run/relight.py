"""A stored view under other strengths of lamps and daylight, from its EXR; effects: reads files."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

import numpy as np

from pbrs_farm.core import keys
from pbrs_farm.core.arrays import F32, Srgb8Image
from pbrs_farm.core.errors import BadInput, ObjectMissing
from pbrs_farm.core.lighting import Mode
from pbrs_farm.core.recipe import ToneFields, recipe_from_json
from pbrs_farm.formats.layer_file import layer_bytes
from pbrs_farm.formats.radiance_exr import FILE as RADIANCE_EXR
from pbrs_farm.formats.radiance_exr import RadianceExr, radiance_from_exr
from pbrs_farm.formats.view_json import lamps_from_view_json
from pbrs_farm.regular_files import read_given
from pbrs_farm.run.output_root import attribution
from pbrs_farm.store import StoreSettings, store_from_url
from pbrs_farm.store.folder import FolderStore
from pbrs_farm.transport.develop.denoiser import denoise_radiance
from pbrs_farm.transport.develop.mode_pictures import Factor, LinearAovs, denoise_aovs, develop
from pbrs_farm.transport.lamp_layers import indoor_from_lamps, lamp_shares, relit_indoor


@dataclass(frozen=True, slots=True)
class LampFactor:
    """The request of one --lamp."""

    word: str  # a lamp's number, item, name, or a pattern of these
    rgb: tuple[float, float, float]  # what its light is multiplied by


def linear_aovs(radiance: RadianceExr) -> LinearAovs:
    """The images of a radiance.exr for `develop`, as stored, (H, W, 3) float32; BadInput if one is missing."""
    image = radiance.image
    return LinearAovs(image("outdoor"), image("indoor"), image("albedo"), image("normal"))


@dataclass(frozen=True, slots=True, eq=False)
class RelightLayers:
    """The layers of light that relit views are sums of, (H, W, 3) float32 radiance each."""

    aovs: LinearAovs  # its groups for `develop`
    lamps: Mapping[int, F32]  # number -> its share of indoor light; they sum to it


def relight_layers(
    radiance: RadianceExr, rows: Sequence[Mapping[str, Any]], *, denoise: bool
) -> RelightLayers:
    """The layers whose sums `relit` tones. rows: the lamps of view.json, () without any.

    With denoise, each lamp's layer is denoised and scaled so that their sum is the denoised indoor light.
    MachineFailed without a denoiser. BadInput if the file lacks a layer of rows.
    """
    aovs = linear_aovs(radiance)
    layers = {int(r["number"]): radiance.image(r["layer"]) for r in rows if r["layer"]}
    if not denoise:
        return RelightLayers(aovs, layers)
    clean = denoise_aovs(aovs)
    return RelightLayers(clean, lamp_shares(clean.indoor, _denoised_lamps(aovs, layers)))


def picture_of_layers(
    light: RelightLayers, tone: ToneFields, *, outdoor: Factor, lamps: Mapping[int, F32]
) -> Srgb8Image:
    """(H, W, 3) sRGB of mode mlt_il_ol under other factors of daylight and of each lamp, (3,)."""
    indoor = indoor_from_lamps(light.lamps, lamps, light.aovs.outdoor.shape)
    images = develop(replace(light.aovs, indoor=indoor), tone, denoise=False, outdoor=outdoor)
    return images[Mode.MLT_IL_OL.value].rgb_srgb8


def relit(
    view: Path, *, indoor: Factor, outdoor: Factor, denoise: bool, lamps: Sequence[LampFactor] = ()
) -> bytes:
    """PNG of mode mlt_il_ol with each light group and each lamp times its factor.

    view: the folder of a view in an output root, whose recipe tones the picture. lamps: the last
    word that names a lamp counts; indoor multiplies all of them. Denoising comes first, so that a
    picture is linear in its factors. Raises BadInput when a file is missing, when the view has no
    light by lamp or none of a name.
    """
    # OUT of OUT/houses/<house>/views/<view>.
    root = view.resolve().parents[3] if len(view.resolve().parents) > 3 else view
    if not (view / RADIANCE_EXR).is_file():
        raise BadInput(view, RADIANCE_EXR, "no such file", hint=_NO_LIGHT)
    radiance = radiance_from_exr(read_given(view / RADIANCE_EXR), str(view / RADIANCE_EXR))
    aovs = linear_aovs(radiance)
    clean = denoise_aovs(aovs) if denoise else aovs
    # Sum indoor light anew from the lamps' own layers.
    if lamps:
        rows = lamps_of_view(view)
        factors = lamp_factors(rows, lamps)
        layers = {int(r["number"]): radiance.image(r["layer"]) for r in rows if r["layer"]}
        if denoise:
            relit_light = relit_indoor(clean.indoor, _denoised_lamps(aovs, layers), factors)
        else:
            relit_light = indoor_from_lamps(layers, factors, aovs.indoor.shape)
        clean = replace(clean, indoor=relit_light)
    # Develop it as the run would have, with the recipe's tone.
    recipe = recipe_from_json(read_given(root / "recipe.json"), str(root / "recipe.json"))
    house_id = view.resolve().parents[1].name
    tone = recipe.camera_of(house_id, view.resolve().name).tone
    images = develop(clean, tone, denoise=False, indoor=indoor, outdoor=outdoor)
    credit = attribution(FolderStore(root), house_id)
    return layer_bytes(Mode.MLT_IL_OL.value, images[Mode.MLT_IL_OL.value].rgb_srgb8, credit)


def _denoised_lamps(aovs: LinearAovs, layers: Mapping[int, F32]) -> dict[int, F32]:
    # Their sum is scaled to the denoised indoor light, so the fast network has the same error; a lone lamp is that light.
    if len(layers) < 2:
        return dict(layers)
    return {
        n: denoise_radiance(layer, aovs.albedo, aovs.normal, "fast") for n, layer in layers.items()
    }


def lamps_of_view(view: Path) -> list[dict[str, Any]]:
    """The lamps' rows of a view's view.json (transport/lamp_layers.py); BadInput without any."""
    return lamps_from_view_json(read_given(view / "view.json"), view)


def lamp_factors(rows: Sequence[Mapping[str, Any]], words: Sequence[LampFactor]) -> dict[int, F32]:
    """Lamp's number -> (3,) factors. BadInput for a word that names no lamp, saying which exist.

    rows are those of `lamps_of_view`. A word may name several lamps; of two words for one lamp the
    last counts. Factors are float32 linear RGB; lamps that no word names are not in the result.
    """
    factors: dict[int, F32] = {}
    for factor_word in words:
        named = [int(row["number"]) for row in rows if _is_named(row, factor_word.word)]
        if not named:
            exist = ", ".join(f"{row['number']} {row['item']} ({row['name']})" for row in rows)
            hint = f"of {exist}" if exist else "this view has no lamps"
            raise BadInput("--lamp", factor_word.word, "no such lamp", hint=hint)
        factors |= {number: np.array(factor_word.rgb, np.float32) for number in named}
    return factors


def unlit_lamps(view: Path, words: Sequence[LampFactor]) -> list[dict[str, Any]]:
    """The rows of lamps named by words without * that bring no light to a view; BadInput as `lamp_factors`."""
    rows = lamps_of_view(view)
    named = lamp_factors(rows, [w for w in words if "*" not in w.word])
    return [row for row in rows if int(row["number"]) in named and not row["layer"]]


def _is_named(row: Mapping[str, Any], word: str) -> bool:
    """By number, item (all light sources of one that has several), name, or a pattern of these."""
    # Compare with each of its names, then as a pattern.
    item, name = str(row["item"]), str(row["name"])
    is_it = word in (str(row["number"]), item, name) or item.startswith(f"{word}/")
    return is_it or ("*" in word and (fnmatchcase(item, word) or fnmatchcase(name, word)))


_NO_LIGHT: Final = (
    "the view has no mode of light, or was rendered with --drop-radiance, as parts of sets are: render"
    " it again into a new folder without that (in a set's file: drop_radiance = false)"
)
_VIEW: Final = re.compile(
    r"(?P<root>[^:]+://.+)/(?:houses|objects)/(?P<house>[^/]+)/views/(?P<view>[^/]+)/?"
)


@contextmanager
def folder_of_view(word: str, settings: StoreSettings, *, needs_light: bool) -> Iterator[Path]:
    """The folder of a view, or a copy of a URL's (with radiance.exr if needs_light); BadInput."""
    if "://" not in word:
        if not (Path(word) / "view.json").is_file():
            raise BadInput(word, "view.json", "no such file", hint="OUT/houses/HOUSE/views/VIEW")
        yield Path(word)
        return
    match = _VIEW.fullmatch(word)
    if match is None:
        raise BadInput(word, "", "is not a view", hint="URL/houses/HOUSE/views/VIEW")
    house, view = match["house"], match["view"]
    store = store_from_url(match["root"], settings)
    needed_keys = [keys.RECIPE, keys.view_key(house, view, "view.json")]
    if needs_light:
        needed_keys.append(keys.view_key(house, view, RADIANCE_EXR))
    with TemporaryDirectory(prefix="pbrs-view-") as folder:
        copy = FolderStore(Path(folder))
        for key in (*needed_keys, keys.house_key(house, "house.json")):
            try:
                copy.put(key, store.get(key))
            except ObjectMissing:
                # house.json needs its credit line alone.
                if key in needed_keys:
                    hint = _NO_LIGHT if key.endswith(RADIANCE_EXR) else ""
                    raise BadInput(word, key, "not in this store", hint=hint) from None
        yield Path(folder) / keys.view_key(house, view)
