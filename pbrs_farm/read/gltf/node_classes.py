"""What a glTF node is: by its extras, by the user's mapping file, by the words of its name.

No effects. The mapping file is JSON: {"nodes": {"Sofa*": "sofa", "Lamp_2": {"class": "lamp",
"kind": "lamp"}}}; patterns are as in a shell, the first that fits wins, exact names come first.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from itertools import chain
from typing import Any, Final

import numpy as np

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.checked_json import json_from_bytes
from pbrs_farm.core.classes import (
    DOOR,
    FLOOR,
    LAMP,
    NYU40_NAMES,
    OTHERPROP,
    OTHERSTRUCTURE,
    REFRIGERATOR,
    WINDOW,
)
from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.house import Item, ItemKind, Surface
from pbrs_farm.home.names import words_of
from pbrs_farm.read.common.furniture_classes import class_of_piece, kind_of, nyu40_of
from pbrs_farm.read.common.room_shells import CLASS_OF_STRUCTURE, planar_parts, room_parts
from pbrs_farm.read.gltf.room_fittings import parted_fittings

_WALL_WORDS: Final = "wall wallpaper wand waende tapete mur muro pared parete parede"
_CEILING_WORDS: Final = "ceiling zimmerdecke decke plafond techo soffitto teto"
_FLOOR_WORDS: Final = (
    "floor flooring boden fussboden parquet parkett laminate laminat linoleum sol suelo pavimento"
)
# Word of a name -> kind, the words of walls first ("wall above the floor" is a wall).
_STRUCTURE_WORDS: Final = {
    word: kind
    for kind, words in (
        (ItemKind.WALL, _WALL_WORDS),
        (ItemKind.CEILING, _CEILING_WORDS),
        (ItemKind.FLOOR, _FLOOR_WORDS),
        (ItemKind.GROUND, "ground terrain"),
    )
    for word in words.split()
}
# Classes that are kinds of their own: wall, floor, door, lamp ...
_KIND_OF_CLASS: Final[dict[str, ItemKind]] = {
    kind.value: kind for kind in ItemKind if kind.value in NYU40_NAMES and kind.value != "object"
}
# Class names without spaces and dashes -> NYU40 id.
_IDS: Final = {re.sub(r"[ _-]", "", name): i for i, name in enumerate(NYU40_NAMES)} | {
    "refridgerator": REFRIGERATOR,
    "void": 0,
}


@dataclass(frozen=True, slots=True)
class NodeClass:
    """Class and kind of an item."""

    nyu40: int
    kind: ItemKind
    is_tagged: bool  # said by extras or the mapping, not guessed


@dataclass(frozen=True, slots=True)
class Mapping:
    """The user's mapping file: (pattern, class) in order."""

    rows: tuple[tuple[str, NodeClass], ...] = ()

    def of(self, name: str) -> NodeClass | None:
        """The class of a node's name: exact rows first, then patterns, in order."""
        exact = (found for pattern, found in self.rows if pattern == name)
        alike = (found for pattern, found in self.rows if fnmatchcase(name, pattern))
        return next(chain(exact, alike), None)


def mapping_from_json(data: bytes, file: str) -> Mapping:
    """The mapping in a JSON file; BadHouse naming the row that is wrong."""
    fields_json = json_from_bytes(data, file)
    nodes = fields_json.get("nodes") if isinstance(fields_json, dict) else None
    if not isinstance(nodes, dict):
        raise BadHouse(file, "nodes", 'expected {"nodes": {"name or pattern": "class"}}')
    return Mapping(tuple((pattern, _row(row, file, pattern)) for pattern, row in nodes.items()))


def _row(row: Any, file: str, pattern: str) -> NodeClass:
    fields_json = {"class": row} if isinstance(row, (str, int)) else row
    found = _tagged(fields_json) if isinstance(fields_json, dict) else None
    if found is None:
        text = f"{str(row)[:60]!r} names no class; one of {', '.join(NYU40_NAMES[1:])}"
        raise BadHouse(file, f"nodes[{pattern[:60]!r}]", text)
    return found


def class_of_node(name: str, extras: Any, mapping: Mapping) -> NodeClass | None:
    """extras' `nyu40` or `class` (and `kind`), else the mapping's row, else the name's words."""
    tagged = _tagged(extras) if isinstance(extras, dict) else None
    return tagged or mapping.of(name) or class_of_node_name(name)


# Words of nodes that only group others.
_COLLECTIONS: Final = frozenset(
    ("furniture", "group", "collection", "scene", "room", "level", "storey", "set")
)


def collection_of(name: str, seen: NodeClass) -> NodeClass | None:
    """What the members of a node without a mesh are, where its name means several things.

    None: the node is one thing ("Chair"). "Chairs": chairs. "Furniture", "Ground floor" (a storey):
    no class that members would share, nyu40 0.
    """
    words = words_of(name)
    # words_of gives singulars beside plurals.
    plurals = {w[:-1] for w in words if w.endswith("s") and w[:-1] in words}
    if words & _COLLECTIONS or seen.kind in (ItemKind.FLOOR, ItemKind.GROUND):
        return NodeClass(0, ItemKind.OBJECT, is_tagged=False)
    if any(nyu40_of("", w) is not None or w in _STRUCTURE_WORDS for w in plurals):
        return seen
    return None


