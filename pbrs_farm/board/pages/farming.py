"""Pages of a farm: live jobs and workers, and actions on them. Effects: controls the farm."""

from __future__ import annotations

import json
import threading
from collections.abc import AsyncIterator, Callable
from dataclasses import asdict
from functools import partial
from typing import TYPE_CHECKING, Any, Final

import anyio
import anyio.to_thread
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import JSONResponse, RedirectResponse, Response, StreamingResponse

from pbrs_farm.board.guard import form_of
from pbrs_farm.board.live_farm import LiveFarm
from pbrs_farm.board.pages.lists import board_of
from pbrs_farm.board.pages.rendering import asks_for_json, page
from pbrs_farm.core.errors import PbrsError

if TYPE_CHECKING:
    from workers.client.farm_client import Farm

_EVERY_S: Final = 2.0  # between reads of the farm for an event stream
_BEAT_S: Final = 15.0  # between keep-alive comments for proxies
_LIFE_S: Final = 3600.0  # maximum life of an event stream; browsers reconnect

# Actions on jobs and workers, with the text of the confirmation.
_OF_JOBS: Final = {
    "pause": "Start no more tasks of this job. Running tasks finish.",
    "resume": "Continue this job.",
    "cancel": "Cancel this job: running tasks are killed, stored results remain.",
    "retry": "Retry every failed task of this job.",
    "priority": "Change the priority of this job: 0 is first, 9 last.",
}
_OF_WORKERS: Final = {
    "drain": "Let this worker finish its tasks and stop.",
    "undrain": "Let this worker accept tasks again.",
}


def live_farm(request: Request) -> LiveFarm:
    """The board's farm; 404 without one."""
    farm = board_of(request).farm
    if farm is None:
        raise HTTPException(404, "This board has no farm: start it with PBRS_REDIS_URL.")
    return farm


def farm(request: Request) -> Response:
    """GET /farm: every job and worker."""
    now = live_farm(request).now()
    if asks_for_json(request):
        return JSONResponse(asdict(now))
    audit = board_of(request).audit.last()
    return page(request, "farm.html", now=now, audit=audit, **_prices(request))


def job(request: Request) -> Response:
    """GET /farm/jobs/JOB: one job."""
    state = live_farm(request).job(request.path_params["job"])
    return page(request, "job.html", found=state, job=state.row["job"], **_prices(request))


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
    """GET /farm/events: changed parts of a page as server-sent events; 503 for too many streams."""
    farm, board = live_farm(request), board_of(request)
    name = request.query_params.get("job", "")[:40]
    if not board.streams.acquire(blocking=False):
        raise HTTPException(503, "Too many pages are open.")
    answer = StreamingResponse(
        _stream(partial(_farm_parts, request, farm, name), board.ending, board.streams.release),
        media_type="text/event-stream",
    )
    answer.headers["Cache-Control"] = "no-store"
    return answer


async def _stream(
    parts: Callable[[], dict[str, str]], ending: threading.Event, release: Callable[[], None]
) -> AsyncIterator[bytes]:
    """An event for each change of parts(), and comments between them."""
    sent: dict[str, str] = {}
    silent_s = lived_s = 0.0
    try:
        yield b"retry: 3000\n\n"
        while lived_s < _LIFE_S and not ending.is_set():
            now = await anyio.to_thread.run_sync(parts)
            changed = {k: v for k, v in now.items() if sent.get(k) != v}
            sent = now
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
    """Id of an element -> its present HTML."""
    templates, prices = board_of(request).templates, _prices(request)
    may = request.scope.get("may_change", False)
    if not job:
        now = farm.now()
        render = templates.get_template("farm_part.html").render
        return {"farm": render(now=now, may_change=may, **prices)}
    try:
        state = farm.job(job)
    except PbrsError as error:
        return {"job-fault": str(templates.from_string("{{ text }}").render(text=str(error)))}
    render = templates.get_template("job_part.html").render
    return {"job": render(found=state, may_change=may, job=job, **prices), "job-fault": ""}


def confirm(request: Request) -> Response:
    """GET /farm/confirm?what=pause&job=JOB: confirmation of an action; 404 for an unknown one.

    Every button leads here first, so that links change nothing.
    """
    live_farm(request)
    action, of = request.query_params.get("what", ""), request.query_params.get("of", "")[:200]
    text = (_OF_JOBS | _OF_WORKERS).get(action)
    to = request.query_params.get("to", "")[:40]
    if text is None or not of or (action == "priority") != bool(to):
        raise HTTPException(404, "There is no such action.")
    back = f"/farm/jobs/{of}" if action in _OF_JOBS and of.isalnum() else "/farm"
    return page(request, "confirm.html", what=action, of=of, to=to, text=text, back=back)


async def steer(request: Request) -> Response:
    """POST /farm/do: do an action and write an audit line; 409 if the farm refuses."""
    farm, board = live_farm(request), board_of(request)
    form = await form_of(request)
    action, of, to = form.get("what", ""), form.get("of", "")[:200], form.get("to", "")[:40]
    if action not in _OF_JOBS | _OF_WORKERS or not of:
        raise HTTPException(404, "There is no such action.")
    address = request.client.host if request.client else ""
    user = request.scope.get("user", "")
    note = partial(board.audit.note, address=address, user=user, what=action, of=of)
    try:
        answer = await anyio.to_thread.run_sync(
            lambda: _do(farm.acting_as(user, address), action, of, to)
        )
    except PbrsError as error:
        note(answer=f"refused: {error}")
        return page(request, "message.html", 409, text=str(error))
    note(answer=answer)
    farm.forget()
    return RedirectResponse(f"/farm/jobs/{of}" if action in _OF_JOBS else "/farm", 303)


def _do(farm: Farm, what: str, of: str, to: str) -> str:
    """Do an action on a job or worker; its result for the audit. to: the new priority of a job."""
    from workers.ids import priority_from_text

    if what == "priority":
        before, number = farm.status(of)["priority"], priority_from_text(to)
        farm.set_priority(of, number)
        return f"{before} -> {number}"
    if what == "retry":
        return f"{len(farm.retry(of))} tasks will be retried"
    if what in _OF_JOBS:
        act: dict[str, Callable[[str], str]] = {
            "pause": farm.pause,
            "resume": farm.resume,
            "cancel": farm.cancel,
        }
        return act[what](of)
    farm.drain(of, undo=what == "undrain")
    return "asked"


def _prices(request: Request) -> dict[str, Any]:
    options = board_of(request).options
    return {"price": options.price_per_slot_hour, "currency": options.currency}
