"""`pbrs-farm sheet`: a contact sheet (PNG) of a finished output folder. Effects: reads files."""

from __future__ import annotations

import io
import textwrap
import zlib
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Final

from PIL import Image, ImageDraw, ImageFont

from pbrs_farm.core.arrays import Srgb8Image
from pbrs_farm.core.classes import NYU40_COLOURS, NYU40_NAMES
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.layers import Layer
from pbrs_farm.core.lighting import ALL_MODES
from pbrs_farm.core.shown_text import shown
from pbrs_farm.formats.output_folder import ViewEntry, views_of
from pbrs_farm.gallery.gallery_page import attributions, best_first
from pbrs_farm.gallery.sheet_text import Font, draw_line
from pbrs_farm.gallery.view_tiles import NOT_RENDERED, TILES, Tile, tiles_of

TILE_PX: Final = 224  # longer edge of a tile
_GAP_PX: Final = 6
_MARGIN_PX: Final = 28
PAPER: Final = (16, 18, 23)  # background, sRGB
INK: Final = (236, 238, 242)  # text
_FAINT: Final = (142, 149, 163)  # secondary text
_EMPTY: Final = (29, 32, 40)  # placeholder for a missing tile
_Chip = tuple[int, int]  # legend entry: left edge in px, NYU40 id
_BETWEEN_PX: Final = 8
_LINE_PX: Final = 16  # line height of the caption
_MOST_LINES: Final = 6


def contact_sheet(
    folder: Path, *, max_views: int = 12, made: Mapping[Path, Sequence[Tile]] | None = None
) -> bytes:
    """PNG bytes: a row of tiles for each of at most max_views views of an output folder.

    made: view folder -> existing tiles of at most TILE_PX.
    The views are spread over houses, then rooms, the best first. A missing tile shows the reason;
    empty columns are left out. Raises BadInput if folder is not an output folder or has no view.
    """
    # Choose the views and make their tiles.
    everything = best_first(views_of(folder))
    if not everything:
        raise BadInput(folder, "houses/", "has no view yet", hint="run `pbrs-farm run` first")
    views = spread_views(everything, max_views)
    tiles_of_view = made or {}
    rows = [(view, tiles_of_view.get(view.folder) or tiles_of(view, TILE_PX)) for view in views]
    # A damaged layer keeps its column: its tile shows the reason.
    rendered = {t.kind for _view, tiles in rows for t in tiles if t.missing != NOT_RENDERED}
    kinds = [kind for kind in TILES if kind in rendered]
    rows = [(view, [t for t in tiles if t.kind in rendered]) for view, tiles in rows]
    heights = [row_height(tiles) for _view, tiles in rows]
    classes = _classes_shown([tiles for _view, tiles in rows])
    credits = _sheet_credits(everything)

    # Lay out: header, a row per view, legend, credits.
    width = 2 * _MARGIN_PX + max(4, len(kinds)) * (TILE_PX + _GAP_PX) - _GAP_PX
    legend = _legend_rows(classes, width - 2 * _MARGIN_PX)
    header, foot = 112, 48 + 28 * len(legend) + 22 * len(credits)
    sheet = Image.new("RGB", (width, header + sum(heights) + foot), PAPER)
    draw = ImageDraw.Draw(sheet)
    _draw_header(draw, everything, len(views), kinds)
    y = header
    for (view, tiles), height in zip(rows, heights, strict=True):
        _draw_row(sheet, draw, y, view, tiles)
        y += height
    y = _draw_legend(draw, y + 10, legend)
    for line in credits:
        draw_line(draw, (_MARGIN_PX, y), line, fill=_FAINT, size=13)
        y += 22

    file = io.BytesIO()
    # A sheet is mostly photographs: runs alone make it 4 % larger than level 4, in two thirds of the time.
    sheet.save(file, "PNG", compress_level=1, compress_type=zlib.Z_RLE)
    return file.getvalue()


def spread_views(views: Sequence[ViewEntry], max_views: int) -> list[ViewEntry]:
    """At most max_views of views, in order, from each house and room in turn."""
    # Group by house and room.
    rooms: dict[str, dict[str, list[ViewEntry]]] = defaultdict(lambda: defaultdict(list))
    for view in views:
        rooms[view.house.id][view.room_id].append(view)
    turns = {house: _in_turn(of_room.values()) for house, of_room in rooms.items()}
    # Take in turn, then restore the original order.
    chosen = _in_turn(turns.values())[: max(max_views, 0)]
    places = {id(view): i for i, view in enumerate(views)}
    return sorted(chosen, key=lambda view: places[id(view)])


def _in_turn(lists: Iterable[Sequence[ViewEntry]]) -> list[ViewEntry]:
    """The first of each list, then the second of each, and so on."""
    # Interleave by position, skipping exhausted lists.
    columns = [list(x) for x in lists]
    longest = max((len(x) for x in columns), default=0)
    return [x[i] for i in range(longest) for x in columns if i < len(x)]


