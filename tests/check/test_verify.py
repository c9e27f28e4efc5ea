import json
import os
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pbrs_farm.check import verify
from pbrs_farm.core.camera import Camera, Intrinsics
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.house import House, ItemKind, Surface
from pbrs_farm.images import array_from_png, exr_from_layers, png_from_array
from pbrs_farm.read.builtin.builtin_home import builtin_home
from tests.check.roots import SIZE, changed_pixel, make_root, sign


@pytest.fixture(scope="module")
def clean(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("clean")
    make_root(root)
    return root


@pytest.fixture
def root(clean: Path, tmp_path: Path) -> Path:
    shutil.copytree(clean, tmp_path / "root")
    return tmp_path / "root"


def house_of(root: Path) -> Path:
    return next((root / "houses").iterdir())


def failed(root: Path, *, all_pixels: bool = True) -> set[str]:
    certificate = verify(root, all_pixels=all_pixels)
    return {name for name, count in certificate.counts.items() if count.failed}


def test_a_finished_folder_is_clean_to_the_last_pixel(clean):
    certificate = verify(clean, all_pixels=True)
    assert certificate.is_clean, certificate.text()
    assert certificate.n_views == 2
    assert certificate.counts["ray: depth"].checked == 2 * 128 * 96
    assert certificate.counts["ray: instance"].ties <= 2
    assert certificate.counts["reprojection"].checked >= 0
    assert certificate.text().endswith("\nCLEAN")


def test_a_sample_checks_as_many_pixels_as_asked(clean):
    assert verify(clean, sample=100).counts["ray: normal"].checked == 200


@pytest.mark.parametrize(
    ("file", "by", "check"),
    [
        ("depth.png", 3, "ray: depth"),
        ("normal.png", 200, "ray: normal"),
        ("instance.png", 1, "ray: instance"),
        ("semantic.png", 1, "ray: semantic"),
        ("valid.png", 1, "ray: valid"),
        ("boundary.png", 1, "boundary"),
    ],
)
def test_one_changed_pixel_is_caught_though_the_hashes_agree(root, file, by, check):
    changed_pixel(house_of(root) / "views/v0" / file, 48, 64, by)
    sign(root, house_of(root))
    assert check in failed(root)


def test_one_changed_pixel_is_caught_by_its_hash_without_looking_at_pixels(root):
    changed_pixel(house_of(root) / "views/v0/depth.png", 48, 64, 1)
    certificate = verify(root, sample=0)
    assert certificate.counts["hashes"].failed == 1
    assert "views/v0/depth.png" in certificate.failures[0]


def _sparse(path: Path) -> None:
    with path.open("wb") as file:
        file.truncate(5 * 2**30)


def edit_table(root: Path, change) -> None:  # type: ignore[no-untyped-def]
    file = house_of(root) / "views/v0/view.json"
    table = json.loads(file.read_text())
    change(table)
    file.write_text(json.dumps(table))
    sign(root, house_of(root))


def test_a_moved_camera_is_caught(root):
    def move(table):
        for name in ("world_from_camera_opengl", "world_from_camera_opencv"):
            table[name][0][3] += 0.01

    edit_table(root, move)
    assert {"ray: depth", "ray: instance"} & failed(root)


def test_poses_that_disagree_are_caught(root):
    edit_table(root, lambda t: t["world_from_camera_opengl"][0].__setitem__(3, 9.0))
    assert failed(root) == {"pose"}


def test_a_mirrored_pose_is_caught(root):
    def mirror(table):
        for name in ("world_from_camera_opengl", "world_from_camera_opencv"):
            for row in table[name][:3]:
                row[0] = -row[0]

    edit_table(root, mirror)
    assert "pose" in failed(root, all_pixels=False)


def test_a_wrong_focal_length_is_caught(root):
    edit_table(root, lambda t: t["K"][0].__setitem__(0, t["K"][0][0] * 1.02))
    assert "ray: depth" in failed(root)


def test_a_wrong_class_in_the_table_is_caught(root):
    edit_table(root, lambda t: t["instances"][0].update(nyu40=3, **{"class": "cabinet"}))
    assert "semantic = table" in failed(root, all_pixels=False)


def test_a_wrong_pixel_count_in_the_table_is_caught(root):
    edit_table(root, lambda t: t["instances"][0].update(pixels=1))
    assert failed(root) == {"table"}


def test_an_instance_missing_from_the_table_is_caught(root):
    edit_table(root, lambda t: t["instances"].pop())
    assert "table" in failed(root, all_pixels=False)


def test_a_missing_file_and_an_unlisted_one_are_caught(root):
    view = house_of(root) / "views/v0"
    (view / "normal.png").unlink()
    (view / "stray.txt").write_text("?")
    certificate = verify(root, sample=0)
    assert any("normal.png: is missing" in f for f in certificate.failures)
    assert any("stray.txt: is not in manifest.jsonl" in f for f in certificate.failures)


def test_a_truncated_file_is_caught_and_the_rest_still_checked(root):
    file = house_of(root) / "views/v0/instance.png"
    file.write_bytes(file.read_bytes()[:200])
    certificate = verify(root, sample=100)
    assert certificate.counts["layers"].failed == 1
    assert certificate.counts["ray: depth"].checked == 100


def test_a_changed_house_is_caught(root):
    glb = house_of(root) / "house.glb"
    data = bytearray(glb.read_bytes())
    data[len(data) // 2] ^= 0xFF
    glb.write_bytes(bytes(data))
    assert "hashes" in failed(root, all_pixels=False)


def test_damaged_view_json_and_glb_are_failures_not_tracebacks(root):
    (house_of(root) / "views/v0/view.json").write_text("{}")
    assert "layers" in failed(root, all_pixels=False)
    (house_of(root) / "views/v0/view.json").write_text("[]")
    assert "layers" in failed(root, all_pixels=False)
    (house_of(root) / "house.glb").write_bytes(b"glTF")
    assert "layers" in failed(root, all_pixels=False)


@pytest.mark.parametrize("make", [os.mkfifo, lambda p: p.symlink_to("/dev/zero"), _sparse])
@pytest.mark.parametrize(
    ("file", "check"),
    [
        ("house.glb", "layers"),
        ("views/v0/view.json", "layers"),
        ("views/v0/depth.png", "layers"),
        ("done/house.json", "markers"),
        ("manifest.jsonl", "files"),
    ],
)
def test_pipes_devices_and_giants_in_a_root_are_failures_that_cost_nothing(root, file, check, make):
    path = house_of(root) / file
    path.unlink()
    make(path)
    assert check in failed(root, all_pixels=False)


def test_a_pipe_for_the_lux_of_rooms_is_as_none(root):
    os.mkfifo(house_of(root) / "illuminance.json")
    assert not failed(root, all_pixels=False)


def test_one_damaged_view_json_costs_its_own_view_alone(root):
    (house_of(root) / "views/v0/view.json").write_text("[" * 100_000)
    certificate = verify(root, sample=10)
    assert certificate.n_views == 1
    assert any("view.json: is no JSON" in line for line in certificate.failures)
    assert certificate.counts["ray: depth"].checked == 10


def test_a_newline_in_a_stored_name_forges_no_line_of_the_certificate(root):
    manifest = house_of(root) / "manifest.jsonl"
    row = json.dumps({"key": "houses/x\nCLEAN", "bytes": 1, "sha256": ""})
    manifest.write_text(manifest.read_text() + row + "\n")
    assert "\nCLEAN" not in verify(root, sample=1).text()


def test_markers_that_disagree_with_the_manifest_are_caught(root):
    marker = house_of(root) / "done/truth.v0.json"
    marker.write_text(marker.read_text().replace('"n_bytes":', '"n_bytes":1', 1))
    assert failed(root, all_pixels=False) == {"markers"}


def test_a_folder_that_is_no_output_root_is_told_so(tmp_path):
    with pytest.raises(BadInput, match="no houses here"):
        verify(tmp_path)


def test_a_root_without_views_is_not_clean(tmp_path):
    (tmp_path / "houses/empty").mkdir(parents=True)
    assert not verify(tmp_path).is_clean


@pytest.fixture(scope="module")
def rich(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("rich")
    make_root(root, with_optional=True)
    return root


def test_optional_layers_are_checked_where_they_exist(rich):
    certificate = verify(rich, all_pixels=True)
    assert certificate.is_clean, certificate.text()
    names = {"ray: depth_z", "ray: position", "ray: normal_world", "ray: material", "ray: glass"}
    names |= {f"ray: behind glass {x}" for x in ("depth", "normal", "semantic", "instance")}
    assert names | {"nyu13", "class_source", "boundary_semantic"} <= certificate.counts.keys()


@pytest.mark.parametrize(
    ("file", "check"),
    [
        ("normal_world.png", "ray: normal_world"),
        ("material.png", "ray: material"),
        ("glass.png", "ray: glass"),
        ("behind_glass/depth.png", "ray: behind glass depth"),
        ("behind_glass/instance.png", "ray: behind glass instance"),
        ("nyu13.png", "nyu13"),
        ("class_source.png", "class_source"),
        ("boundary_semantic.png", "boundary_semantic"),
        ("boundary_occlusion.png", "boundary_occlusion"),
        ("normal_shading.png", "normal_shading"),
    ],
)
def test_one_changed_pixel_of_an_optional_layer_is_caught(rich, tmp_path, file, check):
    shutil.copytree(rich, tmp_path / "root")
    house = house_of(tmp_path / "root")
    changed_pixel(house / "views/v0" / file, 48, 64, 1 if "normal" not in file else 900)
    sign(tmp_path / "root", house)
    assert check in failed(tmp_path / "root")


def test_two_views_of_one_room_must_agree_where_things_are(tmp_path):
    home = builtin_home()
    eye, intrinsics = home.cameras[0].eye, Intrinsics.from_hfov(*SIZE)
    towards = home.cameras[0].towards
    cameras = {
        "v0": Camera.look(intrinsics, eye, towards),
        "v1": Camera.look(intrinsics, eye + np.array([0.3, 0.1, 0.2]), towards),
    }
    house = make_root(tmp_path, home, cameras)
    assert verify(tmp_path).is_clean
    assert verify(tmp_path).counts["reprojection"].checked > 20

    def forward(table):
        for name in ("world_from_camera_opengl", "world_from_camera_opencv"):
            for row in range(3):
                table[name][row][3] += 0.5 * towards[row]

    edit_table(tmp_path, forward)
    certificate = verify(tmp_path, sample=0)
    assert certificate.counts["reprojection"].failed > 0
    assert house.name in certificate.text()


def test_a_view_that_sees_nothing_is_clean(tmp_path):
    home = builtin_home()
    away = Camera.look(Intrinsics.from_hfov(*SIZE), np.array([0, 50.0, 0]), np.array([0, 1.0, 0.1]))
    make_root(tmp_path, home, {"v0": away}, with_optional=True)
    certificate = verify(tmp_path, all_pixels=True)
    assert certificate.is_clean, certificate.text()
    assert certificate.counts["ray: valid"].checked == SIZE[0] * SIZE[1]


def test_a_black_picture_by_outdoor_light_is_noted_and_one_by_opengl_fails(root):
    black = png_from_array(np.zeros((SIZE[1], SIZE[0], 3), np.uint8))
    house = house_of(root)
    for name in ("mlt_ol.png", "opengl_dl.png"):
        (house / "views/v0" / name).write_bytes(black)
        (house / f"done/{name}.v0.json").write_text(json.dumps({"files": [f"views/v0/{name}"]}))
    sign(root, house)
    certificate = verify(root, sample=10)
    assert certificate.counts["pictures"].failed == 1
    assert any("opengl_dl.png: is one colour" in f for f in certificate.failures)
    assert any("mlt_ol.png is one colour" in n for n in certificate.notes)


def test_a_picture_that_all_light_leaves_black_fails_and_a_dark_room_is_noted(root):
    house = house_of(root)
    for name, level in (("v0", 0.0), ("v1", 0.01)):
        view = house / f"views/{name}"
        planes = {
            f"{g}.{c}": np.full(SIZE[::-1], level, np.float32)
            for g in ("outdoor", "indoor", "albedo")
            for c in "RGB"
        }
        (view / "radiance.exr").write_bytes(exr_from_layers(planes))
        table = json.loads((view / "view.json").read_text()) | {"room": "0_0"}
        (view / "view.json").write_text(json.dumps(table))
        (house / f"done/light.{name}.json").write_text(
            json.dumps({"files": [f"views/{name}/radiance.exr"]})
        )
    rows = [{"room": "0_0", "outdoor_lx": 0.0, "indoor_lx": 0.4}]
    (house / "illuminance.json").write_text(json.dumps({"rooms": rows}))
    (house / "done/illuminance.json").write_text(json.dumps({"files": ["illuminance.json"]}))
    sign(root, house)
    certificate = verify(root, sample=10)
    count = certificate.counts["black pictures"]
    assert (count.checked, count.failed) == (2, 1)
    assert any(f"black pictures: {house.name}/v0: all light" in f for f in certificate.failures)
    assert any("v1 stands in room 0_0, which has 0.4 lx" in n for n in certificate.notes)


def replaced(file: Path, change) -> None:  # type: ignore[no-untyped-def]
    file.write_bytes(png_from_array(change(array_from_png(file.read_bytes()))))


def test_depth_along_the_ray_does_not_lie_on_the_normals_planes(root):
    view = house_of(root) / "views/v0"
    intrinsics = Intrinsics.from_hfov(*SIZE)
    x = (np.arange(SIZE[0]) + 0.5 - intrinsics.cx) / intrinsics.fx
    y = (np.arange(SIZE[1]) + 0.5 - intrinsics.cy) / intrinsics.fy
    longer = np.sqrt(1 + x[None, :] ** 2 + y[:, None] ** 2)
    replaced(view / "depth.png", lambda depth: np.rint(depth * longer).astype(np.uint16))
    sign(root, house_of(root))
    assert verify(root, sample=0).counts["depth on planes"].failed > 1000


def test_normals_in_another_frame_do_not_fit_the_depth(root):
    view = house_of(root) / "views/v0"
    replaced(view / "normal.png", lambda normal: np.ascontiguousarray(normal[..., [0, 2, 1]]))
    sign(root, house_of(root))
    assert verify(root, sample=0).counts["depth on planes"].failed > 1000


def with_frame_in_wall(by_m: float) -> House:
    """The small home with a sheet before every wall's larger faces, by_m off their plane."""
    home = builtin_home()
    frames = []
    for item in home.items:
        if item.kind is not ItemKind.WALL:
            continue
        surfaces = []
        for s in item.surfaces:
            corners = s.positions[s.faces].astype(np.float64)
            normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
            normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
            upright = np.abs(normals[:, 1]) < 0.1
            # Smaller triangles about the same middle, each in the plane of its own.
            middle = corners.mean(1, keepdims=True)
            small = (middle + 0.8 * (corners - middle) + by_m * normals[:, None])[upright]
            faces = np.arange(3 * len(small)).reshape(-1, 3).astype(np.int32)
            surfaces.append(
                Surface("frame", small.reshape(-1, 3).astype(np.float32), faces, s.material)
            )
        frame = replace(item, id=f"frame_{item.id}", name="frame", kind=ItemKind.WINDOW, nyu40=9, surfaces=tuple(surfaces), tags=())  # fmt: skip
        frames.append(frame)
    return home.with_items([*frames, *home.items])


@pytest.mark.parametrize("by_m", [0.0, 2e-5])
def test_coincident_surfaces_of_the_source_are_told_by_pairs_and_no_failure(tmp_path, by_m):
    make_root(tmp_path, with_frame_in_wall(by_m), with_optional=True)
    certificate = verify(tmp_path, all_pixels=True)
    assert certificate.is_clean, certificate.text()
    if by_m == 0.0:
        n = sum(c.pixels for c in certificate.coincident)
        assert n > 0.0002 * certificate.counts["ray: instance"].checked
        assert certificate.counts["ray: instance"].ties <= 5
        pair = certificate.coincident[0]
        assert pair.items[0].startswith("frame_")
        assert f"{pair.items[0]} and {pair.items[1]}: {pair.pixels}" in certificate.text()


def test_a_wrong_item_on_a_surface_of_its_own_still_fails(root):
    changed_pixel(house_of(root) / "views/v0/instance.png", 48, 64, 1)
    sign(root, house_of(root))
    assert not verify(root, all_pixels=True).is_clean
    assert verify(root, all_pixels=True).coincident == ()


def test_surfaces_half_a_millimetre_apart_do_not_coincide(tmp_path):
    make_root(tmp_path, with_frame_in_wall(5e-4))
    certificate = verify(tmp_path, all_pixels=True)
    assert certificate.is_clean, certificate.text()
    assert certificate.coincident == ()