def _tagged(fields_json: dict[str, Any]) -> NodeClass | None:
    # Read the kind if one is named, and the class by number or by name.
    kind_word = str(fields_json.get("kind", "")).lower()
    kind = next((k for k in ItemKind if k.value == kind_word), None)
    nyu40 = fields_json.get("nyu40", fields_json.get("class"))
    if isinstance(nyu40, str):
        word = re.sub(r"[ _-]", "", nyu40.lower())
        nyu40 = int(word) if word.isascii() and word.isdigit() and len(word) < 3 else _IDS.get(word)
        # Kinds without a class of their own: a plant is otherprop, the others floor.
        if nyu40 is None and word in ("ground", "plant", "stairs"):
            return NodeClass(OTHERPROP if word == "plant" else 2, ItemKind(word), is_tagged=True)
    if type(nyu40) is not int or not 0 <= nyu40 < len(NYU40_NAMES):
        return None
    named = _KIND_OF_CLASS.get(NYU40_NAMES[nyu40], ItemKind.OBJECT)
    return NodeClass(nyu40, kind or named, is_tagged=True)


def class_of_node_name(name: str) -> NodeClass | None:
    """What the words of a node's or a material's name say, if anything."""
    piece = class_of_piece("", name)
    nyu40 = piece.nyu40
    if nyu40 is None or nyu40 == OTHERSTRUCTURE:
        # Look for structure where the name says nothing more special.
        words = words_of(name)
        for word, kind in _STRUCTURE_WORDS.items():
            if word in words:
                # The ground outside is labelled floor.
                label = FLOOR if kind is ItemKind.GROUND else NYU40_NAMES.index(kind.value)
                return NodeClass(label, kind, is_tagged=False)
    if nyu40 is None:
        return None
    # A name tells openings and lamps only by their class.
    is_opening = nyu40 in (DOOR, WINDOW)
    kind = kind_of(piece, nyu40, is_opening=is_opening, is_light=nyu40 == LAMP)
    return NodeClass(nyu40, kind, is_tagged=False)


# What one node shows of a room, parted into walls, floors and ceilings, or named by its
# materials.
# No effects. The name of a node often says nothing ("Mesh_12"); those of its materials then do.


_STRUCTURE: Final[tuple[ItemKind, ...]] = (ItemKind.WALL, ItemKind.FLOOR, ItemKind.CEILING)
_THICKEST_OPENING_M: Final = 1.5  # a porch of glass has less
UNMAPPED: Final = "unmapped"
"""Tag of an item of which nothing says what it is."""


def centres_of(items: Sequence[Item]) -> F64:
    """(N, 3) centres of items that are no part of a room."""
    found = [i.bounds.mean(0) for i in items if i.n_faces and i.kind not in _STRUCTURE]
    return np.array(found, np.float64).reshape(-1, 3)


def structure_parts(item: Item, others: F64) -> tuple[Item, ...]:
    """The items that a node's item is, where it is a wall, floor or ceiling, or is not known.

    others: centres_of all items. A room seen from inside is parted by how its faces look, after
    what is fitted into it (room_fittings); what is no room by the names of its materials; open walls are parted plane by plane. A node whose name
    holds the word window or door ("Room with windows") may be a room, too, where it is as large,
    and so may one called "Ground" or "Ground floor".
    """
    is_unknown = UNMAPPED in item.tags
    may_be_room = item.kind in (*_STRUCTURE, ItemKind.GROUND) or is_unknown
    if not (may_be_room or _is_too_large_for_an_opening(item)):
        return (item,)
    # What names and connected parts tell apart is no room's side, whichever way its faces look.
    own, fittings = parted_fittings(item, by_shape=True)
    parts = room_parts(own, others)
    if fittings and parts[0] is own:
        own, fittings = item, ()
        if item.kind is ItemKind.WALL:
            own, fittings = parted_fittings(item, by_shape=False)
        parts = room_parts(own, others)
    if parts[0] is own and (is_unknown or item.kind is ItemKind.WALL):
        parts = _by_materials(own)
    return (*(p for part in parts for p in planar_parts(part)), *fittings)


def _is_too_large_for_an_opening(item: Item) -> bool:
    if item.kind not in (ItemKind.DOOR, ItemKind.WINDOW) or not item.n_faces:
        return False
    low, high = item.bounds
    return bool((high - low)[[0, 2]].min() > _THICKEST_OPENING_M)


def _by_materials(item: Item) -> tuple[Item, ...]:
    kinds = [class_of_node_name(s.name) for s in item.surfaces]
    # Part what is wall, floor and ceiling; surfaces that say nothing stay with the item.
    groups: dict[ItemKind | None, list[Surface]] = {}
    for surface, seen in zip(item.surfaces, kinds, strict=True):
        kind = seen.kind if seen and seen.kind in _STRUCTURE else None
        groups.setdefault(None if kind is item.kind else kind, []).append(surface)
    if set(groups) == {None}:
        return (_named(item, kinds),)
    found = [replace(item, surfaces=tuple(groups.pop(None)))] if None in groups else []
    for kind, surfaces in groups.items():
        assert kind is not None
        part = replace(
            item, id=f"{item.id}.{kind}" if found else item.id, kind=kind,
            nyu40=CLASS_OF_STRUCTURE[kind], surfaces=tuple(surfaces), box=None,
            lights=() if found else item.lights, tags=_known(item),
        )  # fmt: skip
        found.append(part)
    return tuple(found)


def _named(item: Item, classes: Sequence[object]) -> Item:
    # An unknown thing is what all of its materials say.
    one = class_of_node_name(item.surfaces[0].name) if item.surfaces else None
    if UNMAPPED not in item.tags or one is None or any(c != one for c in classes):
        return item
    if one.kind in (ItemKind.LAMP, ItemKind.PERSON, ItemKind.DOOR, ItemKind.WINDOW):
        return item  # needs more than a class: light, a place in a wall
    return replace(item, nyu40=one.nyu40, kind=one.kind, tags=_known(item))


def _known(item: Item) -> tuple[str, ...]:
    return tuple(t for t in item.tags if t != UNMAPPED)
