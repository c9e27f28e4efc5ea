"""HTML gallery of a finished output folder: pages of at most 5 MB, no network. Effects: reads files.

Thumbnails are embedded, so that a page can be sent by mail; a click shows the full picture, linked
relative to the folder.
"""

from __future__ import annotations

import base64
import io
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final
from urllib.parse import quote

import numpy as np
from PIL import Image

from pbrs_farm import images
from pbrs_farm.core.arrays import Srgb8Image
from pbrs_farm.core.classes import NYU40_COLOURS, NYU40_NAMES
from pbrs_farm.formats.output_folder import ViewEntry, reasons_of, views_of
from pbrs_farm.gallery.html_page import page
from pbrs_farm.gallery.view_tiles import TILES, Tile, tiles_of

TEMPLATE: Final = ("pbrs_farm.gallery", "gallery.html")  # package and file of the pages
THUMBNAIL_PX: Final = 320  # longer edge
MAX_TILE_BYTES: Final = 11_000  # maximum size of a thumbnail
MAX_PAGE_BYTES: Final = 5_000_000

# Views per page: nine tiles each, base64's extra third and 6 kB of text stay below the limit.
PAGE_VIEWS: Final = 35
_BLACK_LX: Final = 0.05  # daylight on the floor below which a room is black, lux


def page_name(number: int) -> str:
    """The file name of a page, counted from 1."""
    return "index.html" if number == 1 else f"index-{number}.html"


@dataclass(frozen=True, slots=True)
class CardTiles:
    """The tiles of a view's card without pixels, since a house may have many views."""

    tiles: tuple[dict[str, Any], ...]  # for the template, pictures as URLs
    classes: tuple[tuple[int, float], ...]  # (NYU40 id, share), largest first
    shape: tuple[int, ...] | None  # of the first available picture


def card_tiles(tiles: Sequence[Tile]) -> CardTiles:
    """Tiles of at most THUMBNAIL_PX for a card, as data URLs; classes and shape of the first with any."""
    rows = tuple(
        {"kind": t.kind, "note": t.note, "missing": t.missing, "source": _tile_url(t)}
        for t in tiles
    )
    classes = next((tile.classes for tile in tiles if tile.classes), ())
    shape = next((t.pixels.shape for t in tiles if t.pixels is not None), None)
    return CardTiles(rows, classes, shape)


