"""Pages of a farm: its jobs and workers, live, and what may be done to them. Effects: steers it."""

from __future__ import annotations

import json
import threading
from collections.abc import AsyncIterator, Callable
from functools import partial
from typing import TYPE_CHECKING, Any, Final

import anyio
import anyio.to_thread
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import RedirectResponse, Response, StreamingResponse

from pbrs_farm.board.guard import form_of
from pbrs_farm.board.live_farm import LiveFarm
from pbrs_farm.board.pages.lists import board_of
from pbrs_farm.board.pages.rendering import page
from pbrs_farm.core.errors import PbrsError

if TYPE_CHECKING:
    from workers.client.farm_client import Farm

_EVERY_S: Final = 2.0  # between two reads of the farm for an event stream
_BEAT_S: Final = 15.0  # between keep-alive comments, without which proxies close an idle stream
_LIFE_S: Final = 3600.0  # an event stream is closed after this; browsers connect again

# What may be done -> whether it is done to a job or a worker, and the words of its question.
_OF_JOBS: Final = {
    "pause": "Start nothing more of this job. What runs, ends.",
    "resume": "Go on with this job.",
    "cancel": "Stop this job for good: what runs is killed, what is stored stays.",
    "retry": "Give every failed task of this job fresh attempts.",
    "priority": "Feed this job by another number: 0 goes first, 9 last.",
}
_OF_WORKERS: Final = {
    "drain": "Let this worker finish what it runs and take nothing more.",
    "undrain": "Let this worker take tasks again.",
}


def live_farm(request: Request) -> LiveFarm:
    """The board's farm; 404 on a board of a folder alone."""
    farm = board_of(request).farm
    if farm is None:
        raise HTTPException(404, "This board shows no farm: start it with PBRS_REDIS_URL.")
    return farm


def farm(request: Request) -> Response:
    """GET /farm: every job and worker."""
    now = live_farm(request).now()
    audit = board_of(request).audit.last()
    return page(request, "farm.html", now=now, audit=audit, **_prices(request))


def job(request: Request) -> Response:
    """GET /farm/jobs/JOB: one job."""
    found = live_farm(request).job(request.path_params["job"])
    return page(request, "job.html", found=found, job=found.row["job"], **_prices(request))


def log(request: Request) -> Response:
    """GET /farm/jobs/JOB/log?task=HOUSE/UNIT/STAGE: the end of a task's log."""
    name, task = request.path_params["job"], request.query_params.get("task", "")[:300]
    try:
        text = live_farm(request).log(name, task)
    except PbrsError as error:
        text = str(error)
    is_part = request.headers.get("hx-request") == "true"
    template = "log_part.html" if is_part else "log.html"
    return page(request, template, job=name, task=task, text=text)


async def events(request: Request) -> Response:
    """GET /farm/events: the parts of a page that changed, as server-sent events.

    503 when so many pages listen already that no stream is left; the stream ends when the board
    does.
    """
    farm, board = live_farm(request), board_of(request)
    name = request.query_params.get("job", "")[:40]
    if not board.streams.acquire(blocking=False):
        raise HTTPException(503, "Too many pages listen already.")
    answer = StreamingResponse(
        _stream(partial(_farm_parts, request, farm, name), board.ending, board.streams.release),
        media_type="text/event-stream",
    )
    answer.headers["Cache-Control"] = "no-store"
    return answer


async def _stream(
    parts: Callable[[], dict[str, str]], ending: threading.Event, release: Callable[[], None]
) -> AsyncIterator[bytes]:
    """An event whenever what parts() says has changed, a comment when long nothing has."""
    said: dict[str, str] = {}
    silent_s = lived_s = 0.0
    try:
        yield b"retry: 3000\n\n"
        while lived_s < _LIFE_S and not ending.is_set():
            now = await anyio.to_thread.run_sync(parts)
            changed = {k: v for k, v in now.items() if said.get(k) != v}
            said = now
            if changed:
                yield f"data: {json.dumps(changed)}\n\n".encode()
                silent_s = 0.0
            elif silent_s >= _BEAT_S:
                yield b": nothing new\n\n"
                silent_s = 0.0
            await anyio.sleep(_EVERY_S)
            silent_s += _EVERY_S
            lived_s += _EVERY_S
    finally:
        release()


