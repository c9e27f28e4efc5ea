"""Make parts of sheet and gallery in a thread, view by view, while other views are rendered."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

from pbrs_farm.core import keys
from pbrs_farm.formats.output_folder import OutputHouse, ViewEntry

if TYPE_CHECKING:
    from pbrs_farm.gallery.gallery_page import CardTiles
    from pbrs_farm.gallery.view_tiles import Tile

_Parts: TypeAlias = "tuple[Sequence[Tile], CardTiles]"


class SheetParts:
    """Tiles and cards of an output folder's finished views; close after use."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._thread = ThreadPoolExecutor(max_workers=1)
        self._made: dict[Path, Future[_Parts]] = {}

    def close(self) -> None:
        """Start no more parts, and wait for the current one."""
        self._thread.shutdown(cancel_futures=True)

    def make(self, house_id: str, view_id: str) -> None:
        """Start making the parts of a complete view in the background; a failure leaves it without."""
        folder = self._folder / keys.view_key(house_id, view_id, "view.json")
        view = ViewEntry(OutputHouse(house_id, "", ""), view_id, "", "", folder.parent)
        self._made[view.folder] = self._thread.submit(_part_sizes, view)

    def tiles(self) -> dict[Path, Sequence[Tile]]:
        """View folder -> the tiles of its row, for all views with parts, running ones awaited."""
        return {folder: tiles for folder, (tiles, _card) in self._results().items()}

    def cards(self) -> dict[Path, CardTiles]:
        """View folder -> the encoded tiles of its card, for all views with parts, running ones awaited."""
        return {folder: card for folder, (_tiles, card) in self._results().items()}

    def _results(self) -> dict[Path, _Parts]:
        # Leave out failed parts: the sheet makes them again and reports the error.
        done = {folder: part for folder, part in self._made.items() if part.exception() is None}
        return {folder: part.result() for folder, part in done.items()}


def _part_sizes(view: ViewEntry) -> _Parts:
    # Import in the thread, so that the start of a run does not wait.
    from pbrs_farm.gallery.contact_sheet import TILE_PX
    from pbrs_farm.gallery.gallery_page import TEMPLATE, THUMBNAIL_PX, card_tiles
    from pbrs_farm.gallery.html_page import compile_template
    from pbrs_farm.gallery.view_tiles import tiles_of_sizes

    compile_template(*TEMPLATE)
    tiles, small = tiles_of_sizes(view, TILE_PX, THUMBNAIL_PX)
    return tiles, card_tiles(small)
