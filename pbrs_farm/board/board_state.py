"""What one running board is made of. Effects: opens the index, starts and ends its threads."""

from __future__ import annotations

import threading
from dataclasses import dataclass

from jinja2 import Environment

from pbrs_farm.board.index.queries import Queries
from pbrs_farm.board.index.refresh import Refresher
from pbrs_farm.board.index.view_index import ViewIndex
from pbrs_farm.board.live_farm import Audit, LiveFarm
from pbrs_farm.board.options import BoardOptions
from pbrs_farm.board.pages.rendering import environment
from pbrs_farm.board.picture_cache import PictureCache
from pbrs_farm.board.root_reader import RootReader
from pbrs_farm.board.sessions import Sessions
from pbrs_farm.board.static_files import Asset, assets
from pbrs_farm.core import keys
from pbrs_farm.store.object_store import Store


@dataclass(frozen=True, slots=True, eq=False)
class Board:
    """One running board: what its routes share."""

    options: BoardOptions
    reader: RootReader
    index: ViewIndex
    queries: Queries
    refresher: Refresher
    pictures: PictureCache
    sessions: Sessions
    templates: Environment
    assets: dict[str, Asset]
    audit: Audit
    streams: threading.Semaphore  # pages that listen
    ending: threading.Event  # set when the board is to end
    farm: LiveFarm | None = None  # None: a folder alone is shown

    def start(self) -> None:
        """Begin to look at the root."""
        self.refresher.start()

    def end(self) -> None:
        """Stop what was started."""
        self.refresher.end()


def new_board(store: Store, options: BoardOptions, farm: LiveFarm | None = None) -> Board:
    """A board of an output root; what it makes is kept below options.cache, by the root's URL.

    Nothing runs yet: `Board.start` begins to look at the root, which is only read. Two boards of
    one root with one cache share their index. Without a farm there are no pages of jobs and no
    users but the board's own token.
    """
    folder = options.cache / keys.digest(store.url)
    reader = RootReader(store)
    index = ViewIndex(folder / "index.sqlite")
    found = assets()
    return Board(
        options=options,
        reader=reader,
        index=index,
        queries=Queries(index),
        refresher=Refresher(reader, index, farm.finished_houses if farm is not None else None),
        pictures=PictureCache(folder / "pictures"),
        sessions=Sessions(options.token, farm.user_with)
        if farm is not None
        else Sessions(options.token),
        templates=environment(found),
        assets=found,
        audit=Audit(folder / "audit.jsonl"),
        streams=threading.Semaphore(options.limits.streams),
        ending=threading.Event(),
        farm=farm,
    )
