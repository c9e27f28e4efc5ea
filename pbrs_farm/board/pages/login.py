"""The page that asks for the token, and the board's own files. Effects: opens and ends sessions."""

from __future__ import annotations

import anyio.to_thread
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import PlainTextResponse, RedirectResponse, Response

from pbrs_farm.board.guard import form_of
from pbrs_farm.board.pages.lists import board_of
from pbrs_farm.board.pages.rendering import page
from pbrs_farm.board.sessions import COOKIE


def login(request: Request) -> Response:
    """GET /login: the form."""
    return page(request, "login.html", fault="")


async def log_in(request: Request) -> Response:
    """POST /login: a session for who shows the token."""
    board = board_of(request)
    form = await form_of(request)
    token = form.get("token", "").strip()
    user = await anyio.to_thread.run_sync(board.sessions.user_with, token)
    if user is None:
        return page(request, "login.html", 403, fault="That is not the token of this board.")
    answer = RedirectResponse("/", 303)
    answer.set_cookie(
        COOKIE,
        board.sessions.open(user),
        max_age=12 * 3600,
        httponly=True,
        samesite="strict",
        secure=request.url.scheme == "https",
    )
    return answer


async def log_out(request: Request) -> Response:
    """POST /logout: the end of the session."""
    board_of(request).sessions.close(request.scope.get("session", ""))
    answer = RedirectResponse("/", 303)
    answer.delete_cookie(COOKIE)
    return answer


def asset(request: Request) -> Response:
    """GET /static/NAME: a file of the package, by its name in a table.

    Answers 304 to a browser that has these bytes; an address with the right version may be kept for
    a year. Names are looked up in a table, so no path can leave the folder.
    """
    found = board_of(request).assets.get(request.path_params["name"])
    if found is None:
        raise HTTPException(404, "There is no such file.")
    # Answer 304 to a browser that has these bytes.
    etag = f'"{found.version}"'
    if request.headers.get("if-none-match") == etag:
        return Response(status_code=304, headers={"ETag": etag})
    is_zipped = "gzip" in request.headers.get("accept-encoding", "")
    # An address with the right version never changes.
    is_version = request.query_params.get("v") == found.version
    cache = "public, max-age=31536000, immutable" if is_version else "no-cache"
    headers = {"Cache-Control": cache, "Vary": "Accept-Encoding", "ETag": etag}
    if is_zipped:
        headers["Content-Encoding"] = "gzip"
    data = found.zipped if is_zipped else found.data
    return Response(data, media_type=found.content_type, headers=headers)


async def health(_request: Request) -> Response:
    """GET /health: the board answers, even while every thread is busy."""
    return PlainTextResponse("ok\n")
