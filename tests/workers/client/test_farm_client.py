"""The farm from outside: submit, status, refused input, metrics, merge."""

from __future__ import annotations

import json
import re
import tracemalloc
import urllib.request
from dataclasses import replace
from pathlib import Path

import pytest

from pbrs_farm.cli import main
from pbrs_farm.core.errors import BadInput, BadRecipe, MachineFailed
from pbrs_farm.core.recipe import recipe_from_name
from pbrs_farm.store import MemoryStore
from pbrs_farm.store.folder import FolderStore
from tests.workers.drive import Drive
from tests.workers.redis_server import free_port
from workers.client.farm_client import Farm, completed, new_spec
from workers.config import FarmConfig
from workers.coordinator.metrics import serve_metrics
from workers.ids import job_key
from workers.job import HouseEntry, JobSpec, lines_from_houses
from workers.ledger.task_ledger import Fault
from workers.node.merging import merge_job, merge_shard

HOUSES = [HouseEntry(house_id=f"h{k}", source="{}") for k in range(3)]


@pytest.fixture
def farm(config: FarmConfig, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Farm:
    monkeypatch.setenv("PBRS_TEST_CONTROL", str(tmp_path))
    return Farm(replace(config, runner="tests.workers.fake_runner:runner"))


def submit(farm: Farm) -> Drive:
    job = farm.submit(HOUSES, new_spec(recipe_from_name("preview")))
    return Drive(farm.ledger, farm.spec(job.job_id))


def test_a_job_submitted_twice_is_one_job(farm: Farm) -> None:
    first = farm.submit(HOUSES, new_spec(recipe_from_name("preview")))
    again = farm.submit(HOUSES[::-1], new_spec(recipe_from_name("preview")))
    assert (first.was, again.was) == ("", "running")
    assert first.job_id == again.job_id == farm.newest_job()
    assert farm.view(first.job_id).n_waiting_houses == 3


def test_a_job_file_that_does_not_fit_is_refused_in_one_line(farm: Farm) -> None:
    key = job_key(job := submit(farm).job.job_id)
    farm.store.put(key, json.dumps(json.loads(farm.store.get(key)) | {"spp": 3}).encode())
    with pytest.raises(BadInput, match=rf"^{key}: spp: no such field") as caught:
        farm.spec(job)
    assert not re.search(r"pydantic|[Ii]nput|\n", str(caught.value))


def test_another_recipe_in_the_same_store_is_refused_with_the_differences(farm: Farm) -> None:
    submit(farm)
    with pytest.raises(BadRecipe, match=r"light\.spp: 10 -> 28"):
        farm.submit(HOUSES, new_spec(recipe_from_name("fast")))
    assert len(farm.jobs()) == 1


def test_status_counts_running_tasks_and_why_explains_waiting_ones(farm: Farm) -> None:
    d = submit(farm)
    tasks = d.dispatch()
    d.run(tasks[0])
    d.claim(tasks[1])
    status = farm.status(d.job.job_id)
    geometry = status["stages"][0]
    assert (geometry["done"], geometry["running"], geometry["queued"]) == (1, 1, 1)
    json.dumps(status)
    (row,) = farm.explain(d.job.job_id, tasks[1])
    assert row["state"] == "running"
    assert row["worker"] == "w1"
    assert farm.explain(d.job.job_id, "h0/a")[0]["views"] == ["a", "b"]
    with pytest.raises(BadInput, match="no such house"):
        farm.explain(d.job.job_id, "nobody")
    with pytest.raises(BadInput, match="no such task or view"):
        farm.explain(d.job.job_id, "h0/zzz")


def test_why_names_the_obstacle_of_a_task(farm: Farm) -> None:
    d = submit(farm)
    job = d.job.job_id
    d.dispatch()

    def because() -> str:
        (row,) = farm.explain(job, "h0")
        return str(row.get("because", ""))

    assert because() == "no worker serves geometry"
    farm.registry.heartbeat()
    assert because() == ""
    assert farm.registry.drain("w1")
    assert because() == "all workers for geometry are stopping"
    farm.registry.open_breaker("disk full")
    assert because() == "storage is unhealthy: disk full"
    farm.pause(job)
    assert because() == "the job is paused: by hand"


def test_equal_failures_are_grouped(farm: Farm) -> None:
    d = submit(farm)
    for number, task in enumerate(d.dispatch()):
        fault = Fault(fault="data", fingerprint="data: wall w#", message=f"wall w{number}")
        farm.ledger.fail(d.job.job_id, task, d.claim(task).token, fault, delay_s=0)
    (kind,) = farm.failures(d.job.job_id)
    assert kind["n"] == 3
    assert kind["tasks"] == ["h0/-/geometry", "h1/-/geometry", "h2/-/geometry"]
    assert len(farm.retry(d.job.job_id)) == 3
    assert farm.failures(d.job.job_id) == []


def test_missing_files_and_jobs_are_one_line(farm: Farm) -> None:
    with pytest.raises(BadInput, match="no job in the ledger"):
        farm.newest_job()
    with pytest.raises(BadInput, match="not in the ledger"):
        farm.status("0" * 12)
    with pytest.raises(BadInput, match="not a job"):
        farm.status("nonsense")
    with pytest.raises(BadInput, match="no such worker"):
        farm.drain("nobody")
    with pytest.raises(MachineFailed, match="no store"):
        _ = Farm(replace(farm.config, store_url="")).store


def test_recover_takes_up_a_cancelled_job(farm: Farm) -> None:
    d = submit(farm)
    d.dispatch()
    farm.cancel(d.job.job_id)
    farm.submit(HOUSES, new_spec(recipe_from_name("preview")))
    assert d.state == "running"
    d.run_all()
    assert d.state == "done"


def test_the_metrics_endpoint_counts_without_naming_houses(farm: Farm) -> None:
    d = submit(farm)
    d.run(d.dispatch()[0])
    port = free_port()
    server, thread = serve_metrics(replace(farm.config, metrics_port=port), farm.ledger)
    try:
        with urllib.request.urlopen(f"http://127.0.0.1:{port}/metrics", timeout=10) as answer:
            text = answer.read().decode()
    finally:
        server.shutdown()
        server.server_close()
        thread.join()
    labels = f'{{job="{d.job.job_id}",stage="geometry"}}'
    assert f"pbrs_tasks_done_total{labels} 1.0" in text
    assert f"pbrs_task_seconds_count{labels} 1.0" in text
    assert "pbrs_up 1.0" in text
    assert "h0" not in text
    deploy = Path(__file__).parents[3] / "deploy"
    files = ("grafana-dashboard.json", "prometheus-alerts.yaml")
    shown = "".join((deploy / name).read_text() for name in files)
    exposed = set(re.findall(r"pbrs_[a-z_]+", shown)) - {"pbrs_farm"}
    documented = set(re.findall(r"^# TYPE (pbrs_[a-z_]+)", text, re.MULTILINE)) | {
        "pbrs_task_seconds_bucket"
    }
    assert len(exposed) > 8
    assert exposed <= documented


def test_merging_upwards_twice_is_the_same_and_lists_missing_houses() -> None:
    store = MemoryStore()
    spec: JobSpec
    houses, spec = completed(HOUSES, new_spec(recipe_from_name("preview"), rules={"shard_size": 2}))
    store.put(job_key(spec.job_id, "houses.jsonl"), lines_from_houses(houses))
    for house in ("h0", "h2", "other"):
        line = json.dumps({"key": f"houses/{house}/house.glb"}) + "\n"
        store.put(f"houses/{house}/manifest.jsonl", line.encode())
    store.put("manifest.jsonl", store.get("houses/other/manifest.jsonl"))
    for _ in range(2):
        merge_shard(store, spec, 0, lambda _step: None)
        merge_job(store, spec, lambda _step: None)
        report = json.loads(store.get(job_key(spec.job_id, "report.json")))
        assert report["houses_missing"] == ["h1"]
        rows = [json.loads(x)["key"] for x in store.get("manifest.jsonl").splitlines()]
        assert rows == [f"houses/{h}/house.glb" for h in ("h0", "h2", "other")]


def test_merging_a_job_holds_a_shard_not_all_of_it(tmp_path: Path) -> None:
    store = FolderStore(tmp_path)
    entries = [HouseEntry(house_id=f"h{k:02d}") for k in range(40)]
    spec: JobSpec
    houses, spec = completed(
        entries, new_spec(recipe_from_name("preview"), rules={"shard_size": 2})
    )
    store.put(job_key(spec.job_id, "houses.jsonl"), lines_from_houses(houses))
    for entry in entries:
        row = json.dumps({"key": f"houses/{entry.house_id}/house.glb", "sha256": "0" * 64}) + "\n"
        store.put(f"houses/{entry.house_id}/manifest.jsonl", row.encode() * 1000)
    for shard in range(20):
        merge_shard(store, spec, shard, lambda _step: None)
    tracemalloc.start()
    merge_job(store, spec, lambda _step: None)
    _now, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    size = len(store.get("manifest.jsonl"))
    assert json.loads(store.get(job_key(spec.job_id, "report.json")))["objects"] == 40_000
    assert size > 4_000_000
    assert peak < size / 4


def test_the_verbs_parse_and_dry_run_touches_nothing(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    words = ["submit", "builtin", "--recipe", "preview", "--dry-run", "--json"]
    assert main([*words, "--store", str(tmp_path / "none")]) == 0
    assert json.loads(capsys.readouterr().out)["houses"] == 1
    assert not (tmp_path / "none").exists()