def row_height(tiles: Sequence[Tile]) -> int:
    heights = [TILE_PX * 3 // 4 if t.pixels is None else t.pixels.shape[0] for t in tiles]
    return 34 + max(heights) + 12  # title above, gap below


def _classes_shown(rows: Sequence[Sequence[Tile]]) -> list[int]:
    """NYU40 ids seen, most frequent first."""
    total: dict[int, float] = defaultdict(float)
    for tile in (tile for tiles in rows for tile in tiles):
        for nyu40, share in tile.classes:
            total[nyu40] += share
    return sorted(total, key=lambda i: -total[i])


def _sheet_credits(views: Sequence[ViewEntry]) -> list[str]:
    return [shown(line, 260) for line in attributions(views)]


def _font(size: int) -> Font:
    return ImageFont.load_default(size)


def _draw_header(
    draw: ImageDraw.ImageDraw, views: Sequence[ViewEntry], n_shown: int, kinds: Sequence[Layer]
) -> None:
    # Write the summary, then a title over each column.
    n_houses = len({view.house.id for view in views})
    draw.text((_MARGIN_PX, 22), "pbrs_farm", INK, _font(30))
    part = "" if n_shown == len(views) else f"{n_shown} of "
    text = (
        f"{part}{len(views)} view{'s'[: len(views) != 1]}, "
        f"{n_houses} house{'s'[: n_houses != 1]}: {modes_text(kinds)}labels of the same pixels"
    )
    draw.text((_MARGIN_PX + 172, 34), text, _FAINT, _font(16))
    for i, kind in enumerate(kinds):
        draw.text((_MARGIN_PX + i * (TILE_PX + _GAP_PX), 80), kind.shown_title, INK, _font(15))


def modes_text(kinds: Sequence[Layer]) -> str:
    """ "two lighting modes, " for the columns' modes; "" without any."""
    n_modes = sum(kind.name in {mode.value for mode in ALL_MODES} for kind in kinds)
    number = ("", "one", "two", "three", "four")[n_modes]
    return f"{number} lighting mode{'s'[: n_modes != 1]}, " if n_modes else ""


def _draw_row(
    sheet: Image.Image, draw: ImageDraw.ImageDraw, y: int, view: ViewEntry, tiles: Sequence[Tile]
) -> None:
    draw.line([(_MARGIN_PX, y + 2), (sheet.width - _MARGIN_PX, y + 2)], fill=(38, 42, 52), width=1)
    # Write the room, and the home and view behind it, over the row of tiles.
    length = draw_line(draw, (_MARGIN_PX, y + 9), view.room_name, fill=INK, size=16)
    after = _MARGIN_PX + length + 14
    text = f"{view.house.name}, view {view.id}"
    draw_line(draw, (after, y + 11), text, fill=_FAINT, size=14)
    for i, tile in enumerate(tiles):
        x = _MARGIN_PX + i * (TILE_PX + _GAP_PX)
        _draw_tile(sheet, draw, (x, y + 34), tile)


def _draw_tile(
    sheet: Image.Image, draw: ImageDraw.ImageDraw, at: tuple[int, int], tile: Tile
) -> None:
    # Write the reason into the frame of a missing tile.
    if tile.pixels is None:
        size = (TILE_PX, TILE_PX * 3 // 4)
        draw.rectangle([at, (at[0] + size[0] - 1, at[1] + size[1] - 1)], _EMPTY)
        middle = (at[0] + size[0] // 2, at[1] + size[1] // 2)
        draw.text(middle, tile.missing, _FAINT, _font(15), anchor="mm")
        return
    # Draw the note over the picture's corner, on a dark background.
    sheet.paste(Image.fromarray(tile.pixels), at)
    if tile.note:
        box = draw.textbbox((at[0] + 6, at[1] + 5), tile.note, _font(12))
        draw.rectangle([box[0] - 4, box[1] - 3, box[2] + 4, box[3] + 3], PAPER)
        draw.text((at[0] + 6, at[1] + 5), tile.note, INK, _font(12))


def _legend_rows(classes: Sequence[int], width: int) -> list[list[_Chip]]:
    """The legend's rows, each as wide as width allows."""
    rows: list[list[_Chip]] = []
    x = width  # left edge of the next chip
    for nyu40 in classes:
        # Measure a chip: its square, its word and the gap behind it.
        length = 22 + round(_font(14).getlength(NYU40_NAMES[nyu40])) + 22
        if not rows or x + length > width:
            rows.append([])
            x = 0
        rows[-1].append((x, nyu40))
        x += length
    return rows


def _draw_legend(draw: ImageDraw.ImageDraw, y: int, rows: Sequence[Sequence[_Chip]]) -> int:
    for row in rows:
        for left, nyu40 in row:
            x = _MARGIN_PX + left
            colour = tuple(NYU40_COLOURS[nyu40].tolist())
            draw.rounded_rectangle([x, y + 2, x + 14, y + 16], 3, colour, (70, 76, 90))
            draw.text((x + 22, y), NYU40_NAMES[nyu40], INK, _font(14))
        y += 28
    return y


def before_after_png(before: Srgb8Image, after: Srgb8Image, caption: str) -> bytes:
    """PNG of two pictures (H, W, 3) side by side, and a caption, its credits whole, below."""
    height, width = before.shape[:2]
    # A letter of size 12 is about 6 px wide.
    most = max(20, (2 * width) // 6)
    lines = textwrap.wrap(shown(caption, most * _MOST_LINES), most)[:_MOST_LINES] or [""]
    size = (2 * width + _BETWEEN_PX, height + 8 + _LINE_PX * len(lines))
    sheet = Image.new("RGB", size, PAPER)
    sheet.paste(Image.fromarray(before), (0, 0))
    sheet.paste(Image.fromarray(after), (width + _BETWEEN_PX, 0))
    draw = ImageDraw.Draw(sheet)
    for k, line in enumerate(lines):
        draw_line(draw, (6, height + 5 + k * _LINE_PX), line, fill=_FAINT, size=12)
    file = io.BytesIO()
    sheet.save(file, "PNG", compress_level=6)
    return file.getvalue()
