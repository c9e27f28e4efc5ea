"""Homes in URDF and SDF: items, rooms, joints, included models, and notes on faults."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.house import House, Item, ItemKind
from pbrs_farm.core.recipe import ReadFields
from pbrs_farm.geometry.solids import box
from pbrs_farm.prepare.read_source import read_house
from pbrs_farm.prepare.source import resolve
from tests.inputs.robot_files import BOXES, RED, write_sdf, write_urdf
from tests.read.gltf.gltf_scenes import Scene

Write = Callable[[Path], Path]
WRITERS = [write_urdf, write_sdf, partial(write_sdf, is_included=True)]
MUG = """<model name="mug"><pose degrees="true">3 1 0.5 0 0 90</pose><link name="l"><visual name="v">
<pose>0.1 0 0 0 0 0</pose><geometry><mesh><uri>{uri}</uri><scale>0.1 0.1 0.2</scale></mesh></geometry>
</visual>{more}</link></model>"""


def house(path: Path) -> House:
    return read_house(resolve(str(path)), ReadFields())


def item(home: House, name: str) -> Item:
    return next(i for i in home.items if i.name == name)


@pytest.mark.parametrize("write", WRITERS)
def test_links_and_models_are_items_with_joints_in_one_room(tmp_path: Path, write: Write) -> None:
    home = house(write(tmp_path))
    assert {i.name for i in home.items} == set(BOXES)
    assert home.notes == ()
    assert len(home.rooms) == 1
    kinds = [i.kind for i in home.items]
    assert (kinds.count(ItemKind.WALL), kinds.count(ItemKind.FLOOR)) == (4, 1)
    cabinet = item(home, "cabinet")
    assert cabinet.nyu40 == 3
    # z up becomes y up: (x, y, z) -> (x, z, -y); the door is closed in front.
    low, high = cabinet.bounds
    assert low == pytest.approx([0.7, 0, -3.0], abs=1e-6)
    assert high == pytest.approx([1.3, 1.8, -2.37], abs=1e-6)
    (joint,) = cabinet.joints
    assert joint.point == pytest.approx((1.3, 0.9, -2.38), abs=1e-6)
    assert (joint.axis, joint.lower, joint.upper) == ((0, 1, 0), 0, 1.5)
    colours = [home.materials[s.material].diffuse for s in cabinet.surfaces if s.part]
    assert colours[0][0] > 5 * colours[0][1]


def test_a_mesh_is_turned_scaled_and_lit_as_its_model_says(tmp_path: Path) -> None:
    cube = Scene()
    cube.node("mesh", mesh=cube.box([-0.5, -0.5, -0.5], [0.5, 0.5, 0.5]))
    (tmp_path / "mug.glb").write_bytes(cube.glb())
    light = '<light type="point" name="bulb"><pose>0 0 0.3 0 0 0</pose></light>'
    home = house(write_sdf(tmp_path, MUG.format(uri="mug.glb", more=light)))
    mug = item(home, "mug")
    # A quarter turn about z takes the offset along x to y, which is -z of ours.
    assert mug.bounds == pytest.approx(np.array([[2.95, 0.4, -1.15], [3.05, 0.6, -1.05]]), abs=1e-6)
    assert mug.lights[0].position == pytest.approx((3, 0.8, -1))


@pytest.mark.parametrize(
    ("uri", "kind", "text"),
    [
        ("gone.glb", "missing-model", "1 models are not here: gone.glb"),
        (
            "mug.dae",
            "unread-part",
            "1 models are not read; models are .glb, .gltf, .obj, .stl: mug.dae",
        ),
        ("damaged.glb", "unreadable-model", "it is left out"),
        ("../../mug.glb", "unreadable-model", "leads out of the folder"),
    ],
)
def test_a_model_that_cannot_be_read_is_a_note(
    tmp_path: Path, uri: str, kind: str, text: str
) -> None:
    (tmp_path / "damaged.glb").write_bytes(b"glTF, it says")
    home = house(write_sdf(tmp_path, MUG.format(uri=uri, more="")))
    assert {i.name for i in home.items} == set(BOXES)
    (note,) = home.notes
    assert note.kind == kind
    assert text in note.text


@pytest.mark.parametrize(
    "model",
    [
        '<model name="m"><pose>1 2 three 0 0 0</pose><link name="l"/></model>',
        '<model name="m"><link name="l"><pose relative_to="k"/></link><link name="k"><pose relative_to="l"/></link></model>',
        "<include><uri>model://nowhere</uri></include>",
    ],
)
def test_a_damaged_or_missing_model_is_left_out_of_its_world(tmp_path: Path, model: str) -> None:
    home = house(write_sdf(tmp_path, model))
    assert {i.name for i in home.items} == set(BOXES)
    assert len(home.notes) == 1


@pytest.mark.parametrize(
    ("old", "new", "lost"),
    [
        ('<axis xyz="0 0 1"/>', '<axis xyz="0 0 0"/>', {"cabinet_door"}),
        ('<box size="0.6 0.6 1.8"/>', '<box size="0.6 wide 1.8"/>', {"cabinet", "cabinet_door"}),
    ],
)
def test_a_damaged_link_is_left_out_with_those_below_it(
    tmp_path: Path, old: str, new: str, lost: set[str]
) -> None:
    path = write_urdf(tmp_path)
    path.write_text(path.read_text().replace(old, new))
    home = house(path)
    assert {i.name for i in home.items} == set(BOXES) - lost
    assert sum(len(i.joints) for i in home.items) == 0
    assert [n.kind for n in home.notes] == ["unreadable-model"]


def test_a_change_of_an_included_model_is_seen(tmp_path: Path) -> None:
    path = write_sdf(tmp_path, is_included=True)
    before = resolve(str(path)).companions
    file = tmp_path / "models/cupboard/model.sdf"
    file.write_text(file.read_text().replace("1.5", "1.4"))
    assert before != resolve(str(path)).companions != ""


def test_a_world_without_any_of_its_models_says_so(tmp_path: Path) -> None:
    path = tmp_path / "house.world"
    path.write_text("<sdf><world><include><uri>model://house</uri></include></world></sdf>")
    with pytest.raises(BadHouse, match=r"none of its models is here.*--models FOLDER"):
        house(path)


def test_a_single_robot_is_no_home(tmp_path: Path) -> None:
    path = tmp_path / "arm.urdf"
    box = '<visual><geometry><box size="1 1 1"/></geometry></visual>'
    path.write_text(f'<robot name="arm"><link name="base">{box}</link></robot>')
    with pytest.raises(BadHouse, match="has no floor"):
        house(path)


def test_walls_of_one_model_on_a_plane_are_a_room(tmp_path: Path) -> None:
    """A house drawn in Gazebo: links of one model, the ground of Gazebo's library, a state."""
    walls = ""
    for name, (middle, size) in BOXES.items():
        if name.startswith("wall"):
            box = f"<geometry><box><size>{size[0]} {size[1]} {size[2]}</size></box></geometry>"
            place = f"<pose>{middle[0]} {middle[1]} {middle[2]} 0 0 0</pose>"
            walls += f'<link name="{name}">{place}<visual name="v">{box}</visual></link>'
    path = tmp_path / "house.world"
    path.write_text(
        '<sdf version="1.6"><world name="default"><include><uri>model://sun</uri></include>'
        "<include><uri>model://ground_plane</uri></include>"
        f'<model name="my_house"><pose>9 9 0 0 0 0</pose>{walls}</model><state world_name="default">'
        '<model name="my_house"><pose>1 0 0 0 0 0</pose></model></state><model name="far_ball">'
        '<pose>90 0 1 0 0 0</pose><link name="link"><visual name="v"><geometry><sphere><radius>1</radius>'
        "</sphere></geometry></visual></link></model></world></sdf>"
    )
    home = house(path)
    assert home.notes == ()
    assert {i.name for i in home.items} == {
        "ground",
        "far_ball",
        *(n for n in BOXES if n.startswith("wall")),
    }
    (room,) = home.rooms
    assert room.polygon.min(0) == pytest.approx([1, -3], abs=0.01)
    assert room.polygon.max(0) == pytest.approx([5, 0], abs=0.01)
    assert room.floor_y == pytest.approx(0, abs=1e-6)


