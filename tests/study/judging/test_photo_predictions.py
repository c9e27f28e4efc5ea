"""Predictions of photographs: size and orientation, unreadable files, output files."""

from __future__ import annotations

import io
import json
import os
import shutil
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from pbrs_farm.cli import main
from pbrs_farm.core.classes import NYU13_NAMES
from pbrs_farm.core.errors import BadInput
from pbrs_farm.images import array_from_png, png_from_array
from pbrs_farm.progress import seconds_text
from pbrs_farm.store.folder import FolderStore
from pbrs_farm.study.judging import evaluation
from pbrs_farm.study.judging.evaluation import open_run
from pbrs_farm.study.judging.photo_predictions import (
    network_size,
    photograph_files,
    read_photograph,
    upright,
)
from tests.study.training.made_views import TINY
from tests.views.small_roots import fill

pytestmark = pytest.mark.study


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root, out = (tmp_path_factory.mktemp("predict") / name for name in ("root", "run"))
    fill(FolderStore(root), {f"home-{k}-00000000": 2 for k in range(2)}, (40, 32))
    words = ["train", "normals", str(root), "--out", str(out), "--hold-out", "none", *TINY]
    assert main(words) == 0
    return out


def jpeg(path: Path, colour: np.ndarray, orientation: int = 1) -> Path:
    exif = Image.Exif()
    exif[0x0112] = orientation
    Image.fromarray(colour).save(path, "JPEG", quality=95, exif=exif)
    return path


