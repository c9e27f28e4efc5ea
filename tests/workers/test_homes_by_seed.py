"""Homes by seed on a farm: a worker's tasks write the same files as a run on one machine."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import pbrs_farm as pf
from pbrs_farm.assets import debian, furniture_package, homes_package
from pbrs_farm.core.plugins import Plugin
from pbrs_farm.core.recipe import Recipe, recipe_from_name
from pbrs_farm.run.local import run_local
from pbrs_farm.run.local_run import Run
from pbrs_farm.run.plan import wanted
from pbrs_farm.store import MemoryStore, Store
from tests.workers.redis_server import RedisServer
from tests.workers.small_farm import REAL_RUNNER, SmallFarm
from workers.client.farm_client import completed, new_spec
from workers.house_files import entries_from_arguments, has_own_furniture, needed_plugins
from workers.ids import GEOMETRY, GL, LIGHT, REDUCE, job_key
from workers.job import JobSpec
from workers.node.house_runner import HouseRunner
from workers.runner import TaskRequest

WORDS = ["made:1,rooms=0..1,furniture=none", "made:2,rooms=0..1,furniture=none"]


def small() -> Recipe:
    fields = {
        "image.width_px": "64", "image.height_px": "48", "light.spp": "2", "light.pilot_spp": "0",
        "cameras.cell_m": "1.0", "cameras.score_width_px": "80", "cameras.score_height_px": "60",
    }  # fmt: skip
    return recipe_from_name("preview", fields)


def farmed(store: Store, recipe: Recipe) -> JobSpec:
    """Run every task of a job like two workers, each house by a different one."""
    entries = [entry for entry, _ref in entries_from_arguments(WORDS)]
    houses, spec = completed(entries, new_spec(recipe, n_views=1))
    store.put(job_key(spec.job_id), spec.model_dump_json().encode())
    for house in houses:
        worker = HouseRunner(store, n_threads=1)
        request = TaskRequest(job_id=spec.job_id, house=house.house_id, unit="-", stage=GEOMETRY)
        first = request.model_copy(update={"source": house.source})
        for number, views in enumerate(worker.run(first, lambda _text: None).batches):
            for stage in (GL, LIGHT):
                batch = {"unit": str(number), "stage": stage, "views": views}
                worker.run(request.model_copy(update=batch), lambda _text: None)
        worker.run(request.model_copy(update={"stage": REDUCE}), lambda _text: None)
    return spec


def products(files: dict[str, bytes]) -> dict[str, bytes]:
    """Houses, labels and pictures; no markers, because they hold seconds and names."""
    return {k: v for k, v in files.items() if k.startswith("houses/") and "/done/" not in k}


@pytest.mark.slow
def test_a_farms_pictures_of_homes_by_seed_are_the_same_bytes_as_a_runs(tmp_path: Path) -> None:
    recipe, store = small(), MemoryStore()
    farmed(store, recipe)
    theirs = products({key: store.get(key) for key in store.list("houses/")})
    summary = run_local(Run(WORDS, str(tmp_path), recipe, wanted([], [], 1)))
    assert summary.failures == []
    files = [p for p in tmp_path.rglob("*") if p.is_file()]
    ours = products({str(p.relative_to(tmp_path)): p.read_bytes() for p in files})
    assert sum(key.endswith("mlt_il_ol.png") for key in ours) == len(WORDS)
    assert sorted(ours) == sorted(theirs)
    assert [key for key in ours if ours[key] != theirs[key]] == []


@pytest.mark.chaos
def test_two_workers_of_a_farm_leave_the_bytes_of_a_run(tmp_path: Path) -> None:
    words = [f"made:{k},rooms=0..1,furniture=none" for k in (1, 2, 3, 4)]
    (tmp_path / "redis").mkdir()
    server = RedisServer(tmp_path / "redis")
    server.start()
    farm = SmallFarm(tmp_path, server, runner=REAL_RUNNER, lease_s=60, heartbeat_s=2, resend_s=30)
    try:
        farm.coordinator()
        for worker in ("w1", "w2"):
            farm.worker(worker)
        entries = [entry for entry, _ref in entries_from_arguments(words)]
        farm.job = farm.farm.submit(entries, new_spec(small(), n_views=1)).job_id
        farm.wait_done(500)
        theirs = products(farm.objects())
    finally:
        farm.close()
        server.end()
    summary = run_local(Run(words, str(tmp_path / "run"), small(), wanted([], [], 1)))
    assert summary.failures == []
    files = [p for p in (tmp_path / "run").rglob("*") if p.is_file()]
    ours = products({str(p.relative_to(tmp_path / "run")): p.read_bytes() for p in files})
    assert sum(key.endswith("mlt_il_ol.png") for key in ours) == len(words)
    assert ours == theirs


@pytest.mark.long
def test_a_worker_without_the_furniture_takes_it_from_the_store_for_a_made_home(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PBRS_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(homes_package, "cached", object)
    ((entry, empty),) = entries_from_arguments(["made:2,furniture=none"])
    furnished = empty.model_copy(update={"location": "made:2"})
    assert (has_own_furniture(empty), has_own_furniture(furnished)) == (False, True)
    # b"deb" is no package, so the generated home has no furniture.
    monkeypatch.setattr("workers.node.house_runner.has_own_furniture", lambda _source: True)
    name = f"{furniture_package.PACKAGE}_{furniture_package.TESTED_VERSION}_all.deb"
    store = MemoryStore()
    store.put(f"jobs/sources/{name}", b"deb")
    _houses, spec = completed([entry], new_spec(small(), modes=("opengl_dl",)))
    store.put(job_key(spec.job_id), spec.model_dump_json().encode())
    request = TaskRequest(
        job_id=spec.job_id, house=entry.house_id, unit="-", stage=GEOMETRY, source=entry.source
    )
    HouseRunner(store, n_threads=1).run(request, lambda _text: None)
    assert (debian.cache_folder() / name).read_bytes() == b"deb"
    assert json.loads(store.get(f"houses/{entry.house_id}/house.json"))["source"]["kind"] == "made"


class _Entry:
    """An entry point that loads a function of this module."""

    def load(self) -> object:
        return _without_sofa


def _without_sofa(seed: int) -> pf.Home:
    return pf.load("builtin").without("sofa" if seed == 1 else "bed")


@pytest.mark.long
def test_homes_of_a_plugin_are_made_on_workers(monkeypatch: pytest.MonkeyPatch) -> None:
    plugin = Plugin("homes", "two", "lab", "1.0", _Entry())  # type: ignore[arg-type]
    monkeypatch.setattr(
        "pbrs_farm.core.plugins.plugins", lambda group: {"two": plugin} if group == "homes" else {}
    )
    monkeypatch.setattr("tests.workers.test_homes_by_seed.WORDS", ["plugin:two,1", "plugin:two,2"])
    store = MemoryStore()
    farmed(store, small())
    houses = {
        key: json.loads(store.get(key))
        for key in store.list("houses/")
        if key.count("/") == 2 and key.endswith("/house.json")
    }
    # A removed item leaves its place empty, so that no instance id shifts.
    names = [
        {item["name"] for item in house["items"] if item["surfaces"]} for house in houses.values()
    ]
    assert ["sofa" in name for name in names] == [False, True]
    refs = [ref for _entry, ref in entries_from_arguments(["plugin:two,1"])]
    assert needed_plugins(refs, small(), ()) == ("two of lab 1.0",)
