"""NYUv2's .mat, built in code: tests, tuning, and refused files."""

from __future__ import annotations

import json
from pathlib import Path

import h5py
import numpy as np
import pytest
from scipy.io import savemat

from pbrs_farm.cli import main
from pbrs_farm.core.errors import BadInput
from pbrs_farm.store.folder import FolderStore
from pbrs_farm.study.judging.judged_places import open_judged_place
from pbrs_farm.study.tasks.tasks import task_of
from pbrs_farm.study.training.view_sources import TrainingSource, held_out_views, training_views
from tests.study.training.made_views import TINY, small_plan
from tests.views.small_roots import fill

pytestmark = pytest.mark.study


@pytest.fixture
def mat(tmp_path: Path) -> Path:
    """Three pictures of a wall straight ahead; 1 and 3 judge, 2 trains."""
    rng = np.random.default_rng(0)
    with h5py.File(tmp_path / "nyu.mat", "w") as file:
        file["images"] = rng.integers(0, 256, (3, 3, 640, 480)).astype(np.uint8)
        file["depths"] = np.full((3, 640, 480), 2.5, np.float32)
        file["labels"] = np.full((3, 640, 480), 5, np.uint16)
        instances = np.ones((3, 640, 480), np.uint8)
        instances[:, 320:] = 2
        file["instances"] = instances
    savemat(tmp_path / "splits.mat", {"trainNdxs": [[2]], "testNdxs": [[1], [3]]})
    savemat(tmp_path / "classMapping40.mat", {"mapClass": [np.arange(894) % 40 + 1]})
    return tmp_path / "nyu.mat"


@pytest.mark.parametrize("task", ["normals", "segmentation", "boundaries", "depth"])
def test_pictures_are_cut_to_the_crop_and_the_test_split(task: str, mat: Path) -> None:
    plan = small_plan(task, width_px="160", height_px="120")
    views = open_judged_place(str(mat), plan, mode="mlt_il_ol")
    assert views.ids == ("0001", "0003")
    assert "2 test pictures" in views.truth
    # The crop is 561x427: wider than 4:3 by a few pixels of height.
    assert views.sizes == [(421, 561)] * 2
    prediction = task_of(task).prediction_of(views.truths[0])
    if task == "normals":
        assert views.truths[0]["valid"].mean() > 0.9
        np.testing.assert_allclose(prediction[200, 200], [0, 0, -1], atol=1e-3)
    elif task == "segmentation":
        assert (prediction == 5).all()
    elif task == "depth":
        np.testing.assert_allclose(prediction, 2.5)
    else:
        assert (np.nonzero(prediction.any(0))[0] == 279).all()


def test_raw_depth_judges_and_parts_of_a_scene_are_one_room(mat: Path) -> None:
    filled = open_judged_place(str(mat), small_plan("depth"), mode="mlt_il_ol")
    assert "filled depth along the axis" in filled.truth
    with h5py.File(mat, "a") as file:
        raw = np.full((3, 640, 480), 2.5, np.float32)
        raw[:, 300:320] = 0
        file["rawDepths"] = raw
        names = ("kitchen_0004a", "bath_0001", "kitchen_0004b")
        letters = [np.frombuffer(name.encode(), np.uint8).astype(np.uint16) for name in names]
        refs = [file.create_dataset(f"#refs#/{k}", data=x[:, None]) for k, x in enumerate(letters)]
        table = file.create_dataset("scenes", (1, 3), h5py.ref_dtype)
        table[0] = [row.ref for row in refs]
    views = open_judged_place(str(mat), small_plan("depth"), mode="mlt_il_ol")
    assert "raw depth along the axis" in views.truth
    assert views.rooms == ("kitchen_0004", "kitchen_0004")
    depth = views.truths[0]["depth"]
    assert (depth == 0).mean() == pytest.approx(20 / depth.shape[1])


@pytest.mark.parametrize("task", ["normals", "segmentation", "boundaries", "depth"])
def test_its_train_split_trains_and_its_test_split_is_held_out(task: str, mat: Path) -> None:
    plan, source = small_plan(task), TrainingSource((str(mat),))
    views, held_out = training_views(source, plan), held_out_views(source, plan)
    assert views.ids == ("NYUv2/0002",)
    assert held_out is not None
    assert held_out.ids == ("NYUv2/0001", "NYUv2/0003")
    target = held_out.all_targets()[0]
    if task == "normals":
        assert target["normal"].shape == (32, 40, 3)
        assert (target["normal"][16, 20] == [0, 0, -32767]).all()
    elif task == "segmentation":
        assert (target["labels"] == 5).all()
    elif task == "depth":
        np.testing.assert_allclose(target["depth"], 2.5)
    else:
        # A line of one pixel stays whole at a fourteenth of the size.
        assert target["edges"].any(1).all()
        assert target["edges"].any(0).sum() == 1


def test_a_run_is_tuned_on_it_and_judged_beside_the_papers_tuned_row(
    mat: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    fill(FolderStore(tmp_path / "root"), {"home-0-00000000": 2}, (40, 32))
    root, first, tuned = (str(tmp_path / name) for name in ("root", "first", "tuned"))
    words = ["train", "normals", root, "--hold-out", "none", "--out", first]
    assert main([*words, *TINY]) == 0
    assert main(["train", "normals", str(mat), "--init", first, "--out", tuned, *TINY]) == 0
    record = json.loads((tmp_path / "tuned" / "run.json").read_text())
    assert record["mode"] == "nyuv2"
    assert record["init_origin"]["mode"] == "mlt_il_ol"
    assert record["views"] == {"train": 1, "held_out": 2}
    capsys.readouterr()
    assert main(["evaluate", tuned, "--on", str(mat), "--on", f"home={root}"]) == 0
    text = capsys.readouterr().out
    assert "paper: MLT-IL/OL, then NYUv2, on NYUv2" in text
    assert "21.74" in text
    assert "NYUv2 (2)" in text
    assert "home (2)" in text
    # Without splits.mat the training pictures are unknown.
    (mat.parent / "splits.mat").unlink()
    assert main(["evaluate", tuned, "--on", str(mat)]) == 1
    assert "without splits.mat what trained would judge" in capsys.readouterr().err
    assert main(["evaluate", first, "--on", str(mat)]) == 0


def test_missing_files_for_training_are_named(mat: Path) -> None:
    plan = small_plan()
    with pytest.raises(BadInput, match="NYUv2 cannot be combined"):
        training_views(TrainingSource((str(mat), "root")), plan)
    (mat.parent / "splits.mat").write_bytes(b"no matrix")
    with pytest.raises(BadInput, match="not the expected MATLAB 5 file"):
        training_views(TrainingSource((str(mat),)), plan)
    (mat.parent / "splits.mat").unlink()
    with pytest.raises(BadInput, match=r"splits.mat.*needed beside"):
        training_views(TrainingSource((str(mat),)), plan)
    mat.write_bytes(b"no matrix at all")
    with pytest.raises(BadInput, match="not a MATLAB"):
        open_judged_place(str(mat), plan, mode="mlt_il_ol")
    assert main(["ablation", str(mat), "--out", str(mat.parent / "a")]) == 1


@pytest.mark.parametrize("lacking", ["images", "depths", "labels"])
def test_a_mat_that_lacks_a_table_names_it(lacking: str, mat: Path) -> None:
    with h5py.File(mat, "a") as file:
        del file[lacking]
    with pytest.raises(BadInput, match=lacking):
        open_judged_place(str(mat), small_plan("boundaries"), mode="mlt_il_ol")
