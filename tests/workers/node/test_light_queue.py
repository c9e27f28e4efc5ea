"""A worker of the queue light.gpu: messages through Celery, its slot, a real render process, real light."""

from __future__ import annotations

import time
from functools import partial
from pathlib import Path

import pytest
from celery import Celery
from celery.contrib.testing.worker import start_worker

from pbrs_farm.core import keys
from pbrs_farm.core.recipe import recipe_from_name
from pbrs_farm.formats.marker import read_marker
from pbrs_farm.raycast.variant import choose_variant
from pbrs_farm.run.processes.child_process import ChildProcess
from pbrs_farm.run.processes.limits import ProcessLimits
from pbrs_farm.run.processes.render_process import RenderProcess
from pbrs_farm.store.folder import FolderStore
from pbrs_farm.store.secret import Secret
from tests.workers.memory_ledger import MemoryLedger, MemoryRegistry
from workers.client.farm_client import completed, new_spec
from workers.config import FarmConfig
from workers.house_files import entries_from_arguments
from workers.ids import GEOMETRY, GL, LIGHT, LIGHT_GPU, job_key, queue_of
from workers.job import JobSpec
from workers.node.house_runner import HouseRunner
from workers.node.renderer import HANDLER
from workers.node.slot import Slot
from workers.queue import task as queued_task
from workers.queue.celery_app import make_app
from workers.runner import TaskRequest

SMALL = {
    "image.width_px": "64", "image.height_px": "48", "light.spp": "4", "light.denoise": "false",
    "cameras.cell_m": "1.0", "cameras.score_width_px": "80", "cameras.score_height_px": "60",
}  # fmt: skip


def labelled(store: FolderStore) -> tuple[JobSpec, str, tuple[str, ...]]:
    """A GPU job of the built-in home, finished up to light: (job, house, its first batch of views)."""
    entries = [entry for entry, _ref in entries_from_arguments(["builtin"])]
    (house,), spec = completed(
        entries, new_spec(recipe_from_name("preview", SMALL), n_views=1, gpu=True)
    )
    store.put(job_key(spec.job_id), spec.model_dump_json().encode())
    runner = HouseRunner(store, n_threads=1)
    ask = partial(TaskRequest, job_id=spec.job_id, house=house.house_id)
    whole = ask(unit="-", stage=GEOMETRY, source=house.source)
    views = runner.run(whole, lambda _step: None).batches[0]
    runner.run(ask(unit="0", stage=GL, views=views), lambda _step: None)
    return spec, house.house_id, views


def queue_in_memory(config: FarmConfig) -> Celery:
    """The farm's Celery application with a broker in this process."""
    app = make_app(config)
    app.conf.update(broker_transport="memory", broker_transport_options={})
    app.steps["worker"].clear()  # removes the heartbeat, which needs Redis
    return app


def lit_by_the_queue(folder: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """The Mitsuba variant that rendered the light task of such a job."""
    store = FolderStore(folder / "store")
    spec, house, views = labelled(store)
    # The render process finds the store through its environment.
    monkeypatch.setenv("PBRS_STORE", store.url)
    monkeypatch.setenv("PBRS_FARM_SCRATCH", str(folder))
    config = FarmConfig(
        redis_url=Secret("memory://"), store_url=store.url, worker="w1", scratch=folder
    )
    task = f"{house}/0/{LIGHT}"
    ledger = MemoryLedger(inputs={task: ",".join(views)})
    process = RenderProcess(partial(ChildProcess, HANDLER, folder / "log.txt"), ProcessLimits())
    slot = Slot(config, ledger, MemoryRegistry(), process)
    monkeypatch.setattr(queued_task, "current_slot", lambda: slot)
    app = queue_in_memory(config)
    # Send to the queue of the stage, like the coordinator; the worker listens to light.gpu only.
    app.send_task(queued_task.RUN, (spec.job_id, task, "r"), queue=queue_of(LIGHT, gpu=spec.gpu))
    give_up = time.monotonic() + 120
    with start_worker(app, queues=[LIGHT_GPU], perform_ping_check=False, shutdown_timeout=60):
        while not (ledger.finished or ledger.faults) and time.monotonic() < give_up:
            time.sleep(0.05)
    process.close()
    assert task in ledger.finished, (ledger.faults, (folder / "log.txt").read_text())
    marker = read_marker(store, keys.marker_key(house, "light", views[0]))
    assert marker is not None
    return str(marker.facts["variant"])


@pytest.mark.slow
def test_a_worker_of_the_gpu_queue_renders_light_on_the_machines_device(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert lit_by_the_queue(tmp_path, monkeypatch) == choose_variant()


@pytest.mark.gpu
def test_a_worker_of_the_gpus_queue_renders_light_on_the_gpu(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert lit_by_the_queue(tmp_path, monkeypatch) == "cuda_ad_rgb"
