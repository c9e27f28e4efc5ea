"""A share of each batch from photographs, training only on photographs, and valid judges."""

from __future__ import annotations

import json
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
import torch

from pbrs_farm.cli import main
from pbrs_farm.core.errors import BadInput
from pbrs_farm.store.folder import FolderStore
from pbrs_farm.study.judging.packed_weights import pack_weights
from pbrs_farm.study.training.checkpoint import read_tensors
from pbrs_farm.study.training.mixed_views import MixedViews
from pbrs_farm.study.training.photograph_views import Mix, mix_of
from pbrs_farm.study.training.run_folder import RunFolder
from pbrs_farm.study.training.training_views import ViewArrays
from pbrs_farm.study.training.view_sources import TrainingSource, training_views
from tests.curate.tum_sequence import write_sequence
from tests.inputs.scannet_scenes import write_scene
from tests.study.training.made_views import TINY, small_plan, views
from tests.views.small_roots import fill

pytestmark = pytest.mark.study


@pytest.fixture
def root(tmp_path: Path) -> Path:
    """Nine views of three homes."""
    fill(FolderStore(tmp_path / "root"), {f"home-{k}-00000000": 3 for k in range(3)}, (40, 32))
    return tmp_path / "root"


@pytest.fixture
def sequences(tmp_path: Path) -> Path:
    """Two sequences of three frames each, a wall straight ahead."""
    for name in ("a", "b"):
        folder = write_sequence(tmp_path / "real" / name, [1.0, 3.0, 5.0], [1.0, 3.0, 5.0])
        (folder / "intrinsics.txt").write_text("80 80 45 30")
    return tmp_path / "real"


def _named(n: int, name: str) -> ViewArrays:
    arrays = views(n, small_plan())
    return ViewArrays(tuple(f"{name}/{k}" for k in range(n)), arrays.colour, arrays.targets)


def _mixed() -> MixedViews:
    return MixedViews(_named(7, "home"), ((_named(3, "x"), 0.25), (_named(2, "y"), 0.1)))


def _ids(mixed: MixedViews, steps: range, rows: slice = slice(None)) -> list[list[str]]:
    return [ids for ids, _ in mixed.batches(steps, small_plan(batch="8"), 0, rows)]


def test_each_set_has_its_share_of_the_batches() -> None:
    batches = _ids(_mixed(), range(40))
    assert all(len(ids) == 8 for ids in batches)
    counts = Counter(id.partition("/")[0] for ids in batches for id in ids)
    assert counts == {"x": 80, "y": 32, "home": 208}
    # Every photograph is used equally often, except in the last round.
    taken = Counter(id for ids in batches for id in ids if id.startswith("x"))
    assert set(taken.values()) <= {26, 27}


def test_a_steps_views_do_not_depend_on_earlier_steps_and_processes_share_them() -> None:
    whole = _ids(_mixed(), range(12))
    assert _ids(_mixed(), range(5, 12)) == whole[5:]
    halves = [_ids(_mixed(), range(12), slice(rank, None, 2)) for rank in range(2)]
    for step, ids in enumerate(whole):
        assert sorted(halves[0][step] + halves[1][step]) == sorted(ids)


def test_rows_are_those_of_their_ids() -> None:
    mixed = _mixed()
    x, y = (part for part, _ in mixed.photographs)
    sources = {"home": mixed.views, "x": x, "y": y}
    for ids, arrays in mixed.batches(range(3), small_plan(batch="8"), 0, slice(None)):
        for k, id in enumerate(ids):
            name, _, number = id.partition("/")
            source = sources[name]
            assert isinstance(source, ViewArrays)
            np.testing.assert_array_equal(arrays["colour"][k], source.colour[int(number)])
            np.testing.assert_array_equal(arrays["normal"][k], source.targets["normal"][int(number)])  # fmt: skip


def test_streamed_views_are_mixed_as_those_in_memory(root: Path, sequences: Path) -> None:
    batches = []
    for memory in ("4", "1e-9"):
        plan = small_plan(batch="4", memory_gb=memory, workers="0")
        source = TrainingSource((str(root),), hold_out=frozenset(), mix=(Mix(str(sequences), 0.3),))
        mixed = training_views(source, plan)
        batches.append(list(mixed.batches(range(6), plan, 0, slice(None))))
    for (ids, arrays), (other_ids, expected) in zip(*batches, strict=True):
        assert ids == other_ids
        assert arrays.keys() == expected.keys() == {"colour", "normal", "valid"}
        assert all(np.array_equal(arrays[name], expected[name]) for name in arrays)


