"""Third-party libraries with our files and figures: webdataset, datasets, mlcroissant,
torchmetrics, pycocotools.
"""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import pytest
import torch

from pbrs_farm.core.house_split import SplitShares
from pbrs_farm.export.masks import compressed_runs
from pbrs_farm.store.folder import FolderStore
from pbrs_farm.study.metrics.confusion import Confusion
from pbrs_farm.views.open_views import open_views
from pbrs_farm.views.packing.pack_shards import pack
from pbrs_farm.views.packing.packing_plan import Packing
from pbrs_farm.views.view_sample import LAYERS
from tests.views.small_roots import MODES, arrays_of_view, fill

pytestmark = pytest.mark.study


def test_webdataset_reads_every_view_with_all_its_bits(tmp_path: Path) -> None:
    import webdataset

    fill(FolderStore(tmp_path / "root"), {"home-0-00000000": 3, "home-1-00000000": 2})
    packing = Packing(layers=LAYERS, modes=MODES, views_per_shard=4)
    pack(open_views(tmp_path / "root"), tmp_path / "shards", packing)
    tars = [str(tar) for tar in sorted((tmp_path / "shards").glob("*.tar"))]
    assert len(tars) == 2
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # warnings of the library itself
        read = list(webdataset.WebDataset(tars, shardshuffle=False).decode("rgb8"))
    assert len(read) == 5
    for sample in read:
        house, _, view = sample["__key__"].partition("__")
        stored = arrays_of_view(1000 * int(house.split("-")[1]) + int(view[-1]))
        assert sample["json"]["house"] == house
        for mode in MODES:
            assert np.array_equal(sample[f"{mode}.png"], stored[f"{mode}.png"])
        # Labels of 16 bits come unchanged, which its picture decoders would not do.
        for part, name in (("normal", "normal"), ("depth", "depth"), ("instance", "instance")):
            array = sample[f"{part}.npz"][name]
            assert array.dtype == np.uint16
            assert np.array_equal(array, stored[f"{name}.png"])
        assert np.array_equal(sample["normal.npz"]["valid"], stored["valid.png"])


@pytest.mark.filterwarnings("ignore")  # warnings of the library itself
@pytest.mark.parametrize("shares", [None, SplitShares(0.5, 0.0, 0.5)])
def test_datasets_loads_a_folder_of_parquet_with_all_its_bits(
    tmp_path: Path, shares: SplitShares | None
) -> None:
    import datasets

    datasets.disable_progress_bars()
    fill(FolderStore(tmp_path / "root"), {f"home-{k}-00000000": 2 for k in range(6)})
    packing = Packing(layers=LAYERS, modes=MODES, shares=shares, views_per_shard=4)
    packed = pack(open_views(tmp_path / "root"), tmp_path / "x", packing, form="parquet")
    cache = str(tmp_path / "cache")
    loaded = datasets.load_dataset(str(tmp_path / "x"), cache_dir=cache)
    assert {name: len(rows) for name, rows in loaded.items()} == packed.n_views
    assert set(loaded) == ({"train"} if shares is None else {"train", "test"})
    for row in (row for rows in loaded.values() for row in rows):
        stored = arrays_of_view(1000 * int(row["house"].split("-")[1]) + int(row["id"][-1]))
        for mode in MODES:
            assert np.array_equal(np.asarray(row[mode]), stored[f"{mode}.png"])
        for name in ("normal", "depth", "instance", "class40"):
            file = "semantic" if name == "class40" else name
            assert np.array_equal(row[name], stored[f"{file}.png"])


@pytest.mark.filterwarnings("ignore")  # warnings of the library itself
def test_labels_are_arrays_of_16_bits_in_the_torch_format_of_datasets(tmp_path: Path) -> None:
    import datasets

    datasets.disable_progress_bars()
    fill(FolderStore(tmp_path / "root"), {"home-0-00000000": 2})
    packing = Packing(layers=LAYERS, modes=MODES)
    pack(open_views(tmp_path / "root"), tmp_path / "x", packing, form="parquet")
    cache = str(tmp_path / "cache")
    rows = datasets.load_dataset(str(tmp_path / "x"), split="train", cache_dir=cache)
    names = ["instance", "class40", "depth", "normal"]
    for row in rows.with_format("torch", columns=[*names, "id"], dtype=torch.uint16):
        stored = arrays_of_view(int(row["id"][-1]))
        for name in names:
            file = "semantic" if name == "class40" else name
            assert row[name].dtype == torch.uint16
            assert np.array_equal(row[name].numpy(), stored[f"{file}.png"])
    # By default `datasets` converts them to int64, the type for losses over classes.
    row = rows.with_format("torch")[0]
    assert (row["class40"].dtype, row["class40"].ndim) == (torch.int64, 2)


@pytest.mark.filterwarnings("ignore")  # warnings of the library itself
def test_mlcroissant_validates_and_reads_the_file_beside_parquet(tmp_path: Path) -> None:
    import mlcroissant

    fill(FolderStore(tmp_path / "root"), {f"home-{k}-00000000": 3 for k in range(6)})
    packing = Packing(layers=LAYERS, modes=MODES, shares=SplitShares(0.5, 0.0, 0.5))
    packed = pack(open_views(tmp_path / "root"), tmp_path / "x", packing, form="parquet")
    dataset = mlcroissant.Dataset(jsonld=str(tmp_path / "x/croissant.json"))
    assert not dataset.metadata.issues.errors
    for split, n_views in packed.n_views.items():
        rows = list(dataset.records(split))
        assert len(rows) == n_views
        for row in rows:
            values = {name.rpartition("/")[2]: value for name, value in row.items()}
            number = values["house"].decode().split("-")[1]
            stored = arrays_of_view(1000 * int(number) + int(values["id"].decode()[-1]))
            assert np.array_equal(np.asarray(values["mlt_il_ol"]), stored["mlt_il_ol.png"])
            normal = np.array([list(map(list, line)) for line in values["normal"]])
            assert np.array_equal(normal, stored["normal.png"])


@pytest.mark.parametrize("seed", range(4))
def test_mean_iou_is_that_of_torchmetrics(seed: int) -> None:
    from torchmetrics.classification import MulticlassJaccardIndex

    dice = np.random.default_rng(seed)
    truth, predicted = dice.integers(0, 41, (60, 80)), dice.integers(1, 41, (60, 80))
    ours = Confusion(40)
    ours.add(predicted, truth)
    theirs = MulticlassJaccardIndex(40, ignore_index=-1)
    value = theirs(torch.from_numpy(predicted - 1), torch.from_numpy(truth - 1))
    assert ours.score().mean_iou == pytest.approx(float(value), abs=1e-6)


@pytest.mark.filterwarnings(
    "ignore:__array__ implementation"
)  # a warning of numpy 2 in the library
@pytest.mark.parametrize("seed", range(4))
def test_pycocotools_reads_compressed_runs(seed: int) -> None:
    from pycocotools import mask as coco

    dice = np.random.default_rng(seed)
    mask = dice.random((37, 53)) < (0.02, 0.3, 0.7, 1)[seed]
    row = compressed_runs(mask)
    assert np.array_equal(coco.decode(row).astype(bool), mask)
    assert coco.encode(np.asfortranarray(mask.astype(np.uint8)))["counts"].decode() == row["counts"]
