"""State of a running board. Effects: opens the index, starts and ends its threads."""

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
from pbrs_farm.board.pictures import PictureCache
from pbrs_farm.board.root_reader import RootReader
from pbrs_farm.board.sessions import Sessions
from pbrs_farm.board.static_files import Asset, assets
from pbrs_farm.core import keys
from pbrs_farm.store.object_store import Store


@dataclass(frozen=True, slots=True, eq=False)
class Board:
    """Objects shared by the routes of a board."""

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
    streams: threading.Semaphore  # free event streams
    ending: threading.Event  # set at the end of the board
    farm: LiveFarm | None = None  # None for a root without a farm


def new_board(store: Store, options: BoardOptions, farm: LiveFarm | None = None) -> Board:
    """A board of an output root with its cache below options.cache, not started yet.

    Two boards with one root and one cache share their index. Without a farm there are no pages of
    jobs, and the board's own token is the only one.
    """
    folder = options.cache / keys.digest(store.url)
    reader = RootReader(store)
    index = ViewIndex(folder / "index.sqlite")
    static = assets()
    return Board(
        options=options,
        reader=reader,
        index=index,
        queries=Queries(index),
        refresher=Refresher(reader, index, farm.finished_houses if farm is not None else None),
        pictures=PictureCache(folder / "pictures"),
        sessions=Sessions(options.token, *([farm.user_with] if farm is not None else [])),
        templates=environment(static),
        assets=static,
        audit=Audit(folder / "audit.jsonl"),
        streams=threading.Semaphore(options.limits.streams),
        ending=threading.Event(),
        farm=farm,
    )