def test_a_run_with_photographs_records_them_and_they_may_not_judge(
    root: Path, sequences: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "run"
    words = ["train", "normals", str(root), "--mix", f"{sequences}:0.5:4", "--out", str(out)]
    assert main([*words, "--hold-out", "home-2", *TINY]) == 0
    assert "4 photographs of real, 0.5 of each batch" in capsys.readouterr().out
    record = json.loads((out / "run.json").read_text())
    assert len(record["photographs"][0]["pictures"]) == 4
    assert record["views"]["train"] == 6
    assert "planes fitted to raw depth" in record["truth"]
    # The same files in another folder are the same photographs.
    (tmp_path / "moved").mkdir()
    sequences.rename(tmp_path / "moved/elsewhere")
    assert main(["evaluate", str(out), "--on", str(tmp_path / "moved")]) != 0
    assert "this photograph was used for training" in capsys.readouterr().err
    pack_weights(out, tmp_path / "packed")
    card = (tmp_path / "packed/README.md").read_text()
    assert "4 photographs with depth of real, 0.5 of each batch" in card
    assert str(tmp_path) not in card


def test_photographs_train_without_views_and_scenes_are_held_out(
    sequences: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "run"
    words = ["train", "normals", str(sequences), "--out", str(out), "--hold-out", "b", *TINY]
    assert main([*words, "--views", "2"]) == 0
    record = json.loads((out / "run.json").read_text())
    assert record["views"] == {"train": 2, "held_out": 3}
    assert record["homes"] == {"train": ["a"], "held_out": ["b"]}
    assert record["mode"] == "photographs"
    # They judge a run, and a run is tuned on others.
    tuned = tmp_path / "tuned"
    words = ["train", "normals", str(sequences), "--out", str(tuned), "--init", str(out)]
    assert main([*words, "--hold-out", "b", *TINY, "--set", "steps=1"]) == 0
    assert json.loads((tuned / "run.json").read_text())["init"] == str(out)
    capsys.readouterr()
    words = ["train", "normals", str(sequences), "--out", str(tmp_path / "x"), "--hold-out", "a", "b"]  # fmt: skip
    assert main([*words, *TINY]) != 0
    assert "all its scenes are held out" in capsys.readouterr().err


def test_labels_of_scannet_train_with_views(root: Path, tmp_path: Path) -> None:
    write_scene(tmp_path / "scans/s0", "intrinsics_depth.txt")
    # A scene without labels cannot judge classes.
    write_scene(tmp_path / "scans/s1", "intrinsics_depth.txt", label=False)
    plan = small_plan("segmentation", batch="4")
    source = TrainingSource((str(root),), hold_out=frozenset(), mix=(Mix(str(tmp_path / "scans"), 0.25),))  # fmt: skip
    mixed = training_views(source, plan)
    ids, arrays = next(mixed.batches(range(1), plan, 0, slice(None)))
    assert ids[0] == "s0/000100"
    assert set(np.unique(arrays["labels"][0])) == {1, 5}
    write_scene(tmp_path / "none/s1", "intrinsics_depth.txt", label=False)
    with pytest.raises(BadInput, match="only normals and depth, not segmentation"):
        training_views(TrainingSource((str(root),), mix=(Mix(str(tmp_path / "none"), 0.2),)), plan)


@pytest.mark.parametrize("word", ["/my/rgbd", "/my/rgbd:", "/my:1", "/my:0", "/my:0.2:x"])
def test_a_mixture_is_a_folder_and_a_share(word: str) -> None:
    with pytest.raises(BadInput, match="--mix"):
        mix_of(word)


def test_a_folders_name_may_hold_a_colon() -> None:
    assert mix_of("/my/rgbd:0.2") == Mix("/my/rgbd", 0.2)
    assert mix_of(r"C:\rgbd:.25:80") == Mix(r"C:\rgbd", 0.25, 80)


def test_shares_leave_something_to_the_views(root: Path, sequences: Path) -> None:
    mix = (Mix(str(sequences), 0.6), Mix(str(sequences), 0.4))
    with pytest.raises(BadInput, match="must sum to less than 1"):
        training_views(TrainingSource((str(root),), mix=mix), small_plan())


def test_a_run_starts_from_the_packages_weights_or_reports_a_mismatch(
    root: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["train", "normals", str(root), "--hold-out", "none", "--init", "shipped", *TINY]
    out = tmp_path / "lite"
    assert main([*words, "--plan", "lite", "--set", "rate=0", "--out", str(out)]) == 0
    shipped = Path(json.loads((out / "run.json").read_text())["init"])
    tensors = [read_tensors(RunFolder(folder).weights)[0] for folder in (out, shipped)]
    # At a rate of 0 the weights are the shipped ones, in full floats.
    name = "model.encoder.stem.0.weight"
    assert torch.equal(tensors[0][name], tensors[1][name].float())
    capsys.readouterr()
    assert main([*words, "--out", str(tmp_path / "tiny")]) != 0
    assert "this network" in capsys.readouterr().err
