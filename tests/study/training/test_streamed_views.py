"""Views read again for each step train like those in memory, from a root and from shards."""

from __future__ import annotations

from pathlib import Path

import pytest
import torch

from pbrs_farm.store.folder import FolderStore
from pbrs_farm.study.training.checkpoint import read_tensors
from pbrs_farm.study.training.run_folder import RunFolder
from pbrs_farm.study.training.streamed_views import StreamedViews
from pbrs_farm.study.training.training_job import Job, train
from pbrs_farm.study.training.training_views import ViewArrays
from pbrs_farm.study.training.view_sources import TrainingSource, held_out_views, training_views
from pbrs_farm.views.open_views import open_views
from pbrs_farm.views.packing.pack_shards import pack
from pbrs_farm.views.packing.packing_plan import Packing
from tests.study.training.made_views import small_plan
from tests.views.small_roots import MODES, fill

pytestmark = pytest.mark.study
HOMES = {f"home-{k}-00000000": 3 for k in range(4)}


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Twelve views of four homes."""
    folder = tmp_path_factory.mktemp("streamed") / "root"
    fill(FolderStore(folder), HOMES, (40, 32))
    return folder


def source_of(place: Path) -> TrainingSource:
    return TrainingSource((str(place),), MODES, hold_out=frozenset({"home-3"}))


def weights_of(place: Path, out: Path, **changed: str) -> dict[str, torch.Tensor]:
    plan = small_plan(**changed)
    source = source_of(place)
    train(Job(plan, out), training_views(source, plan), held_out_views(source, plan))
    return read_tensors(RunFolder(out).weights)[0]


def equal(a: dict[str, torch.Tensor], b: dict[str, torch.Tensor]) -> bool:
    return all(torch.equal(a[name], b[name]) for name in a)


def test_views_that_fit_stay_in_memory(root: Path) -> None:
    n_bytes = 40 * 32 * 10  # colour 3, normal 6, valid 1
    for n_fitting, kind in ((18, ViewArrays), (17, StreamedViews)):
        plan = small_plan(memory_gb=str((n_fitting + 0.5) * n_bytes / 1e9))
        assert isinstance(training_views(source_of(root), plan), kind)


@pytest.mark.parametrize("workers", ["0", "2"])
def test_a_root_streamed_trains_to_the_weights_of_memory(
    root: Path, tmp_path: Path, workers: str
) -> None:
    in_memory = weights_of(root, tmp_path / "kept")
    streamed = weights_of(root, tmp_path / "streamed", memory_gb="0", workers=workers)
    assert equal(in_memory, streamed)
    figures = [RunFolder(tmp_path / name).figures()["network"] for name in ("kept", "streamed")]
    assert figures[0] == figures[1]


def test_streamed_shards_resume_to_the_same_weights_with_other_workers(
    root: Path, tmp_path: Path
) -> None:
    packing = Packing(modes=MODES, views_per_shard=2)
    pack(open_views(root), tmp_path / "shards", packing)
    place = tmp_path / "shards"
    whole = weights_of(place, tmp_path / "whole", memory_gb="0")

    class Stopped(Exception):
        pass

    def stop(row: dict[str, float]) -> None:
        if row["step"] == 5:
            raise Stopped

    plan = small_plan(memory_gb="0")
    views = training_views(source_of(place), plan)
    with pytest.raises(Stopped):
        train(Job(plan, tmp_path / "stopped"), views, observe=stop)
    resumed = weights_of(place, tmp_path / "stopped", memory_gb="0", workers="2")
    assert equal(whole, resumed)


def test_each_view_comes_once_a_round_in_both_lights(root: Path, tmp_path: Path) -> None:
    plan = small_plan(memory_gb="0", batch="6")
    views = training_views(source_of(root), plan)
    read = [id for ids, _ in views.batches(range(3), plan, 0, slice(None)) for id in ids]
    assert sorted(read) == sorted(views.ids)
    assert len(set(read)) == 9
    assert views.homes == tuple(HOMES)[:3]
    assert len(views.decoded(5)) == 5
