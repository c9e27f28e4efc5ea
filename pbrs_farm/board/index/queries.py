"""Queries of the index: filters, pages, menus. Effects: reads the index."""

from __future__ import annotations

import json
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import asdict, dataclass, fields, replace
from functools import lru_cache
from itertools import pairwise
from typing import Any, Final, Generic, TypeVar
from urllib.parse import urlencode

from pbrs_farm.board.index.house_rows import DISTANCES, LAYER_BIT, SIZES
from pbrs_farm.board.index.view_index import LAYERS_PER_COLUMN, ViewIndex
from pbrs_farm.core.classes import NYU40_NAMES
from pbrs_farm.core.layers import LAYERS
from pbrs_farm.core.lighting import ALL_MODES

T = TypeVar("T")  # type of the rows of a page

VIEWS_PER_PAGE: Final = 48
HOMES_PER_PAGE: Final = 24
_MAX_WORD: Final = 120  # characters of a filter's value
_MAX_PAGE: Final = 10_000_000
_MAX_MENU: Final = 200  # entries
_MAX_BARS: Final = 40  # of a chart
VERDICTS: Final = {"kept": "Kept", "refused": "Refused", "unjudged": "Not judged"}
_CLASS_NUMBER: Final = {name: k for k, name in enumerate(NYU40_NAMES) if k}


@dataclass(frozen=True, slots=True)
class ViewFilter:
    """Filter of views; "" = all."""

    home: str = ""
    room: str = ""
    has: str = ""  # a class's name
    mode: str = ""  # a lighting mode with a picture
    verdict: str = ""  # of VERDICTS
    reason: str = ""  # of a refusal
    warned: str = ""  # "1" = with warnings, "0" = without
    words: str = ""  # part of the name of home or room, or of an id
    layer: str = ""  # of the thumbnails
    page: int = 1

    def url(self, path: str = "/views", **changes: Any) -> str:
        """Address of the filter with changes, without default values; changes go to page 1."""
        values = asdict(replace(self, **({"page": 1} | changes)))
        fields = {k: v for k, v in values.items() if v != _DEFAULTS[k]}
        return f"{path}?{urlencode(fields)}" if fields else path


_DEFAULTS: Final = {f.name: f.default for f in fields(ViewFilter)}


def filter_from_query(query: Mapping[str, str]) -> ViewFilter:
    """The filter of an address; unknown values are ignored and long words truncated."""
    words = {name: query.get(name, "").strip()[:_MAX_WORD] for name in _DEFAULTS if name != "page"}
    allowed: dict[str, Collection[str]] = {
        "has": _CLASS_NUMBER, "mode": [m.value for m in ALL_MODES], "verdict": VERDICTS,
        "warned": ("0", "1"), "layer": LAYER_BIT,
    }  # fmt: skip
    words |= {name: "" for name, values in allowed.items() if words[name] not in values}
    return ViewFilter(**words, page=page_number(query.get("page", "")))


def page_number(text: str) -> int:
    """Number of a page in an address, 1 for anything else."""
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
        """True if the view has the file of a layer."""
        return bool(self.layers & LAYER_BIT[layer])

    def row(self) -> dict[str, Any]:
        """The view in a list as JSON."""
        verdict = "unjudged" if self.reason is None else "refused" if self.reason else "kept"
        return {
            "house": self.house,
            "view": self.id,
            "room": self.room,
            "layers": [name for name in LAYER_BIT if self.has(name)],
            "warnings": list(self.warnings),
            "verdict": verdict,
            "reason": self.reason or "",
        }

    def shown_layer(self, layer: str = "") -> str:
        """The layer of a thumbnail: the given one or else the best picture; "" if it is missing."""
        if layer:
            return layer if self.has(layer) else ""
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

    def row(self) -> dict[str, Any]:
        """The home in a list as JSON."""
        return {
            "house": self.id,
            "name": self.name,
            "credit": self.credit,
            "n_rooms": self.n_rooms,
            "n_views": self.n_views,
            "n_warned": self.n_warned,
            "best_view": self.cover.id if self.cover else "",
        }


@dataclass(frozen=True, slots=True)
class Page(Generic[T]):
    """One page of a list."""

    rows: tuple[T, ...]
    number: int
    n_pages: int
    n_rows: int  # of all pages

    def table(self) -> dict[str, Any]:
        """The page as JSON; its rows are listed views or homes."""
        rows = [row.row() for row in self.rows if isinstance(row, ListedView | ListedHome)]
        return {"page": self.number, "n_pages": self.n_pages, "n_rows": self.n_rows, "rows": rows}


