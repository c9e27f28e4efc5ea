"""Runs judged on homes and photographs, the verbs, and refused input."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import h5py
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.io import savemat

from pbrs_farm.cli import main
from pbrs_farm.core.errors import BadInput
from pbrs_farm.curate.photographs import PhotoFiles
from pbrs_farm.images import jpeg_from_array, png_from_array
from pbrs_farm.store.folder import FolderStore
from pbrs_farm.study.judging.ablation import ablation_table, hold_out_notes, training_sets
from pbrs_farm.study.judging.evaluation import (
    evaluate,
    evaluation_text,
    mean_interval,
    notes,
    open_run,
    with_others,
)
from pbrs_farm.study.judging.figure_text import is_underfit, markdown, shown_figure, spread_text
from pbrs_farm.study.judging.judged_places import open_judged_place, open_judged_places
from pbrs_farm.study.judging.others_predictions import OthersPredictions, predictions_in
from pbrs_farm.study.judging.paper_figures import PAPER, paper_row
from pbrs_farm.study.photographs import crop_to_size, middle_of_form
from pbrs_farm.study.real_frames import camera_of, room_of
from pbrs_farm.study.sun_rgbd_labels import classes_of_scene
from pbrs_farm.study.tasks.tasks import task_of
from pbrs_farm.study.training.view_sources import TrainingSource, held_out_views, training_views
from pbrs_farm.views.open_views import open_views
from pbrs_farm.views.packing.pack_shards import pack
from pbrs_farm.views.packing.packing_plan import Packing
from tests.curate.tum_sequence import write_sequence
from tests.inputs.scannet_scenes import write_scene
from tests.study.training.made_views import TINY, small_plan
from tests.views.small_roots import fill

pytestmark = pytest.mark.study
SIZE = (40, 32)
HOMES = {f"home-{k}-00000000": 3 for k in range(3)}


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Nine views of three homes."""
    folder = tmp_path_factory.mktemp("study") / "root"
    fill(FolderStore(folder), HOMES, SIZE)
    return folder


@pytest.fixture(scope="module")
def run(root: Path) -> Path:
    """A run of three steps; home-2 is held out."""
    out = root.parent / "run"
    words = ["train", "normals", str(root), "--out", str(out), "--hold-out", "home-2", *TINY]
    assert main(words) == 0
    return out


@pytest.fixture
def pairs(tmp_path: Path) -> Path:
    """A photograph of a wall straight ahead, with depth and intrinsics."""
    rng = np.random.default_rng(0)
    rgb = rng.integers(0, 256, (60, 90, 3)).astype(np.uint8)
    (tmp_path / "wall_rgb.png").write_bytes(png_from_array(rgb))
    depth = np.full((60, 90), 2000, np.uint16)
    depth[:10] = 0
    (tmp_path / "wall_depth.png").write_bytes(png_from_array(depth))
    (tmp_path / "intrinsics.json").write_text('{"fx": 80, "fy": 80, "cx": 45, "cy": 30}')
    return tmp_path


def test_homes_are_held_out_whole(root: Path) -> None:
    plan, source = small_plan(), TrainingSource((str(root),), hold_out=frozenset({"home-2"}))
    assert training_views(source, plan).homes == ("home-0-00000000", "home-1-00000000")
    held_out = held_out_views(source, plan)
    assert held_out is not None
    assert held_out.homes == ("home-2-00000000",)
    assert len(training_views(TrainingSource((str(root),), hold_out=frozenset()), plan)) == 9
    assert (
        len(training_views(TrainingSource((str(root),), hold_out=frozenset(), most=4), plan)) == 4
    )
    with pytest.raises(BadInput, match="no such home"):
        training_views(TrainingSource((str(root),), hold_out=frozenset({"villa"})), plan)


def test_shards_train_as_their_root_does(root: Path, tmp_path: Path) -> None:
    pack(open_views(root), tmp_path / "shards", Packing(modes=("mlt_il_ol",), views_per_shard=4))
    plan, hold_out = small_plan(), frozenset({"home-2"})
    whole, packed = (
        training_views(TrainingSource((str(place),), hold_out=hold_out), plan)
        for place in (root, tmp_path / "shards")
    )
    assert whole.digest() == packed.digest()


