import json
import tarfile
from pathlib import Path

import h5py
import numpy as np
import pytest

from pbrs_farm.core.errors import BadInput
from pbrs_farm.export.coco import run_lengths
from pbrs_farm.export.export_views import export
from pbrs_farm.images import array_from_png, png_from_array
from tests.check.roots import SIZE, make_root


def mask_from_run_lengths(runs: dict[str, list[int]]) -> np.ndarray:
    """The mask (H, W) of COCO's uncompressed run lengths, read as its documentation says."""
    height, width = runs["size"]
    values = np.arange(len(runs["counts"])) % 2 == 1  # runs alternate, zeros first
    return np.repeat(values, runs["counts"]).reshape(width, height).T


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


def test_coco_masks_boxes_and_classes_are_those_of_the_labels(root, tmp_path):
    assert export(root, tmp_path / "coco", "coco") == (2, 3)
    document = json.loads((tmp_path / "coco/annotations.json").read_text())
    names = {c["id"]: c["name"] for c in document["categories"]}
    assert len(names) == 40
    instance, semantic = (png(view_folder(root) / f"{x}.png") for x in ("instance", "semantic"))
    rebuilt = np.zeros_like(instance)
    for a in (a for a in document["annotations"] if a["image_id"] == 1):
        mask = mask_from_run_lengths(a["segmentation"])
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


def test_run_lengths_are_column_by_column_and_begin_with_zeros():
    assert run_lengths(np.array([[True, False], [False, False]]))["counts"] == [0, 1, 3]
    assert run_lengths(np.array([[False, True], [False, False]]))["counts"] == [2, 1, 1]


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
        pose = np.array(json.loads(file["campose"][()])["cam2world_matrix"])
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


def test_only_what_a_selection_keeps_is_exported(root, tmp_path):
    house = view_folder(root).parent.parent.name
    (root / "selection").mkdir(exist_ok=True)
    rows = [{"house": house, "view": f"v{k}", "kept": k == 1} for k in range(2)]
    (root / "selection/run.jsonl").write_text("".join(json.dumps(r) + "\n" for r in rows))
    assert export(root, tmp_path / "x", "webdataset", selection="run")[0] == 1
    with pytest.raises(BadInput, match="no such selection"):
        export(root, tmp_path / "y", "coco", selection="other")


def test_a_wrong_form_a_full_folder_and_an_empty_root_are_told(root, tmp_path):
    with pytest.raises(BadInput, match="coco, hdf5, webdataset, released"):
        export(root, tmp_path / "x", "kitti")
    (tmp_path / "full").mkdir()
    (tmp_path / "full/file").write_text("mine")
    with pytest.raises(BadInput, match="is there already"):
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
