"""What a room is used for, by its types, its name and what stands in it; no effects."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable, Sequence
from enum import StrEnum
from functools import lru_cache
from typing import Final

from pbrs_farm.core.classes import (
    BATHTUB,
    BED,
    CABINET,
    DESK,
    OTHERFURNITURE,
    REFRIGERATOR,
    SINK,
    SOFA,
    TABLE,
    TOILET,
)
from pbrs_farm.core.house import Item, Room

# The words of which names of rooms and things are made.


RADIATORS: Final = frozenset({"radiator", "heater", "heizkorper", "heizkoerper", "radiateur"})


def folded(text: str) -> str:
    """Lower case, without accents."""
    # What that takes apart besides (Hangul) is composed again.
    taken_apart = unicodedata.normalize("NFKD", text.casefold())
    plain = "".join(c for c in taken_apart if not unicodedata.combining(c))
    return unicodedata.normalize("NFC", plain)


def words_of(name: str) -> frozenset[str]:
    """Folded words of letters alone; camelCase adds its parts, a plural adds its singular."""
    parted = re.sub(r"(?<=[^\W\d_])(?=[A-Z][a-z])|(?<=[a-z])(?=[A-Z])", " ", name)
    words = re.findall(r"[^\W\d_]+", folded(f"{name} {parted}"))
    return frozenset(words) | {word.removesuffix("s") for word in words}


def words_of_item(item: Item) -> frozenset[str]:
    """Words of what an item is called and of its class in the source: "Woven basket" has no oven."""
    return words_of(f"{item.name} {item.source_class}")


# What a room is used for, by its types, its name and what stands in it.


class RoomKind(StrEnum):
    """What a room is for."""

    LIVING = "living"
    BEDROOM = "bedroom"
    KITCHEN = "kitchen"
    DINING = "dining"
    BATHROOM = "bathroom"
    OFFICE = "office"
    HALL = "hall"
    OUTDOOR = "outdoor"
    STORE = "store"  # garage, cellar, closet, laundry
    OTHER = "other"


# Whole words, accents folded, of the languages that homes are drawn in; the first kind that has
# one of a name's words holds.
_WORDS = (
    (RoomKind.OUTDOOR, """
        balcony terrace garden patio deck loggia porch yard balkon garten terrasse balcon jardin
        terraza jardim varanda sacada quintal balcone terrazza giardino tuin balkong taras ogrod
        zahrada teras bahce балкон терраса сад 베란다 발코니 테라스"""),
    (RoomKind.STORE, """
        garage cellar basement closet storage store laundry carport keller wardrobe cave warehouse
        pantry waschkuche abstellraum lager buanderie cellier garaje trastero lavadero
        garagem lavanderia cantina ripostiglio berging schuur garasje bod piwnica garaz sklep
        kiler depo гараж кладовая подвал 창고 다용도실"""),
    (RoomKind.BATHROOM, """
        bath bathroom toilet wc shower restroom lavatory bad badezimmer dusche bain bains douche
        sdb toilettes bano aseo banheiro lavabo bagno badkamer badrum baderom lazienka łazienka koupelna
        banyo tuvalet ванная санузел туалет 욕실 화장실"""),
    (RoomKind.KITCHEN, """
        kitchen kitchenette kuche kueche cuisine cocina cucina cozinha keuken kok kjokken kokken
        kuchnia kuchyn kuchyne mutfak кухня 주방 부엌"""),
    (RoomKind.BEDROOM, """
        bed bedroom bedrom guest child nursery kids schlafzimmer kinderzimmer gastezimmer chambre
        dormitorio habitacion alcoba quarto suite camera cameretta slaapkamer sovrum
        soverom sovevaerelse sypialnia loznice pokoj yatak спальня детская 침실 안방"""),
    (RoomKind.DINING, """
        dining esszimmer comedor manger jantar pranzo eetkamer matsal spisestue jadalnia jidelna
        yemek столовая 식당"""),
    (RoomKind.OFFICE, """
        office study library buro buero bureau arbeitszimmer despacho escritorio estudio biblioteca
        ufficio studio werkkamer kantoor kontor biuro gabinet pracovna ofis кабинет 서재"""),
    (RoomKind.LIVING, """
        living lounge sitting family wohnzimmer salon sejour soggiorno saloon sala salotto estar
        woonkamer vardagsrum stue stua obyvaci oturma гостиная 거실"""),
    (RoomKind.HALL, """
        hall hallway corridor entry entrance entryway foyer landing flur diele stairs lobby gang
        couloir entree degagement pasillo recibidor entrada corredor corridoio ingresso disimpegno
        przedpokoj korytarz chodba predsin koridor antre прихожая коридор 현관 복도"""),
)  # fmt: skip

# Written without spaces: looked for anywhere in the name.
_WITHIN = (
    (RoomKind.OUTDOOR, "阳台 陽台 露台 花园 庭院 バルコニー ベランダ テラス"),
    (RoomKind.STORE, "车库 車庫 储藏 儲藏 洗衣 ガレージ 納戸"),
    (RoomKind.BATHROOM, "卫生间 衛生間 浴室 厕所 洗手间 トイレ 洗面 風呂"),
    (RoomKind.KITCHEN, "厨房 廚房 キッチン 台所"),
    (RoomKind.BEDROOM, "卧室 臥室 主卧 次卧 寝室 子供部屋"),
    (RoomKind.DINING, "餐厅 餐廳 ダイニング"),
    (RoomKind.OFFICE, "书房 書房 書斎"),
    (RoomKind.LIVING, "客厅 客廳 起居 リビング 居間"),
    (RoomKind.HALL, "走廊 玄关 玄關 过道 廊下 玄関"),
)

_LARGE_M2 = 9.0
_COOKED_AT = frozenset({
    "cooker", "stove", "stovetop", "oven", "hob", "hood", "dishwasher", "fridge", "refrigerator",
    "herd", "gasherd", "elektroherd", "backofen",
})  # fmt: skip


def is_cooked_in(items: Iterable[Item]) -> bool:
    """Whether a cooker, a hood, a dishwasher or a fridge stands among them."""
    return any(
        item.nyu40 == REFRIGERATOR
        or (item.nyu40 in (CABINET, OTHERFURNITURE) and words_of_item(item) & _COOKED_AT)
        for item in items
    )


def room_kind(room: Room, items: Sequence[Item], area_m2: float) -> RoomKind:
    """What the room is for: what it is called, else what the items (those in it) say."""
    named = _named(" ".join((*room.types, room.name)))
    has = {item.nyu40 for item in items}
    # A studio is a study in some languages and a home of one room in others.
    if named is RoomKind.OFFICE and (BED in has or is_cooked_in(items)):
        return RoomKind.LIVING
    if named is not None:
        return named
    if not has & {TOILET, BATHTUB, BED} and is_cooked_in(items):
        return RoomKind.KITCHEN
    for kind, classes in (
        (RoomKind.BATHROOM, {TOILET, BATHTUB}),
        (RoomKind.BEDROOM, {BED}),
        (RoomKind.KITCHEN, {REFRIGERATOR}),
        (RoomKind.LIVING, {SOFA}),
        (RoomKind.OFFICE, {DESK}),
        (RoomKind.DINING, {TABLE}),
        (RoomKind.BATHROOM, {SINK}),
    ):
        if has & classes:
            return kind
    # Small or long rooms without furniture are passages.
    return RoomKind.HALL if area_m2 < _LARGE_M2 else RoomKind.OTHER


def named_kind(name: str) -> RoomKind | None:
    """What a room of that name is for; None where the name does not say."""
    return _named(name)


@lru_cache(1024)
def _named(said: str) -> RoomKind | None:
    words = words_of(said)
    for kind, names in _WORDS:
        if words & {folded(n) for n in names.split()}:
            return kind
    for kind, names in _WITHIN:
        if any(n in said for n in names.split()):
            return kind
    return None
