"""Checks of every request before its route: rate, size, host, origin, session.

An ASGI middleware, so that it applies to streams and errors too.
"""

from __future__ import annotations

import ipaddress
import socket
import time
from collections import OrderedDict
from collections.abc import Callable
from http.cookies import CookieError, SimpleCookie
from typing import Any, Final
from urllib.parse import parse_qs, urlsplit

import anyio
import anyio.to_thread
from starlette.datastructures import Headers, MutableHeaders
from starlette.requests import Request
from starlette.responses import PlainTextResponse, RedirectResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from pbrs_farm.board.options import BoardOptions
from pbrs_farm.board.sessions import COOKIE, Sessions

_MAX_ADDRESSES: Final = 4096  # maximum number of remembered addresses
LOGIN: Final = "/login"
HEALTH: Final = "/health"
_READS: Final = ("GET", "HEAD")
_OPEN: Final = ("/static/", HEALTH, LOGIN)  # readable without a token
_CSP: Final = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob:;"
    " connect-src 'self'; form-action 'self'; base-uri 'none'; frame-ancestors 'none'"
)
HEADERS: Final = {
    "Content-Security-Policy": _CSP,
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Referrer-Policy": "same-origin",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Permissions-Policy": "camera=(), microphone=(), geolocation=()",
}


