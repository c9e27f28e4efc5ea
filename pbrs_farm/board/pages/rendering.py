"""HTML from the board's templates, every value escaped. Effects: reads the templates."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final
from urllib.parse import quote, unquote, urlencode

from jinja2 import Environment, PackageLoader, StrictUndefined
from starlette.requests import Request
from starlette.responses import HTMLResponse

from pbrs_farm.board.index.queries import ListedView
from pbrs_farm.board.pictures import title_of
from pbrs_farm.board.static_files import Asset
from pbrs_farm.core.shown_text import printable, shown
from workers.client.text import duration_text, memory_text

_MAX_PAGES_SHOWN: Final = 2  # linked pages before and after the present one


def environment(static: Mapping[str, Asset]) -> Environment:
    """The templates with links to these assets.

    Text is escaped and made printable, except markupsafe.Markup; an unknown name is an error.
    """

    def asset_url(name: str) -> str:
        return f"/static/{name}?v={static[name].version}"

    env = Environment(
        loader=PackageLoader("pbrs_farm.board", "templates"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        finalize=lambda value: printable(value) if type(value) is str else value,
    )
    env.globals |= {
        "asset_url": asset_url,
        "home_url": home_url,
        "view_url": view_url,
        "thumb_url": thumb_url,
        "page_numbers": page_numbers,
        "title_of": title_of,
        "duration": duration_text,
        "memory": memory_text,
        "confirm_url": confirm_url,
        "log_url": log_url,
    }
    return env


def page(request: Request, template: str, status: int = 200, **values: Any) -> HTMLResponse:
    """A template of board/templates with values and those of every page (root, user, form word)."""
    board = request.app.state.board
    session = request.scope.get("session", "")
    common = {
        "request_path": request.url.path,
        "root_name": shown(_root_name(board.reader.url), 60),
        "progress": board.refresher.progress,
        "may_change": request.scope.get("may_change", False),
        "is_readonly": board.options.is_readonly,
        "has_session": bool(session),
        "form_word": board.sessions.form_word(session) if session else "",
        "has_farm": board.farm is not None,
    }
    html = board.templates.get_template(template).render(common | values)
    return HTMLResponse(html, status)


def asks_for_json(request: Request) -> bool:
    """True for ?format=json, and for a header Accept with JSON and without HTML."""
    accepted = request.headers.get("accept", "")
    is_accepted = "application/json" in accepted and "text/html" not in accepted
    return request.query_params.get("format") == "json" or is_accepted


def _root_name(url: str) -> str:
    """Name of a root: of a folder its last part, without the path on this machine."""
    if url.startswith("file://"):
        return unquote(url.rstrip("/").rpartition("/")[2])
    return url


def home_url(house: str, rest: str = "") -> str:
    """Address of a home's page, or of a file below it."""
    return f"/homes/{quote(house, safe='')}{rest}"


def view_url(house: str, view: str, rest: str = "") -> str:
    """Address of a view's page, or of a file below it."""
    return f"{home_url(house)}/views/{quote(view, safe='')}{rest}"


def thumb_url(view: ListedView, layer: str) -> str:
    """Address of a view's thumbnail, with the version of the house's files."""
    return view_url(view.house, view.id, f"/thumb/{layer}.jpg?v={quote(view.version, safe='')}")


def confirm_url(what: str, of: str) -> str:
    """Address of the confirmation of an action on a job or worker."""
    return f"/farm/confirm?{urlencode({'what': what, 'of': of})}"


def log_url(job: str, task: str) -> str:
    """Address of a task's log."""
    return f"/farm/jobs/{job}/log?{urlencode({'task': task})}"


def page_numbers(number: int, n_pages: int) -> list[int]:
    """Numbers of the linked pages: the first, the last and near ones; 0 = a gap.

    >>> page_numbers(5, 9)
    [1, 0, 3, 4, 5, 6, 7, 0, 9]
    """
    near = range(number - _MAX_PAGES_SHOWN, number + _MAX_PAGES_SHOWN + 1)
    linked = sorted({1, n_pages, *near} & set(range(1, n_pages + 1)))
    numbers: list[int] = []
    for k in linked:
        if numbers and k > numbers[-1] + 1:
            numbers.append(0)
        numbers.append(k)
    return numbers
