"""Homes, their variants and the user's libraries are sent to the workers."""

from __future__ import annotations

from pathlib import Path

import pytest

from pbrs_farm.assets import debian, furniture_package, homes_package
from pbrs_farm.core import keys
from pbrs_farm.core.recipe import recipe_from_name
from pbrs_farm.prepare.source_ref import SourceRef
from pbrs_farm.store import MemoryStore
from tests.assets.debs import write_deb
from workers.house_files import (
    entries_from_arguments,
    fill_cache,
    local_catalogue,
    placed_catalogue,
    upload,
)
from workers.node.house_runner import HouseRunner
from workers.runner import TaskRequest


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("PBRS_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


def test_each_home_goes_out_once_dressed_by_each_seed():
    entries = entries_from_arguments(["builtin"], (1, 2))
    assert [entry.house_id[-3:] for entry, _ref in entries] == ["-d1", "-d2"]
    assert [SourceRef.model_validate_json(e.source).dress_seed for e, _ref in entries] == [1, 2]


def test_the_variants_of_a_home_share_one_file_in_the_store(tmp_path: Path):
    path = tmp_path / "home.sh3d"
    path.write_bytes(b"not looked into")
    ref = SourceRef(
        kind="sweethome3d", location=str(path), house_id="home-1", sha256="0", companions=""
    )
    variants = [
        ref.model_copy(update={"house_id": f"home-1-d{n}", "dress_seed": n}) for n in (1, 2)
    ]
    store = MemoryStore()
    upload(store, variants)
    homes = [key for key in store.list("jobs/sources/") if key.endswith(".sh3d")]
    assert homes == ["jobs/sources/home-1/home.sh3d"]


def test_a_users_library_travels_by_its_content_and_no_path_does(tmp_path: Path, cache: Path):
    library = tmp_path / "mine.sh3f"
    library.write_bytes(b"models")
    (key,) = placed_catalogue(f"{library}")
    assert str(tmp_path) not in key
    store = MemoryStore()
    store.put(key, library.read_bytes())
    recipe = recipe_from_name("fast", {"dress.catalogue": f'"generated:{key}"'})
    words = local_catalogue(store, recipe).dress.catalogue.split(":")
    assert words[0] == "generated"
    assert Path(words[1]).read_bytes() == b"models"
    assert Path(words[1]).name == "mine.sh3f"
    # The library's path does not change the output.
    assert local_catalogue(store, recipe).digest("read") == recipe.digest("read")


def test_a_worker_takes_the_furniture_of_a_dressed_house_from_the_store(
    cache: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(homes_package, "cached", object)
    name = f"{furniture_package.PACKAGE}_{furniture_package.TESTED_VERSION}_all.deb"
    store = MemoryStore()
    store.put(f"jobs/sources/{name}", b"deb")
    fill_cache(store)
    assert not (debian.cache_folder() / name).exists()
    fill_cache(store, with_furniture=True)
    assert (debian.cache_folder() / name).read_bytes() == b"deb"


def test_an_unpacked_package_travels_to_the_workers(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setenv("PBRS_CACHE", str(tmp_path / "here"))
    (tmp_path / "here").mkdir()
    name = f"{homes_package.PACKAGE}_{homes_package.TESTED_VERSION}_all.deb"
    write_deb(tmp_path / "here" / name, {homes_package.JAR: b"a jar"})
    package, store = homes_package.fetch(), MemoryStore()
    ref = SourceRef(kind="example", location="Studio", house_id="s", sha256="0", companions="")
    upload(store, [ref])
    assert not any(key.endswith(".deb") for key in store.list("jobs/sources/"))
    monkeypatch.setenv("PBRS_CACHE", str(tmp_path / "there"))
    fill_cache(store)
    there = homes_package.cached()
    assert there is not None
    assert there.label == package.label
    assert there.jar.read_bytes() == b"a jar"


def test_a_worker_dresses_the_variant_that_its_task_names(monkeypatch: pytest.MonkeyPatch):
    from workers.client.farm_client import completed, new_spec
    from workers.ids import GEOMETRY, job_key

    ((entry, _ref),) = entries_from_arguments(["builtin"], (2,))
    recipe = recipe_from_name(
        "preview",
        {"dress.catalogue": "generated", "cameras.cell_m": "1", "cameras.score_width_px": "80",
         "cameras.score_height_px": "60", "dress.clutter": "0", "dress.textiles": "0",
         "surroundings.kind": "none"},
    )  # fmt: skip
    _houses, spec = completed([entry], new_spec(recipe, modes=("opengl_dl",)))
    store = MemoryStore()
    store.put(job_key(spec.job_id), spec.model_dump_json().encode())
    request = TaskRequest(
        job_id=spec.job_id, house=entry.house_id, unit="-", stage=GEOMETRY, source=entry.source
    )
    HouseRunner(store, n_threads=1).run(request, lambda _text: None)
    assert store.head(keys.house_key(entry.house_id, keys.DRESS)) is not None


def test_made_homes_put_no_file_into_the_store(cache: Path):
    # The package is in the cache of each machine, or is uploaded to the store.
    words = [f"made:{seed},furniture=none" for seed in range(1, 4)]
    # An empty home needs no package, even if it is cached.
    cache.mkdir(parents=True, exist_ok=True)
    (cache / f"{furniture_package.PACKAGE}_1.8-1_all.deb").write_bytes(b"deb")
    entries = entries_from_arguments(words)
    assert [SourceRef.model_validate_json(e.source).location for e, _ref in entries] == words
    store = MemoryStore()
    upload(store, [ref for _entry, ref in entries])
    assert list(store.list("")) == []


def test_a_worker_makes_the_home_that_was_submitted(cache: Path, tmp_path: Path):
    from pbrs_farm.core.recipe import Recipe
    from pbrs_farm.prepare.read_source import read_house

    ((entry, ref),) = entries_from_arguments(["made:2,furniture=none"])
    local_house = read_house(ref, Recipe().read)
    worker_house = read_house(SourceRef.model_validate_json(entry.source), Recipe().read)
    assert worker_house.id == local_house.id == entry.house_id
    assert [item.id for item in worker_house.items] == [item.id for item in local_house.items]
