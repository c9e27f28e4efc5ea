"""Pages that list: homes, views, a home. Effects: reads the index and the store."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import JSONResponse, Response

from pbrs_farm.board.board_state import Board
from pbrs_farm.board.index.queries import (
    VERDICTS,
    ListedHome,
    ListedView,
    filter_from_query,
    page_number,
)
from pbrs_farm.board.pages.rendering import page
from pbrs_farm.board.pages.words import OF_A_CANDIDATE, OF_A_SELECTION, listed
from pbrs_farm.core.lighting import ALL_MODES
from pbrs_farm.core.shown_text import shown

_GONE: Final = "It was moved or removed, or the address is of another root."
_MAX_VIEWS: Final = 120  # of a home that its own page lists


def board_of(request: Request) -> Board:
    """The board that a request is for."""
    board: Board = request.app.state.board
    return board


def asked_home(request: Request) -> ListedHome:
    """The home that the path names; 404 when the index has none of that id."""
    house = request.path_params["house"]
    board = board_of(request)
    home = board.queries.home(house)
    if home is None:
        raise HTTPException(404, f"There is no home {shown(house)} in this root. {_GONE}")
    # The index looks every few seconds or minutes.
    if not board.reader.has_house(house):
        raise HTTPException(404, f"The home {home.name} is not in the root any more. {_GONE}")
    return home


def asked_view(request: Request) -> ListedView:
    """The view that the path names; 404 when the index has none of these ids."""
    words = request.path_params
    view = board_of(request).queries.view(words["house"], words["view"])
    if view is None:
        raise HTTPException(404, f"There is no view {shown(words['view'])} of this home. {_GONE}")
    return view


def homes(request: Request) -> Response:
    """GET /: the homes of the root, a page at a time."""
    words = request.query_params.get("words", "").strip()[:120]
    queries = board_of(request).queries
    found = queries.homes(words, page_number(request.query_params.get("page", "")))
    return page(request, "homes.html", found=found, words=words, n_views=queries.n_views())


def views(request: Request) -> Response:
    """GET /views: thumbnails of the views that the address' filter lets through."""
    queries = board_of(request).queries
    wanted = filter_from_query(request.query_params)
    found = queries.views(wanted)
    menus = queries.menus()
    # htmx asks for the results alone, but for the whole page when a reader goes back to it.
    headers = request.headers
    is_back = headers.get("hx-history-restore-request") == "true"
    is_part = headers.get("hx-request") == "true" and not is_back
    answer = page(
        request,
        "views_part.html" if is_part else "views.html",
        wanted=wanted,
        found=found,
        menus=menus,
        modes=[mode.value for mode in ALL_MODES],
        verdicts=VERDICTS,
        words=listed((reason for reason, _text in menus["reason"]), OF_A_SELECTION),
        credits=sorted(_credits_of_homes(queries.home(h) for h in {v.house for v in found.rows})),
    )
    # The address leaves out what the form leaves empty.
    answer.headers["HX-Push-Url"] = wanted.url(page=wanted.page)
    return answer


def _credits_of_homes(homes: Iterable[ListedHome | None]) -> set[str]:
    return {h.credit for h in homes if h is not None and h.credit}


def home(request: Request) -> Response:
    """GET /homes/HOUSE: a home in 3D, with its views beside it."""
    found = asked_home(request)
    views = board_of(request).queries.views_of(found.id)
    version = views[0].version if views else ""
    words = list(OF_A_CANDIDATE.items())
    return page(
        request, "home.html", home=found, views=views[:_MAX_VIEWS], version=version, words=words
    )


def progress(request: Request) -> Response:
    """GET /progress: how far the root is read, as JSON; an empty text when it is."""
    now = board_of(request).refresher.progress
    return JSONResponse({"text": now.text, "fault": bool(now.fault)})
