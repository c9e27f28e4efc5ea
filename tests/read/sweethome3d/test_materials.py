"""Materials, textures, panes, mirrors and lamps of Sweet Home 3D homes."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pbrs_farm.core.house import House, Item, ItemKind, Material, MaterialKind, Surface
from pbrs_farm.read.builtin.builtin_home import checks, png_from_srgb8
from pbrs_farm.read.sweethome3d.home import read_home
from tests.read.sweethome3d.sh3d_source import BOX_OBJ, WALLS, WINDOW_OBJ, home_xml, piece, sh3d

PNG = png_from_srgb8(checks(4, 2, (255, 0, 0), (0, 0, 255)))


def read(body: str, contents: dict[str, bytes] | None = None) -> House:
    return read_home(sh3d(home_xml(body), {"1": BOX_OBJ, **(contents or {})}), "test.sh3d")


def item(house: House, item_id: str) -> Item:
    return next(i for i in house.items if i.id == item_id)


def look(house: House, item_id: str, surface: int = 0) -> tuple[Surface, Material]:
    s = item(house, item_id).surfaces[surface]
    return s, house.materials[s.material]


def test_only_a_wall_without_a_colour_is_marked_default() -> None:
    house = read(WALLS.replace("id='a'", "id='a' leftSideColor='FF804020' leftSideShininess='0.5'"))
    _, left_paint = look(house, "wall_a", 0)
    _, right = look(house, "wall_a", 1)
    assert left_paint.diffuse == pytest.approx((128 / 255, 64 / 255, 32 / 255))
    assert left_paint.specular == (0.5, 0.5, 0.5)
    assert left_paint.shininess == 64
    assert not left_paint.is_default
    assert right.is_default
    assert right.diffuse == (1.0, 1.0, 1.0)


def test_wall_texture_coordinates_count_tiles_of_the_real_size() -> None:
    texture = "<texture attribute='leftSideTexture' name='Brick' width='50' height='25' image='t'/>"
    walls = WALLS.replace(
        "yEnd='0' thickness='10'/>", f"yEnd='0' thickness='10'>{texture}</wall>", 1
    )
    house = read(walls, {"t": PNG})
    surface, material = look(house, "wall_a", 0)
    assert material.texture_id in house.textures
    assert surface.uvs is not None
    assert np.ptp(surface.uvs[:, 0]) == pytest.approx(4.1 / 0.5, rel=1e-5)
    assert np.ptp(surface.uvs[:, 1]) == pytest.approx(2.5 / 0.25, rel=1e-5)
    # Not mirrored: u grows to the right for a viewer facing the left side (towards -z).
    order = surface.positions[:, 0].argsort()
    assert surface.uvs[order[0], 0] > surface.uvs[order[-1], 0]


def test_texture_scale_and_angle_act_on_tiles() -> None:
    texture = (
        "<texture attribute='floorTexture' name='Tiles' width='20' height='20' scale='2'"
        f" angle='{math.pi / 2}' image='t'/>"
    )
    room = f"<room name='R'><point x='0' y='0'/><point x='100' y='0'/><point x='100' y='300'/><point x='0' y='300'/>{texture}</room>"
    house = read_home(sh3d(home_xml("", room=room), {"t": PNG}), "test.sh3d")
    surface, _ = look(house, "floor_0_0")
    assert surface.uvs is not None
    assert np.ptp(surface.uvs[:, 0]) == pytest.approx(3.0 / 0.4, rel=1e-4)
    assert np.ptp(surface.uvs[:, 1]) == pytest.approx(1.0 / 0.4, rel=1e-4)


def test_a_piece_takes_its_models_colours_unless_the_home_overrides_them() -> None:
    house = read(
        piece("")
        + piece("color='FF00FF00' shininess='0.25'")
        + piece("color='FF00FF00'", "<material name='white' color='FF0000FF'/>")
    )
    _, override = look(house, "piece_0")
    _, whole = look(house, "piece_1")
    _, named = look(house, "piece_2")
    assert override.diffuse == pytest.approx((0.64, 0.64, 0.64), abs=0.4)
    assert whole.diffuse == (0.0, 1.0, 0.0)
    assert whole.shininess == 32
    assert named.diffuse == (0.0, 0.0, 1.0)


def test_a_material_made_invisible_is_left_out() -> None:
    two = BOX_OBJ.replace(b"f 2 3 7 6", b"usemtl red\nf 2 3 7 6")
    house = read(piece("", "<material name='red' color='00000000'/>"), {"1": two})
    assert [s.name for s in item(house, "piece_0").surfaces] == ["white"]


def test_a_home_texture_is_in_centimetres_on_every_side() -> None:
    texture = "<texture name='Wood' width='50' height='50' image='t'/>"
    house = read(piece("", texture), {"t": PNG})
    surface, material = look(house, "piece_0")
    assert material.texture_id is not None
    assert surface.uvs is not None
    a, b, c = (surface.positions[surface.faces[:, k]] for k in range(3))
    u, v, w = (surface.uvs[surface.faces[:, k]] for k in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    d, e = v - u, w - u
    uv_area = np.abs(d[:, 0] * e[:, 1] - d[:, 1] * e[:, 0])
    assert uv_area * 0.25 == pytest.approx(area, rel=1e-4)


def test_a_models_texture_is_looked_up_beside_its_mtl() -> None:
    obj = b"mtllib c.mtl\nvt 0 0\n" + BOX_OBJ.replace(b"usemtl white", b"usemtl w").replace(
        b"f 4 3 2 1", b"f 4/1 3/1 2/1 1/1"
    )
    obj = obj.replace(
        b"f 5 6 7 8\nf 1 2 6 5\nf 3 4 8 7\nf 2 3 7 6\nf 4 1 5 8", b"f 5/1 6/1 7/1 8/1"
    )
    contents = {
        "2/c/c.obj": obj,
        "2/c/c.mtl": rb"newmtl w" + b"\nKd 0.5 0.5 0.5\nmap_Kd C:\\art\\pic.png\n",
        "2/c/pic.png": PNG,
    }
    house = read(piece("model='2/c/c.obj'"), contents)
    _, material = look(house, "piece_0")
    assert material.texture_id is not None
    assert material.diffuse == (1.0, 1.0, 1.0)
    assert not house.notes or all(n.kind != "missing-texture" for n in house.notes)


def test_a_black_material_with_a_missing_picture_is_grey() -> None:
    obj = b"mtllib c.mtl\n" + BOX_OBJ.replace(b"usemtl white", b"usemtl w")
    mtl = b"newmtl w\nKd 0 0 0\nmap_Kd pic.png\n"
    house = read(piece("model='2/c/c.obj'"), {"2/c/c.obj": obj, "2/c/c.mtl": mtl})
    assert look(house, "piece_0")[1].diffuse == (0.8, 0.8, 0.8)


def test_a_texture_that_cannot_be_read_is_noted_and_the_colour_stays() -> None:
    texture = "<texture attribute='floorTexture' name='T' width='50' height='50' image='{}'/>"
    for image, kind in (("absent", "missing-texture"), ("junk", "unreadable-texture")):
        room = f"<room floorColor='FF102030'><point x='0' y='0'/><point x='300' y='0'/><point x='300' y='300'/>{texture.format(image)}</room>"
        house = read_home(sh3d(home_xml("", room=room), {"junk": b"no picture"}), "t.sh3d")
        assert [n.kind for n in house.notes] == [kind]
        _, material = look(house, "floor_0_0")
        assert material.diffuse == pytest.approx((16 / 255, 32 / 255, 48 / 255))


def test_glass_of_windows_is_a_pane_and_other_glass_is_glass() -> None:
    window = piece("model='2' catalogId='eTeks#window85x123' y='0' depth='20'", tag="doorOrWindow")
    house = read(WALLS + window + piece("model='2' name='Oven'"), {"2": WINDOW_OBJ})
    thing = item(house, "piece_0")
    kinds = {s.name: house.materials[s.material].kind for s in thing.surfaces}
    assert kinds == {"white": MaterialKind.OPAQUE, "pane:white": MaterialKind.PANE}
    assert thing.kind is ItemKind.WINDOW
    assert thing.nyu40 == 9
    assert house.openings[0].is_window
    vase = item(house, "piece_1")
    assert MaterialKind.GLASS in {house.materials[s.material].kind for s in vase.surfaces}


def test_a_mirror_group_is_a_mirror() -> None:
    obj = WINDOW_OBJ.replace(b"sweethome3d_window_pane_on_hinge_1", b"sweethome3d_window_mirror")
    house = read(piece("model='2'"), {"2": obj})
    assert any(m.kind is MaterialKind.MIRROR for m in house.materials)


LAMP = "<lightSource x='0.25' y='0.1' z='0.9' color='00FF8000' diameter='0.1'/>"


def test_a_light_source_is_at_fractions_of_the_box_from_left_front_bottom() -> None:
    house = read(piece("power='0.5'", LAMP, tag="light"))
    lamp = item(house, "piece_0")
    (light,) = lamp.lights
    # Box 0.5..2.5 x 0..0.5 x 0.5..1.5; front is +z.
    assert light.position == pytest.approx((1.0, 0.45, 1.4))
    assert light.radius_m == pytest.approx(0.1)
    assert light.power == 0.5
    assert light.share == 1.0
    assert light.rgb_linear[0] == 1.0
    assert light.rgb_linear[1] == pytest.approx(0.2158, abs=1e-3)
    assert lamp.kind is ItemKind.LAMP


def test_a_mirrored_lamp_mirrors_its_source() -> None:
    house = read(piece("power='0.5' modelMirrored='true'", LAMP, tag="light"))
    assert item(house, "piece_0").lights[0].position == pytest.approx((2.0, 0.45, 1.4))


def test_a_lamp_switched_off_gives_no_light() -> None:
    assert item(read(piece("power='0'", LAMP, tag="light")), "piece_0").lights == ()


def test_sources_share_their_lamps_power_by_brightness() -> None:
    second = LAMP.replace("FF8000", "552A00")
    lights = item(read(piece("power='0.8'", LAMP + second, tag="light")), "piece_0").lights
    assert sum(x.share for x in lights) == pytest.approx(1.0)
    assert lights[0].share / lights[1].share == pytest.approx(3.0)


def test_named_light_materials_and_light_groups_glow() -> None:
    two = BOX_OBJ.replace(b"f 2 3 7 6", b"usemtl bulb\nf 2 3 7 6")
    by_name = read(
        piece("power='0.5'", LAMP + "<lightSourceMaterial name='bulb'/>", tag="light"), {"1": two}
    )
    group = BOX_OBJ.replace(b"f 2 3 7 6", b"g sweethome3d_light_1\nf 2 3 7 6")
    by_group = read(piece("power='0.5'", LAMP, tag="light"), {"1": group})
    for house in (by_name, by_group):
        lamp = item(house, "piece_0")
        (glowing,) = lamp.lights[0].emitting
        assert house.materials[lamp.surfaces[glowing].material].kind is MaterialKind.BULB


def test_a_light_source_without_a_body_is_kept_as_a_lamp() -> None:
    house = read(piece("power='0.5' model='2'", LAMP, tag="light"), {"2": b"v 0 0 0\n"})
    lamp = item(house, "piece_0")
    assert lamp.surfaces == ()
    assert len(lamp.lights) == 1


def test_movable_parts_have_the_pose_saved_in_the_home() -> None:
    obj = BOX_OBJ.replace(b"f 4 3 2 1", b"g sweethome3d_opening_on_hinge_1\nf 4 3 2 1")
    shift = "<transformation name='sweethome3d_hinge_1' matrix='1 0 0 1  0 1 0 0  0 0 1 0'/>"
    house = read(piece("", shift), {"1": obj})
    low, high = item(house, "piece_0").bounds
    # The moved side doubles the model's width; the box is the home's.
    assert [low[0], high[0]] == pytest.approx([0.5, 2.5], abs=1e-6)
    back = item(house, "piece_0").surfaces[0].positions
    moved = back[np.isclose(back[:, 2], 0.5)]
    assert moved[:, 0].max() == pytest.approx(2.5)


def test_a_walls_ends_wear_its_sides_colour_and_not_its_tops() -> None:
    colours = "leftSideColor='FFFF0000' rightSideColor='FF0000FF' topColor='FF101010'"
    house = read(WALLS.replace("id='a'", f"id='a' {colours}"))
    names = [s.name for s in item(house, "wall_a").surfaces]
    for name in ("start", "end", "bottom"):
        assert look(house, "wall_a", names.index(name))[1].diffuse == (1.0, 0.0, 0.0)
    assert look(house, "wall_a", names.index("top"))[1].diffuse == pytest.approx((16 / 255,) * 3)
