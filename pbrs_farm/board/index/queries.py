"""Questions to the index: filters, pages, menus. Effects: reads the index."""

from __future__ import annotations

import json
from collections.abc import Collection, Mapping
from dataclasses import asdict, dataclass, fields, replace
from functools import lru_cache
from typing import Any, Final, Generic, TypeVar
from urllib.parse import urlencode

from pbrs_farm.board.index.house_rows import LAYER_BIT
from pbrs_farm.board.index.view_index import ViewIndex
from pbrs_farm.core.classes import NYU40_NAMES
from pbrs_farm.core.layers import LAYERS
from pbrs_farm.core.lighting import ALL_MODES

T = TypeVar("T")  # what a page lists

VIEWS_PER_PAGE: Final = 48
HOMES_PER_PAGE: Final = 24
_MAX_WORD: Final = 120  # characters of a filter's value
_MAX_PAGE: Final = 10_000_000
_MAX_MENU: Final = 200  # entries
VERDICTS: Final = {"kept": "Kept", "refused": "Refused", "unjudged": "Not judged"}
_CLASS_NUMBER: Final = {name: k for k, name in enumerate(NYU40_NAMES) if k}


@dataclass(frozen=True, slots=True)
class ViewFilter:
    """Which views a gallery page shows; "" = all. What cannot be meant counts as not said."""

    home: str = ""
    room: str = ""
    has: str = ""  # a class's name
    mode: str = ""  # a lighting mode whose picture must be there
    verdict: str = ""  # of VERDICTS
    reason: str = ""  # why a selection refused it
    warned: str = ""  # "1" = with warnings, "0" = without
    words: str = ""  # in the names of home and room, and in ids
    layer: str = ""  # what thumbnails show
    page: int = 1

    def url(self, path: str = "/views", **changes: Any) -> str:
        """The address of the same filter with changes; what stands at its default is left out.

        A change of anything but the page goes back to page 1, since the pages of another filter are
        others.
        """
        values = asdict(replace(self, **({"page": 1} | changes)))
        said = {k: v for k, v in values.items() if v != _DEFAULTS[k]}
        return f"{path}?{urlencode(said)}" if said else path


_DEFAULTS: Final = {f.name: f.default for f in fields(ViewFilter)}


def filter_from_query(query: Mapping[str, str]) -> ViewFilter:
    """The filter that an address says.

    Never fails: a value that is not of its closed list is left out, words are cut, and a page that
    is no number is 1.
    """
    words = {name: query.get(name, "").strip()[:_MAX_WORD] for name in _DEFAULTS if name != "page"}
    # Take of each closed list only what stands in it.
    allowed: dict[str, Collection[str]] = {
        "has": _CLASS_NUMBER, "mode": [m.value for m in ALL_MODES], "verdict": VERDICTS,
        "warned": ("0", "1"), "layer": LAYER_BIT,
    }  # fmt: skip
    words |= {name: "" for name, values in allowed.items() if words[name] not in values}
    return ViewFilter(**words, page=page_number(query.get("page", "")))


def page_number(text: str) -> int:
    """A page's number from an address, 1 where it is none."""
    is_number = text.isascii() and text.isdigit() and len(text) < 9
    return min(max(1, int(text)), _MAX_PAGE) if is_number else 1


@dataclass(frozen=True, slots=True)
class ListedView:
    """A view on a page."""

    house: str
    house_name: str
    id: str
    room: str
    layers: int
    warnings: tuple[str, ...]
    reason: str | None  # "" kept, None not judged
    version: str  # of the house's files

    def has(self, layer: str) -> bool:
        """Whether the file of a layer is there."""
        return bool(self.layers & LAYER_BIT[layer])

    def shown_layer(self, wanted: str = "") -> str:
        """The layer a thumbnail shows: the one wanted, else the best picture there is, or "".

        A wanted layer that the view lacks gives "", not another in its place.
        """
        if wanted:
            return wanted if self.has(wanted) else ""
        best = [*(mode.value for mode in reversed(ALL_MODES)), "semantic", "depth"]
        return next((name for name in best if self.has(name)), "")


