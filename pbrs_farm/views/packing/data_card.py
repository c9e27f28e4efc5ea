"""Metadata of packed views: README.md, croissant.json, the rest of dataset.json.

Effects: reads the table of each view and the source of each home.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from pbrs_farm.core.classes import NYU40_COLOURS
from pbrs_farm.core.recipe import Recipe
from pbrs_farm.views.packing.packing_plan import Packing
from pbrs_farm.views.stored_layers import STORED, array_names
from pbrs_farm.views.stored_root import StoredRoot
from pbrs_farm.views.views import Views

AXES = "x right, y forward, z up (published); pbrs_farm gives opencv, opengl or published"
SPLIT_RULE = (
    "by home: sha256 of the house's id without digest and variant (-d3), its first 8 bytes as a"
    " number of 0..1: train below train, val below train + val, else test"
)
TITLE = "Rendered rooms with exact labels"


@dataclass(frozen=True, slots=True)
class HomeFacts:
    """A home of a pack."""

    id: str
    n_views: int
    licence: str  # "" if its source names none
    author: str


@dataclass(frozen=True, slots=True)
class RootFacts:
    """Facts about the packed views of an output root."""

    homes: tuple[HomeFacts, ...]
    credits: tuple[str, ...]  # lines that every product must carry
    recipe: Recipe | None  # None: the root holds none
    sizes: tuple[tuple[int, int], ...]  # as rendered, width and height
    hfov_deg: tuple[float, ...]  # minimum and maximum of the pinholes, horizontal; () without one
    pixels_of_class: Mapping[str, int]  # most frequent first
    origins: tuple[str, ...]  # of the cameras
    n_warned: int  # views with a warning
    n_left_out: int  # unfinished views, and views without a layer


def root_facts(views: Views, root: StoredRoot) -> RootFacts:
    """The facts of these views, from their tables."""
    pixels, origins, sizes = Counter[str](), set[str](), set[tuple[int, int]]()
    hfov_deg, n_warned = [], 0
    for ref in views.refs:
        facts, table = root.facts(ref), root.table(ref)
        sizes.add(facts.size)
        if "lens" not in table and facts.K[0][0] > 0:
            hfov_deg.append(math.degrees(2 * math.atan(0.5 * facts.size[0] / facts.K[0][0])))
        origins.add(str(table.get("origin", "")))
        n_warned += bool(table.get("warnings"))
        for row in table.get("instances", ()):
            pixels[str(row["class"])] += int(row["pixels"])
    n_views = Counter(ref.house for ref in views.refs)
    sources = {house: root.source_of(house) for house in views.homes}
    homes = [
        HomeFacts(house, n_views[house], source.get("licence", ""), source.get("author", ""))
        for house, source in sources.items()
    ]
    return RootFacts(
        tuple(homes),
        root.credits(views.homes),
        root.recipe,
        tuple(sorted(sizes)),
        (min(hfov_deg), max(hfov_deg)) if hfov_deg else (),
        dict(pixels.most_common()),
        tuple(sorted(filter(None, origins))),
        n_warned,
        len(views.left_out),
    )


def dataset_description(packing: Packing, credits: Sequence[str]) -> dict[str, Any]:
    """The fields of dataset.json that third-party readers need."""
    colours = [bytes(row).hex() for row in NYU40_COLOURS.tolist()]
    arrays = {
        name: {
            "dtype": STORED[name].dtype,
            "unit": STORED[name].unit,
            "nothing": STORED[name].nothing,
        }
        for name in array_names(packing.layers)
    }
    return {
        "class_colours_srgb": colours,
        "arrays": arrays,
        "normal_axes": AXES,
        "camera": "K: (x right, y down, z forward) to pixels, centre of the first at (0.5, 0.5)",
        "split_rule": SPLIT_RULE if packing.shares else None,
        "colour": packing.colour if packing.colour == "png" else f"jpeg {packing.quality}",
        "seed": packing.seed,
        "credits": list(credits),
        "card": "README.md",
    }
