"""Login, logout and static files. Effects: opens and ends sessions."""

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
    """POST /login: opens a session for a valid token."""
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
    """POST /logout: ends the session."""
    board_of(request).sessions.close(request.scope.get("session", ""))
    answer = RedirectResponse("/", 303)
    answer.delete_cookie(COOKIE)
    return answer


def asset(request: Request) -> Response:
    """GET /static/NAME: a file of the package from a table; 304 if the browser has it.

    Addresses with the current version are cached for a year.
    """
    file = board_of(request).assets.get(request.path_params["name"])
    if file is None:
        raise HTTPException(404, "There is no such file.")
    etag = f'"{file.version}"'
    if request.headers.get("if-none-match") == etag:
        return Response(status_code=304, headers={"ETag": etag})
    is_zipped = "gzip" in request.headers.get("accept-encoding", "")
    is_version = request.query_params.get("v") == file.version
    cache = "public, max-age=31536000, immutable" if is_version else "no-cache"
    headers = {"Cache-Control": cache, "Vary": "Accept-Encoding", "ETag": etag}
    if is_zipped:
        headers["Content-Encoding"] = "gzip"
    data = file.zipped if is_zipped else file.data
    return Response(data, media_type=file.content_type, headers=headers)


async def health(_request: Request) -> Response:
    """GET /health: answered even if all threads are busy."""
    return PlainTextResponse("ok\n")
