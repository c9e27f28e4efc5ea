"""Sweet Home 3D geometry: every item is placed as the format specifies."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
import shapely
import trimesh

from pbrs_farm.core.frames import rotation_y
from pbrs_farm.core.house import House, Item, ItemKind
from pbrs_farm.read.sweethome3d.home import read_home
from tests.read.sweethome3d.sh3d_source import (
    BOX_OBJ,
    ROOM,
    WALLS,
    WEDGE_OBJ,
    home_xml,
    piece,
    sh3d,
)


def read(body: str, obj: bytes = WEDGE_OBJ, **more: str) -> House:
    return read_home(sh3d(home_xml(body, **more), {"1": obj}), "test.sh3d")


def item(house: House, item_id: str) -> Item:
    return next(i for i in house.items if i.id == item_id)


def solid(surfaces: object) -> trimesh.Trimesh:
    parts = [trimesh.Trimesh(s.positions, s.faces, process=False) for s in surfaces]  # type: ignore[attr-defined]
    mesh = trimesh.util.concatenate(parts)
    mesh.merge_vertices(merge_tex=True, merge_norm=True)
    return mesh


def points(thing: Item) -> np.ndarray:
    return np.concatenate([s.positions for s in thing.surfaces])


def test_a_wall_is_a_closed_solid_with_outward_faces() -> None:
    house = read(WALLS)
    for wall in (i for i in house.items if i.kind is ItemKind.WALL):
        mesh = solid(wall.surfaces)
        assert mesh.is_watertight
        assert mesh.is_winding_consistent
        assert [s.name for s in wall.surfaces] == ["left", "right", "top", "bottom", "start", "end"]
        length = 4.0 if wall.id in ("wall_a", "wall_c") else 3.0
        assert mesh.volume == pytest.approx(length * 0.1 * 2.5, rel=1e-5)


def test_mitred_walls_tile_the_corner_without_overlap() -> None:
    house = read(WALLS)
    outlines = []
    for wall in (i for i in house.items if i.kind is ItemKind.WALL):
        bottom = next(s for s in wall.surfaces if s.name == "bottom")
        outlines.append(shapely.MultiPoint(bottom.positions[:, [0, 2]]).convex_hull)
    ring = shapely.union_all(outlines)
    assert sum(o.area for o in outlines) == pytest.approx(ring.area, abs=1e-5)
    assert ring.area == pytest.approx(4.1 * 3.1 - 3.9 * 2.9, abs=1e-5)


def test_joined_walls_share_their_corner_bit_for_bit() -> None:
    house = read(WALLS)
    walls = [i for i in house.items if i.kind is ItemKind.WALL]
    for a, b in pairwise([*walls, walls[0]]):
        end = {tuple(p) for p in a.surfaces[5].positions.tolist()}
        start = {tuple(p) for p in b.surfaces[4].positions.tolist()}
        assert end == start


def test_left_is_the_left_side_along_the_wall() -> None:
    wall = item(read(WALLS.replace("id='a'", "id='a' leftSideColor='FFFF0000'")), "wall_a")
    left_surface = wall.surfaces[0]
    # From (0, 0) to (4, 0) with y down: left is up on the plan, so z < 0.
    assert left_surface.name == "left"
    assert left_surface.positions[:, 2].max() < 0


def test_a_mitre_stops_at_twice_the_thickness() -> None:
    sharp = (
        "<wall id='a' wallAtEnd='b' xStart='0' yStart='0' xEnd='200' yEnd='0' thickness='10'/>"
        "<wall id='b' wallAtStart='a' xStart='200' yStart='0' xEnd='0' yEnd='20' thickness='10'/>"
    )
    house = read(sharp)
    reach = points(item(house, "wall_a"))[:, 0].max()
    assert reach <= 2.0 + 2 * 0.1 + 1e-5


def test_a_wall_shorter_than_its_neighbours_are_thick_stays_sound() -> None:
    house = read(
        "<wall id='a' wallAtEnd='b' xStart='-200' yStart='0' xEnd='0' yEnd='0' thickness='60'/>"
        "<wall id='b' wallAtStart='a' wallAtEnd='c' xStart='0' yStart='0' xEnd='5' yEnd='5' thickness='10'/>"
        "<wall id='c' wallAtStart='b' xStart='5' yStart='5' xEnd='-60' yEnd='200' thickness='60'/>"
    )
    mesh = solid(item(house, "wall_b").surfaces)
    assert mesh.is_watertight
    assert mesh.volume > 0


def test_an_arc_wall_bulges_to_its_left_and_keeps_its_ends() -> None:
    extent = math.pi / 2
    house = read(
        f"<wall id='a' xStart='0' yStart='0' xEnd='200' yEnd='0' thickness='10' arcExtent='{extent}'/>"
    )
    wall = item(house, "wall_a")
    mesh = solid(wall.surfaces)
    radius = 1 / math.sin(extent / 2)
    assert mesh.is_watertight
    # Exact for the inscribed polygon: area of an annulus sector, chords instead of arcs.
    n = 18
    sector = 0.5 * n * math.sin(extent / n) * ((radius + 0.05) ** 2 - (radius - 0.05) ** 2)
    assert mesh.volume == pytest.approx(sector * 2.5, rel=1e-4)
    assert mesh.bounds[0, 2] == pytest.approx(
        radius * math.cos(extent / 2) - radius - 0.05, abs=1e-3
    )
    assert "arc" in wall.tags


def test_a_sloped_wall_rises_to_its_height_at_the_end() -> None:
    house = read(
        "<wall id='a' xStart='0' yStart='0' xEnd='200' yEnd='0' thickness='10' height='100'"
        " heightAtEnd='250'/>"
    )
    mesh = solid(item(house, "wall_a").surfaces)
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(2 * 0.1 * 1.75, rel=1e-5)


def test_a_wall_upstairs_reaches_down_through_its_floor() -> None:
    house = read(
        "<level id='0' elevation='0' floorThickness='12' height='250'/>"
        "<level id='1' elevation='262' floorThickness='12' height='250'/>"
        "<wall id='a' level='1' xStart='0' yStart='0' xEnd='200' yEnd='0' thickness='10' height='250'/>",
        room=ROOM.replace("<room ", "<room level='0' "),
    )
    low, high = item(house, "wall_a").bounds[:, 1]
    assert low == pytest.approx(2.50, abs=1e-5)
    assert high == pytest.approx(5.12, abs=1e-5)


def test_hidden_levels_are_left_out_unless_requested() -> None:
    body = (
        "<level id='0' elevation='0' floorThickness='12' height='250'/>"
        "<level id='1' elevation='262' floorThickness='12' height='250' visible='false'/>"
        + piece("level='1'")
    )
    room = ROOM.replace("<room ", "<room level='0' ")
    house = read(body, room=room)
    assert [level.id for level in house.levels] == ["0"]
    assert not [i for i in house.items if i.kind is ItemKind.OBJECT]
    assert any(n.kind == "hidden-level" for n in house.notes)


def test_a_hidden_level_between_shown_ones_is_read() -> None:
    levels = "".join(
        f"<level id='{k}' elevation='{262 * k}' floorThickness='12' height='250' {hidden}/>"
        for k, hidden in enumerate(["", "visible='false'", "viewable='false'", "", "visible='0'"])
    )
    levels += "<level id='5' elevation='1310' floorThickness='12' height='250' visible='false'/>"
    house = read(levels, room=ROOM.replace("<room ", "<room level='0' "))
    assert [round(level.elevation, 2) for level in house.levels] == [0.0, 2.62, 5.24, 7.86]
    notes = {n.place[:7]: n.text for n in house.notes if n.kind == "hidden-level"}
    assert notes["level 1"] == "not visible, but between levels that are: read"
    assert "left out" in notes["level 5"]


def test_floors_look_up_and_ceilings_down_over_the_room_exactly() -> None:
    house = read(WALLS)
    for kind, y, up in ((ItemKind.FLOOR, 0.0, 1.0), (ItemKind.CEILING, 2.5, -1.0)):
        thing = next(i for i in house.items if i.kind is kind)
        mesh = solid(thing.surfaces)
        assert mesh.area == pytest.approx(3.9 * 2.9, rel=1e-6)
        assert np.allclose(mesh.face_normals, [0, up, 0])
        assert np.allclose(points(thing)[:, 1], y)
        assert thing.room_id == "0_0"


def test_a_room_polygon_runs_counter_clockwise() -> None:
    polygon = read(WALLS).rooms[0].polygon
    assert shapely.LinearRing(polygon).is_ccw


def test_later_rooms_win_in_overlaps() -> None:
    second = "<room name='Bath'><point x='205' y='5'/><point x='395' y='5'/><point x='395' y='295'/><point x='205' y='295'/></room>"
    house = read("", room=ROOM + second)
    areas = [solid(i.surfaces).area for i in house.items if i.kind is ItemKind.FLOOR]
    assert areas == pytest.approx([2.0 * 2.9, 1.9 * 2.9], rel=1e-5)
    assert house.rooms[0].polygon[:, 0].max() == pytest.approx(2.05)


def test_a_piece_fills_its_box_for_any_units_of_its_model() -> None:
    house = read(piece("elevation='30'"))
    low, high = item(house, "piece_0").bounds
    assert low == pytest.approx([0.5, 0.3, 0.5], abs=1e-6)
    assert high == pytest.approx([2.5, 0.8, 1.5], abs=1e-6)


def test_the_front_of_a_piece_looks_down_the_plan() -> None:
    thing = item(read(piece("")), "piece_0")
    # The wedge's high edge is at its left as seen from its back: x is least where y is greatest.
    top = points(thing)[points(thing)[:, 1] > 0.49]
    assert np.allclose(top[:, 0], 0.5)
    assert np.allclose(thing.oriented_box.axes[:, 2], [0, 0, 1])


def test_a_piece_turns_clockwise_on_the_plan() -> None:
    thing = item(read(piece(f"angle='{math.pi / 2}'")), "piece_0")
    # x' = x cos a - y sin a, y' = x sin a + y cos a: the left edge (-x) goes to -y, i.e. -z.
    top = points(thing)[points(thing)[:, 1] > 0.49]
    assert np.allclose(top[:, 2], 1.0 - 1.0, atol=1e-5)
    assert thing.bounds[1] - thing.bounds[0] == pytest.approx([1.0, 0.5, 2.0], abs=1e-5)


def test_a_mirrored_piece_swaps_left_and_right_and_stays_outward() -> None:
    thing = item(read(piece("modelMirrored='true'")), "piece_0")
    mesh = solid(thing.surfaces)
    top = points(thing)[points(thing)[:, 1] > 0.49]
    assert np.allclose(top[:, 0], 2.5)
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(0.5 * 2 * 1 * 0.5, rel=1e-5)
    assert "mirrored" in thing.tags


def test_shading_normals_follow_the_faces_of_a_mirrored_turned_squeezed_piece() -> None:
    thing = item(read(piece("modelMirrored='true' angle='1.1' roll='0.3' pitch='-0.2'")), "piece_0")
    for s in thing.surfaces:
        mesh = trimesh.Trimesh(s.positions, s.faces, process=False)
        assert s.normals is not None
        dots = (s.normals[s.faces] * mesh.face_normals[:, None]).sum(-1)
        assert dots.min() > 0.999  # the wedge has sharp edges only
        assert np.allclose(np.linalg.norm(s.normals, axis=1), 1, atol=1e-5)


def test_a_model_rotation_turns_the_model_inside_its_box() -> None:
    # 90 degrees about y: model +z becomes +x.
    thing = item(read(piece("modelRotation='0 0 1 0 1 0 -1 0 0'")), "piece_0")
    low, high = thing.bounds
    assert low == pytest.approx([0.5, 0.0, 0.5], abs=1e-6)
    assert high == pytest.approx([2.5, 0.5, 1.5], abs=1e-6)
    top = points(thing)[points(thing)[:, 1] > 0.49]
    # The model's high -x side now faces +z.
    assert np.allclose(top[:, 2], 1.5)


def test_a_tilted_piece_rests_on_its_elevation() -> None:
    thing = item(read(piece(f"pitch='{math.pi / 2}' elevation='20'"), BOX_OBJ), "piece_0")
    low, high = thing.bounds
    assert low[1] == pytest.approx(0.2, abs=1e-5)
    assert high - low == pytest.approx([2.0, 1.0, 0.5], abs=1e-5)


@pytest.mark.parametrize(
    "tilt", ["pitch='0.4'", "roll='-0.3'", "angle='1.1' pitch='0.4' roll='0.3'"]
)
def test_the_box_of_the_tilted_points_is_centred_on_the_place(tilt: str) -> None:
    # The wedge is not symmetric: the centre of its tilted points is not that of its box.
    thing = item(read(piece(f"{tilt} elevation='20'")), "piece_0")
    angle = 1.1 if "angle" in tilt else 0.0
    turned = points(thing) @ rotation_y(-angle)
    low, high = turned.min(0), turned.max(0)
    assert low[1] == pytest.approx(0.2, abs=1e-5)
    centre = rotation_y(-angle) @ ((low + high) / 2)
    assert (centre[0], centre[2]) == pytest.approx((1.5, 1.0), abs=1e-5)


def test_pieces_of_a_group_keep_their_coordinates() -> None:
    group = f"<furnitureGroup name='Set' x='999' y='999' angle='1' width='1' depth='1' height='1'>{piece('')}</furnitureGroup>"
    low, high = item(read(group), "piece_0").bounds
    assert (low + high) / 2 == pytest.approx([1.5, 0.25, 1.0], abs=1e-5)


def test_a_shelf_unit_is_a_piece_like_any_other() -> None:
    shelf = piece("", "<shelf elevation='0.5'/>", tag="shelfUnit")
    assert item(read(shelf), "piece_0").bounds[1] == pytest.approx([2.5, 0.5, 1.5], abs=1e-5)


def test_invisible_pieces_and_groups_are_left_out() -> None:
    hidden = f"<furnitureGroup name='Set' visible='false'>{piece('')}</furnitureGroup>"
    house = read(hidden + piece("visible='false'"))
    assert not [i for i in house.items if i.kind is ItemKind.OBJECT]


def test_a_piece_belongs_to_the_room_around_it() -> None:
    assert item(read(piece("")), "piece_0").room_id == "0_0"
    assert item(read(piece("x='2000'")), "piece_0").room_id is None


def test_stored_cameras_have_the_authors_view() -> None:
    camera = (
        "<observerCamera attribute='storedCamera' name='Door' x='100' y='200' z='160' yaw='0'"
        " pitch='0.1' fieldOfView='1.1'/>"
        "<observerCamera attribute='observerCamera' x='0' y='0' z='0' yaw='0' pitch='0' fieldOfView='1'/>"
    )
    cameras = read(camera).cameras
    assert len(cameras) == 1
    assert cameras[0].eye == pytest.approx([1.0, 1.6, 2.0])
    assert cameras[0].towards == pytest.approx([0, -math.sin(0.1), math.cos(0.1)])
    assert cameras[0].hfov_rad == pytest.approx(1.1)


def test_a_baseboard_is_a_solid_strip_along_the_wall() -> None:
    body = WALLS.replace(
        "yEnd='0' thickness='10'/>",
        "yEnd='0' thickness='10'><baseboard attribute='rightSideBaseboard' thickness='1' height='7'/></wall>",
        1,
    )
    board = item(read(body), "wall_a_right_baseboard")
    mesh = solid(board.surfaces)
    assert mesh.is_watertight
    assert mesh.volume > 0
    assert mesh.bounds[:, 1] == pytest.approx([0, 0.07], abs=1e-5)
    assert mesh.bounds[1, 2] == pytest.approx(0.06, abs=1e-5)
    assert board.kind is ItemKind.WALL


@pytest.mark.parametrize(("gap_cm", "n"), [(90, 2), (180, 1)])
def test_rooms_between_walls_end_at_a_doorway(gap_cm: int, n: int) -> None:
    ends = f"""
    <wall id='e' xStart='250' yStart='0' xEnd='250' yEnd='100' thickness='10'/>
    <wall id='f' xStart='250' yStart='{100 + gap_cm}' xEnd='250' yEnd='300' thickness='10'/>
    """
    house = read_home(sh3d(home_xml(WALLS + ends, room="")), "test.sh3d")
    areas = sorted(float(shapely.Polygon(r.polygon).area) for r in house.rooms)
    assert len(areas) == n
    # Half of the doorway's ground belongs to each room.
    expected = [1.45 * 2.9 - 0.05 * (2.9 - 0.9), 2.45 * 2.9 - 0.05 * (2.9 - 0.9)]
    assert n == 1 or areas == pytest.approx(expected, abs=0.01)
    floors = [i for i in house.items if i.kind is ItemKind.FLOOR]
    assert len(floors) == n


@pytest.mark.parametrize(("door_cm", "n"), [(0, 1), (180, 2)])
def test_a_double_door_between_two_walls_parts_two_rooms(door_cm: int, n: int) -> None:
    ends = """
    <wall id='e' xStart='250' yStart='0' xEnd='250' yEnd='60' thickness='10'/>
    <wall id='f' xStart='250' yStart='240' xEnd='250' yEnd='300' thickness='10'/>
    """
    door = piece(
        f"name='Door' x='250' y='150' width='{door_cm}' depth='10' height='210' angle='{math.pi / 2}'",
        tag="doorOrWindow",
    )  # fmt: skip
    body = WALLS + ends + (door if door_cm else "")
    house = read_home(sh3d(home_xml(body, room=""), {"1": BOX_OBJ}), "test.sh3d")
    assert len(house.rooms) == n


def test_a_home_whose_outer_wall_ends_at_its_entrance_has_a_room() -> None:
    open_wall = WALLS.replace(
        "xStart='0' yStart='300' xEnd='0' yEnd='0'", "xStart='0' yStart='300' xEnd='0' yEnd='100'"
    ).replace("wallAtEnd='a' xStart='0' yStart='300'", "xStart='0' yStart='300'")
    house = read_home(sh3d(home_xml(open_wall, room="")), "test.sh3d")
    (room,) = house.rooms
    assert shapely.Polygon(room.polygon).area == pytest.approx(3.9 * 2.9, rel=0.02)