def test_the_table_shows_homes_baseline_and_paper_side_by_side(
    run: Path, root: Path, pairs: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["evaluate", str(run), "--on", f"home={root}", "--on", f"photos={pairs}"]
    assert main([*words, "--out", str(run / "e")]) == 0
    text = capsys.readouterr().out
    for column in (
        "training homes (6)",
        "held-out homes (3)",
        "home (3)",
        "photos (1)",
        "mean normal",
    ):
        assert column in text
    assert "paper: MLT-IL/OL, on NYUv2" in text
    assert "27.90" in text
    assert "underfit" in text
    assert "planes fitted to raw depth" in text
    # Random colours teach nothing, so that the held-out home may be judged separately.
    figures = json.loads((run / "e" / "evaluation.json").read_text())
    assert [row["n_views"] for row in figures["evaluations"]] == [3, 1]
    assert set(figures["evaluations"][1]["errors"]) == {"wall"}
    # The photograph's wall is 2 m away and faces the camera; the home's views have depth as well.
    parts = [row["parts"] for row in figures["evaluations"]]
    names = ("network", "mean normal")
    floors = ("floor of the truth", "floor by planes")
    assert parts[1].keys() == {*names, *(f"{name}, large planes" for name in names), *floors}
    assert parts[0].keys() == {"network", "mean normal"}, "rendered truth needs no floor"
    assert {"frontal", "2 to 4 m"} <= parts[1]["mean normal"].keys()
    assert not {"up", "nearer than 2 m"} & parts[1]["mean normal"].keys()
    assert any(" m" in part for part in parts[0]["network"])
    assert "photos: mean, degrees" in text
    page = (run / "e" / "index.html").read_text()
    assert page.count("<figure>") == 4 * 4
    assert "home home-2-00000000: a person" in page


def test_the_interval_of_a_mean_is_that_of_its_normal_law() -> None:
    values = np.random.default_rng(3).normal(30, 4, 200)
    low, high = mean_interval(values.tolist())
    half = 1.645 * values.std() / np.sqrt(200)
    assert low == pytest.approx(values.mean() - half, abs=0.08)
    assert high == pytest.approx(values.mean() + half, abs=0.08)
    assert mean_interval([30.0, 30.0, 30.0]) == (30.0, 30.0)


def test_photographs_of_rooms_are_reported_by_room_with_an_interval(run: Path, pairs: Path) -> None:
    for room in ("kitchen", "bath", "hall"):
        (pairs / room).mkdir()
        for kind in ("rgb", "depth"):
            data = (pairs / f"wall_{kind}.png").read_bytes()
            (pairs / room / f"1_{kind}.png").write_bytes(data)
    trained = open_run(run)
    evaluation = evaluate(trained, open_judged_place(str(pairs), trained.plan, mode="mlt_il_ol"))
    assert set(evaluation.groups) == {"", "bath", "hall", "kitchen"}
    assert any("over its 4 homes or rooms" in line for line in notes(trained, [evaluation]))
    assert evaluation.as_json()["groups"] == evaluation.groups


def write_corner(folder: Path, seed: int) -> NDArray[np.float64]:
    """A noisy photograph of a floor before a wall; its exact normals (120, 160, 3)."""
    folder.mkdir()
    rng = np.random.default_rng(seed)
    columns, rows = np.meshgrid(np.arange(160) + 0.5, np.arange(120) + 0.5)
    rays = np.stack([(columns - 80) / 130, (rows - 60) / 130, np.ones_like(rows)], -1)
    planes = np.array([[0, -0.94, -0.34], [0.6, 0, -0.8]])
    depths = [
        -distance / (rays @ plane) for plane, distance in zip(planes, (1.2, 2.5), strict=True)
    ]
    is_floor = (depths[0] > 0) & (depths[0] < depths[1])
    depth = 1 / (1 / np.where(is_floor, *depths) + rng.normal(0, 0.002, rows.shape))
    depth[:, :30] = 0
    np.save(folder / "1_depth.npy", depth.astype(np.float32))
    rgb = rng.integers(0, 256, (120, 160, 3)).astype(np.uint8)
    (folder / "1_rgb.png").write_bytes(png_from_array(rgb))
    (folder / "intrinsics.json").write_text('{"fx": 130, "fy": 130, "cx": 80, "cy": 60}')
    return np.where(is_floor[..., None], *planes)


def test_a_perfect_network_errs_by_the_floor_of_the_truth_and_not_by_large_planes(
    run: Path, tmp_path: Path
) -> None:
    exact = [write_corner(tmp_path / name, k) for k, name in enumerate(("a_1", "a_2", "b"))]
    (tmp_path / "rooms.json").write_text('{"a_1": "a", "a_2": "a"}')
    trained = open_run(run)
    views = open_judged_place(str(tmp_path), trained.plan, mode="mlt_il_ol")
    evaluation = evaluate(trained, views, mirror=True)
    rows, columns = middle_of_form(120, 160, 40, 32)
    crops = [normal[rows, columns] for normal in exact]
    evaluation = with_others(trained, evaluation, "perfect", crops)
    # The two pictures of room a are wrong by a right angle, that of b is not.
    halves = [np.stack([n[..., 1], -n[..., 0], 0 * n[..., 0]], -1) for n in crops[:2]]
    evaluation = with_others(trained, evaluation, "half", [*halves, crops[2]])
    row = evaluation.as_json()
    means = {name: figures["mean_deg"] for name, figures in row["figures"].items()}
    assert 4 < means["perfect"] < 12
    assert means["floor of the truth"] == pytest.approx(means["perfect"], rel=0.25)
    assert means["perfect, large planes"] < 0.5
    assert means["floor by planes"] == pytest.approx(means["perfect"], rel=0.15)
    assert row["parts"]["perfect, large planes"].keys() >= {"up", "oblique", "2 to 4 m"}
    # A fifth of the width has no depth; the crop's sides are cut.
    measured = np.mean([truth["valid"].mean() for truth in views.truths])
    assert row["measured"] == pytest.approx(measured)
    assert 0.5 < row["on_large_planes"] < row["measured"] < 0.83
    assert row["mirror"]
    errors = evaluation.rows["half"].errors
    assert row["over_rooms"]["half"] == pytest.approx((np.mean(errors[:2]) + errors[2]) / 2)
    assert row["groups"].keys() == {"a", "b"}
    text = evaluation_text(trained, [evaluation])
    by_title = {
        cells[1].strip(): [cell.strip() for cell in cells[2:-1]]
        for cells in (line.split("|") for line in text.splitlines())
        if len(cells) > 2
    }
    titles = by_title[""]
    floor_columns = [titles.index(name) for name in ("floor of the truth", "floor by planes")]
    assert all(by_title["mean, degrees"][k] != "-" for k in floor_columns)
    assert all(by_title["large planes: mean, degrees"][k] == "-" for k in floor_columns)
    # The kinds of surface by large planes are in a second table with other shares of pixels.
    on_planes = text.partition(f"{views.name}, large planes: mean, degrees")[2]
    up = next(line for line in on_planes.splitlines() if line.startswith("| up "))
    assert up.split("|")[2].strip() == f"{100 * row['plane_shares']['up']:.1f} %"
    assert row["plane_shares"]["up"] != row["shares"]["up"]
    assert f"{100 * measured:.0f} % of the pixels measured" in text
    assert "averaged with those of the mirrored pictures" in text


@pytest.mark.parametrize(
    ("layout", "id", "room"),
    [
        ("", "scene0012_00/color/000100", "scene0012"), ("", "scene0012_01/000100", "scene0012"),
        ("", "kitchen_0004/7", "kitchen_0004"), ("", "7", ""),
        ("sun", "kv2/kinect2data/000002_2014-05-26_14-23-37_260595134347_rgbf000103-resize",
         "kv2/kinect2data/000002_2014-05-26_14-23-37_260595134347"),
        ("sun", "kv1/NYUdata/NYU0001", "kv1/NYUdata/NYU0001"),
        ("sun", "xtion/sun3ddata/brown_bm_1/brown_bm_1/000103", "xtion/sun3ddata/brown_bm_1/brown_bm_1"),
    ],
)  # fmt: skip
def test_scans_and_videos_of_a_room_are_one(
    tmp_path: Path, layout: str, id: str, room: str
) -> None:
    picture = tmp_path / id / "image/1.jpg"
    if layout:
        (tmp_path / id / "extrinsics").mkdir(parents=True)
        (tmp_path / id / "intrinsics.txt").write_text("")
    assert room_of(PhotoFiles(id, picture, picture), tmp_path) == room


def test_a_damaged_or_misspelt_list_of_rooms_is_named(pairs: Path) -> None:
    (pairs / "rooms.json").write_text('["kitchen"]')
    with pytest.raises(BadInput, match=r"rooms\.json: expected the room of each folder"):
        open_judged_place(str(pairs), small_plan(), mode="mlt_il_ol")
    # The file is read again after a correction. Pictures have rooms, too.
    (pairs / "rooms.json").write_text('{"wal": "kitchen"}')
    with pytest.raises(
        BadInput, match=r"rooms\.json: wal: no folder of pictures.*did you mean wall"
    ):
        open_judged_place(str(pairs), small_plan(), mode="mlt_il_ol")
    (pairs / "rooms.json").write_text('{"wall": "kitchen"}')
    views = open_judged_place(str(pairs), small_plan(), mode="mlt_il_ol")
    assert views.rooms == ("kitchen",)


def test_photographs_are_judged_at_full_size(pairs: Path) -> None:
    views = open_judged_place(str(pairs), small_plan(), mode="mlt_il_ol")
    # The middle of 90x60 in the aspect 40:32.
    assert views.sizes == [(60, 75)]
    assert views.colour.shape == (1, 32, 40, 3)
    truth = views.truths[0]
    np.testing.assert_allclose(
        truth["normal"][truth["valid"]], [[0, 0, -32767]] * truth["valid"].sum(), atol=40
    )
    assert not truth["valid"][:10].any()
    assert truth["valid"][20:].all()


def test_photographs_without_intrinsics_are_refused(pairs: Path) -> None:
    (pairs / "intrinsics.json").unlink()
    with pytest.raises(BadInput, match="photographs without intrinsics"):
        open_judged_place(str(pairs), small_plan(), mode="mlt_il_ol")
    (pairs / "intrinsics.txt").write_text("80 0 45\n0 81 30\n0 0 1\n")
    assert camera_of(pairs, pairs).K == (80, 81, 45, 30)
    (pairs / "intrinsics.txt").write_text("80 zero")
    with pytest.raises(BadInput, match="expected fx, fy, cx and cy"):
        camera_of(pairs, pairs)


@pytest.mark.parametrize(
    "camera", ["intrinsics_depth.txt", "intrinsic_depth.txt", "intrinsic/intrinsic_depth.txt"]
)
def test_scannets_scenes_are_judged(tmp_path: Path, camera: str) -> None:
    for scene in ("scene0000_00", "scene0001_00"):
        write_scene(tmp_path / scene, camera)
    assert camera_of(tmp_path / "scene0000_00/color", tmp_path).K == (577.87, 577.87, 319.5, 239.5)
    views = open_judged_place(str(tmp_path), small_plan(), mode="mlt_il_ol")
    assert views.ids == ("scene0000_00/000100", "scene0001_00/000100")
    truth = views.truths[0]
    expected = [[0, 0, -32767]] * truth["valid"].sum()
    np.testing.assert_allclose(truth["normal"][truth["valid"]], expected, atol=40)
    # The picture is aligned with its depth: dark on the left, bright on the right.
    colour = views.colour[0].astype(int)
    assert colour[:, :18].max() < 30
    assert colour[:, 22:].min() > 170
    classes = open_judged_place(str(tmp_path), small_plan("segmentation"), mode="mlt_il_ol")
    labels = classes.truths[0]["labels"]
    half = labels.shape[1] // 2
    assert len(np.unique(labels[:, : half - 1])) == len(np.unique(labels[:, half + 1 :])) == 1
    assert labels[0, 0] != labels[0, -1]


def test_scannets_labels_must_be_nyu40s(tmp_path: Path) -> None:
    write_scene(tmp_path / "s", "intrinsics_depth.txt")
    raw = np.full((480, 640), 1163, np.uint16)  # another numbering, as in label-filt
    (tmp_path / "s/label/000100.png").write_bytes(png_from_array(raw))
    with pytest.raises(BadInput, match="NYU40 ids, 0 to 40"):
        open_judged_place(str(tmp_path), small_plan("segmentation"), mode="mlt_il_ol")


def test_labels_of_another_size_than_their_picture_are_refused(tmp_path: Path) -> None:
    write_scene(tmp_path / "s", "intrinsics_depth.txt")
    turned = np.full((640, 480), 1, np.uint8)
    (tmp_path / "s/label/000100.png").write_bytes(png_from_array(turned))
    with pytest.raises(BadInput, match="labels have another form: 480x640, of a picture 640x480"):
        open_judged_place(str(tmp_path), small_plan("segmentation"), mode="mlt_il_ol")


def test_two_places_of_one_name_and_light_of_photographs_are_refused(pairs: Path) -> None:
    words = [f"room={pairs}", f"room={pairs}"]
    with pytest.raises(BadInput, match="two places are named room"):
        open_judged_places(words, small_plan(), mode="mlt_il_ol")
    for photographs in (str(pairs), "nyu_depth_v2_labeled.mat"):
        with pytest.raises(BadInput, match="photographs have no lighting mode"):
            open_judged_place(f"{photographs}@mlt_ol", small_plan(), mode="mlt_il_ol")
    names = [
        views.name
        for views in open_judged_places(
            ["a=" + words[0][5:], words[0]], small_plan(), mode="mlt_il_ol"
        )
    ]
    assert names == ["a", "room"]


def test_sequences_of_tum_are_judged(tmp_path: Path) -> None:
    name = "rgbd_dataset_freiburg1_desk"
    write_sequence(tmp_path / name, [1.0, 1.2, 3.0], [1.01, 1.21, 3.01])
    assert camera_of(tmp_path / name / "rgb", tmp_path).K == (517.3, 516.5, 318.6, 255.3)
    # A camera given by the user overrides the benchmark's, whose pictures are larger.
    (tmp_path / name / "intrinsics.txt").write_text("80 80 45 30")
    views = open_judged_place(str(tmp_path), small_plan(), mode="mlt_il_ol")
    assert views.ids == (f"{name}/1.000000", f"{name}/3.000000")
    truth = views.truths[0]
    expected = [[0, 0, -32767]] * truth["valid"].sum()
    np.testing.assert_allclose(truth["normal"][truth["valid"]], expected, atol=40)
    depth = open_judged_place(str(tmp_path), small_plan("depth"), mode="mlt_il_ol")
    assert float(depth.truths[0]["depth"].mean()) == pytest.approx(2.0, abs=1e-3)
    (tmp_path / name / "intrinsics.txt").unlink()
    (tmp_path / name).rename(tmp_path / "desk")
    with pytest.raises(BadInput, match="without intrinsics"):
        open_judged_place(str(tmp_path), small_plan(), mode="mlt_il_ol")


def test_sun_rgbds_depth_has_its_bits_turned_back(tmp_path: Path) -> None:
    for k, sensor in enumerate(("kv1/NYUdata/NYU0001", "xtion/sun3ddata/x")):
        scene = tmp_path / "SUNRGBD" / sensor
        for name in ("image", "depth", "depth_bfx", "extrinsics"):
            (scene / name).mkdir(parents=True)
        (scene / f"image/{k}.jpg").write_bytes(jpeg_from_array(np.full((60, 90, 3), 99, np.uint8)))
        mm = np.full((60, 90), 2000 + 100 * k, np.uint16)
        for name, column in (("depth", 0), ("depth_bfx", mm[:, 0])):
            mm[:, 20] = column  # a hole, and how it was filled
            (scene / f"{name}/{k}_abs.png").write_bytes(png_from_array(mm << 3 | mm >> 13))
        (scene / "intrinsics.txt").write_text("80 0 45\n0 80 30\n0 0 1\n")
    views = open_judged_place(str(tmp_path), small_plan("depth"), mode="mlt_il_ol")
    assert [float(t["depth"].max()) for t in views.truths] == pytest.approx([2.0, 2.1])
    assert all((t["depth"] == 0).sum() == 60 for t in views.truths), "raw depth judges"
    assert views.truth.startswith("the photograph's own raw depth")
    for folder in ("kv1/NYUdata/NYU0001", "xtion/sun3ddata/x"):
        shutil.rmtree(tmp_path / "SUNRGBD" / folder / "depth")
        views = open_judged_place(str(tmp_path), small_plan("depth"), mode="mlt_il_ol")
        depths = "filled" if folder.startswith("xtion") else "raw and filled"
        assert views.truth.startswith(f"the photograph's own {depths} depth")


def write_sun_scene(scene: Path) -> None:
    """A frame of SUN RGB-D: dark on the left, bright on the right, 2 m away."""
    for name in ("image", "depth_bfx", "extrinsics"):
        (scene / name).mkdir(parents=True)
    picture = np.zeros((60, 90, 3), np.uint8)
    picture[:, 45:] = 200
    (scene / "image/7.jpg").write_bytes(jpeg_from_array(picture))
    (scene / "depth_bfx/7_abs.png").write_bytes(png_from_array(np.full((60, 90), 16000, np.uint16)))
    (scene / "intrinsics.txt").write_text("80 0 45\n0 80 30\n0 0 1\n")


def write_sun_toolbox(folder: Path, scenes: dict[str, NDArray[np.uint8]]) -> None:
    """SUNRGBD2Dseg.mat and SUNRGBDMeta.mat with the classes of scenes, by their paths below SUNRGBD."""
    folder.mkdir(parents=True)
    rows = np.zeros(len(scenes), [("sensorType", object), ("rgbpath", object)])
    rows["sensorType"] = "kv2"
    rows["rgbpath"] = [f"/n/fs/sun3d/data/SUNRGBD/{s}//image/7.jpg" for s in scenes]
    savemat(folder / "SUNRGBDMeta.mat", {"SUNRGBDMeta": rows})
    with h5py.File(folder / "SUNRGBD2Dseg.mat", "w") as file:
        refs = [
            file.create_dataset(f"#refs#/{k}", data=c.T).ref for k, c in enumerate(scenes.values())
        ]
        table = file.create_dataset("SUNRGBD2Dseg/seglabel", (len(refs), 1), h5py.ref_dtype)
        table[:, 0] = refs


def test_sun_rgbds_classes_are_those_of_its_toolbox(tmp_path: Path) -> None:
    names = ("kv2/kinect2data/a", "kv1/NYUdata/NYU0001")
    for name in (*names, "xtion/without"):
        write_sun_scene(tmp_path / "SUNRGBD" / name)
    place = str(tmp_path / "SUNRGBD")
    with pytest.raises(BadInput, match=r"only normals and depth.*SUNRGBD2Dseg\.mat"):
        open_judged_place(place, small_plan("segmentation"), mode="mlt_il_ol")
    # 37 is a bag, NYU40's 37; the scenes are in another order than the folders.
    classes = np.full((60, 90), 37, np.uint8)
    classes[:, 45:] = 5
    toolbox = tmp_path / "SUNRGBDtoolbox/Metadata"
    write_sun_toolbox(toolbox, {names[0]: classes, names[1]: np.full((60, 90), 22, np.uint8)})
    plan = small_plan("segmentation")
    views = open_judged_place(place, plan, mode="mlt_il_ol")
    assert views.ids == (names[1], names[0]), "a scene without classes does not judge"
    first, second = (truth["labels"] for truth in views.truths)
    assert (first == 22).all()
    middle = second.shape[1] // 2
    assert (second[:, : middle - 1] == 37).all()
    assert (second[:, middle + 1 :] == 5).all()
    # A damaged toolbox gives one line that names the file.
    (toolbox / "SUNRGBD2Dseg.mat").write_bytes(b"MATLAB 7.3")
    with pytest.raises(BadInput, match=r"SUNRGBD2Dseg\.mat: seglabel, row 2: cannot be read"):
        open_judged_place(place, plan, mode="mlt_il_ol")
    (toolbox / "SUNRGBDMeta.mat").unlink()
    (tmp_path / "moved").mkdir()
    for name in ("SUNRGBD", "SUNRGBDtoolbox"):
        (tmp_path / name).rename(tmp_path / "moved" / name)
    place = str(tmp_path / "moved/SUNRGBD")
    with pytest.raises(BadInput, match=r"SUNRGBDMeta\.mat: needed with SUNRGBD2Dseg\.mat"):
        open_judged_place(place, plan, mode="mlt_il_ol")


@pytest.mark.parametrize(
    "stored",
    [
        np.zeros((0, 0)),
        np.full((6, 9), b"x"),
        np.full((6, 9), 5.5),
        np.full((6, 9), 38),
        np.zeros((2, 6, 9)),
    ],
    ids=["empty", "text", "parts", "above", "cube"],
)
def test_labels_that_are_no_table_of_classes_are_refused(
    tmp_path: Path, stored: NDArray[np.uint8]
) -> None:
    write_sun_scene(tmp_path / "SUNRGBD/kv2/a")
    write_sun_toolbox(tmp_path / "SUNRGBDtoolbox/Metadata", {"kv2/a": stored})
    with pytest.raises(BadInput, match=r"seglabel, row 1: expected \(H, W\) classes 0 to 37"):
        classes_of_scene(tmp_path / "SUNRGBD/kv2/a")


def test_depth_says_nothing_of_classes(pairs: Path) -> None:
    with pytest.raises(BadInput, match="only normals and depth"):
        open_judged_place(str(pairs), small_plan("segmentation"), mode="mlt_il_ol")


def test_all_99_thresholds_are_used_on_request(
    root: Path, run: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = root.parent / "edges"
    words = ["train", "boundaries", str(root), "--out", str(out), "--hold-out", "home-2", *TINY]
    assert main(words) == 0
    capsys.readouterr()
    assert main(["evaluate", str(out), "--on", f"home={root}", "--exact"]) == 0
    text = capsys.readouterr().out
    assert "thresholds: 33 of training and held-out homes, 99 of all else" in text
    assert main(["evaluate", str(run), "--exact"]) == 1
    assert "normals has no thresholds" in capsys.readouterr().err


def test_a_home_that_trained_may_not_judge(root: Path) -> None:
    plan = small_plan()
    trained = frozenset(HOMES)
    with pytest.raises(
        BadInput, match=r"was used for training|all its homes were used for training"
    ):
        open_judged_place(
            str(root), plan, mode="mlt_il_ol", trained_on=trained, hold_out=frozenset()
        )
    with pytest.raises(BadInput, match="home home-2 was used for training"):
        open_judged_place(
            str(root), plan, mode="mlt_il_ol", trained_on=trained, hold_out=frozenset({"home-2"})
        )


def test_a_file_is_no_run(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "photo.jpg").write_bytes(b"no run")
    assert main(["evaluate", str(tmp_path / "photo.jpg")]) == 1
    (message,) = capsys.readouterr().err.splitlines()
    assert "photo.jpg: not a run of `train`" in message


def test_a_run_that_is_not_finished_is_not_judged(run: Path, tmp_path: Path) -> None:
    record = json.loads((run / "run.json").read_text())
    (tmp_path / "run.json").write_text(json.dumps({**record, "state": "running"}))
    assert main(["evaluate", str(tmp_path)]) == 1
    assert main(["evaluate", str(tmp_path / "nothing")]) == 1


def test_rows_of_a_comparison_are_named_by_root_and_light() -> None:
    sets = training_sets(["a=x", "b=y+z@opengl_dl"], ["mlt_ol", "opengl_il"], TrainingSource(()))
    assert [each.name for each in sets] == ["a_mlt_ol", "a_opengl_il", "b"]
    assert sets[2].source.places == ("y", "z")
    assert sets[2].source.modes == ("opengl_dl",)
    with pytest.raises(BadInput, match="two rows are named"):
        training_sets(["x", "y"], ["mlt_ol"], TrainingSource(()))


def test_a_comparison_shows_the_spread_of_its_seeds(
    root: Path, pairs: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["ablation", str(root), "--modes", "mlt_il_ol", "opengl_dl", "--seeds", "2"]
    words += ["--on", f"photos={pairs}", "--on", f"bare={root}", "--hold-out", "home-2", *TINY]
    assert main([*words, "--out", str(tmp_path / "a")]) == 0
    table = (tmp_path / "a" / "table.md").read_text()
    assert table.count("±") >= 8
    assert "baseline: mean normal" in table
    assert "34.02" in table  # the paper's number for OpenGL-DL
    assert "photos (1)" in table
    assert "bare (3)" in table
    result = json.loads((tmp_path / "a" / "ablation.json").read_text())
    assert [len(row["seeds"]) for row in result["rows"].values()] == [2, 2]
    # The same command resumes: nothing is trained twice.
    capsys.readouterr()
    assert main([*words, "--out", str(tmp_path / "a")]) == 0
    assert (tmp_path / "a" / "table.md").read_text() == table


def test_of_several_seeds_mean_and_deviation_are_shown() -> None:
    assert spread_text("mean_deg", [28.0, 30.0]) == "29.00 ± 1.41"
    assert spread_text("ods", [0.7]) == "70.0 %"
    assert spread_text("mean_deg", [float("nan")]) == "-"
    assert is_underfit(34.1, 36.8)
    assert not is_underfit(21.0, 36.8)
    assert markdown(["a", "long"], [["xyz", "1"]]).splitlines()[1] == "|-----|------|"


def test_the_papers_rows_have_as_many_figures_as_ours() -> None:
    traced, opengl = paper_row("normals", "mlt_il_ol"), paper_row("normals", "opengl_dl")
    assert traced is not None
    assert traced.figures[:2] == (27.90, 21.29)
    assert opengl is not None
    assert opengl.figures[0] == 34.02
    for task, rows in PAPER.items():
        assert all(len(row.figures) <= len(task_of(task).figures) for row in rows)


@pytest.mark.parametrize(("task", "n_classes"), [("depth", 40), ("segmentation", 13)])
def test_a_table_without_a_row_in_the_paper_has_no_number_of_it(task: str, n_classes: int) -> None:
    figures = dict.fromkeys(task_of(task).figures, 0.5)
    network = {"train": figures, "held_out": figures}
    run = {"network": network, "baseline": network, "baseline_name": "nothing", "on": {}}
    row = {"mode": "mlt_il_ol", "views": 3, "seeds": [run]}
    result = {"task": task, "plan": "tiny", "n_classes": n_classes, "judged_on": {}}
    lines = ablation_table(result | {"rows": {"traced": row}}).splitlines()
    (table_row,) = (line for line in lines if line.startswith("| traced"))
    assert table_row.rstrip(" |").endswith("-")


def test_a_photograph_of_another_form_is_cut_in_its_middle() -> None:
    colour, rows, columns = crop_to_size(np.zeros((100, 300, 3), np.uint8), (40, 32))
    assert colour.shape == (32, 40, 3)
    assert (rows, columns) == (slice(0, 100), slice(87, 212))


def test_a_home_missing_from_one_root_is_a_note_and_from_all_an_error(
    root: Path, tmp_path: Path
) -> None:
    second_root = tmp_path / "other"
    fill(FolderStore(second_root), {"villa-00000000": 1}, SIZE)
    roots, light = [f"a={root}", f"b={second_root}"], ["mlt_il_ol"]
    source = TrainingSource((), hold_out=frozenset({"home-2"}), all_there=False)
    sets = training_sets(roots, light, source)
    assert hold_out_notes(sets) == ["b_mlt_il_ol has no home home-2 to hold out"]
    assert len(training_views(sets[1].source, small_plan())) == 1
    nowhere = TrainingSource((), hold_out=frozenset({"home-9"}), all_there=False)
    with pytest.raises(BadInput, match="no such home in"):
        hold_out_notes(training_sets(roots, light, nowhere))


def test_foreign_predictions_are_judged_beside_the_run(
    run: Path, pairs: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "said"
    folder.mkdir()
    towards = np.broadcast_to([0.0, 0.0, -1.0], (60, 90, 3))
    np.save(folder / "wall.npy", towards)
    words = ["evaluate", str(run), "--on", f"photos={pairs}", "--predictions", f"theirs={folder}"]
    assert main([*words, "--out", str(tmp_path / "e")]) == 0
    rows = json.loads((tmp_path / "e" / "evaluation.json").read_text())["evaluations"]
    assert rows[0]["figures"]["theirs"]["mean_deg"] == pytest.approx(0, abs=0.3)
    assert "theirs" in capsys.readouterr().out
    # Equal to the output of `predict`: x right, y forward, z up.
    (folder / "wall.npy").unlink()
    axes = np.broadcast_to([0.0, -1.0, 0.0], (60, 90, 3))
    stored = np.rint((axes + 1) * 65535 / 2).astype(np.uint16)
    (folder / "wall_normal.png").write_bytes(png_from_array(stored))
    views = open_judged_place(str(pairs), small_plan(), mode="mlt_il_ol")
    predictions = predictions_in(OthersPredictions("theirs", folder), views, small_plan())
    assert predictions is not None
    (normal,) = predictions
    assert normal.shape == (60, 75, 3)
    np.testing.assert_allclose(normal[..., 2], -1, atol=1e-4)


def test_a_folder_without_predictions_of_these_views_is_an_error(
    run: Path, pairs: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["evaluate", str(run), "--on", f"photos={pairs}", "--predictions", str(pairs)]
    assert main([*words, "--out", str(pairs / "e")]) == 1
    assert "no prediction for any evaluated view" in capsys.readouterr().err


def test_weights_of_the_package_are_judged_by_their_task(
    pairs: Path, tmp_path_factory: pytest.TempPathFactory, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path_factory.mktemp("judged")
    words = ["evaluate", "--task", "normals", "--on", f"wall={pairs}", "--out", str(out), "--json"]
    assert main(words) == 0
    (evaluation,) = json.loads(capsys.readouterr().out)["evaluations"]
    (judged,) = json.loads((out / "evaluation.json").read_text())["evaluations"]
    assert evaluation["figures"] == judged["figures"]
    assert judged["figures"]["network"]["n_pixels"] > 0
    assert main(words[:-3]) == 1
    assert "needs --out" in capsys.readouterr().err
    assert main(["evaluate", "--task", "normals", "--mirror"]) == 1
    assert "--mirror: needs --on" in capsys.readouterr().err
    assert main(["evaluate", "--on", str(pairs)]) == 1
    assert main(["evaluate", str(out), "--task", "normals"]) == 1
    assert capsys.readouterr().err.count("give either a RUN or --task") == 2


def test_figures_of_no_pixel_are_null_in_json_and_a_dash_in_tables(
    pairs: Path, tmp_path_factory: pytest.TempPathFactory, capsys: pytest.CaptureFixture[str]
) -> None:
    (pairs / "wall_depth.png").write_bytes(png_from_array(np.zeros((60, 90), np.uint16)))
    out = tmp_path_factory.mktemp("judged")
    words = ["evaluate", "--task", "normals", "--on", f"dark={pairs}", "--out", str(out), "--json"]
    assert main(words) == 0
    for text in (capsys.readouterr().out, (out / "evaluation.json").read_text()):
        (judged,) = json.loads(text, parse_constant=pytest.fail)["evaluations"]
        assert judged["figures"]["network"]["mean_deg"] is None
        assert list(judged["errors"].values()) == [None]
    assert shown_figure("mean_deg", judged["figures"]["network"]["mean_deg"]) == "-"


@pytest.mark.parametrize("words", [["--on", "x="], ["--on", ""], ["--on", "a", "--views", "-2"]])
def test_an_invalid_place_or_number_of_views_is_refused(
    words: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["evaluate", "--task", "normals", *words, "--out", str(tmp_path / "e")]) == 1
    (message,) = capsys.readouterr().err.splitlines()
    assert "has no place" in message or "--views: -2: expected 0 or more" in message