def gallery_pages(
    folder: Path, cards: Mapping[Path, CardTiles] | None = None
) -> Iterator[tuple[str, str]]:
    """(file name, HTML) of each page in turn; cards: view folder -> card_tiles. BadInput as gallery."""
    views, reasons = best_first(views_of(folder)), reasons_of(folder)
    n_pages = max(1, -(-len(views) // PAGE_VIEWS))
    for number in range(1, n_pages + 1):
        yield page_name(number), _page(folder, views, reasons, (number, n_pages), cards or {})


def gallery(folder: Path) -> str:
    """HTML of the first page, full pictures linked relative to folder; BadInput for no output folder."""
    return next(gallery_pages(folder))[1]


def _page(
    folder: Path,
    entries: Sequence[ViewEntry],
    reasons: Mapping[tuple[str, str], str],
    place: tuple[int, int],
    made: Mapping[Path, CardTiles],
) -> str:
    """HTML of one page, place = (its number, of how many); only its own pictures are read."""
    number, n_pages = place
    views = entries[(number - 1) * PAGE_VIEWS : number * PAGE_VIEWS]
    cards: list[dict[str, Any]] = []
    aspect = "4 / 3"
    for view in views:
        # Give every tile the shape of the first available picture.
        tiles = made.get(view.folder) or card_tiles(tiles_of(view, THUMBNAIL_PX))
        if not cards and tiles.shape is not None:
            aspect = f"{tiles.shape[1]} / {tiles.shape[0]}"
        cards.append(_card(folder, view, tiles, reasons.get((view.house.id, view.id))))
    n_houses = len({view.house.id for view in entries})
    return page(
        *TEMPLATE,
        title=f"{len(entries)} views of {n_houses} house{'s'[: n_houses != 1]}",
        number=number,
        pages=[(k, page_name(k)) for k in _near_pages(number, n_pages)],
        aspect=aspect,
        houses=_options((view.house.id, view.house.name) for view in views),
        rooms=_options((view.room_name, view.room_name) for view in views),
        has_verdicts=bool(reasons),
        kinds=TILES,
        cards=cards,
        credits=attributions(views),
    )


def _near_pages(number: int, n_pages: int) -> list[int]:
    """The page numbers linked from a page: first, last and neighbours; empty for a single page."""
    near = {1, n_pages, *range(number - 3, number + 4)}
    return sorted(k for k in near if 1 <= k <= n_pages) if n_pages > 1 else []


def best_first(views: Iterable[ViewEntry]) -> list[ViewEntry]:
    """Views by house, best room and view first, black ones last; frames of a sequence in order."""
    houses: dict[str, dict[str, list[ViewEntry]]] = {}
    for view in views:
        houses.setdefault(view.house.id, {}).setdefault(view.room_id, []).append(view)
    ordered: list[ViewEntry] = []
    for rooms in houses.values():
        for room_views in sorted(rooms.values(), key=lambda r: min(map(_rank, r))):
            is_sequence = any("frame" in view.facts for view in room_views)
            ordered += room_views if is_sequence else sorted(room_views, key=_rank)
    return ordered


def _rank(view: ViewEntry) -> tuple[bool, float]:
    """Sort key of a view: low ranks come first."""
    score = view.facts.get("score")
    light = (view.facts.get("modes") or {}).get("light") or {}
    lux = light.get("floor_lux") or {}
    is_black = bool(lux) and float(lux.get("outdoor", _BLACK_LX)) < _BLACK_LX
    return is_black, -float(score) if isinstance(score, int | float) else 0.0


def attributions(views: Iterable[ViewEntry]) -> list[str]:
    """The lines of credit that the views' houses carry, each once."""
    return list(dict.fromkeys(v.house.attribution for v in views if v.house.attribution))


def _options(pairs: Iterable[tuple[str, str]]) -> list[tuple[str, str]]:
    """(value, text) of a menu, each value once, by text."""
    return sorted(dict(pairs).items(), key=lambda pair: pair[1].lower())


def _card(root: Path, view: ViewEntry, tiles: CardTiles, reason: str | None) -> dict[str, Any]:
    """A view for the template. reason: why it is rejected, "" if kept, None if nobody judged it."""
    # Search text: home, room, view and visible classes.
    names = " ".join(NYU40_NAMES[i] for i, _share in tiles.classes)
    words = f"{view.house.id} {view.house.name} {view.room_name} {view.id} {names}"
    return {
        "view": view,
        "link": quote(view.folder.relative_to(root).as_posix()),
        "reason": reason,
        "verdict": "" if reason is None else "rejected" if reason else "kept",
        "search_text": words.lower(),
        "tiles": tiles.tiles,
        "classes": [
            {"name": NYU40_NAMES[i], "rgb": NYU40_COLOURS[i].tolist(), "share": share}
            for i, share in tiles.classes
        ],
    }


def _tile_url(tile: Tile) -> str:
    if tile.pixels is None:
        return ""
    # Keep flat colours exact with a palette PNG if it is small enough.
    if tile.kind.is_label:
        data = _palette_png(tile.pixels)
        if len(data) <= MAX_TILE_BYTES:
            return data_url(data, "png")
    return data_url(small_jpeg(tile.pixels, MAX_TILE_BYTES), "jpeg")


def data_url(data: bytes, kind: str) -> str:
    """The bytes of a picture ("png" or "jpeg") as a data URL, a third longer."""
    return f"data:image/{kind};base64,{base64.b64encode(data).decode()}"


def small_jpeg(pixels: Srgb8Image, max_bytes: int) -> bytes:
    """JPEG bytes at the best of four qualities within max_bytes, else scaled down to 16 px."""
    for quality in (84, 74, 62, 48):
        data = images.jpeg_from_array(pixels, quality)
        if len(data) <= max_bytes:
            return data
    # Scale to three quarters until it fits or is minimal.
    smaller = images.thumbnail(pixels, max_edge_px=max(16, max(pixels.shape[:2]) * 3 // 4))
    return small_jpeg(smaller, max_bytes) if smaller.shape != pixels.shape else data


def _palette_png(pixels: Srgb8Image) -> bytes:
    """PNG bytes, exact; with a palette for at most 256 colours."""
    # Number each colour by its bytes, then index the numbers that occur.
    keys = pixels.astype(np.uint32) @ np.array([65536, 256, 1], np.uint32)
    colours, index = np.unique(keys, return_inverse=True)
    if len(colours) > 256:
        return images.png_from_array(pixels)
    picture = Image.fromarray(index.reshape(keys.shape).astype(np.uint8), "P")
    picture.putpalette(
        np.stack([colours >> 16, colours >> 8, colours], -1).astype(np.uint8).tobytes()
    )
    file = io.BytesIO()
    picture.save(file, "PNG", optimize=True)
    return file.getvalue()
