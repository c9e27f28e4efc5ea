import json
import shutil
import tarfile
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
from scipy.ndimage import binary_dilation, binary_erosion, gaussian_filter

from pbrs_farm.cli import main
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.house_split import SplitShares, split_of_house
from pbrs_farm.export.chosen_view import Choice
from pbrs_farm.export.export_views import export, remarks_of
from pbrs_farm.export.masks import compressed_runs, mask_polygon, run_lengths
from pbrs_farm.formats.class_map import class_map
from pbrs_farm.images import array_from_png, png_from_array
from tests.check.roots import SIZE, make_root


def mask_from_run_lengths(runs: dict[str, list[int]]) -> np.ndarray:
    """The mask (H, W) of COCO's uncompressed run lengths, read according to its documentation."""
    height, width = runs["size"]
    values = np.arange(len(runs["counts"])) % 2 == 1  # runs alternate, zeros first
    return np.repeat(values, runs["counts"]).reshape(width, height).T


def uncompressed(runs: dict) -> dict[str, list[int]]:
    """COCO's compressed run lengths as plain ones, read like its maskApi.c."""
    counts: list[int] = []
    value = shift = 0
    for code in (ord(c) - 48 for c in runs["counts"]):
        value |= (code & 0x1F) << shift
        shift += 5
        if not code & 0x20:
            value -= (1 << shift) if code & 0x10 else 0
            counts.append(value + (counts[-2] if len(counts) > 2 else 0))
            value = shift = 0
    return {"size": runs["size"], "counts": counts}


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("finished")
    house = make_root(folder)
    for k, view in enumerate(sorted((house / "views").iterdir())):
        picture = np.full((SIZE[1], SIZE[0], 3), 10 * k + 5, np.uint8)
        (view / "mlt_il_ol.png").write_bytes(png_from_array(picture))
    return folder


def view_folder(root: Path, name: str = "v0") -> Path:
    return next((root / "houses").iterdir()) / "views" / name


def png(file: Path) -> np.ndarray:
    return array_from_png(file.read_bytes())


def test_a_view_that_lacks_a_field_is_named_with_its_file(root, tmp_path):
    broken = shutil.copytree(root, tmp_path / "root")
    file = view_folder(broken) / "view.json"
    facts = json.loads(file.read_text())
    del facts["width_px"]
    file.write_text(json.dumps(facts))
    with pytest.raises(BadInput, match="width_px"):
        export(broken, tmp_path / "out", "coco")


def test_coco_masks_boxes_and_classes_are_those_of_the_labels(root, tmp_path):
    assert export(root, tmp_path / "coco", "coco") == (2, 6)
    document = json.loads((tmp_path / "coco/annotations.json").read_text())
    names = {c["id"]: c["name"] for c in document["categories"]}
    assert len(names) == 40
    instance, semantic = (png(view_folder(root) / f"{x}.png") for x in ("instance", "semantic"))
    rebuilt = np.zeros_like(instance)
    for a in (a for a in document["annotations"] if a["image_id"] == 1):
        mask = mask_from_run_lengths(uncompressed(a["segmentation"]))
        rebuilt[mask] = a["instance_id"]
        assert (semantic[mask] == a["category_id"]).all()
        x, y, w, h = a["bbox"]
        assert mask[y : y + h, x : x + w].sum() == a["area"] == mask.sum()
        assert mask[y : y + h, x].any()
        assert mask[y, x : x + w].any()
    assert (rebuilt == np.where(semantic > 0, instance, 0)).all()
    assert png(tmp_path / "coco" / document["images"][1]["file_name"])[0, 0, 0] == 15


@pytest.mark.parametrize(
    "mask", [np.zeros((2, 3), bool), np.ones((2, 3), bool), np.eye(3, dtype=bool)]
)
def test_run_lengths_go_there_and_back(mask):
    runs = run_lengths(mask)
    assert sum(runs["counts"]) == mask.size
    assert (mask_from_run_lengths(runs) == mask).all()
    assert uncompressed(compressed_runs(mask)) == runs


def test_run_lengths_are_column_by_column_and_begin_with_zeros():
    assert run_lengths(np.array([[True, False], [False, False]]))["counts"] == [0, 1, 3]
    assert run_lengths(np.array([[False, True], [False, False]]))["counts"] == [2, 1, 1]


