from __future__ import annotations

from pathlib import Path

import pytest

from pbrs_farm.core.errors import (
    BadHouse,
    BadInput,
    MachineFailed,
    ObjectMissing,
    StoreFailed,
    StoreRefused,
    StoreUnavailable,
)
from pbrs_farm.core.recipe import recipe_from_name
from pbrs_farm.store import MemoryStore
from workers.client.farm_client import completed, new_spec
from workers.house_files import entries_from_arguments, is_left_in_place
from workers.ids import job_key
from workers.node.faults import class_of, fingerprint, without_numbers
from workers.node.house_runner import HouseRunner
from workers.runner import TaskRequest


@pytest.mark.parametrize(
    ("error", "kind"),
    [
        (BadHouse("f", "p", "m"), "data"),
        (StoreUnavailable("k", "m"), "storage"),
        (StoreRefused("k", "m"), "storage"),
        (StoreFailed("k", "a damaged marker must not stop the farm"), "bug"),
        (ObjectMissing("k", "m"), "bug"),
        (MachineFailed("m"), "machine"),
        (MemoryError(), "resource"),
        (KeyError("x"), "bug"),
    ],
)
def test_errors_have_their_class(error: Exception, kind: str) -> None:
    assert class_of(error) == kind


def test_similar_faults_have_one_fingerprint() -> None:
    first, second = (
        ValueError("view 12 at 0x7f00 in /a/b.png"),
        ValueError("view 7 at 0x10 in /c.png"),
    )
    assert fingerprint(first) == fingerprint(second)
    assert fingerprint(first) != fingerprint(KeyError("view 12"))
    assert len(without_numbers("x" * 1000)) == 160


def test_a_worker_that_does_not_see_a_suncg_folder_is_itself_at_fault(tmp_path: Path) -> None:
    house = tmp_path / "root/house/0a1b"
    house.mkdir(parents=True)
    (house / "house.json").write_text("{}")
    ((entry, ref),) = entries_from_arguments([str(house)])
    assert is_left_in_place(ref)
    store = MemoryStore()
    _houses, job = completed([entry], new_spec(recipe_from_name("preview")))
    store.put(job_key(job.job_id), job.model_dump_json().encode())
    request = TaskRequest(
        job_id=job.job_id, house=entry.house_id, unit="-", stage="geometry", source=entry.source
    )
    (house / "house.json").rename(tmp_path / "moved.json")
    house.rmdir()
    with pytest.raises(MachineFailed, match=r"cannot read .*0a1b") as caught:
        HouseRunner(store, n_threads=1).run(request, lambda _step: None)
    assert class_of(caught.value) == "machine"


def test_a_folder_that_is_no_house_says_what_would_be_one(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match=r"has no house.json"):
        entries_from_arguments([str(tmp_path)])
    (tmp_path / "house").mkdir()
    with pytest.raises(BadInput, match="--houses LIST"):
        entries_from_arguments([str(tmp_path)])
