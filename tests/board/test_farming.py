"""Pages of a farm: live jobs and workers, confirmed changes, and the audit log."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import httpx
import pytest

from pbrs_farm.board.live_farm import LiveFarm
from pbrs_farm.cli import main
from pbrs_farm.core.recipe import recipe_from_name
from tests.board.served import log_in, served
from tests.workers.conftest import config, redis_server
from tests.workers.drive import Drive
from workers.client.farm_client import Farm, new_spec
from workers.client.text import workers_text
from workers.client.users import add_user
from workers.config import FarmConfig
from workers.ids import log_key
from workers.job import HouseEntry
from workers.ledger.task_ledger import Fault
from workers.ledger.worker_registry import Registry

__all__ = ["config", "redis_server"]  # fixtures of the workers' tests

HOUSES = [HouseEntry(house_id=f"h{k}", source="{}") for k in range(3)]
EVIL = "<script>alert(1)</script>"


@pytest.fixture
def farm(config: FarmConfig, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Farm:
    monkeypatch.setenv("PBRS_TEST_CONTROL", str(tmp_path))
    url = (tmp_path / "store").as_uri()
    return Farm(replace(config, runner="tests.workers.fake_runner:runner", store_url=url))


@pytest.fixture
def drive(farm: Farm) -> Drive:
    """A job of three homes: one done, one failed with an untrusted message, one running."""
    job = farm.submit(HOUSES, new_spec(recipe_from_name("preview"))).job_id
    drive = Drive(farm.ledger, farm.spec(job))
    first, second, third = drive.dispatch()
    drive.run(first)
    for attempt in (1, 2, 3):
        text = f"{second}: {EVIL} [reproduce: pbrs-farm step house h1 --out X]"
        fault = Fault("bug", "bug: x", text, worker="w1", attempt=attempt)
        drive.ledger.fail(job, second, drive.claim(second).token, fault, delay_s=0)
        drive.dispatch()
    drive.claim(third)
    Registry(farm.ledger).heartbeat()
    return drive


@pytest.fixture
def client(farm: Farm, drive: Drive, tmp_path: Path) -> Iterator[httpx.Client]:
    with served(farm.config.store_url, tmp_path / "cache", LiveFarm(farm)) as client:
        yield client


def do(client: httpx.Client, what: str, of: str, **more: str) -> httpx.Response:
    """Confirm a change from its page."""
    html = client.get("/farm/confirm", params={"what": what, "of": of, **more}).text
    match = re.search(r'name="form_word" value="([0-9a-f]{64})"', html)
    word = match[1] if match else ""
    return client.post("/farm/do", data={"form_word": word, "what": what, "of": of, **more})


def test_jobs_and_workers_are_listed_with_their_tasks(client: httpx.Client, drive: Drive) -> None:
    html = client.get("/farm").text
    now = client.get("/farm?format=json").json()
    assert [row["job"] for row in now["jobs"]] == [drive.job.job_id]
    assert len(now["workers"]) == 1
    assert drive.job.job_id in html
    assert "h2/-/geometry" in html
    assert "w1" in html
    assert "running" in html


def test_the_farm_lists_finished_homes(farm: Farm) -> None:
    job = farm.submit(HOUSES, new_spec(recipe_from_name("preview"))).job_id
    drive, live = Drive(farm.ledger, farm.spec(job)), LiveFarm(farm)
    assert live.finished_houses() == set()
    first, *rest = drive.dispatch()
    drive.run(first)
    drive.run_all()
    assert live.finished_houses() == {first.partition("/")[0]}
    for task in rest:
        drive.run(task)
    drive.run_all()
    assert live.finished_houses() == {"h0", "h1", "h2"}


def test_a_job_shows_stages_and_failures_with_the_command_that_reproduces(
    client: httpx.Client, drive: Drive
) -> None:
    html = client.get(f"/farm/jobs/{drive.job.job_id}").text
    for stage in ("geometry", "gl", "light", "reduce"):
        assert f"<td>{stage}</td>" in html
    assert '<pre class="command">pbrs-farm step house h1 --out X</pre>' in html
    assert "<script>alert" not in html
    assert "&lt;script&gt;alert" in html


def test_cost_is_slot_hours_times_the_operators_price(
    farm: Farm, drive: Drive, tmp_path: Path
) -> None:
    live = LiveFarm(farm)
    (row,) = live.now().jobs
    with served(
        farm.config.store_url, tmp_path / "c2", live, price_per_slot_hour=3600.0, currency="CHF"
    ) as client:
        assert f"{3600 * row['slot_hours']:.2f} CHF" in client.get("/farm").text


def test_a_change_is_requested_confirmed_done_and_logged(
    client: httpx.Client, farm: Farm, drive: Drive, tmp_path: Path
) -> None:
    job = drive.job.job_id
    assert do(client, "pause", job).status_code == 401
    assert farm.view(job).state == "running"
    log_in(client)
    for action, state in (("pause", "paused"), ("resume", "running"), ("cancel", "cancelled")):
        assert do(client, action, job).status_code == 303
        assert farm.view(job).state == state
    (file,) = (tmp_path / "cache").glob("*/audit.jsonl")
    rows = [json.loads(line) for line in file.read_text().splitlines()]
    assert [(r["what"], r["of"], r["answer"]) for r in rows] == [
        ("pause", job, "paused"), ("resume", job, "running"), ("cancel", job, "cancelled"),
    ]  # fmt: skip
    assert rows[0]["address"] == "127.0.0.1"
    assert "paused" in client.get("/farm").text


def test_a_users_changes_need_his_rights_and_are_logged_with_his_name(
    client: httpx.Client, farm: Farm, drive: Drive, tmp_path: Path
) -> None:
    job = drive.job.job_id
    root = add_user(farm, "root", {})
    ann = add_user(farm.acting_as(farm.users.all()["root"], "here"), "ann", {})
    assert log_in(client, "x" * 32).status_code == 403
    log_in(client, ann)
    refused = do(client, "pause", job)
    assert (refused.status_code, farm.view(job).state) == (409, "running")
    assert "is a job of no user" in refused.text
    client.cookies.clear()
    log_in(client, root)
    assert do(client, "pause", job).status_code == 303
    bearer = {"Authorization": f"Bearer {root}"}
    client.cookies.clear()
    assert client.post("/farm/do", data={"what": "resume", "of": job}, headers=bearer).is_redirect
    (file,) = (tmp_path / "cache").glob("*/audit.jsonl")
    rows = [json.loads(line) for line in file.read_text().splitlines()]
    assert [(r["user"], r["what"]) for r in rows] == [
        ("ann", "pause"), ("root", "pause"), ("root", "resume"),
    ]  # fmt: skip
    assert [row["user"] for row in farm.users.changes(2)] == ["root", "root"]


def test_a_priority_is_changed_confirmed_and_kept_for_a_recovery(
    client: httpx.Client, farm: Farm, drive: Drive, tmp_path: Path
) -> None:
    job = drive.job.job_id
    assert do(client, "priority", job, to="1").status_code == 401
    log_in(client)
    assert "<option selected>5</option>" in client.get(f"/farm/jobs/{job}").text
    assert do(client, "priority", job, to="1").status_code == 303
    assert farm.view(job).fields["priority"] == "1"
    assert farm.spec(job).priority == 1
    for wrong in ("10", "-1", "x", EVIL):
        assert do(client, "priority", job, to=wrong).status_code == 409
    assert do(client, "priority", job).status_code == 409
    assert farm.view(job).fields["priority"] == "1"
    (file,) = (tmp_path / "cache").glob("*/audit.jsonl")
    row = json.loads(file.read_text().splitlines()[0])
    assert (row["what"], row["of"], row["answer"]) == ("priority", job, "5 -> 1")


def test_a_worker_reports_its_memory(client: httpx.Client, farm: Farm) -> None:
    assert "GB" not in client.get("/farm").text
    Registry(farm.ledger).heartbeat(memory_mb=1536.0)
    assert re.search(r"1\.5 of [\d.]+ GB", workers_text(farm.workers()))


def test_of_a_job_that_is_over_nothing_is_to_come(farm: Farm, drive: Drive) -> None:
    assert LiveFarm(farm).now().jobs[0]["eta_s"] is not None
    farm.cancel(drive.job.job_id)
    (row,) = LiveFarm(farm).now().jobs
    assert (row["eta_s"], row["slot_hours_left"]) == (None, 0.0)


def test_failed_tasks_are_retried(client: httpx.Client, farm: Farm, drive: Drive) -> None:
    log_in(client)
    assert do(client, "retry", drive.job.job_id).status_code == 303
    assert farm.failures(drive.job.job_id) == []


def test_a_worker_is_drained_and_undrained(client: httpx.Client, farm: Farm) -> None:
    log_in(client)
    for action, state in (("drain", "draining"), ("undrain", "alive")):
        assert do(client, action, "w1").status_code == 303
        assert farm.workers()[0]["state"].startswith(state[:5])
    assert do(client, "drain", EVIL).status_code == 409


@pytest.mark.parametrize(("what", "of"), [("explode", "x"), ("pause", ""), ("drain", "")])
def test_impossible_changes_are_not_offered(what: str, of: str, client: httpx.Client) -> None:
    log_in(client)
    assert client.get("/farm/confirm", params={"what": what, "of": of}).status_code == 404


def test_an_invalid_job_is_refused(client: httpx.Client) -> None:
    assert client.get("/farm/jobs/0123456789ab").status_code == 404
    assert client.get("/farm/jobs/..%2f..").status_code == 404
    assert client.get("/farm/jobs/not-a-job").status_code == 404


def test_a_log_is_text_and_nothing_else(client: httpx.Client, farm: Farm, drive: Drive) -> None:
    job, task = drive.job.job_id, "h1/-/geometry"
    farm.store.put(log_key(job, task, 3), f"line\n{EVIL}\n".encode())
    html = client.get(f"/farm/jobs/{job}/log", params={"task": task}).text
    assert "&lt;script&gt;alert(1)" in html
    assert EVIL not in html
    none = client.get(f"/farm/jobs/{job}/log", params={"task": "../../etc/passwd"})
    assert "not a task" in none.text


def first_event(client: httpx.Client, path: str) -> dict[str, str]:
    with client.stream("GET", path) as answer:
        assert answer.headers["content-type"].startswith("text/event-stream")
        for line in answer.iter_lines():
            if line.startswith("data: "):
                parts: dict[str, str] = json.loads(line.removeprefix("data: "))
                return parts
    raise AssertionError("no event")


def test_pages_receive_changes(client: httpx.Client, drive: Drive) -> None:
    assert "h2/-/geometry" in first_event(client, "/farm/events")["farm"]
    parts = first_event(client, f"/farm/events?job={drive.job.job_id}")
    assert "&lt;script&gt;alert" in parts["job"]
    assert "not in the ledger" in first_event(client, "/farm/events?job=0123456789ab")["job-fault"]


def test_ten_viewers_query_redis_once(
    farm: Farm, drive: Drive, monkeypatch: pytest.MonkeyPatch
) -> None:
    requests: list[str] = []
    live = LiveFarm(farm, clock=lambda: 0.0)
    whole = type(farm).workers
    monkeypatch.setattr(type(farm), "workers", lambda self: requests.append("x") or whole(self))
    for _ in range(10):
        live.now()
    assert requests == ["x"]
    live.forget()
    live.now()
    assert requests == ["x", "x"]


def test_a_silent_farm_is_reported_and_the_root_is_shown(farm: Farm, tmp_path: Path) -> None:
    from pbrs_farm.store.secret import Secret

    away = Farm(replace(farm.config, redis_url=Secret("redis://127.0.0.1:1/0")))
    (tmp_path / "store").mkdir(exist_ok=True)
    with served(farm.config.store_url, tmp_path / "cache", LiveFarm(away)) as client:
        assert "The farm does not answer: no Redis at" in client.get("/farm").text
        assert client.get("/").status_code == 200


def test_a_board_of_a_folder_has_no_farm(root: Path, tmp_path: Path) -> None:
    with served(str(root), tmp_path) as client:
        assert client.get("/farm").status_code == 404
        assert 'href="/farm"' not in client.get("/").text


def test_jobs_is_a_verb(
    farm: Farm, drive: Drive, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("PBRS_REDIS_URL", farm.config.redis_url.reveal())
    monkeypatch.setenv("PBRS_STORE", farm.config.store_url)
    monkeypatch.setenv("PBRS_FARM_PREFIX", farm.config.prefix)
    assert main(["jobs"]) == 0
    assert re.search(rf"{drive.job.job_id}\s+running\s+5\s+preview\s+0/3", capsys.readouterr().out)
    assert main(["priority", "2"]) == 0
    assert capsys.readouterr().out == f"{drive.job.job_id} running, priority 2\n"
    assert main(["jobs", "--json"]) == 0
    (row,) = json.loads(capsys.readouterr().out)
    assert (row["failed"], row["running"], row["houses"], row["priority"]) == (1, 1, 3, 2)
