"""Class of a glTF node: by its extras, by the user's mapping file, by the words of its name.

No effects. The mapping file is JSON: {"nodes": {"Sofa*": "sofa", "Lamp_2": {"class": "lamp",
"kind": "lamp"}}}; patterns are as in a shell, the first match wins, exact names come first.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from itertools import chain
from typing import Any, Final

from pbrs_farm.core.checked_json import json_from_bytes
from pbrs_farm.core.classes import NYU40_NAMES, OTHERPROP, REFRIGERATOR
from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.house import ItemKind
from pbrs_farm.home.names import words_of
from pbrs_farm.read.common.furniture_classes import nyu40_of
from pbrs_farm.read.common.name_classes import STRUCTURE_WORDS, NodeClass, class_of_node_name

# Classes with an item kind of the same name: wall, floor, door, lamp ...
_KIND_OF_CLASS: Final[dict[str, ItemKind]] = {
    kind.value: kind for kind in ItemKind if kind.value in NYU40_NAMES and kind.value != "object"
}
# Class names without spaces and dashes -> NYU40 id.
_IDS: Final = {re.sub(r"[ _-]", "", name): i for i, name in enumerate(NYU40_NAMES)} | {
    "refridgerator": REFRIGERATOR,
    "void": 0,
}


@dataclass(frozen=True, slots=True)
class Mapping:
    """The user's mapping file: (pattern, class) in order."""

    rows: tuple[tuple[str, NodeClass], ...] = ()

    def of(self, name: str) -> NodeClass | None:
        """The class of a node's name (case counts): exact rows first, then a shell's patterns in order; or None."""
        exact = (node_class for pattern, node_class in self.rows if pattern == name)
        alike = (node_class for pattern, node_class in self.rows if fnmatchcase(name, pattern))
        return next(chain(exact, alike), None)


def mapping_from_json(data: bytes, file: str) -> Mapping:
    """The mapping `{"nodes": {"name or pattern": "class"}}`, in order; BadHouse, naming the invalid row."""
    fields_json = json_from_bytes(data, file)
    nodes = fields_json.get("nodes") if isinstance(fields_json, dict) else None
    if not isinstance(nodes, dict):
        raise BadHouse(file, "nodes", 'expected {"nodes": {"name or pattern": "class"}}')
    return Mapping(
        tuple((pattern, _class_of_row(row, file, pattern)) for pattern, row in nodes.items())
    )


def _class_of_row(row: Any, file: str, pattern: str) -> NodeClass:
    fields_json = {"class": row} if isinstance(row, (str, int)) else row
    tagged = _tagged(fields_json) if isinstance(fields_json, dict) else None
    if tagged is None:
        text = f"{str(row)[:60]!r} names no class; one of {', '.join(NYU40_NAMES[1:])}"
        raise BadHouse(file, f"nodes[{pattern[:60]!r}]", text)
    return tagged


def class_of_node(
    name: str, extras: Any, mapping: Mapping, materials: Sequence[str] = ()
) -> NodeClass | None:
    """Class of a node by its extras (`nyu40`, `class`, `kind`), else the mapping, else its name; or None."""
    tagged = _tagged(extras) if isinstance(extras, dict) else None
    return tagged or mapping.of(name) or class_of_node_name(name, materials=materials)


# Words of nodes that only group others.
_COLLECTIONS: Final = frozenset(
    ("furniture", "group", "collection", "scene", "room", "level", "storey", "set")
)


def collection_of(name: str, node_class: NodeClass) -> NodeClass | None:
    """Class of the members of a node without a mesh, if its name is a collective noun.

    None: the node is one item ("Chair"). "Chairs": chairs. "Furniture", "Ground floor" (a storey): no
    class shared by members, nyu40 0.
    """
    words = words_of(name)
    # words_of gives singulars beside plurals.
    plurals = {w[:-1] for w in words if w.endswith("s") and w[:-1] in words}
    if words & _COLLECTIONS or node_class.kind in (ItemKind.FLOOR, ItemKind.GROUND):
        return NodeClass(0, ItemKind.OBJECT, is_tagged=False)
    if any(nyu40_of("", w) is not None or w in STRUCTURE_WORDS for w in plurals):
        return node_class
    return None


def _tagged(fields_json: dict[str, Any]) -> NodeClass | None:
    # Read the kind if one is named, and the class by number or by name.
    kind_word = str(fields_json.get("kind", "")).lower()
    kind = next((k for k in ItemKind if k.value == kind_word), None)
    nyu40 = fields_json.get("nyu40", fields_json.get("class"))
    if isinstance(nyu40, str):
        word = re.sub(r"[ _-]", "", nyu40.lower())
        nyu40 = int(word) if word.isascii() and word.isdigit() and len(word) < 3 else _IDS.get(word)
        # Kinds without an NYU40 class: a plant is otherprop, the others floor.
        if nyu40 is None and word in ("ground", "plant", "stairs"):
            return NodeClass(OTHERPROP if word == "plant" else 2, ItemKind(word), is_tagged=True)
    if type(nyu40) is not int or not 0 <= nyu40 < len(NYU40_NAMES):
        return None
    named = _KIND_OF_CLASS.get(NYU40_NAMES[nyu40], ItemKind.OBJECT)
    return NodeClass(nyu40, kind or named, is_tagged=True)
