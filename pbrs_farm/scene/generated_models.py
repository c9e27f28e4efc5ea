"""Furniture and small items generated on request, by pf.generate_model. Effects: writes a GLB into the cache."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, Final

import numpy as np

from pbrs_farm.assets.debian import cache_folder, write_whole
from pbrs_farm.core import keys
from pbrs_farm.core.catalogue import Shape
from pbrs_farm.core.checked_calls import Whole, checked_call
from pbrs_farm.core.edits import ModelRef
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.house import House, Item, ItemKind, Source
from pbrs_farm.core.shown_text import did_you_mean
from pbrs_farm.dress.style import style_for
from pbrs_farm.formats.house_glb import glb_from_house
from pbrs_farm.furnishings.things.families import families, fitted_to_size
from pbrs_farm.furnishings.things.maker import Family
from pbrs_farm.furnishings.things.parameters import Range, changed, in_range
from pbrs_farm.furnishings.things.things import THINGS
from pbrs_farm.scene.models import Model

_SIZES: Final = ("width_m", "depth_m", "height_m")
_SIZE_SLACK: Final = 1.6  # factor by which a size may leave the range of the catalogue
_N_SIZES: Final = 40  # drawn sizes that give this range

_WORDS: Final = {
    "bed": "double_bed",
    "table": "dining_table",
    "bookcase": "open_bookcase",
    "shelf": "open_shelves",
    "shelves": "open_shelves",
    "lamp": "shade_lamp",
    "table_lamp": "shade_lamp",
    "floor_lamp": "standing_lamp",
    "ceiling_lamp": "hanging_lamp",
    "kitchen_unit": "base_cabinet",
}
"""Everyday words for families with another name."""


@checked_call
def generate_model(name: str, *, seed: Whole = 0, style: str = "", **parameters: object) -> Model:
    """A piece of furniture or a small item of the generated catalogue, as a model to place.

    name: "bed", "sofa", "cup"; docs/dress/catalogue.md lists all. seed: of all values that are not
    given. style: a style of dressing, else by the seed. parameters: width_m, depth_m, height_m,
    and those of its family; a colour is taken for a material. Doors and drawers are shut, and a lamp
    is not lit: Home.add_light lights one.

    Raises BadInput for an unknown name or parameter, with the near names, and for a value that does
    not fit.

        >>> bed = pf.generate_model("bed", width_m=1.6, slats=True)
        >>> round(bed.size_m[0], 3)
        1.6
    """
    item_name = _own_name(name)
    taste = style_for(np.random.default_rng(keys.seed("thing", "style", seed)), style)
    rng = np.random.default_rng(keys.seed("thing", item_name, seed))
    if item_name in THINGS:
        if parameters:
            raise BadInput(
                name, "", f"has no parameter {next(iter(parameters))!r}", hint="of seed, style"
            )
        piece, shape = THINGS[item_name].make(rng, taste)
    else:
        family = families()[item_name]
        shared = family.shared(rng, taste)
        size = _size(family, name, family.size(rng, taste, *shared), parameters, shared)
        chosen = {key: value for key, value in parameters.items() if key not in _SIZES}
        piece, shape = family.make(rng, taste, size, *shared, change=_change(family, name, chosen))
        piece = replace(piece, size=size)
        shape = fitted_to_size(shape, piece)
    data = _glb(name, shape)
    path = cache_folder() / "things" / f"{keys.slug(name)}-{keys.sha256(data)[:16]}.glb"
    if not path.is_file():
        path.parent.mkdir(parents=True, exist_ok=True)
        write_whole(path, data)
    return Model(
        ModelRef(
            path=str(path.resolve()),
            sha256=keys.sha256(data),
            id=keys.slug(name),
            category=piece.group,
            nyu40=piece.nyu40,
        )
    )


def _own_name(name: str) -> str:
    """The family or item with a name or everyday word; BadInput if no name matches."""
    kind = name if name in families() else _WORDS.get(name, name)
    called = {family.called: key for key, family in reversed([*families().items()])}
    kind = kind if kind in families() or kind in THINGS else called.get(kind, kind)
    if kind not in families() and kind not in THINGS:
        names = {*families(), *THINGS, *_WORDS, *called}
        raise BadInput(name, "", "no such object to generate", hint=did_you_mean(name, names))
    return kind


def _size(
    family: Family,
    name: str,
    drawn: tuple[float, float, float],
    given: Mapping[str, Any],
    shared: tuple[Any, ...],
) -> tuple[float, float, float]:
    """Width, depth and height: drawn, or given and near those of the catalogue."""
    styles = [style_for(np.random.default_rng(k)) for k in range(_N_SIZES)]
    usual = [family.size(np.random.default_rng(k), s, *shared) for k, s in enumerate(styles)]
    size = list(drawn)
    for axis, key in enumerate(_SIZES):
        if key in given:
            values = [row[axis] for row in usual]
            limits = Range(round(min(values) / _SIZE_SLACK, 2), round(max(values) * _SIZE_SLACK, 2))
            size[axis] = float(in_range(given[key], limits, f"{name}, {key}"))
    return size[0], size[1], size[2]


def _change(family: Family, name: str, chosen: Mapping[str, object]) -> Callable[[Any], Any] | None:
    """A function that changes drawn parameters; BadInput if the family has no parameters."""
    if family.draw is not None:
        return lambda drawn: changed(drawn, chosen, name)
    if chosen:
        text = f"has no parameter {next(iter(chosen))!r}"
        raise BadInput(name, "", text, hint=f"of {', '.join((*_SIZES, 'seed', 'style'))}")
    return None


def _glb(name: str, shape: Shape) -> bytes:
    """The shape as a GLB whose materials keep their kinds."""
    item = Item(name, name, ItemKind.OBJECT, "", shape.surfaces)
    source = Source("generated", name, "")
    house = House(name, name, source, (), (), (item,), shape.materials, dict(shape.textures))
    return glb_from_house(house)
