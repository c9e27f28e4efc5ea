"""A home as a MuJoCo model: placement, joints, refused files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.house import House, Item, ItemKind
from pbrs_farm.core.joints import JointKind
from pbrs_farm.core.recipe import ReadFields
from pbrs_farm.images import png_from_array
from pbrs_farm.prepare.formats import format_of_file
from pbrs_farm.prepare.read_source import read_house
from pbrs_farm.prepare.source import resolve
from tests.inputs.mjcf_files import ROOM, write_model


def house(path: Path) -> House:
    return read_house(resolve(str(path)), ReadFields())


def item(found: House, name: str) -> Item:
    return next(i for i in found.items if i.name == name)


def bounds(thing: Item, part: str) -> list[list[float]]:
    points = np.concatenate([s.positions for s in thing.surfaces if s.part == part])
    return [points.min(0).tolist(), points.max(0).tolist()]


def test_bodies_are_items_with_y_up(tmp_path: Path) -> None:
    bodies_house = house(write_model(tmp_path))
    fridge = item(bodies_house, "fridge_1")
    assert (fridge.nyu40, item(bodies_house, "cabinet").nyu40) == (24, 3)
    # (x, y, z) with z up is (x, z, -y) with y up.
    box = np.array([[0.7, 0, -2.9], [1.3, 1.8, -2.3]])
    assert bounds(fridge, "") == pytest.approx(box, abs=1e-6)
    cup = item(bodies_house, "mug")
    assert cup.bounds == pytest.approx(np.array([[2.96, 0.8, -1.04], [3.04, 0.9, -0.96]]), abs=1e-6)
    kinds = [i.kind for i in bodies_house.items]
    assert (kinds.count(ItemKind.WALL), kinds.count(ItemKind.CEILING)) == (4, 1)


def test_an_endless_floor_makes_a_room(tmp_path: Path) -> None:
    (room,) = house(write_model(tmp_path)).rooms
    low, high = room.polygon.min(0), room.polygon.max(0)
    assert [low.tolist(), high.tolist()] == pytest.approx(np.array([[0, -3], [4, 0]]), abs=1e-6)
    assert (room.floor_y, room.ceiling_y) == pytest.approx((0, 2.5))


def test_joints_move_their_parts(tmp_path: Path) -> None:
    parts_house = house(write_model(tmp_path))
    (door,) = item(parts_house, "fridge_1").joints
    assert (door.kind, door.part, door.upper) == (JointKind.REVOLUTE, "fridge_1_door", 2)
    assert door.point == pytest.approx((1.3, 0.9, -2.3))
    assert door.axis == pytest.approx((0, 1, 0))
    (tray,) = item(parts_house, "cabinet").joints
    # The cabinet is turned by a quarter: its +y is -x. The rail has a negative range.
    assert (tray.kind, tray.lower, tray.upper) == (JointKind.PRISMATIC, 0, 0.25)
    assert tray.axis == pytest.approx((1, 0, 0), abs=1e-6)
    assert item(parts_house, "mug").joints == ()


def test_the_first_keyframe_gives_the_pose(tmp_path: Path) -> None:
    quarter = np.pi / 2
    key = f'<keyframe><key qpos="{quarter} -.2 3 1 .85 1 0 0 0"/></keyframe>'
    posed_house = house(write_model(tmp_path, more=key))
    # Turned anticlockwise about its right edge, the leaf is in front of the cabinet.
    opened = np.array([[1.3, 0, -2.3], [1.38, 1.8, -1.7]])
    shut = np.array([[0.7, 0, -2.3], [1.3, 1.8, -2.22]])
    fridge = item(posed_house, "fridge_1")
    assert bounds(fridge, "fridge_1_door") == pytest.approx(opened, abs=1e-5)
    (door,) = fridge.joints
    assert door.value == pytest.approx(quarter)
    motion = door.motion(0.0)
    points = np.concatenate([s.positions for s in fridge.surfaces if s.part])
    back = points @ motion[:3, :3].T + motion[:3, 3]
    assert [back.min(0).tolist(), back.max(0).tolist()] == pytest.approx(shut, abs=1e-5)
    assert item(posed_house, "cabinet").joints[0].value == pytest.approx(0.2)


def test_a_joint_drawn_open_by_its_reference_is_open(tmp_path: Path) -> None:
    box = """<body name="safe" pos="1 1 .5"><geom type="box" size=".3 .3 .5"/>
      <body name="safe_door" pos="-.3 -.31 0" euler="0 0 -1.0471975511965976"><geom type="box" size=".3 .01 .4" pos=".3 0 0"/>
      <joint type="hinge" axis="0 0 1" range="-1.5707963267948966 0" ref="-1.0471975511965976"/></body></body>"""
    safe = item(house(write_model(tmp_path, ROOM + box)), "safe")
    (door,) = safe.joints
    assert door.value == pytest.approx(np.pi / 3)
    assert (door.lower, door.upper) == pytest.approx((0, np.pi / 2))
    points = np.concatenate([s.positions for s in safe.surfaces if s.part])
    shut = points @ door.motion(0.0)[:3, :3].T + door.motion(0.0)[:3, 3]
    assert np.ptp(shut[:, 2]) == pytest.approx(0.02, abs=1e-5)


@pytest.mark.parametrize("normals", [False, True])
def test_normals_that_mujoco_generates_are_not_those_of_the_file(
    tmp_path: Path, normals: bool
) -> None:
    (tmp_path / "meshes").mkdir()
    corners = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n"
    faces = ["1 3 2", "1 2 4", "2 3 4", "1 4 3"]
    if normals:
        corners += "vn -1 -1 -1\nvn 1 0 0\nvn 0 1 0\nvn 0 0 1\n"
        faces = [" ".join(f"{k}//{k}" for k in face.split()) for face in faces]
    lines = "".join(f"f {face}\n" for face in faces)
    (tmp_path / "meshes/wedge.obj").write_text(corners + lines)
    assets = """<compiler meshdir="meshes"/><asset><mesh name="wedge" file="wedge.obj"/></asset>"""
    body = '<body name="vase" pos="1 1 1"><geom type="mesh" mesh="wedge"/></body>'
    (surface,) = item(house(write_model(tmp_path, ROOM + body, assets)), "vase").surfaces
    assert (surface.normals is not None) == normals


def test_colliders_and_hidden_geoms_are_not_seen(tmp_path: Path) -> None:
    table = """
      <body name="table" pos="2 1 .4">
        <geom type="box" size=".4 .3 .02" contype="0" conaffinity="0" group="1"/>
        <geom type="box" size=".5 .5 .4"/>
        <geom type="box" size="1 1 1" rgba="0 1 0 0" contype="0" conaffinity="0"/>
        <geom type="box" size="1 1 1" group="3" contype="0" conaffinity="0"/>
      </body>"""
    table_item = item(house(write_model(tmp_path, ROOM + table)), "table")
    assert table_item.bounds == pytest.approx(
        np.array([[1.6, 0.38, -1.3], [2.4, 0.42, -0.7]]), abs=1e-6
    )


def test_a_body_without_a_name_is_named_by_its_contents(tmp_path: Path) -> None:
    chair = '<body><body name="obj_7"><geom name="chair_seat" type="box" pos="1 1 .4" size=".2 .2 .02"/></body></body>'
    assert item(house(write_model(tmp_path, ROOM + chair)), "chair_seat").nyu40 == 5


@pytest.mark.parametrize("name", ["kitchen", "room_4"])
def test_rooms_contain_their_floor_and_items(tmp_path: Path, name: str) -> None:
    walls = "".join(line for line in ROOM.splitlines(True) if "plane" not in line)
    room = f"""<body name="{name}"><geom name="slab_1" type="box" pos="2 1.5 -.005" size="2 1.5 .005"/>
      <body name="oven" pos="1 1 .4"><geom type="box" size=".3 .3 .4"/></body></body>"""
    rooms_house = house(write_model(tmp_path, walls + room))
    assert item(rooms_house, "slab_1").kind is ItemKind.FLOOR
    assert len(rooms_house.rooms) == 1
    assert item(rooms_house, "oven").n_faces == 12


def test_meshes_have_their_pictures_and_colours(tmp_path: Path) -> None:
    (tmp_path / "meshes").mkdir()
    (tmp_path / "meshes/panel.obj").write_text(
        "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"
        "f 1/1 2/2 3/3\nf 1/1 3/3 4/4\n"
    )
    picture = np.zeros((8, 8, 3), np.uint8)
    picture[:4] = (255, 0, 0)  # its upper half
    (tmp_path / "meshes/paint.png").write_bytes(png_from_array(picture))
    assets = """<compiler meshdir="meshes" texturedir="meshes"/><asset>
      <mesh name="panel" file="panel.obj"/><texture name="paint" type="2d" file="paint.png"/>
      <material name="paint" texture="paint" shininess="0"/></asset>"""
    picture_body = (
        '<body name="picture" pos="1 1 1"><geom type="mesh" mesh="panel" material="paint"/></body>'
    )
    picture_house = house(write_model(tmp_path, ROOM + picture_body, assets))
    (surface,) = item(picture_house, "picture").surfaces
    material = picture_house.materials[surface.material]
    assert material.texture_id is not None
    assert surface.uvs is not None
    # The panel's upper edge, at y = 1 in its own frame, shows the picture's upper edge: v = 1 upwards.
    highest = surface.positions[:, 2] < surface.positions[:, 2].min() + 1e-6
    lowest = surface.positions[:, 2] > surface.positions[:, 2].max() - 1e-6
    v = (
        {round(float(x), 6) for x in surface.uvs[highest, 1]},
        {round(float(x), 6) for x in surface.uvs[lowest, 1]},
    )
    assert v == ({1.0}, {0.0})
    red = picture_house.materials[item(picture_house, "wall_n").surfaces[0].material]
    assert red.diffuse == pytest.approx((1, 0, 0), abs=1e-6)


def test_included_files_and_files_that_change_are_seen(tmp_path: Path) -> None:
    (tmp_path / "parts").mkdir()
    part = tmp_path / "parts/sofa.xml"
    part.write_text(
        '<mujocoinclude><body name="sofa" pos="2 1 .3"><geom type="box" size=".9 .4 .3"/></body></mujocoinclude>'
    )
    path = write_model(tmp_path, ROOM + '<include file="parts/sofa.xml"/>')
    assert item(house(path), "sofa").nyu40 == 6
    before = resolve(str(path)).companions
    part.write_text(part.read_text().replace(".9", ".8"))
    assert resolve(str(path)).companions != before


def test_files_above_need_the_folder_of_both(tmp_path: Path) -> None:
    (tmp_path / "things").mkdir()
    (tmp_path / "things/sofa.xml").write_text(
        '<mujocoinclude><body name="sofa"><geom type="box" size=".9 .4 .3"/></body></mujocoinclude>'
    )
    path = write_model(
        tmp_path, ROOM + '<include file="../things/sofa.xml"/>', name="scenes/home.xml"
    )
    with pytest.raises(BadHouse, match=r"sofa.xml.*leads out.*--models"):
        house(path)
    read_home = read_house(resolve(str(path), models=str(tmp_path)), ReadFields())
    assert item(read_home, "sofa").nyu40 == 6


def test_shapes_that_are_not_read_are_a_note(tmp_path: Path) -> None:
    assets = '<asset><hfield name="h" nrow="2" ncol="2" size="1 1 1 .1"/></asset>'
    noted_house = house(write_model(tmp_path, ROOM + '<geom type="hfield" hfield="h"/>', assets))
    assert [(n.kind, n.place) for n in noted_house.notes] == [("unread-part", "height field")]


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("<mujoco", "not valid XML"),
        ("<mujoco><worldbody><geom type='ball'/></worldbody></mujoco>", "MuJoCo cannot load it"),
        ("<mujoco><worldbody><body name='a'/></worldbody></mujoco>", "no floor"),
        ("<mujoco><include file='b.xml'/><worldbody/></mujoco>", "MuJoCo cannot load it"),
        ("<mujoco><worldbody><geom type='box' size='nan 1 1'/></worldbody></mujoco>", "MuJoCo"),
    ],
)
def test_a_file_that_is_no_home_is_named(tmp_path: Path, text: str, what: str) -> None:
    path = tmp_path / "a.xml"
    path.write_text(text)
    with pytest.raises(BadHouse, match=what) as error:
        house(path)
    assert "a.xml" in str(error.value)


def test_xml_of_other_kinds_stays_theirs(tmp_path: Path) -> None:
    path = tmp_path / "Home.xml"
    path.write_text("<?xml version='1.0'?><home version='7000'/>")
    format_found = format_of_file(path)
    assert format_found is not None
    assert format_found.kind == "sweethome3d"


def test_no_file_is_written_to_the_working_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    work = tmp_path / "work"
    work.mkdir()
    monkeypatch.chdir(work)
    with pytest.raises(BadHouse):
        house(write_model(tmp_path, ROOM.replace("2 3.05", "nan 3.05")))
    assert list(work.iterdir()) == []