class Queries:
    """Queries of one index."""

    def __init__(self, index: ViewIndex) -> None:
        self._index = index
        self._count = lru_cache(maxsize=256)(self._counted)
        self._menu = lru_cache(maxsize=8)(self._menus)
        self._contents = lru_cache(maxsize=8)(self._counted_contents)

    def views(self, view_filter: ViewFilter) -> Page[ListedView]:
        """The views of a page, or of the last one, by house and id."""
        where, values = _where(view_filter)
        n_rows = self._count(where, values, self._index.generation)
        # Select the keys of the page first, from an SQL index, then only their rows.
        sql = (
            f"{_VIEW} WHERE (v.house, v.id) IN (SELECT v.house, v.id FROM view v {where}"
            " ORDER BY v.house, v.id LIMIT ? OFFSET ?) ORDER BY v.house, v.id"
        )
        return self._page(sql, values, n_rows, view_filter.page, VIEWS_PER_PAGE, _view)

    def _page(
        self, sql: str, values: tuple[Any, ...], n_rows: int, number: int, per_page: int,
        read: Callable[[Any], T],
    ) -> Page[T]:  # fmt: skip
        """A page of the rows of a statement that ends with LIMIT and OFFSET."""
        n_pages = max(1, -(-n_rows // per_page))
        number = min(number, n_pages)
        rows = self._index.rows(sql, (*values, per_page, (number - 1) * per_page))
        return Page(tuple(map(read, rows)), number, n_pages, n_rows)

    def view(self, house: str, view: str) -> ListedView | None:
        """A view, or None."""
        rows = self._index.rows(f"{_VIEW} WHERE v.house = ? AND v.id = ?", (house, view))
        return _view(rows[0]) if rows else None

    def neighbours(self, house: str, view: str) -> tuple[str, str]:
        """Ids of the previous and the next view of a house, "" at the ends."""
        (row,) = self._index.rows(
            "SELECT (SELECT max(id) FROM view WHERE house = ?1 AND id < ?2) AS previous,"
            " (SELECT min(id) FROM view WHERE house = ?1 AND id > ?2) AS next",
            (house, view),
        )
        return row["previous"] or "", row["next"] or ""

    def views_of(self, house: str) -> list[ListedView]:
        """All views of a house."""
        return [_view(r) for r in self._index.rows(f"{_VIEW} WHERE v.house = ?", (house,))]

    def homes(self, words: str, number: int) -> Page[ListedHome]:
        """The homes of a page, or of the last one, by name. words: part of a name or id."""
        where = f"WHERE {_NAMED}" if words else ""
        values = (_pattern(words),) if words else ()
        n_rows = self._index.rows(f"SELECT count(*) AS n FROM house {where}", values)[0]["n"]
        sql = f"SELECT * FROM house {where} ORDER BY name, id LIMIT ? OFFSET ?"
        return self._page(sql, values, n_rows, number, HOMES_PER_PAGE, self._home)

    def home(self, house: str) -> ListedHome | None:
        """A home, or None."""
        rows = self._index.rows("SELECT * FROM house WHERE id = ?", (house,))
        return self._home(rows[0]) if rows else None

    def menus(self) -> dict[str, list[tuple[str, str]]]:
        """Name of a filter -> (value, text) of its options, at most 200."""
        return self._menu(self._index.generation)

    def contents(self) -> dict[str, list[tuple[str, int]]]:
        """Title of a chart -> (label, number of views) of its bars; of credits numbers of homes."""
        return self._contents(self._index.generation)

    def _counted_contents(self, _generation: int) -> dict[str, list[tuple[str, int]]]:
        bits: list[tuple[int, int, int]] = [
            (r["classes"], _layers(r), r["n"])
            for r in self._index.rows(
                "SELECT classes, layers, more_layers, count(*) AS n FROM view GROUP BY 1, 2, 3"
            )
        ]
        classes = {
            name: sum(n for seen, _layers, n in bits if seen >> k & 1)
            for name, k in _CLASS_NUMBER.items()
        }
        layers = {
            name: sum(n for _seen, stored, n in bits if stored & bit)
            for name, bit in LAYER_BIT.items()
        }
        return {
            "Classes in view": _largest(classes),
            "Rooms": self._bars("SELECT room, count(*) FROM view GROUP BY 1 ORDER BY 2 DESC"),
            "Objects in view": self._bars(_in_bins("n_objects", (5, 10, 20, 40, 80))),
            **self._items(),
            "Light on the floor, lx": self._bars(_in_bins("lux", (10, 50, 200, 1000, 5000))),
            "Layers": _largest(layers),
            "Selection": self._bars(
                "SELECT iif(reason = '', 'kept', reason), count(*) FROM view"
                " WHERE reason IS NOT NULL GROUP BY 1 ORDER BY 2 DESC"
            ),
            "Credits (homes)": self._bars(
                "SELECT iif(credit = '', 'no credit required', credit), count(*) FROM house"
                " GROUP BY 1 ORDER BY 2 DESC"
            ),
        }

    def _items(self) -> dict[str, list[tuple[str, int]]]:
        bins = {
            "Size (items), % of the picture": _bins_of(SIZES),
            "Distance (items), m": _bins_of(DISTANCES),
        }
        numbers = range(sum(map(len, bins.values())))
        sums = ", ".join(f"sum(json_extract(items, '$[{k}]'))" for k in numbers)
        counts = iter(self._index.rows(f"SELECT {sums} FROM view")[0])
        charts = {title: [(bar, next(counts) or 0) for bar in bars] for title, bars in bins.items()}
        return {title: bars if any(n for _bar, n in bars) else [] for title, bars in charts.items()}

    def _bars(self, sql: str) -> list[tuple[str, int]]:
        rows = self._index.rows(f"{sql} LIMIT {_MAX_BARS}")
        return [(str(label), int(n)) for label, n in rows]

    def n_views(self) -> int:
        """Number of views."""
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
        bits = rows("SELECT DISTINCT classes, layers, more_layers FROM view LIMIT 20000")
        classes = layers = 0
        for row in bits:
            classes |= row["classes"]
            layers |= _layers(row)
        return {
            # Without a menu, many homes can be searched by words.
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


def _largest(counts: Mapping[str, int]) -> list[tuple[str, int]]:
    bars = sorted(counts.items(), key=lambda bar: (-bar[1], bar[0]))
    return [bar for bar in bars[:_MAX_BARS] if bar[1]]


def _bins_of(limits: Sequence[float]) -> list[str]:
    """Names of the bins below, between and above limits."""
    between = [f"{a:,g} to {b:,g}" for a, b in pairwise(limits)]
    return [f"below {limits[0]:,g}", *between, f"{limits[-1]:,g} or more"]


def _in_bins(column: str, limits: Sequence[float]) -> str:
    """SQL of the numbers of views by the bins of a column."""
    *names, last = _bins_of(limits)
    ends = [f"WHEN {column} < {end} THEN '{name}'" for end, name in zip(limits, names, strict=True)]
    case = f"CASE {' '.join(ends)} ELSE '{last}' END"
    known = f"WHERE {column} IS NOT NULL"
    return f"SELECT {case}, count(*) FROM view {known} GROUP BY 1 ORDER BY min({column})"


_NAMED: Final = "(name || ' ' || id) LIKE ? ESCAPE '\\'"
_VIEW: Final = (
    "SELECT v.*, h.name AS house_name, h.fingerprint AS fingerprint"
    " FROM view v JOIN house h ON h.id = v.house"
)


def _layers(row: Any) -> int:
    return int(row["layers"] | row["more_layers"] << LAYERS_PER_COLUMN)


def _view(row: Any) -> ListedView:
    warnings = tuple(json.loads(row["warnings"]))
    return ListedView(
        row["house"], row["house_name"], row["id"], row["room"], _layers(row), warnings,
        row["reason"], row["fingerprint"],
    )  # fmt: skip


def _where(view_filter: ViewFilter) -> tuple[str, tuple[Any, ...]]:
    """A filter as SQL with bound values."""
    f = view_filter
    tests_of_verdict = {"kept": "v.reason = ''", "refused": "v.reason != ''"}
    # Match the name of each home once, not per view.
    homes = f"SELECT id FROM house WHERE {_NAMED}"
    words = f"(v.house IN ({homes}) OR v.id LIKE ? ESCAPE '\\' OR v.room LIKE ? ESCAPE '\\')"
    tests: list[tuple[str, str, list[Any]]] = [
        (f.home, "v.house = ?", [f.home]),
        (f.room, "v.room = ?", [f.room]),
        (f.has, "v.classes & ? != 0", [1 << _CLASS_NUMBER.get(f.has, 0)]),
        (f.mode, "v.layers & ? != 0", [LAYER_BIT.get(f.mode)]),
        (f.verdict, tests_of_verdict.get(f.verdict, "v.reason IS NULL"), []),
        (f.reason, "v.reason = ?", [f.reason]),
        (f.warned, f"v.warnings {'!=' if f.warned == '1' else '='} '[]'", []),
        (f.words, words, [_pattern(f.words)] * 3),
    ]
    used = [(test, values) for field, test, values in tests if field]
    where = f"WHERE {' AND '.join(test for test, _ in used)}" if used else ""
    return where, tuple(value for _, values in used for value in values)


def _pattern(words: str) -> str:
    escaped = words.replace("\\", "\\\\").replace("%", "\\%").replace("_", "\\_")
    return f"%{escaped}%"