def test_each_photograph_gets_a_prediction_of_its_size(run: Path, tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    sizes = {"wide": (60, 120), "tall": (130, 50), "same": (96, 128)}
    folder = tmp_path / "photographs"
    folder.mkdir()
    for name, (height, width) in sizes.items():
        picture = rng.integers(0, 256, (height, width, 3)).astype(np.uint8)
        (folder / f"{name}.png").write_bytes(png_from_array(picture))
    out = tmp_path / "out"
    assert main(["predict", str(run), str(folder), "--out", str(out)]) == 0
    for name, size in sizes.items():
        stored = array_from_png((out / f"{name}_normal.png").read_bytes())
        assert stored.dtype == np.uint16
        assert stored.shape[:2] == size
        length = np.linalg.norm(stored / 65535 * 2 - 1, axis=-1)
        np.testing.assert_allclose(length, 1, atol=1e-3)
    rows = json.loads((out / "predictions.json").read_text())
    assert [row["photograph"] for row in rows] == ["same", "tall", "wide"]
    assert (out / "index.html").read_text().count("data:image/jpeg") == 6


def test_thirteen_classes_have_a_separate_layer_and_names(tmp_path: Path) -> None:
    fill(FolderStore(tmp_path / "root"), {"home-0-00000000": 2}, (40, 32))
    words = ["train", "segmentation", str(tmp_path / "root"), "--out", str(tmp_path / "run")]
    assert main([*words, "--hold-out", "none", *TINY, "--set", "n_classes=13"]) == 0
    picture = np.full((48, 64, 3), 90, np.uint8)
    (tmp_path / "room.png").write_bytes(png_from_array(picture))
    out = tmp_path / "out"
    assert (
        main(["predict", str(tmp_path / "run"), str(tmp_path / "room.png"), "--out", str(out)]) == 0
    )
    stored = array_from_png((out / "room_nyu13.png").read_bytes())
    assert stored.shape == (48, 64)
    assert 1 <= stored.min() <= stored.max() <= 13
    (row,) = json.loads((out / "predictions.json").read_text())
    assert set(row["classes"]) <= set(NYU13_NAMES)
    assert "33." not in evaluation.figures_table(
        open_run(tmp_path / "run"), []
    )  # the paper's 40 classes


def test_the_same_picture_turned_by_exif_is_predicted_alike(run: Path, tmp_path: Path) -> None:
    x = np.linspace(0, 255, 64)
    picture = np.stack(np.broadcast_arrays(x[None, :], x[:48, None], 128), -1).astype(np.uint8)
    lying = np.ascontiguousarray(np.rot90(picture))  # a camera held on its side
    files = [jpeg(tmp_path / "upright.jpg", picture), jpeg(tmp_path / "turned.jpg", lying, 6)]
    a, b = (read_photograph(f).colour.astype(int) for f in files)
    assert a.shape == b.shape
    assert np.abs(a - b).mean() < 2


@pytest.mark.parametrize("orientation", range(1, 9))
def test_exif_orientations_are_undone_as_pillow_undoes_them(orientation: int) -> None:
    picture = np.arange(24, dtype=np.uint8).reshape(2, 4, 3)
    file = io.BytesIO()
    exif = Image.Exif()
    exif[0x0112] = orientation
    Image.fromarray(picture).save(file, "PNG", exif=exif)
    from PIL import ImageOps

    expected = np.asarray(ImageOps.exif_transpose(Image.open(file)))
    np.testing.assert_array_equal(upright(picture, orientation), expected)


def test_a_file_that_is_no_picture_is_reported_and_the_others_are_predicted(
    run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    broken = tmp_path / "broken.png"
    broken.write_bytes(b"\x89PNG\r\n\x1a\n nothing")
    good = jpeg(tmp_path / "good.jpg", np.full((40, 60, 3), 128, np.uint8))
    out = tmp_path / "out"
    words = ["predict", str(run), str(broken), str(good), str(tmp_path / "none.jpg")]
    assert main([*words, "--out", str(out)]) == 1
    assert (out / "good_normal.png").exists()
    text = capsys.readouterr().out
    assert "broken.png" in text
    assert "none.jpg" in text


def test_a_folder_without_pictures_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="has no picture"):
        photograph_files([tmp_path])


def test_a_photograph_keeps_its_proportions_in_the_network() -> None:
    assert network_size(480, 640, 160 * 120) == (128, 160)
    assert network_size(4000, 1000, 160 * 120) == (288, 64)
    assert network_size(10, 10_000, 160 * 120) == (32, 4384)
    assert network_size(7, 7, 32 * 32) == (32, 64)


def test_onnx_predicts_like_the_run(run: Path, tmp_path: Path) -> None:
    import onnxruntime
    import torch

    from pbrs_farm.study.judging.evaluation import open_run
    from pbrs_farm.study.training.prediction import network_output, write_onnx

    trained, path = open_run(run), tmp_path / "model.onnx"
    write_onnx(trained.network, trained.plan, path)
    size = trained.plan.height_px, trained.plan.width_px
    colour = torch.rand(1, 3, *size, generator=torch.Generator().manual_seed(1))
    with torch.no_grad():
        expected = network_output(trained.network.eval(), colour, trained.plan).numpy()
    session = onnxruntime.InferenceSession(path)
    output = session.run(["map"], {"colour": colour.numpy()})[0]
    np.testing.assert_allclose(output, expected, atol=1e-4)


def test_a_card_has_the_errors_by_kind_of_surface_and_the_command_of_the_evaluation(
    run: Path, tmp_path: Path
) -> None:
    from pbrs_farm.study.judging.packed_weights import pack_weights

    (tmp_path / "desk").mkdir()
    rgb = np.random.default_rng(0).integers(0, 256, (60, 90, 3)).astype(np.uint8)
    (tmp_path / "desk/1_rgb.png").write_bytes(png_from_array(rgb))
    depth = np.full((60, 90), 2000, np.uint16)
    (tmp_path / "desk/1_depth.png").write_bytes(png_from_array(depth))
    (tmp_path / "desk/intrinsics.json").write_text('{"fx": 80, "fy": 80, "cx": 45, "cy": 30}')
    copy = tmp_path / "copy"
    shutil.copytree(run, copy)
    assert main(["evaluate", str(copy), "--on", f"wall={tmp_path}", "--no-mirror"]) == 0
    card = (pack_weights(copy, tmp_path / "packed").root / "README.md").read_text()
    assert f"pbrs-farm evaluate copy --on wall={tmp_path.name} --no-mirror\n```" in card
    assert "| frontal " in card
    assert str(tmp_path) not in card
    assert "mirrored pictures" not in card
    assert main(["evaluate", str(copy), "--on", f"wall={tmp_path}", "--mirror"]) == 0
    mirrored = (pack_weights(copy, tmp_path / "mirrored").root / "README.md").read_text()
    assert "Predictions of wall are averaged with those of the mirrored pictures." in mirrored
    report = json.loads((copy / "evaluation/evaluation.json").read_text())
    assert report["evaluations"][0]["mirror"]
    assert report["run"]["seconds"] > 0


def test_onnx_is_asked_for_before_the_training(
    run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("pbrs_farm.study.training.prediction.find_spec", lambda _name: None)
    words = ["train", "normals", str(run.parent / "nothing"), "--out", str(tmp_path / "run")]
    assert main([*words, "--export", "onnx"]) == 1
    assert "ONNX needs onnx" in capsys.readouterr().err
    assert not (tmp_path / "run").exists()


def test_packed_weights_predict_like_the_run_and_are_checked_by_their_sha256(
    run: Path, tmp_path: Path
) -> None:
    import torch

    import pbrs_farm
    from pbrs_farm.study.judging.packed_weights import pack_weights
    from pbrs_farm.study.training.prediction import predict

    packed = pack_weights(run, tmp_path / "packed", made_by=("pbrs-farm run home",))
    whole, half = open_run(run), open_run(packed.root)
    assert packed.weights.stat().st_size < 0.6 * whole.folder.weights.stat().st_size
    size = whole.plan.height_px, whole.plan.width_px
    colour = np.random.default_rng(0).integers(0, 256, (1, *size, 3)).astype(np.uint8)
    a, b = (next(predict(r.network, colour, r.task, r.plan)) for r in (whole, half))
    assert (a * b).sum(-1).min() > np.cos(np.radians(1))
    card = (packed.root / "README.md").read_text()
    assert half.record["weights_sha256"] in card
    assert "degrees" in card
    seconds = seconds_text(whole.record["seconds"])
    made_by = f"{os.cpu_count()} cores, {seconds}.\n\nMade by:\n\n```\npbrs-farm run home\n"
    assert f"{made_by}pbrs-farm train normals root --out run --hold-out none --set" in card
    assert f"pbrs_farm {pbrs_farm.__version__}, torch {torch.__version__}" in card
    assert str(run.parent) not in card + (packed.root / "run.json").read_text()

    data = bytearray(packed.weights.read_bytes())
    data[-1] ^= 1
    packed.weights.write_bytes(data)
    with pytest.raises(BadInput, match="other bytes than"):
        open_run(packed.root)


def test_weights_that_start_from_a_run_name_it_and_its_training_works(
    run: Path, tmp_path: Path
) -> None:
    fill(FolderStore(tmp_path / "root"), {"home-7-00000000": 2}, (40, 32))
    # As if that run had started from weights trained on photographs.
    first = tmp_path / "first"
    shutil.copytree(run, first)
    record = json.loads((first / "run.json").read_text())
    record["init_origin"]["photographs"] = "ImageNet's"
    (first / "run.json").write_text(json.dumps(record))
    words = ["train", "segmentation", str(tmp_path / "root"), "--out", str(tmp_path / "run")]
    words += ["--hold-out", "none", *TINY, "--init", str(first), "--export", "weights"]
    assert main(words) == 0
    packed = tmp_path / "run" / "packed"
    card = (packed / "README.md").read_text()
    assert "Initial weights: a run of normals" in card
    assert "No photograph was trained on; the initial weights used ImageNet's." in card
    for home in ("home-0-00000000", "home-7-00000000"):
        assert f"home {home}: a person" in card
    assert str(tmp_path) not in (packed / "run.json").read_text()


def test_predict_without_a_photograph_explains_its_use(
    run: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["predict", str(run), "--out", "nowhere"]) == 1
    assert "no photograph given" in capsys.readouterr().err


def test_shipped_weights_are_small_whole_and_have_a_card() -> None:
    from pbrs_farm.study.judging.evaluation import open_run
    from pbrs_farm.study.judging.packed_weights import shipped_run, weights_folder

    tasks = sorted(path.parent.name for path in weights_folder().glob("*/run.json"))
    assert tasks == ["boundaries", "normals", "segmentation"]
    for task in tasks:
        run = open_run(shipped_run(task))  # checks the sha256
        assert run.task.name == task
        assert run.folder.weights.stat().st_size <= 9e6
        card = (run.folder.root / "README.md").read_text()
        assert "## Limits" in card
        assert "CC-BY" in card
        assert "/var/" not in (run.folder.root / "run.json").read_text()
