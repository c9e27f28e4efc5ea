"""Torch datasets of views; tests of order without torch are in test_epoch_order.py."""

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pbrs_farm.core.errors import BadInput
from pbrs_farm.store.folder import FolderStore
from pbrs_farm.views.open_views import open_views
from pbrs_farm.views.packing.pack_shards import pack
from pbrs_farm.views.packing.packing_plan import Packing
from pbrs_farm.views.sample_changes import flip
from pbrs_farm.views.view_sample import LAYERS, SampleRequest
from tests.views.small_roots import MODES, fill

pytestmark = pytest.mark.study
HOUSES = {f"home-{k}-00000000": 4 for k in range(6)}


@pytest.fixture(scope="module")
def places(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """A root of 24 views, and its shards of 5 views."""
    folder = tmp_path_factory.mktemp("study")
    fill(FolderStore(folder / "root"), HOUSES)
    pack(open_views(folder / "root"), folder / "shards", Packing(modes=MODES, views_per_shard=5))
    return folder / "root", folder / "shards"


def ids_of(loader) -> list[list[str]]:
    return [batch["id"] for batch in loader]


def test_tensors_have_the_types_that_training_needs(places):
    import torch

    from pbrs_farm.study.samples.stored_views import StoredViews

    views = StoredViews(places[0], SampleRequest(LAYERS))
    tensors = views[3]
    types = {name: t.dtype for name, t in tensors.items() if isinstance(t, torch.Tensor)}
    assert types == {
        "K": torch.float32, "colour": torch.uint8, "normal": torch.float32, "valid": torch.bool,
        "depth": torch.float32, "class40": torch.uint8, "instance": torch.int32,
        "boundary": torch.bool,
    }  # fmt: skip
    assert tensors["colour"].shape == tensors["normal"].shape == (3, 12, 16)
    assert (tensors["normal"].numpy().transpose(1, 2, 0) == views.sample(3).normal).all()
    assert tensors["id"] == "home-0-00000000/0_0_3"


def test_shards_and_folder_give_equal_tensors(places):
    import torch

    from pbrs_farm.study.samples.sharded_views import ShardedViews
    from pbrs_farm.study.samples.stored_views import StoredViews

    request = SampleRequest(LAYERS, "opengl_dl", axes="published")
    stored = {t["id"]: t for t in StoredViews(places[0], request)}
    packed = {t["id"]: t for t in ShardedViews(places[1], request)}
    assert stored.keys() == packed.keys()
    for id, tensors in stored.items():
        for name, tensor in tensors.items():
            tensor_of_shard = packed[id][name]
            same = (
                torch.equal(tensor, tensor_of_shard)
                if isinstance(tensor, torch.Tensor)
                else tensor == tensor_of_shard
            )
            assert same, (id, name)


def loader_of(place: Path, workers: int, seed: int = 5, rank: int = 0, world: int = 1):
    from pbrs_farm.study.samples.sharded_views import ShardedViews
    from pbrs_farm.study.samples.stored_views import StoredViews
    from pbrs_farm.study.samples.view_loader import ViewLoader

    is_packed = (place / "dataset.json").exists()
    views = ShardedViews(place) if is_packed else StoredViews(place)
    return ViewLoader(views, 3, workers=workers, seed=seed, rank=rank, world=world)


@pytest.mark.parametrize("packed", [False, True])
@pytest.mark.parametrize("workers", [0, 2])
def test_a_loader_resumes_from_its_state(places, packed, workers):
    place = places[packed]
    whole = loader_of(place, workers)
    batches = [*ids_of(whole), *ids_of(whole)]
    assert len(batches) == 2 * len(whole) == 16
    assert batches[:8] != batches[8:]
    # Stop within the first and within the second epoch, and resume with a new loader.
    for n_before in (3, 8, 11):
        first, before = loader_of(place, workers), []
        while len(before) < n_before:
            for batch in first:
                before.append(batch["id"])
                if len(before) == n_before:
                    break
        second = loader_of(place, workers)
        second.load_state_dict(first.state_dict())
        rest = []
        while len(before) + len(rest) < 16:
            rest += ids_of(second)
        assert before + rest == batches


@pytest.mark.parametrize("packed", [False, True])
def test_a_loop_over_the_length_gets_whole_epochs(places, packed):
    whole, counted = loader_of(places[packed], 0), loader_of(places[packed], 0)
    batches = [*ids_of(whole), *ids_of(whole)]
    ids = []
    for _ in range(2):
        epoch = iter(counted)
        ids += [next(epoch)["id"] for _ in range(len(counted))]
    assert ids == batches


@pytest.mark.parametrize("packed", [False, True])
def test_ranks_read_different_views_and_equally_many(places, packed):
    ranks = [ids_of(loader_of(places[packed], 0, rank=r, world=2)) for r in range(2)]
    read = [{id for batch in batches for id in batch} for batches in ranks]
    assert len(read[0]) == len(read[1]) == 12
    assert not read[0] & read[1]


def test_the_seed_decides_the_order(places):
    for place in places:
        first, again, reseeded = (ids_of(loader_of(place, 0, seed=s)) for s in (1, 1, 2))
        assert first == again != reseeded


def test_a_state_of_another_loader_is_refused(places):
    state = loader_of(places[1], 0).state_dict()
    with pytest.raises(BadInput, match="resume: workers: was 0 when the run stopped, is 2"):
        loader_of(places[1], 2).load_state_dict(state)
    with pytest.raises(BadInput, match="resume: seed"):
        loader_of(places[1], 0, seed=6).load_state_dict(state)


def test_fewer_views_than_a_batch_are_told(places):
    with pytest.raises(BadInput, match="24 views are too few for a batch of 3"):
        loader_of(places[0], 0, world=9)


def test_transforms_follow_from_seed_epoch_and_view(places):
    from pbrs_farm.study.samples.sharded_views import ShardedViews

    def by_chance(sample, rng):
        return flip(sample) if rng.random() < 0.5 else replace(sample)

    def colours(n_parts, epoch):
        views = {}
        for rank in range(n_parts):
            shards = ShardedViews(
                places[1], transform=by_chance, rank=rank, world=n_parts, shuffle=False
            )
            shards.start_at(epoch)
            views |= {t["id"]: t["colour"].numpy().tobytes() for t in shards}
        return views

    assert colours(1, 0) == colours(3, 0) != colours(1, 1)


def test_a_split_is_that_of_the_houses(places, tmp_path):
    from pbrs_farm.core.house_split import shares_from_text, split_of_house
    from pbrs_farm.study.samples.stored_views import StoredViews

    shares = shares_from_text("50/25/25")
    views = StoredViews(places[0], split="train", shares=shares)
    assert {split_of_house(v.ref.house, shares) for v in views.views} == {"train"}
    assert len(views) == len(open_views(places[0]).only(split="train", shares=shares))


def test_shards_need_only_torch_and_numpy(places):
    code = f"""
import sys
for name in ("pydantic", "OpenImageIO", "scipy", "pyarrow", "PIL", "obstore", "mitsuba", "rich", "shapely"):
    sys.modules[name] = None
from pbrs_farm.study.samples.sharded_views import ShardedViews
from pbrs_farm.study.samples.view_loader import ViewLoader
loader = ViewLoader(ShardedViews({str(places[1])!r}), 4)
print(sum(len(batch["id"]) for batch in loader))
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (done.stderr, done.stdout) == ("", "24\n")


def test_evaluation_reads_every_view_once_for_any_workers(places):
    from torch.utils.data import DataLoader

    from pbrs_farm.study.samples.sharded_views import ShardedViews

    views = ShardedViews(places[1], shuffle=False)
    read = [id for batch in DataLoader(views, batch_size=4, num_workers=2) for id in batch["id"]]
    assert len(read) == len(set(read)) == 24
    assert np.unique(read).size == 24