class Buckets:
    """Token buckets per address; used from one thread."""

    def __init__(
        self, per_s: float, burst: float, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._per_s, self._burst, self._clock = per_s, burst, clock
        self._tokens: OrderedDict[str, tuple[float, float]] = OrderedDict()  # tokens, time

    def takes(self, address: str) -> bool:
        """Take a token of the address; False without one.

        The address with the oldest request is forgotten first, and starts with a full bucket again.
        """
        now, tokens = self._clock(), self._filled(address)
        may = tokens >= 1
        self._tokens.pop(address, None)
        self._tokens[address] = (tokens - 1 if may else tokens, now)
        while len(self._tokens) > _MAX_ADDRESSES:
            self._tokens.popitem(last=False)
        return may

    def would_take(self, address: str) -> bool:
        """True if the address has a token."""
        return self._filled(address) >= 1

    def _filled(self, address: str) -> float:
        now = self._clock()
        tokens, since = self._tokens.get(address, (self._burst, now))
        return min(self._burst, tokens + (now - since) * self._per_s)


class Guard:
    """Passes valid requests on, with scope["session"], "" without a token, and scope["user"], "" without
    a token or with the board's own.
    """

    def __init__(self, app: ASGIApp, options: BoardOptions, sessions: Sessions) -> None:
        self._app, self._options, self._sessions = app, options, sessions
        limits = options.limits
        self._rates = Buckets(limits.requests_per_s, limits.burst)
        self._logins = Buckets(limits.logins_per_s, limits.login_burst)
        self._hosts = {"localhost", socket.gethostname().lower(), options.host.lower()}
        self._hosts |= {name.lower() for name in options.allowed_hosts}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Refuse the request, or pass it on."""
        if scope["type"] != "http":
            if scope["type"] == "lifespan":
                await self._app(scope, receive, send)
            return
        answer = await self._refusal(scope, receive)
        if answer is not None:
            await answer(scope, receive, _with_headers(send))
        else:
            receive = _repeated(scope.get("board_body"), receive)
            await self._app(scope, receive, _with_headers(send))

    async def _refusal(self, scope: Scope, receive: Receive) -> Response | None:
        """The refusal of a request, None for a valid one."""
        headers, method, path = Headers(scope=scope), scope["method"], scope["path"]
        address = (scope.get("client") or ("", 0))[0]
        # Health checks have no rate limit.
        if path != HEALTH and not self._rates.takes(address):
            return _text_response(429, "too many requests: wait a little", {"Retry-After": "2"})
        if len(scope["raw_path"]) + len(scope["query_string"]) > self._options.limits.target_bytes:
            return _text_response(414, "the address is too long")
        if not self._is_our_host(headers.get("host", "")):
            return _text_response(400, "unknown host name: pbrs-farm board --allow-host NAME")
        if method not in (*_READS, "POST"):
            return _text_response(
                405, "the board supports GET and POST", {"Allow": "GET, HEAD, POST"}
            )
        # The user has a cookie of a session, or a script sends the token.
        cookie = _cookie(headers.get("cookie", ""))
        user = self._sessions.user_of(cookie) if cookie else None
        session = cookie if user is not None else ""
        scheme, _, word = headers.get("authorization", "").partition(" ")
        is_script = False
        if scheme.lower() == "bearer":
            # Wrong tokens count as wrong logins; after too many, valid ones are refused too.
            if not self._logins.would_take(address):
                return _too_many_tries()
            token_user = await anyio.to_thread.run_sync(self._sessions.user_with, word)
            is_script = token_user is not None
            if not is_script:
                self._logins.takes(address)
            user = user or token_user
        scope["session"], scope["user"] = session, user or ""
        scope["may_change"] = (bool(session) or is_script) and not self._options.is_readonly
        if method in _READS:
            may_read = self._options.is_private or session or is_script
            if may_read or path.startswith(_OPEN):
                return None
            return RedirectResponse(LOGIN, 303)
        return await self._refused_change(scope, receive, session, is_script=is_script)

    async def _refused_change(
        self, scope: Scope, receive: Receive, session: str, *, is_script: bool
    ) -> Response | None:
        headers, path = Headers(scope=scope), scope["path"]
        if not _is_own_page(headers):
            return _text_response(403, "a change must come from the board's own pages")
        is_login = path == LOGIN
        if self._options.is_readonly and not is_login:
            return _text_response(403, "this board was started with --readonly")
        limits = self._options.limits
        try:
            with anyio.fail_after(limits.receive_s):
                body = await _body(receive, limits.body_bytes)
        except TimeoutError:
            return _text_response(408, "the form arrived too late", {"Connection": "close"})
        if body is None:
            return _text_response(413, "the form is too large")
        scope["board_body"] = body
        if is_login:
            if not self._logins.takes((scope.get("client") or ("", 0))[0]):
                return _too_many_tries()
            return None
        if is_script:
            return None
        if not session:
            return _text_response(401, "log in first: /login")
        word = form_values(body).get("form_word", "") or headers.get("x-form-word", "")
        if not self._sessions.is_form_word(session, word):
            return _text_response(403, "the form is of another session: reload the page")
        return None

    def _is_our_host(self, host: str) -> bool:
        """True for names in the options and IP addresses, against DNS rebinding."""
        name = _host_name(host)
        try:
            ipaddress.ip_address(name)
        except ValueError:
            return name in self._hosts
        return True


def _host_name(host: str) -> str:
    try:
        return (urlsplit(f"//{host}").hostname or "").lower()
    except ValueError:
        return ""


def _is_own_page(headers: Headers) -> bool:
    """True if the browser names no other page as the origin."""
    if headers.get("sec-fetch-site", "same-origin") not in ("same-origin", "none"):
        return False
    origin = headers.get("origin")
    return origin is None or urlsplit(origin).netloc.lower() == headers.get("host", "").lower()


def _cookie(text: str) -> str:
    try:
        morsel = SimpleCookie(text[:4096]).get(COOKIE)
    except CookieError:
        return ""
    return morsel.value if morsel is not None else ""


async def _body(receive: Receive, most: int) -> bytes | None:
    """The whole body, None if it is larger than most."""
    body, more = b"", True
    while more:
        message = await receive()
        body += message.get("body", b"")
        if message["type"] == "http.disconnect" or len(body) > most:
            return None
        more = message.get("more_body", False)
    return body


def _repeated(body: bytes | None, receive: Receive) -> Receive:
    """receive, starting with an earlier body."""
    if body is None:
        return receive
    messages: list[Message] = [{"type": "http.request", "body": body, "more_body": False}]

    async def again() -> Message:
        return messages.pop() if messages else await receive()

    return again


def _with_headers(send: Send) -> Send:
    async def sending(message: Message) -> None:
        if message["type"] == "http.response.start":
            headers = MutableHeaders(scope=message)
            for name, value in HEADERS.items():
                headers.setdefault(name, value)
            headers.setdefault("Cache-Control", "no-store")
        await send(message)

    return sending


def _too_many_tries() -> Response:
    return _text_response(429, "too many attempts: wait a minute", {"Retry-After": "60"})


def _text_response(status: int, text: str, headers: dict[str, str] | None = None) -> Response:
    return PlainTextResponse(f"{text}\n", status, headers)


def form_values(body: bytes) -> dict[str, str]:
    """Name -> last value of a form's body; {} if it is not UTF-8 or has more than 64 fields."""
    try:
        fields = parse_qs(body.decode("utf-8"), keep_blank_values=True, max_num_fields=64)
    except ValueError:
        return {}
    return {name: values[-1] for name, values in fields.items()}


async def form_of(request: Request) -> dict[str, str]:
    """The form of a request, whose body the guard has read."""
    body: Any = request.scope.get("board_body") or b""
    return form_values(body)
