import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import pbrs_farm as pf
from pbrs_farm.check import verify
from pbrs_farm.core.camera import Camera, Intrinsics
from pbrs_farm.images import array_from_png, png_from_array
from pbrs_farm.read.builtin.builtin_home import builtin_home
from tests.check.perforated_homes import with_frame_in_wall
from tests.check.roots import SIZE, changed_pixel, edit_table, failed, house_of, make_root, sign
from tests.scene.homes import can, crate, small_home


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


def test_two_views_of_one_room_must_agree_on_places(tmp_path):
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


@pytest.mark.long
@pytest.mark.parametrize("by_m", [0.0, 2e-5])
def test_coincident_surfaces_of_the_source_are_reported_in_pairs_without_failure(tmp_path, by_m):
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


def test_a_wrong_item_on_a_single_surface_still_fails(root):
    changed_pixel(house_of(root) / "views/v0/instance.png", 48, 64, 1)
    sign(root, house_of(root))
    assert not verify(root, all_pixels=True).is_clean
    assert verify(root, all_pixels=True).coincident == ()


@pytest.mark.long
@pytest.mark.parametrize(("by_m", "coincide"), [(0.0, True), (5e-4, False)])
def test_coplanar_parts_of_one_item_in_two_colours_are_reported(tmp_path, by_m, coincide):
    home = builtin_home()
    framed = with_frame_in_wall(by_m)
    frames = {i.id.removeprefix("frame_"): i for i in framed.items if i.id.startswith("frame_")}
    last = max(s.material for i in home.items for s in i.surfaces)
    items = []
    for item in home.items:
        parts = frames[item.id].surfaces if item.id in frames else ()
        parts = tuple(replace(s, material=last) for s in parts)
        items.append(replace(item, surfaces=(*item.surfaces, *parts)))
    make_root(tmp_path, home.with_items(items))
    certificate = verify(tmp_path, all_pixels=True)
    # Instance, depth and normal are right for both: only the colour is arbitrary.
    assert certificate.is_clean, certificate.text()
    listed = [c.items[0] for c in certificate.coincident if c.items[0] == c.items[1]]
    assert bool(listed) == coincide


def test_surfaces_half_a_millimetre_apart_do_not_coincide(tmp_path):
    make_root(tmp_path, with_frame_in_wall(5e-4))
    certificate = verify(tmp_path, all_pixels=True)
    assert certificate.is_clean, certificate.text()
    assert certificate.coincident == ()


@pytest.mark.long
def test_model_coordinates_are_recomputed(tmp_path):
    home = (
        small_home().place(can(tmp_path), at=(2, 0.5, 2)).place(crate(tmp_path), at=(2.1, 0.5, 1.9))
    )
    look = pf.Camera.look_at((1.9, 0.9, 2.6), (2, 0.56, 2), size=(96, 72), hfov_deg=40)
    pf.render(home, look, modes=[], layers=["nocs"]).save(tmp_path / "root")
    root = tmp_path / "root"
    assert verify(root, all_pixels=True).is_clean
    view = next((house_of(root) / "views").iterdir())
    label = array_from_png((view / "nocs.png").read_bytes()).copy()
    rows = json.loads((view / "view.json").read_text())["instances"]
    instance = array_from_png((view / "instance.png").read_bytes())
    posed = np.isin(instance, [r["id"] for r in rows if "model" in r])
    assert (label.any(-1) == posed).all()
    assert posed.sum() > 500
    # A tenth of a model off, and a point off any model.
    for place, value in ((posed, 6000), (~posed, 1)):
        wrong = label.astype(int)
        row, column = np.argwhere(place)[7]
        wrong[row, column] += value
        (view / "nocs.png").write_bytes(png_from_array(wrong.clip(0, 65535).astype(np.uint16)))
        sign(root, house_of(root))
        assert failed(root) == {"ray: nocs"}