def test_a_world_that_includes_itself_ends(tmp_path: Path) -> None:
    path = tmp_path / "a.sdf"
    include = "<include><uri>a.sdf</uri></include>"
    path.write_text(f"<sdf><world name='w'/>{include * 3}</sdf>")
    with pytest.raises(BadHouse, match="more than 10000 models and includes"):
        house(path)


def _stl(*, is_binary: bool, damage: str = "") -> bytes:
    """A cube of one metre about the origin."""
    cube = box("", np.zeros(3), np.full(3, 0.5), 0)
    corners = cube.positions[cube.faces].astype("<f4")
    if is_binary:
        facets = b"".join(bytes(12) + facet.tobytes() + bytes(2) for facet in corners)
        return bytes(80) + len(corners).to_bytes(4, "little") + facets
    rows = ["solid cube"]
    for facet in corners.tolist():
        vertices = [f"vertex {x} {y} {z}" for x, y, z in facet]
        rows += ["facet normal 0 0 0", "outer loop", *vertices, "endloop", "endfacet"]
    return (
        "\n".join([*rows, "endsolid"]).replace("vertex 0.5", f"vertex {damage or 0.5}")
    ).encode()


@pytest.mark.parametrize("is_binary", [True, False])
def test_an_stl_has_sharp_edges_and_its_visuals_colour(tmp_path: Path, is_binary: bool) -> None:
    (tmp_path / "mug.stl").write_bytes(_stl(is_binary=is_binary))
    colour = f"<material><diffuse>{RED}</diffuse></material></visual>"
    model = MUG.format(uri="mug.stl", more="").replace("</visual>", colour)
    home = house(write_sdf(tmp_path, model))
    mug = item(home, "mug")
    assert np.ptp(mug.bounds, axis=0) == pytest.approx([0.1, 0.2, 0.1], abs=1e-6)
    (surface,) = mug.surfaces
    assert surface.normals is not None
    assert np.abs(surface.normals).max(1) == pytest.approx(np.ones(24), abs=1e-6)
    red, green, _blue = home.materials[surface.material].diffuse
    assert red > 5 * green


@pytest.mark.parametrize("data", [b"", _stl(is_binary=False, damage="wide"), bytes(84)])
def test_a_damaged_stl_is_a_note(tmp_path: Path, data: bytes) -> None:
    (tmp_path / "mug.stl").write_bytes(data)
    home = house(write_sdf(tmp_path, MUG.format(uri="mug.stl", more="")))
    assert [n.kind for n in home.notes] == ["unreadable-model"]
