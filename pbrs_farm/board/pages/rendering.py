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

_MAX_PAGES_SHOWN: Final = 2  # before and after the one that is shown


def environment(found: Mapping[str, Asset]) -> Environment:
    """The templates; only markupsafe.Markup is not escaped, an unknown name is an error.

    found are the assets that templates may link. Text is escaped, and made printable unless it is
    Markup: names in stored files may hold anything.
    """

    def asset_url(name: str) -> str:
        return f"/static/{name}?v={found[name].version}"

    env = Environment(
        loader=PackageLoader("pbrs_farm.board", "templates"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        finalize=lambda value: printable(value) if type(value) is str else value,
    )
    env.globals |= {
        "asset_url": asset_url, "home_url": home_url, "view_url": view_url, "thumb_url": thumb_url,
        "page_numbers": page_numbers, "title_of": title_of, "duration": duration_text,
        "memory": memory_text, "confirm_url": confirm_url, "log_url": log_url,
    }  # fmt: skip
    return env


def page(request: Request, template: str, status: int = 200, **values: Any) -> HTMLResponse:
    """The template filled with values and what every page shows (root, user, form word).

    template: of board/templates; every value is escaped. status: of HTTP.
    """
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


def _root_name(url: str) -> str:
    """What a root is called: a folder by its own name, as whoever looks needs no path of this machine."""
    if url.startswith("file://"):
        return unquote(url.rstrip("/").rpartition("/")[2])
    return url


def home_url(house: str, rest: str = "") -> str:
    """The address of a home's page, or of what lies below it."""
    return f"/homes/{quote(house, safe='')}{rest}"


def view_url(house: str, view: str, rest: str = "") -> str:
    """The address of a view's page, or of what lies below it."""
    return f"{home_url(house)}/views/{quote(view, safe='')}{rest}"


def thumb_url(view: ListedView, layer: str) -> str:
    """The address of a view's thumbnail; it changes with the house's files, so it can be kept.

    Use it for every link to a thumbnail: an address without the version may show an old picture.
    """
    return view_url(view.house, view.id, f"/thumb/{layer}.jpg?v={quote(view.version, safe='')}")


def confirm_url(what: str, of: str) -> str:
    """The address of the question before something is done to a job or worker."""
    return f"/farm/confirm?{urlencode({'what': what, 'of': of})}"


def log_url(job: str, task: str) -> str:
    """The address of a task's log."""
    return f"/farm/jobs/{job}/log?{urlencode({'task': task})}"


def page_numbers(number: int, n_pages: int) -> list[int]:
    """The numbers of pages that a page links: first, last and those beside it; 0 = a gap.

    >>> page_numbers(5, 9)
    [1, 0, 3, 4, 5, 6, 7, 0, 9]
    """
    near = range(number - _MAX_PAGES_SHOWN, number + _MAX_PAGES_SHOWN + 1)
    wanted = sorted({1, n_pages, *near} & set(range(1, n_pages + 1)))
    numbers: list[int] = []
    for k in wanted:
        if numbers and k > numbers[-1] + 1:
            numbers.append(0)
        numbers.append(k)
    return numbers