@dataclass(frozen=True, slots=True)
class ListedHome:
    """A home on a page."""

    id: str
    name: str
    credit: str
    n_rooms: int
    n_views: int
    n_warned: int
    cover: ListedView | None


@dataclass(frozen=True, slots=True)
class Page(Generic[T]):
    """One page of a list."""

    rows: tuple[T, ...]
    number: int
    n_pages: int
    n_rows: int  # of all pages


class Queries:
    """Answers of one index."""

    def __init__(self, index: ViewIndex) -> None:
        self._index = index
        self._count = lru_cache(maxsize=256)(self._counted)
        self._menu = lru_cache(maxsize=8)(self._menus)

    def views(self, wanted: ViewFilter) -> Page[ListedView]:
        """The views of a page, by house and id.

        A number beyond the last page gives the last. Counting is kept as long as the index does not
        change.
        """
        where, values = _where(wanted)
        n_rows = self._count(where, values, self._index.generation)
        n_pages = max(1, -(-n_rows // VIEWS_PER_PAGE))
        number = min(wanted.page, n_pages)
        # Find the page's keys first, which an index holds, then read those rows alone.
        found = self._index.rows(
            f"{_VIEW} WHERE (v.house, v.id) IN (SELECT v.house, v.id FROM view v {where}"
            " ORDER BY v.house, v.id LIMIT ? OFFSET ?) ORDER BY v.house, v.id",
            (*values, VIEWS_PER_PAGE, (number - 1) * VIEWS_PER_PAGE),
        )
        return Page(tuple(map(_view, found)), number, n_pages, n_rows)

    def view(self, house: str, view: str) -> ListedView | None:
        """One view, None when the index has none of these ids."""
        found = self._index.rows(f"{_VIEW} WHERE v.house = ? AND v.id = ?", (house, view))
        return _view(found[0]) if found else None

    def neighbours(self, house: str, view: str) -> tuple[str, str]:
        """The ids of the views before and after one of a house, "" at the ends."""
        before = self._index.rows(
            "SELECT max(id) AS id FROM view WHERE house = ? AND id < ?", (house, view)
        )
        after = self._index.rows(
            "SELECT min(id) AS id FROM view WHERE house = ? AND id > ?", (house, view)
        )
        return before[0]["id"] or "", after[0]["id"] or ""

    def views_of(self, house: str) -> list[ListedView]:
        """All views of a house."""
        return [_view(r) for r in self._index.rows(f"{_VIEW} WHERE v.house = ?", (house,))]

    def homes(self, words: str, number: int) -> Page[ListedHome]:
        """The homes of a page, by name. words: part of a name or id.

        Sorted by name, then id. A number beyond the last page gives the last. Letters in words
        match anywhere in a name or id; "" lists all.
        """
        where = f"WHERE {_NAMED}" if words else ""
        values = (_pattern(words),) if words else ()
        n_rows = self._index.rows(f"SELECT count(*) AS n FROM house {where}", values)[0]["n"]
        n_pages = max(1, -(-n_rows // HOMES_PER_PAGE))
        number = min(number, n_pages)
        found = self._index.rows(
            f"SELECT * FROM house {where} ORDER BY name, id LIMIT ? OFFSET ?",
            (*values, HOMES_PER_PAGE, (number - 1) * HOMES_PER_PAGE),
        )
        return Page(tuple(map(self._home, found)), number, n_pages, n_rows)

    def home(self, house: str) -> ListedHome | None:
        """One home, None when the index has none of that id."""
        found = self._index.rows("SELECT * FROM house WHERE id = ?", (house,))
        return self._home(found[0]) if found else None

    def menus(self) -> dict[str, list[tuple[str, str]]]:
        """Name of a filter -> (value, text) of what it can be; at most 200 of each."""
        return self._menu(self._index.generation)

    def n_views(self) -> int:
        """How many views there are."""
        return self._count("", (), self._index.generation)

    def _home(self, row: Any) -> ListedHome:
        cover = self.view(row["id"], row["cover"]) if row["cover"] else None
        return ListedHome(
            row["id"], row["name"], row["credit"], row["n_rooms"], row["n_views"],
            row["n_warned"], cover,
        )  # fmt: skip

    def _counted(self, where: str, values: tuple[Any, ...], _generation: int) -> int:
        sql = f"SELECT count(*) AS n FROM view v {where}"
        return int(self._index.rows(sql, values)[0]["n"])

    def _menus(self, _generation: int) -> dict[str, list[tuple[str, str]]]:
        rows = self._index.rows
        homes = rows(f"SELECT id, name FROM house ORDER BY name, id LIMIT {_MAX_MENU + 1}")
        rooms = rows(f"SELECT room, count(*) AS n FROM view GROUP BY room LIMIT {_MAX_MENU}")
        reasons = rows(
            "SELECT reason, count(*) AS n FROM view WHERE reason != '' GROUP BY reason"
            f" ORDER BY n DESC LIMIT {_MAX_MENU}"
        )
        bits = rows("SELECT DISTINCT classes, layers FROM view LIMIT 20000")
        classes = layers = 0
        for row in bits:
            classes |= row["classes"]
            layers |= row["layers"]
        return {
            # Too many homes for a menu: they are found by words.
            "home": [(r["id"], r["name"]) for r in homes] if len(homes) <= _MAX_MENU else [],
            "room": [(r["room"], f"{r['room']} ({r['n']:,})") for r in rooms],
            "reason": [(r["reason"], f"{r['reason']} ({r['n']:,})") for r in reasons],
            "has": [(n, n) for n, k in sorted(_CLASS_NUMBER.items()) if classes >> k & 1],
            "layer": [
                (layer.name, layer.name)
                for layer in LAYERS
                if layers & LAYER_BIT[layer.name] and layer.name != "radiance"
            ],
        }


_NAMED: Final = "(name || ' ' || id) LIKE ? ESCAPE '\\'"
_VIEW: Final = (
    "SELECT v.*, h.name AS house_name, h.fingerprint AS fingerprint"
    " FROM view v JOIN house h ON h.id = v.house"
)


def _view(row: Any) -> ListedView:
    return ListedView(
        house=row["house"],
        house_name=row["house_name"],
        id=row["id"],
        room=row["room"],
        layers=row["layers"],
        warnings=tuple(json.loads(row["warnings"])),
        reason=row["reason"],
        version=row["fingerprint"],
    )


def _where(wanted: ViewFilter) -> tuple[str, tuple[Any, ...]]:
    """A filter as SQL with its values; every value of a request is bound, none is text of SQL."""
    tests: list[str] = []
    values: list[Any] = []

    def add(test: str, *bound: Any) -> None:
        tests.append(test)
        values.extend(bound)

    if wanted.home:
        add("v.house = ?", wanted.home)
    if wanted.room:
        add("v.room = ?", wanted.room)
    if wanted.has:
        add("v.classes & ? != 0", 1 << _CLASS_NUMBER[wanted.has])
    if wanted.mode:
        add("v.layers & ? != 0", LAYER_BIT[wanted.mode])
    if wanted.verdict:
        add(
            {"kept": "v.reason = ''", "refused": "v.reason != ''"}.get(
                wanted.verdict, "v.reason IS NULL"
            )
        )
    if wanted.reason:
        add("v.reason = ?", wanted.reason)
    if wanted.warned:
        add("v.warnings != '[]'" if wanted.warned == "1" else "v.warnings = '[]'")
    if wanted.words:
        # Match each home's name once, not once a view.
        homes = f"SELECT id FROM house WHERE {_NAMED}"
        views = "v.id LIKE ? ESCAPE '\\' OR v.room LIKE ? ESCAPE '\\'"
        add(f"(v.house IN ({homes}) OR {views})", *[_pattern(wanted.words)] * 3)
    return ("WHERE " + " AND ".join(tests) if tests else ""), tuple(values)


def _pattern(words: str) -> str:
    escaped = words.replace("\\", "\\\\").replace("%", "\\%").replace("_", "\\_")
    return f"%{escaped}%"
