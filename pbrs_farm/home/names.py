"""Words in the names of rooms and items; no effects."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Collection
from functools import lru_cache
from typing import Final

from pbrs_farm.core.house import Item

RADIATORS: Final = frozenset({"radiator", "heater", "heizkorper", "heizkoerper", "radiateur"})
# Words of names, accents folded: English, German, French, Spanish, Italian, Dutch, Swedish.
# fmt: off
GLASS_WORDS: Final = frozenset(
    ("glass", "glazing", "pane", "windowpane", "windowglass", "glas", "scheibe", "verglasung",
     "fensterglas", "verre", "vitre", "vitrage", "vidrio", "cristal", "vetro", "ruit")
)
# fmt: on
# fmt: off
MIRROR_WORDS: Final = frozenset(
    ("mirror", "spiegel", "spiegelglas", "miroir", "espejo", "specchio", "espelho", "lustro",
     "zrcadlo", "зеркало", "spegel")
)
# fmt: on
# fmt: off
FRAME_WORDS: Final = frozenset(
    ("frame", "sill", "sash", "handle", "trim", "casing", "shutter", "blind", "curtain", "wood",
     "metal", "rahmen", "griff", "cadre", "marco", "telaio")
)
# fmt: on
# Words for parts of a mirror, and for opaque glass.
_NO_MIRROR_WORDS: Final = FRAME_WORDS | {"back", "base", "lamp", "leg", "light", "stand"}
_OPAQUE_GLASS_WORDS: Final = FRAME_WORDS | {
    "black",
    "ceramic",
    "fiber",
    "fibre",
    "frosted",
    "satin",
}
# Letters that no decomposition takes apart.
_LETTERS: Final = str.maketrans({"ł": "l", "ø": "o", "ß": "ss", "đ": "d", "ı": "i", "æ": "ae"})


def folded(text: str) -> str:
    """Lower case without accents, to compare names of any language; not for display.

    Letters that Unicode does not decompose (such as those with strokes) are replaced if `_LETTERS`
    lists them; Hangul syllables stay composed.
    """
    # Recompose Hangul, which the normalization also decomposes.
    taken_apart = unicodedata.normalize("NFKD", text.casefold().translate(_LETTERS))
    plain = "".join(c for c in taken_apart if not unicodedata.combining(c))
    return unicodedata.normalize("NFC", plain)


def parted(text: str) -> str:
    """The text with a space between the words of camelCase.

    "LivingRoom2" becomes "Living Room2": digits are not parted from letters, and runs of capitals
    stay together up to the last one ("TVStand" is "TV Stand").
    """
    return re.sub(r"(?<=[^\W\d_])(?=[A-Z][a-z])|(?<=[a-z])(?=[A-Z])", " ", text)


@lru_cache(1 << 14)
def words_of(name: str) -> frozenset[str]:
    """Folded words of letters alone; camelCase adds its parts, a plural adds its singular.

    For matching a name against tables of words. Both the name as written and its parts count
    ("BedRoom" has bed, room and bedroom); the singular is the word less a final s, right or not.
    Digits and signs part words.
    """
    words = re.findall(r"[^\W\d_]+", folded(f"{name} {parted(name)}"))
    return frozenset(words) | {word.removesuffix("s") for word in words}


def words_of_item(item: Item) -> frozenset[str]:
    """Words of what an item is called and of its class in the source, folded, with singulars.

    Whole words: "Woven basket" has no oven.
    """
    return words_of(f"{item.name} {item.source_class}")


def names_glass(name: str) -> bool:
    """Whether the name of a part of a window or door says that the part is glass.

    Words of several languages. A name with a word of a frame ("glass door frame") is no glass.
    """
    words = words_of(name)
    return bool(words & GLASS_WORDS) and not words & FRAME_WORDS


def names_clear_glass(name: str) -> bool:
    """True if the name of a part means transparent glass; false for "frosted glass"."""
    words = words_of(name)
    return bool(words & GLASS_WORDS) and not words & _OPAQUE_GLASS_WORDS


def has_copy_suffix(name: str, siblings: Collection[str] = ()) -> bool:
    """True if a modelling program named a mirrored copy: "Cabinet.mirror", "Leg.Mirror.001".

    siblings: names of parts of the same item; "Leg_mirror" is a copy beside "Leg".
    """
    suffixed = re.fullmatch(r"(.*\w)([._ -])mirror(ed)?([._ ]?\d+)?", name, re.IGNORECASE)
    return suffixed is not None and (suffixed[2] == "." or suffixed[1] in siblings)


def names_mirror(name: str, siblings: Collection[str] = ()) -> bool:
    """Whether the name of a part of a piece says that it mirrors: a mirror's frame or lamp does not.

    siblings: names of parts of the same piece, of which it may be the mirrored copy.
    """
    words = words_of(name)
    is_mirror = bool(words & MIRROR_WORDS) and not words & _NO_MIRROR_WORDS
    return is_mirror and not has_copy_suffix(name, siblings)
