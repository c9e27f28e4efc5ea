"""NYU40 class and kind of a piece of furniture, from its catalogue id, else from its name's words.

Reads the table beside this file (catalogue id -> class of the default catalogue), nothing else.
"""

from __future__ import annotations

import csv
import re
from functools import cache
from importlib.resources import files
from typing import Final

from pbrs_farm.classes import NYU40_NAMES
from pbrs_farm.house import ItemKind

OTHERPROP: Final = 40

# Words of English names, several words first; the first rule with all its words in the name wins.
_WORDS: Final[tuple[tuple[str, str], ...]] = (
    ("light switch|electrical outlet|socket|plug", "otherprop"),
    ("glass door cabinet|wardrobe|cabinet|cupboard|sideboard|buffet|closet|locker", "cabinet"),
    ("night stand|bedside table|nightstand", "night stand"),
    ("shower curtain", "shower curtain"),
    ("floor mat|doormat|rug|carpet|mat", "floor mat"),
    ("tv unit|tv stand|tv bench|tv cabinet", "cabinet"),
    ("television|tv|flatscreen|monitor", "television"),
    ("window|skylight|hatch|velux", "window"),
    ("door|doorway|gate", "door"),
    ("book shelf|book case|bookcase|bookshelf|bookshelves|library", "bookshelf"),
    ("lamp|light|chandelier|spotlight|uplight|candle|lantern|sconce|candelabra", "lamp"),
    ("coffee table|dining table|table", "table"),
    ("desk", "desk"),
    ("sofa|couch|settee|loveseat|divan|futon", "sofa"),
    ("armchair|chair|stool|bench|ottoman|pouf|seat|recliner|rocker", "chair"),
    ("pillow|cushion", "pillow"),
    ("bed|crib|cradle|bunk|cot", "bed"),
    ("bathtub|bath tub|jacuzzi|bath", "bathtub"),
    ("toilet|bidet|urinal|wc", "toilet"),
    ("washbasin|sink|basin|faucet", "sink"),
    ("fridge|refrigerator|freezer", "refrigerator"),
    ("dresser|chest of drawers|commode|chest", "dresser"),
    ("counter|worktop|island", "counter"),
    ("drawers|vanity", "cabinet"),
    ("shelf|shelves|shelving|rack|etagere", "shelves"),
    ("mirror", "mirror"),
    ("picture|painting|poster|frame|photo|canvas", "picture"),
    ("curtain|curtains|drape|drapes", "curtain"),
    ("blind|blinds|shutter|shutters", "blinds"),
    ("book|books|magazine", "books"),
    ("towel|towels", "towel"),
    ("whiteboard|blackboard|board", "whiteboard"),
    ("paper|newspaper", "paper"),
    ("bag|backpack|suitcase|purse|luggage", "bag"),
    ("box|crate|carton|basket", "box"),
    ("clothes|shirt|jacket|coat|dress|shoes|hat", "clothes"),
    ("person|man|woman|girl|boy|child|people|mannequin|character", "person"),
    ("stairs|staircase|stairway|ladder|railing|banister|fireplace|column|pillar|fence|chimney|"
     "balustrade|partition|wall|beam|pole|roof|slope|gutter|bar", "otherstructure"),
    ("oven|cooker|stove|hob|dishwasher|washer|dryer|microwave|hood|piano|machine|radiator|"
     "heater|boiler|shower|furniture", "otherfurniture"),
    ("plant|flower|flowers|tree|vase|computer|laptop|keyboard|clock|plate|glass|cup|bottle|"
     "bowl|toy|aquarium|fan|phone|printer|guitar|bin|trash|statue|sculpture", "otherprop"),
)  # fmt: skip

_PLANT: Final = frozenset(
    [
        "plant",
        "plants",
        "flower",
        "flowers",
        "tree",
        "trees",
        "palm",
        "bush",
        "shrub",
        "ficus",
        "fern",
        "grass",
        "bonsai",
        "cactus",
        "orchid",
        "ivy",
        "hedge",
    ]
)
_PRIMITIVES: Final = frozenset(
    {"eTeks#texturableBox", "eTeks#texturableCylinder", "eTeks#texturableTriangle"}
)
_PRIMITIVE_NAMES: Final = frozenset({"box", "cylinder", "triangle", ""})
_STAIRS: Final = frozenset(["staircase", "stairs", "stairway", "ladder"])


@cache
def _table() -> dict[str, int]:
    text = files("pbrs_farm.read").joinpath("sweethome3d-classes.csv").read_text("utf-8")
    return {
        r["catalogId"]: NYU40_NAMES.index(r["class"]) for r in csv.DictReader(text.splitlines())
    }


@cache
def _rules() -> tuple[tuple[tuple[frozenset[str], ...], int], ...]:
    return tuple(
        (
            tuple(frozenset(phrase.split()) for phrase in phrases.split("|")),
            NYU40_NAMES.index(name),
        )
        for phrases, name in _WORDS
    )


def words_of(text: str) -> frozenset[str]:
    """Lower-case words of a name; camelCase and digits part words; a plural adds its singular."""
    parted = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", text)
    words = re.findall(r"[a-z]+", parted.lower())
    return frozenset(words) | {w[:-1] for w in words if len(w) > 3 and w.endswith("s")}


def nyu40_of(catalogue_id: str, name: str, group: str = "") -> int | None:
    """NYU40 id by catalogue id, else by the words of the name, else of the id; None = unmapped.

    A bare box, cylinder or triangle is what its name says, or its group's: people build with them.
    """
    known = _table().get(catalogue_id)
    if catalogue_id in _PRIMITIVES:
        if name.lower() not in _PRIMITIVE_NAMES:
            known = _by_words(name) or known
        elif group:
            known = _by_words(group) or known
        return known
    if known is not None:
        return known
    return _by_words(name) or _by_words(catalogue_id.partition("#")[2])


def _by_words(*texts: str) -> int | None:
    for text in texts:
        words = words_of(text)
        for phrases, label in _rules():
            if any(phrase <= words for phrase in phrases):
                return label
    return None


def kind_of(
    catalogue_id: str, name: str, nyu40: int, *, is_opening: bool, is_light: bool
) -> ItemKind:
    """What the piece is to the pipeline: the source's own element first, then class, then words."""
    words = words_of(name) | words_of(catalogue_id.partition("#")[2])
    if is_opening:
        return ItemKind.WINDOW if nyu40 == NYU40_NAMES.index("window") else ItemKind.DOOR
    if is_light:
        return ItemKind.LAMP
    if nyu40 == NYU40_NAMES.index("person"):
        return ItemKind.PERSON
    if words & _STAIRS:
        return ItemKind.STAIRS
    if words & _PLANT and nyu40 == OTHERPROP:
        return ItemKind.PLANT
    return ItemKind.OBJECT