def test_compressed_run_lengths_are_cocos_text():
    # By hand: counts 0, 1, 3 are characters 48 + n; 100 = 3 * 32 + 4 takes two.
    assert compressed_runs(np.array([[True, False], [False, False]]))["counts"] == "013"
    assert compressed_runs(np.zeros((10, 10), bool))["counts"] == chr(48 + 4 + 32) + chr(48 + 3)
    # The fourth count is stored as 2 - 3 = -1 relative to the last but one: 31 with a sign.
    mask = np.array([0, 0, 1, 1, 1, 0, 1, 1], bool)[:, None]
    assert run_lengths(mask)["counts"] == [2, 3, 1, 2]
    assert compressed_runs(mask)["counts"] == "231" + chr(48 + 31)


@pytest.mark.parametrize("seed", range(5))
def test_compressed_runs_of_any_mask_come_back(seed):
    rng = np.random.default_rng(seed)
    mask = rng.random((37, 41)) < rng.random()
    mask[5:30] |= seed % 2 == 0
    runs = compressed_runs(mask)
    assert (mask_from_run_lengths(uncompressed(runs)) == mask).all()


def test_panoptic_segments_are_the_instances(root, tmp_path):
    export(root, tmp_path / "coco", "coco")
    document = json.loads((tmp_path / "coco/panoptic.json").read_text())
    first = document["annotations"][0]
    ids = png(tmp_path / "coco/panoptic" / first["file_name"]).astype(int) @ [1, 256, 65536]
    semantic = png(view_folder(root) / "semantic.png")
    assert {s["id"] for s in first["segments_info"]} == set(np.unique(ids)) - {0}
    for segment in first["segments_info"]:
        assert (ids == segment["id"]).sum() == segment["area"]
        assert (semantic[ids == segment["id"]] == segment["category_id"]).all()
    assert (semantic[ids == 0] == 0).all()
    kinds = {c["name"]: c["isthing"] for c in document["categories"]}
    assert (kinds["wall"], kinds["chair"]) == (0, 1)


def test_yolo_boxes_are_those_of_the_instances(root, tmp_path):
    assert export(root, tmp_path / "yolo", "yolo") == (2, 5)
    house = view_folder(root).parent.parent.name
    lines = (tmp_path / f"yolo/labels/{house}__v0.txt").read_text().splitlines()
    rows = json.loads((view_folder(root) / "view.json").read_text())["instances"]
    rows = [r for r in rows if r["nyu40"] not in (0, 1, 2, 22)]
    assert len(lines) == len(rows) > 0
    number, x, y, w, h = map(float, lines[0].split())
    x0, y0, x1, y1 = rows[0]["box2d"]
    assert number == rows[0]["nyu40"] - 1
    expected = [(x0 + x1) / 256, (y0 + y1) / 192, (x1 - x0) / 128, (y1 - y0) / 96]
    assert [x, y, w, h] == pytest.approx(expected, abs=1e-6)
    assert (tmp_path / f"yolo/images/{house}__v0.png").exists()
    assert "\n  4: chair\n" in (tmp_path / "yolo/data.yaml").read_text()


def test_data_yaml_works_from_any_directory_and_names_the_replacement_of_val(root, tmp_path):
    export(root, tmp_path / "all", "yolo")
    export(root, tmp_path / "one", "yolo-seg", shares=SplitShares(1, 0, 0))
    export(root, tmp_path / "test", "yolo", shares=SplitShares(0, 0, 1))
    for name, folder in (("all", "images"), ("one", "train/images"), ("test", "test/images")):
        lines = (tmp_path / name / "data.yaml").read_text().splitlines()
        assert not [line for line in lines if line.startswith("path")]
        assert {f"train: {folder}", f"val: {folder}"} <= set(lines)
        assert (tmp_path / name / folder).is_dir()
        assert any("val" in remark for remark in remarks_of(tmp_path / name))
    assert "the split left val empty: it is a copy of train" in remarks_of(tmp_path / "one")