def _farm_parts(request: Request, farm: LiveFarm, job: str) -> dict[str, str]:
    """Id of an element -> its HTML now."""
    templates, prices = board_of(request).templates, _prices(request)
    may = request.scope.get("may_change", False)
    if not job:
        now = farm.now()
        render = templates.get_template("farm_part.html").render
        return {"farm": render(now=now, may_change=may, **prices)}
    try:
        found = farm.job(job)
    except PbrsError as error:
        return {"job-fault": str(templates.from_string("{{ text }}").render(text=str(error)))}
    render = templates.get_template("job_part.html").render
    return {"job": render(found=found, may_change=may, job=job, **prices), "job-fault": ""}


def confirm(request: Request) -> Response:
    """GET /farm/confirm?what=pause&job=JOB: asks before anything is done.

    Every button leads here first, so that a link that somebody sends changes nothing. 404 for what
    cannot be done, as for a priority without its value.
    """
    live_farm(request)
    what, of = request.query_params.get("what", ""), request.query_params.get("of", "")[:200]
    text = (_OF_JOBS | _OF_WORKERS).get(what)
    to = request.query_params.get("to", "")[:40]
    if text is None or not of or (what == "priority") != bool(to):
        raise HTTPException(404, "There is nothing to confirm.")
    back = f"/farm/jobs/{of}" if what in _OF_JOBS and of.isalnum() else "/farm"
    return page(request, "confirm.html", what=what, of=of, to=to, text=text, back=back)


async def steer(request: Request) -> Response:
    """POST /farm/do: does it, writes the audit line, and goes back.

    Carries the form's word of its session, which the guard checks before. A refusal of the farm is
    a page with status 409 and is in the audit too.
    """
    farm, board = live_farm(request), board_of(request)
    form = await form_of(request)
    what, of, to = form.get("what", ""), form.get("of", "")[:200], form.get("to", "")[:40]
    if what not in _OF_JOBS | _OF_WORKERS or not of:
        raise HTTPException(404, "There is no such thing to do.")
    address = request.client.host if request.client else ""
    user = request.scope.get("user", "")
    note = partial(board.audit.note, address=address, user=user, what=what, of=of)
    try:
        answer = await anyio.to_thread.run_sync(
            lambda: _do(farm.acting_as(user, address), what, of, to)
        )
    except PbrsError as error:
        note(answer=f"refused: {error}")
        return page(request, "message.html", 409, text=str(error))
    note(answer=answer)
    farm.forget()
    return RedirectResponse(f"/farm/jobs/{of}" if what in _OF_JOBS else "/farm", 303)


def _do(farm: Farm, what: str, of: str, to: str) -> str:
    """Do it to a job or worker; what came of it, for the audit. to: the new priority of a job."""
    from workers.ids import priority_from_text

    if what == "priority":
        before, number = farm.status(of)["priority"], priority_from_text(to)
        farm.set_priority(of, number)
        return f"{before} -> {number}"
    if what == "retry":
        return f"{len(farm.retry(of))} tasks get fresh attempts"
    if what in _OF_JOBS:
        act: dict[str, Callable[[str], str]] = {
            "pause": farm.pause, "resume": farm.resume, "cancel": farm.cancel,
        }  # fmt: skip
        return act[what](of)
    farm.drain(of, undo=what == "undrain")
    return "asked"


def _prices(request: Request) -> dict[str, Any]:
    options = board_of(request).options
    return {"price": options.price_per_slot_hour, "currency": options.currency}
