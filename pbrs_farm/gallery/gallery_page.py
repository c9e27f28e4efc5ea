"""The HTML gallery of a finished output folder: one file, no network. Effects: reads files.

Thumbnails are inside the file; a click shows the full picture, linked relative to the folder.
"""

from __future__ import annotations

import base64
import io
import re
from collections.abc import Iterable, Sequence
from html import escape
from importlib import resources
from pathlib import Path
from typing import Final
from urllib.parse import quote

import numpy as np
from PIL import Image

from pbrs_farm import images
from pbrs_farm.core.arrays import Srgb8Image
from pbrs_farm.core.classes import NYU40_NAMES
from pbrs_farm.formats.output_folder import ViewEntry, reasons_of, views_of
from pbrs_farm.gallery.label_colours import NYU40_COLOURS
from pbrs_farm.gallery.tiles import TILES, Tile, tiles_of

THUMBNAIL_PX: Final = 320
MAX_TILE_BYTES: Final = 11_000
"""Of a thumbnail: 200 views of 9 tiles stay under 30 MB with base64's third on top."""

_VERDICTS: Final = (
    '<select id="verdict" aria-label="Selection"><option value="">Kept and refused</option>'
    '<option value="kept">Kept</option><option value="refused">Refused</option></select>'
)
_FLAT: Final = frozenset({"semantic", "instance", "boundary"})


def gallery(folder: Path) -> str:
    """HTML of every view below folder (written as folder/index.html its links are right).

    Raises BadInput if folder is no output folder. Full pictures are linked, never embedded.
    """
    views = views_of(folder)
    reasons = reasons_of(folder)
    cards: list[str] = []
    aspect = "4 / 3"
    for view in views:
        tiles = tiles_of(view, THUMBNAIL_PX)
        shape = next((t.pixels.shape for t in tiles if t.pixels is not None), None)
        if not cards and shape is not None:
            aspect = f"{shape[1]} / {shape[0]}"
        cards.append(_card(folder, view, tiles, reasons.get((view.house.id, view.id))))

    n_houses = len({view.house.id for view in views})
    template = resources.files("pbrs_farm.gallery").joinpath("gallery.html").read_text("utf-8")
    parts = {
        "TITLE": f"{len(views)} views of {n_houses} house{'s'[: n_houses != 1]}",
        "ASPECT": aspect,
        "HOUSES": _options((view.house.id, view.house.name) for view in views),
        "ROOMS": _options((view.room_name, view.room_name) for view in views),
        "VERDICTS": _VERDICTS if reasons else "",
        "LAYERS": "".join(
            f'<button type="button" data-layer="{kind.layer}" aria-pressed="true">'
            f"{escape(kind.title)}</button>"
            for kind in TILES
        ),
        "CREDITS": "<br>".join(
            escape(line) for line in dict.fromkeys(v.house.attribution for v in views) if line
        ),
        "CARDS": "\n".join(cards),
    }
    return filled(template, parts)


def filled(template: str, parts: dict[str, str]) -> str:
    """template with each @NAME@ replaced by parts[NAME]; what is put in is not searched again."""
    return re.sub("@([A-Z]+)@", lambda found: parts.get(found[1], found[0]), template)


def _options(pairs: Iterable[tuple[str, str]]) -> str:
    unique = sorted(dict(pairs).items(), key=lambda pair: pair[1].lower())
    return "".join(f'<option value="{escape(v)}">{escape(t)}</option>' for v, t in unique)


def _card(root: Path, view: ViewEntry, tiles: Sequence[Tile], reason: str | None) -> str:
    """reason: why selection refused the view, "" where it is kept, None where nobody judged it."""
    link = quote(view.folder.relative_to(root).as_posix())
    classes = next((tile.classes for tile in tiles if tile.classes), ())
    names = " ".join(NYU40_NAMES[i] for i, _share in classes)
    words = f"{view.house.id} {view.house.name} {view.room_name} {view.id} {names}".lower()
    figures = "".join(_figure(link, view, tile) for tile in tiles)
    verdict, badge = "", ""
    if reason is not None:
        verdict = "refused" if reason else "kept"
        badge = f'<b class="{verdict}">{escape(reason or "kept")}</b>'
    return (
        f'<article data-house="{escape(view.house.id)}" data-room="{escape(view.room_name)}" '
        f'data-verdict="{verdict}" data-words="{escape(words)}"><h2>{escape(view.room_name)}{badge}'
        f"<span>{escape(view.house.name)}, view {escape(view.id)}</span>"
        f'<a href="{link}/view.json">view.json</a></h2>'
        f'<div class="tiles">{figures}</div>{_legend(classes)}</article>'
    )


def _figure(link: str, view: ViewEntry, tile: Tile) -> str:
    kind = tile.kind
    note = f"<span>{escape(tile.note)}</span>" if tile.note else ""
    caption = f"<figcaption><span>{escape(kind.title)}</span>{note}</figcaption>"
    if tile.pixels is None:
        shot = f'<div class="shot none">{escape(tile.missing)}</div>'
    else:
        flags = ' data-photo="1"' if kind.is_photo else ""
        flags += ' data-nearest="1"' if kind.layer in _FLAT else ""
        text = escape(f"{kind.title}: {view.room_name}, {view.house.name}, view {view.id}")
        shot = (
            f'<button type="button" class="shot{" label" if kind.layer in _FLAT else ""}" '
            f'data-file="{link}/{kind.file}"{flags}>'
            f'<img loading="lazy" decoding="async" alt="{text}" src="{_data_url(tile)}"></button>'
        )
    return f'<figure data-layer="{kind.layer}">{shot}{caption}</figure>'


def _legend(classes: Sequence[tuple[int, float]]) -> str:
    if not classes:
        return ""
    chips = "".join(
        f'<li><i style="background:rgb({",".join(str(int(c)) for c in NYU40_COLOURS[nyu40])})">'
        f"</i>{NYU40_NAMES[nyu40]} <b>{_percent(share)}</b></li>"
        for nyu40, share in classes
    )
    return f'<ul class="legend">{chips}</ul>'


def _percent(share: float) -> str:
    return f"{100 * share:.0f} %" if share >= 0.01 else "&lt; 1 %"


def _data_url(tile: Tile) -> str:
    assert tile.pixels is not None
    if tile.kind.layer in _FLAT:
        data, kind = _palette_png(tile.pixels), "png"
        if len(data) <= MAX_TILE_BYTES:
            return f"data:image/{kind};base64,{base64.b64encode(data).decode()}"
    data = small_jpeg(tile.pixels, MAX_TILE_BYTES)
    return f"data:image/jpeg;base64,{base64.b64encode(data).decode()}"


def small_jpeg(pixels: Srgb8Image, max_bytes: int) -> bytes:
    """JPEG bytes at the best of four qualities that keeps within max_bytes; else made smaller."""
    for quality in (84, 74, 62, 48):
        data = images.jpeg_from_array(pixels, quality)
        if len(data) <= max_bytes:
            return data
    half = images.thumbnail(pixels, max_edge_px=max(16, max(pixels.shape[:2]) * 3 // 4))
    return small_jpeg(half, max_bytes) if half.shape != pixels.shape else data


def _palette_png(pixels: Srgb8Image) -> bytes:
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
