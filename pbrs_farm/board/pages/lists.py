"""Pages of homes, of views, and of a home. Effects: reads the index and the store."""

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
from pbrs_farm.board.pages.rendering import asks_for_json, page
from pbrs_farm.board.pages.words import OF_A_CANDIDATE, OF_A_SELECTION, listed
from pbrs_farm.core.lighting import ALL_MODES
from pbrs_farm.core.shown_text import shown

_GONE: Final = "It was moved or removed, or the address belongs to another root."
_MAX_VIEWS: Final = 120  # maximum number of views on the page of a home


def board_of(request: Request) -> Board:
    """The board of a request."""
    board: Board = request.app.state.board
    return board


def asked_home(request: Request) -> ListedHome:
    """The home in the path; 404 if it is unknown or removed."""
    house = request.path_params["house"]
    board = board_of(request)
    home = board.queries.home(house)
    if home is None:
        raise HTTPException(404, f"There is no home {shown(house)} in this root. {_GONE}")
    # The index may be older than a removal.
    if not board.reader.has_house(house):
        raise HTTPException(404, f"The home {home.name} is not in the root any more. {_GONE}")
    return home


def asked_view(request: Request) -> ListedView:
    """The view in the path; 404 if it is unknown."""
    words = request.path_params
    view = board_of(request).queries.view(words["house"], words["view"])
    if view is None:
        raise HTTPException(404, f"There is no view {shown(words['view'])} of this home. {_GONE}")
    return view


def homes(request: Request) -> Response:
    """GET /: the homes of the root, a page at a time."""
    words = request.query_params.get("words", "").strip()[:120]
    queries = board_of(request).queries
    listed_homes = queries.homes(words, page_number(request.query_params.get("page", "")))
    if asks_for_json(request):
        return JSONResponse(listed_homes.table())
    return page(request, "homes.html", found=listed_homes, words=words, n_views=queries.n_views())


def views(request: Request) -> Response:
    """GET /views: thumbnails of the filtered views."""
    queries = board_of(request).queries
    view_filter = filter_from_query(request.query_params)
    listed_views = queries.views(view_filter)
    if asks_for_json(request):
        return JSONResponse(listed_views.table())
    menus = queries.menus()
    # htmx requests the results only, but the whole page for the browser's Back.
    headers = request.headers
    is_back = headers.get("hx-history-restore-request") == "true"
    is_part = headers.get("hx-request") == "true" and not is_back
    answer = page(
        request,
        "views_part.html" if is_part else "views.html",
        wanted=view_filter,
        found=listed_views,
        menus=menus,
        modes=[mode.value for mode in ALL_MODES],
        verdicts=VERDICTS,
        words=listed((reason for reason, _text in menus["reason"]), OF_A_SELECTION),
        credits=sorted(
            _credits_of_homes(queries.home(h) for h in {v.house for v in listed_views.rows})
        ),
    )
    # The address omits empty fields.
    answer.headers["HX-Push-Url"] = view_filter.url(page=view_filter.page)
    return answer


def _credits_of_homes(homes: Iterable[ListedHome | None]) -> set[str]:
    return {h.credit for h in homes if h is not None and h.credit}


def home(request: Request) -> Response:
    """GET /homes/HOUSE: a home in 3D with its views."""
    entry = asked_home(request)
    views = board_of(request).queries.views_of(entry.id)
    if asks_for_json(request):
        return JSONResponse(entry.row() | {"views": [view.row() for view in views]})
    version = views[0].version if views else ""
    words = list(OF_A_CANDIDATE.items())
    return page(
        request, "home.html", home=entry, views=views[:_MAX_VIEWS], version=version, words=words
    )


def contents(request: Request) -> Response:
    """GET /contents: the numbers of views by class, room, objects, light, layer and verdict."""
    charts = board_of(request).queries.contents()
    if asks_for_json(request):
        return JSONResponse({title: dict(bars) for title, bars in charts.items()})
    n_views = board_of(request).queries.n_views()
    return page(request, "contents.html", charts=charts, n_views=n_views)


def progress(request: Request) -> Response:
    """GET /progress: progress of reading the root as JSON; "" at the end."""
    now = board_of(request).refresher.progress
    return JSONResponse({"text": now.text, "fault": bool(now.fault)})
