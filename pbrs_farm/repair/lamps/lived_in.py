"""Whether people live in a room, by its size, its types and its name; no effects."""

from __future__ import annotations

import re
import unicodedata
from typing import Final

from pbrs_farm.core.house import Room

MIN_LIVED_IN_M2: Final = 2.0  # smaller is a cupboard or a shaft

# Whole words, accents folded: English, French, German, Spanish, Portuguese, Italian, Dutch,
# Scandinavian, Polish, Czech, Turkish, Russian, Korean.
_OUTDOORS: Final = frozenset(
    re.findall(
        r"\w+",
        """
        balcony balconies terrace garden garage carport patio porch deck yard backyard courtyard
        lawn driveway outdoor outdoors outside exterior loggia pergola gazebo
        balcon terrasse jardin cour balkon garten hof vorgarten hinterhof stellplatz
        terraza garaje cochera balcao sacada terraco quintal jardim garagem
        balcone terrazza terrazzo giardino cortile autorimessa terras tuin
        balkong altan terrass tradgard have hage garasje taras ogrod garaz terasa zahrada
        teras bahce garaj otopark балкон терраса сад гараж двор 발코니 베란다 테라스 정원 차고
        """,
    )
)
# Written without spaces: looked for anywhere in the name.
_OUTDOORS_WITHIN: Final = (
    "阳台", "陽台", "露台", "花园", "花園", "庭院", "院子", "车库", "車庫",
    "バルコニー", "ベランダ", "テラス", "ガレージ", "庭",
)  # fmt: skip


def is_lived_in(room: Room, area_m2: float) -> bool:
    """Whether people live in the room: a balcony, terrace, garden or garage they do not.

    Types go before the name; a room of several types is lived in when one of them is.
    """
    said = room.types or (room.name,)
    return area_m2 > MIN_LIVED_IN_M2 and not all(_is_outdoors(text) for text in said)


def _is_outdoors(text: str) -> bool:
    if any(word in text for word in _OUTDOORS_WITHIN):
        return True
    # Fold accents; what that takes apart besides (Hangul) is composed again.
    taken_apart = unicodedata.normalize("NFKD", text.casefold())
    plain = "".join(c for c in taken_apart if not unicodedata.combining(c))
    words = re.findall(r"[^\W\d_]+", unicodedata.normalize("NFC", plain))
    return any(w in _OUTDOORS or w.removesuffix("s") in _OUTDOORS for w in words)