def test_yolo_polygons_cover_the_visible_masks(root, tmp_path):
    assert export(root, tmp_path / "seg", "yolo-seg") == (2, 5)
    house = view_folder(root).parent.parent.name
    lines = (tmp_path / f"seg/labels/{house}__v0.txt").read_text().splitlines()
    semantic = png(view_folder(root) / "semantic.png")
    height, width = semantic.shape
    drawn = np.zeros(semantic.shape, np.uint8)
    for line in lines:
        number, *shares = line.split()
        ring = np.array(shares, float).reshape(-1, 2) * (width, height)
        assert len(ring) >= 3
        drawn[filled(ring, semantic.shape)] = int(number) + 1
    things = np.where(np.isin(semantic, (0, 1, 2, 22)), 0, semantic)
    items = json.loads((view_folder(root) / "view.json").read_text())["instances"]
    assert len(lines) == sum(item["nyu40"] not in (0, 1, 2, 22) for item in items)
    assert (drawn == things).mean() > 0.98
    assert (things > 0).mean() > 0.02


def filled(ring: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """Pixels whose centres are inside a ring by the even-odd rule."""
    y, x = np.mgrid[: shape[0], : shape[1]] + 0.5
    inside = np.zeros(shape, bool)
    for (x0, y0), (x1, y1) in zip(ring, np.roll(ring, -1, 0), strict=True):
        if y0 != y1:
            inside ^= ((y0 > y) != (y1 > y)) & (x < x0 + (y - y0) * (x1 - x0) / (y1 - y0))
    return inside


def test_a_polygon_goes_around_all_parts_and_holes_within_a_pixel():
    y, x = np.mgrid[:80, :100]
    disc = np.hypot(x - 40, y - 40)
    mask = (disc < 35) & (disc > 12) & ~(np.hypot(x - 60, y - 40) < 5)
    mask[5:9, 90:95] = mask[79, 99] = True
    ring = mask_polygon(mask)
    rebuilt = filled(ring, mask.shape)
    outline = mask ^ binary_erosion(mask) | binary_dilation(mask) ^ mask
    assert not (rebuilt ^ mask)[~outline].any()
    # Steps of single pixels are smoothed, corners stay.
    assert len(ring) < 180
    assert {(90, 5), (90, 9), (95, 5), (95, 9)} <= set(map(tuple, ring))


@pytest.mark.parametrize("smoothing", [0, 1, 3])
def test_polygons_of_random_masks_keep_their_detail(smoothing):
    rng = np.random.default_rng(smoothing)
    for _ in range(20):
        noise = gaussian_filter(rng.standard_normal(rng.integers(1, 40, 2)), smoothing)
        mask = noise > rng.choice([np.median(noise), np.percentile(noise, 90)])
        if mask.any():
            rebuilt = filled(mask_polygon(mask), mask.shape)
            assert (rebuilt & mask).sum() >= 0.97 * (rebuilt | mask).sum()


@pytest.fixture
def own_classes(tmp_path: Path) -> Choice:
    (tmp_path / "own.csv").write_text(
        "from,id,name\nwall,300,shell\nfloor,300,shell\nbed,7,rest\n*,12,'other: thing'\n"
    )
    return Choice(classes=class_map(tmp_path / "own.csv"))


def test_coco_has_the_users_classes(root, tmp_path, own_classes):
    export(root, tmp_path / "coco", "coco", choice=own_classes)
    document = json.loads((tmp_path / "coco/annotations.json").read_text())
    kinds = {c["id"]: (c["name"], c["supercategory"]) for c in document["categories"]}
    assert kinds[300] == ("shell", "structure")
    assert kinds[7] == ("rest", "object")
    assert sorted(kinds) == [7, 12, 300]
    instance, semantic = (png(view_folder(root) / f"{x}.png") for x in ("instance", "semantic"))
    for a in (a for a in document["annotations"] if a["image_id"] == 1):
        (nyu40,) = np.unique(semantic[instance == a["instance_id"]])
        assert a["category_id"] == {1: 300, 2: 300, 4: 7}.get(int(nyu40), 12)
    panoptic = json.loads((tmp_path / "coco/panoptic.json").read_text())
    used = {s["category_id"] for a in panoptic["annotations"] for s in a["segments_info"]}
    assert used == {a["category_id"] for a in document["annotations"]}


def test_yolo_counts_the_users_classes_from_0_and_boxes_all(root, tmp_path, own_classes):
    export(root, tmp_path / "yolo", "yolo", choice=own_classes)
    names = (tmp_path / "yolo/data.yaml").read_text().partition("names:\n")[2]
    assert names == '  0: "rest"\n  1: "\'other: thing\'"\n  2: "shell"\n'
    lines = next((tmp_path / "yolo/labels").glob("*__v0.txt")).read_text().splitlines()
    rows = json.loads((view_folder(root) / "view.json").read_text())["instances"]
    assert len(lines) == len(rows)
    numbers = [{"wall": 2, "floor": 2, "bed": 0}.get(r["class"], 1) for r in rows]
    assert [int(line.split()[0]) for line in lines] == numbers


def test_polygons_have_the_numbers_of_the_users_classes(root, tmp_path, own_classes):
    export(root, tmp_path / "seg", "yolo-seg", choice=own_classes)
    assert '  0: "rest"\n' in (tmp_path / "seg/data.yaml").read_text()
    lines = next((tmp_path / "seg/labels").glob("*__v0.txt")).read_text().splitlines()
    rows = json.loads((view_folder(root) / "view.json").read_text())["instances"]
    assert len(lines) >= len(rows)
    numbers = {{"wall": 2, "floor": 2, "bed": 0}.get(r["class"], 1) for r in rows}
    assert {int(line.split()[0]) for line in lines} == numbers


@pytest.mark.parametrize("size", [None, (64, 48)])
def test_category_maps_hold_the_users_classes(root, tmp_path, own_classes, size):
    choice = replace(own_classes, size=size)
    export(root, tmp_path / "web", "webdataset", choice=choice)
    export(root, tmp_path / "h5", "hdf5", choice=choice)
    with tarfile.open(tmp_path / "web/shard-000000.tar") as tar:
        members = [m for m in tar if "__v0." in m.name]
        data = {m.name.partition(".")[2]: tar.extractfile(m).read() for m in members}
    label, instance = (array_from_png(data[f"{x}.png"]) for x in ("semantic", "instance"))
    assert label.dtype == np.uint16
    facts = json.loads(data["json"])
    assert {r["own_class_name"] for r in facts["instances"]} <= {"shell", "rest", "'other: thing'"}
    for row in facts["instances"]:
        assert (label[instance == row["id"]] == row["own_class"]).all()
    with h5py.File(tmp_path / "h5/0.hdf5") as file:
        assert (file["category_id_segmaps"][:] == label).all()
        attributes = json.loads(file["instance_attribute_maps"][()])
    assert {a["category_id"] for a in attributes} == set(np.unique(label)) - {0}


def test_a_form_without_classes_refuses_those_of_the_user(root, tmp_path, own_classes):
    with pytest.raises(BadInput, match="classes: released has fixed classes"):
        export(root, tmp_path / "x", "released", choice=own_classes)


def test_the_verb_reads_the_table(root, tmp_path, own_classes, capsys):
    words = ["export", str(root), "--to", "yolo", "--classes"]
    assert main([*words, str(tmp_path / "own.csv"), "--out", str(tmp_path / "y")]) == 0
    assert "rest" in (tmp_path / "y/data.yaml").read_text()
    (tmp_path / "bad.csv").write_text("from,id,name\nchiar,1,seat\n")
    assert main([*words, str(tmp_path / "bad.csv"), "--out", str(tmp_path / "z")]) == 1
    assert "line 2: 'chiar' is not a class of NYU40" in capsys.readouterr().err


def test_at_another_size_labels_boxes_and_k_agree(root, tmp_path):
    choice = Choice(size=(64, 48))
    export(root, tmp_path / "small", "webdataset", choice=choice)
    with tarfile.open(tmp_path / "small/shard-000000.tar") as tar:
        members = [m for m in tar if "__v0." in m.name]
        data = {m.name.partition(".")[2]: tar.extractfile(m).read() for m in members}
    facts, large = (
        json.loads(data["json"]),
        json.loads((view_folder(root) / "view.json").read_text()),
    )
    instance = array_from_png(data["instance.png"])
    assert instance.shape == (48, 64)
    assert (facts["width_px"], facts["height_px"]) == (64, 48)
    assert facts["K"][0][2] == large["K"][0][2] / 2
    assert {r["id"] for r in facts["instances"]} == set(np.unique(instance)) - {0}
    for row in facts["instances"]:
        x0, y0, x1, y1 = row["box2d"]
        mask = instance == row["id"]
        assert mask[y0:y1, x0:x1].sum() == mask.sum() == row["pixels"]
    assert array_from_png(data["normal.png"]).dtype == np.uint16
    coco = export(root, tmp_path / "coco", "coco", choice=choice)
    assert coco == (2, 6)
    assert png(next((tmp_path / "coco/images").rglob("*.png"))).shape == (48, 64, 3)


def parts_of(shard: Path) -> set[str]:
    with tarfile.open(shard) as tar:
        return {name.partition(".")[2] for name in tar.getnames()}


def test_only_chosen_layers_and_modes_are_exported_and_radiance_when_named(root, tmp_path):
    for folder in (view_folder(root), view_folder(root, "v1")):
        (folder / "radiance.exr").write_bytes(b"any")
    try:
        export(root, tmp_path / "a", "webdataset")
        assert "radiance.exr" not in parts_of(tmp_path / "a/shard-000000.tar")
        choice = Choice(layers=("radiance", "normal"), modes=("opengl_dl",))
        assert export(root, tmp_path / "b", "webdataset", choice=choice, shard_size=1) == (2, 2)
        parts = {"json", "radiance.exr", "normal.png", "valid.png"}
        assert parts_of(tmp_path / "b/shard-000001.tar") == parts
    finally:
        for folder in (view_folder(root), view_folder(root, "v1")):
            (folder / "radiance.exr").unlink()
    choice = Choice(layers=("depth",), modes=())
    export(root, tmp_path / "h5", "hdf5", choice=choice)
    with h5py.File(tmp_path / "h5/0.hdf5") as file:
        assert set(file) == {"depth", "instance_attribute_maps", "campose"}


def test_a_split_is_a_separate_folder_in_each_form(root, tmp_path):
    house = view_folder(root).parent.parent.name
    shares = SplitShares(1, 0, 0)
    assert split_of_house(house, shares) == "train"
    export(root, tmp_path / "coco", "coco", shares=shares)
    assert (tmp_path / "coco/train/annotations.json").exists()
    export(root, tmp_path / "yolo", "yolo", shares=shares)
    assert "\ntrain: train/images\n" in (tmp_path / "yolo/data.yaml").read_text()
    assert not any("no home falls" in line for line in remarks_of(tmp_path / "yolo"))
    export(root, tmp_path / "empty", "coco", shares=SplitShares(0.98, 0.01, 0.01))
    assert "no home falls into val and test: export more homes" in remarks_of(tmp_path / "empty")


@pytest.mark.parametrize(
    ("fields", "match"),
    [
        ({"layers": ("normals",)}, "--layers: normals: no such layer"),
        ({"modes": ("mlt",)}, "--modes: mlt: no such lighting mode"),
        ({"layers": ("radiance",), "size": (8, 6)}, "radiance.exr is not resized"),
    ],
)
def test_an_impossible_choice_is_refused(fields, match):
    with pytest.raises(BadInput, match=match):
        Choice(**fields)


def test_hdf5_has_blenderprocs_keys_and_conventions(root, tmp_path):
    assert export(root, tmp_path / "h5", "hdf5") == (2, 3)
    folder = view_folder(root)
    with h5py.File(tmp_path / "h5/0.hdf5") as file:
        assert (file["colors"][:] == 5).all()
        assert np.allclose(file["depth"][:] * 1000, png(folder / "depth.png"), atol=1e-3)
        assert (file["instance_segmaps"][:] == png(folder / "instance.png")).all()
        assert (file["category_id_segmaps"][:] == png(folder / "semantic.png")).all()
        normals = file["normals"][:] * 2 - 1
        assert np.abs(np.linalg.norm(normals, axis=-1) - 1).max() < 1e-3
        attributes = json.loads(file["instance_attribute_maps"][()])
        camera = json.loads(file["campose"][()])
        pose = np.array(camera["cam2world_matrix"])
    # BlenderProc's pixel coordinates start at the centre of the first pixel.
    assert camera["cam_K"][0][2] == (SIZE[0] - 1) / 2
    assert camera["cam_K"][1][2] == (SIZE[1] - 1) / 2
    by_id = {a["idx"]: a["category_id"] for a in attributes}
    assert set(by_id) == set(np.unique(png(folder / "instance.png"))) - {0}
    # A floor's normal, turned into the world, is up.
    floor = png(folder / "semantic.png") == 2
    assert np.allclose(normals[floor] @ pose[:3, :3].T, [0, 1, 0], atol=1e-3)


def test_webdataset_samples_are_the_files_and_equal_bytes(root, tmp_path):
    for name in ("a", "b"):
        assert export(root, tmp_path / name, "webdataset") == (2, 1)
    shards = [(tmp_path / name / "shard-000000.tar").read_bytes() for name in ("a", "b")]
    assert shards[0] == shards[1]
    samples: dict[str, dict[str, bytes]] = {}
    with tarfile.open(tmp_path / "a/shard-000000.tar") as tar:
        for member in tar:
            key, _, part = member.name.partition(".")
            samples.setdefault(key, {})[part] = tar.extractfile(member).read()  # type: ignore[union-attr]
    assert len(samples) == 2
    first = samples[min(samples)]
    assert first["depth.png"] == (view_folder(root) / "depth.png").read_bytes()
    assert json.loads(first["json"])["view"] == "v0"


def test_the_released_layout_has_the_published_names_and_cameras(root, tmp_path):
    export(root, tmp_path / "pbrs", "released")
    house = view_folder(root).parent.parent.name
    out, folder = tmp_path / "pbrs", view_folder(root, "v1")
    for published, stored in {
        f"mlt_v2/{house}/000001_mlt.png": "mlt_il_ol.png",
        f"depth_v2/{house}/000001_depth.png": "depth.png",
        f"normal_v2/{house}/000001_norm_camera.png": "normal.png",
        f"normal_v2/{house}/000001_valid.png": "valid.png",
        f"category_v2/{house}/000001_category40.png": "semantic.png",
        f"boundary_v2/{house}/000001_instance_boundary.png": "boundary.png",
    }.items():
        assert (out / published).read_bytes() == (folder / stored).read_bytes()
    assert (out / "data_goodlist_v2.txt").read_text() == f"{house}/000000\n{house}/000001\n"
    line = (out / f"camera_v2/{house}/room_camera.txt").read_text().splitlines()[1]
    eye, towards, up, half, _score = (np.array(g.split(), float) for g in line.split("  "))
    pose = np.array(json.loads((folder / "view.json").read_text())["world_from_camera_opengl"])
    assert np.allclose(eye, pose[:3, 3], atol=1e-4)
    assert np.allclose(towards, -pose[:3, 2], atol=1e-5)
    assert np.allclose(up, pose[:3, 1], atol=1e-5)
    assert half == pytest.approx([0.5534, np.arctan(0.75 * np.tan(0.5534))], abs=1e-5)


def test_only_selected_views_are_exported(root, tmp_path):
    house = view_folder(root).parent.parent.name
    (root / "selection").mkdir(exist_ok=True)
    rows = [{"house": house, "view": f"v{k}", "kept": k == 1} for k in range(2)]
    (root / "selection/run.jsonl").write_text("".join(json.dumps(r) + "\n" for r in rows))
    assert export(root, tmp_path / "x", "webdataset", selection="run")[0] == 1
    with pytest.raises(BadInput, match="no such selection"):
        export(root, tmp_path / "y", "coco", selection="other")


def test_a_wrong_form_a_full_folder_and_an_empty_root_are_refused(root, tmp_path):
    with pytest.raises(BadInput, match="bop, captions, coco, colmap"):
        export(root, tmp_path / "x", "stl")
    (tmp_path / "full").mkdir()
    (tmp_path / "full/file").write_text("mine")
    with pytest.raises(BadInput, match="already exists"):
        export(root, tmp_path / "full", "coco")
    (tmp_path / "empty/houses").mkdir(parents=True)
    with pytest.raises(BadInput, match="no finished view"):
        export(tmp_path / "empty", tmp_path / "z", "coco")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["empty", "full"]


def test_nothing_is_left_behind_when_a_view_cannot_be_read(tmp_path):
    house = make_root(tmp_path / "root")
    (house / "views/v1/instance.png").write_bytes(b"no picture")
    with pytest.raises(BadInput):
        export(tmp_path / "root", tmp_path / "out", "coco")
    assert [p.name for p in tmp_path.iterdir()] == ["root"]
