"""The parts of sheet and gallery, made view by view while other views are rendered.

Effects: a thread, which reads picture files.
"""

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
    """Tiles and cards of the views of an output folder that are done; to be closed."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._thread = ThreadPoolExecutor(max_workers=1)
        self._made: dict[Path, Future[_Parts]] = {}

    def close(self) -> None:
        """Begin no more parts, and wait for the one being made."""
        self._thread.shutdown(cancel_futures=True)

    def make(self, house_id: str, view_id: str) -> None:
        """Begin the parts of a view whose files are all written.

        Returns at once: a thread reads the view's files, so they must be complete. What fails there
        is a view without parts, not an error here.
        """
        folder = self._folder / keys.view_key(house_id, view_id, "view.json")
        view = ViewEntry(OutputHouse(house_id, "", ""), view_id, "", "", folder.parent)
        self._made[view.folder] = self._thread.submit(_part_sizes, view)

    def tiles(self) -> dict[Path, Sequence[Tile]]:
        """View folder -> the tiles of its row, of all views whose parts could be made.

        Waits for the parts that were begun.
        """
        return {folder: tiles for folder, (tiles, _card) in self._results().items()}

    def cards(self) -> dict[Path, CardTiles]:
        """View folder -> the tiles of its card, of all views whose parts could be made.

        Waits for the parts that were begun. Smaller than `tiles`, and encoded as a page needs them.
        """
        return {folder: card for folder, (_tiles, card) in self._results().items()}

    def _results(self) -> dict[Path, _Parts]:
        # What could not be made ahead is made with the sheet, which says why.
        done = {folder: part for folder, part in self._made.items() if part.exception() is None}
        return {folder: part.result() for folder, part in done.items()}


def _part_sizes(view: ViewEntry) -> _Parts:
    # The thread loads what it needs: whoever starts a run waits for none of it.
    from pbrs_farm.gallery.contact_sheet import TILE_PX
    from pbrs_farm.gallery.gallery_page import TEMPLATE, THUMBNAIL_PX, card_tiles
    from pbrs_farm.gallery.html_page import compile_template
    from pbrs_farm.gallery.view_tiles import tiles_of_sizes

    compile_template(*TEMPLATE)
    tiles, small = tiles_of_sizes(view, TILE_PX, THUMBNAIL_PX)
    return tiles, card_tiles(small)
