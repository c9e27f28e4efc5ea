"""Bulbs, openings and shades of single lamps, built in code."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.catalogue import EMPTY
from pbrs_farm.core.classes import OTHERSTRUCTURE
from pbrs_farm.core.house import (
    House,
    Item,
    ItemKind,
    LightPart,
    Material,
    MaterialKind,
    Room,
    Surface,
    corners_of_surfaces,
)
from pbrs_farm.core.lighting import PowerUnit, flux_lm
from pbrs_farm.core.mesh import clipped_to_box, distances_to_triangles, face_areas, triangle_corners
from pbrs_farm.core.recipe import RepairFields
from pbrs_farm.furnishings.things.families import with_families
from pbrs_farm.geometry.solids import box
from pbrs_farm.home.room_use import is_lived_in
from pbrs_farm.read.builtin.builtin_home import builtin_home
from pbrs_farm.repair import repair, summary_of_report
from pbrs_farm.repair.lamps.bulbs import icosphere, with_bulbs
from pbrs_farm.repair.lamps.ceiling_lamp import place_of_lamp
from pbrs_farm.repair.lamps.lampshades import with_shades
from pbrs_farm.repair.lamps.room_lighting import GivenLights, with_room_lighting
from pbrs_farm.repair.structure.plan_geometry import polygon_of_room
from tests.hypothesis_profiles import examples
from tests.repair.embree import EmbreeOccluder

FIELDS = RepairFields()
WHITE = Material("white")


def _ball(radius: float, centre: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Surface:
    return icosphere("ball", np.array(centre), radius, 0, n_splits=3)


def _half_ball(radius: float) -> Surface:
    ball = _ball(radius)
    above = ball.positions[ball.faces][:, :, 1].min(1) > -1e-6
    return replace(ball, faces=ball.faces[above])


def _lamp(*surfaces: Surface, radius_m: float = 0.03) -> House:
    light = LightPart((0.0, 0.0, 0.0), radius_m, 0.5, PowerUnit.SWEETHOME3D)
    item = Item("lamp", "lamp", ItemKind.LAMP, "0", surfaces, lights=(light,))
    home = builtin_home()
    return replace(home, items=(item,), materials=(WHITE,), rooms=())


def _with_shades(house: House) -> tuple[House, float, float]:
    house, sources = with_bulbs(house, FIELDS)
    house, sources = with_shades(house, sources, FIELDS, EmbreeOccluder)
    before, after = sources[0].escape_before, sources[0].escape
    assert before is not None
    assert after is not None
    assert house.items[0].lights[0].escape == after
    return house, before, after


def test_the_bulb_has_the_sources_radius_if_it_fits() -> None:
    house, (source,) = with_bulbs(_lamp(_ball(0.2)), FIELDS)
    assert (source.bulb_added, source.radius_m, source.moved_m) == (True, 0.03, 0.0)
    bulb = house.items[0].surfaces[house.items[0].lights[0].emitting[0]]
    assert house.materials[bulb.material].kind is MaterialKind.BULB
    assert np.linalg.norm(bulb.positions, axis=1) == pytest.approx(0.03, abs=1e-7)
    area = face_areas(triangle_corners(bulb.positions, bulb.faces)).sum()
    assert area == pytest.approx(4 * np.pi * 0.03**2, rel=0.03)


@settings(max_examples=examples(20), deadline=None)
@given(st.tuples(*[st.floats(-0.05, 0.05)] * 3), st.floats(0.01, 0.06))
def test_the_bulb_touches_nothing_of_its_lamp(
    centre: tuple[float, float, float], radius: float
) -> None:
    # For any obstructing ball, through the light's centre or around it.
    lamp = _lamp(_ball(radius, centre))
    house, (source,) = with_bulbs(lamp, FIELDS)
    place = np.array(house.items[0].lights[0].position)
    free = distances_to_triangles(place, corners_of_surfaces(lamp.items[0].surfaces)).min()
    assert free > source.radius_m > 0.0005
    assert source.moved_m <= 0.03 + 1e-9


def test_a_naked_bulb_loses_nothing() -> None:
    _, before, after = _with_shades(_lamp())
    assert (before, after) == (1.0, 1.0)


def test_half_a_ball_around_the_bulb_leaves_half_the_light() -> None:
    house, before, after = _with_shades(_lamp(_half_ball(0.2)))
    # The sphere has equator triangles on both sides: nearly half of it remains.
    part = house.items[0].surfaces[0]
    covered = face_areas(triangle_corners(part.positions, part.faces))
    assert before == after == pytest.approx(1 - covered.sum() / (4 * np.pi * 0.04), abs=0.03)
    assert all(m.kind is not MaterialKind.SHADE for m in house.materials)


def test_a_closed_ball_becomes_a_shade_that_lets_its_share_through() -> None:
    house, before, after = _with_shades(_lamp(_ball(0.2)))
    assert before == 0.0
    assert after == pytest.approx(FIELDS.shade_transmission, abs=1e-4)
    assert house.materials[house.items[0].surfaces[0].material].kind is MaterialKind.SHADE


def test_only_the_part_that_encloses_becomes_a_shade() -> None:
    # Shade and foot are one surface of one material; the foot stays opaque.
    ball, foot = _ball(0.2), _ball(0.1, (0.0, -0.6, 0.0))
    merged = replace(
        ball,
        positions=np.concatenate([ball.positions, foot.positions]),
        faces=np.concatenate([ball.faces, foot.faces + len(ball.positions)]),
        normals=None,
    )
    house, _, after = _with_shades(_lamp(merged))
    kinds = [house.materials[s.material].kind for s in house.items[0].surfaces]
    assert kinds == [MaterialKind.OPAQUE, MaterialKind.BULB, MaterialKind.SHADE]
    assert [len(s.faces) for s in house.items[0].surfaces][::2] == [
        len(foot.faces),
        len(ball.faces),
    ]
    assert 0.35 < after < 0.4
    assert house.items[0].lights[0].emitting == (1,)


def _slab(y0: float, y1: float, half: float = 2.0) -> Item:
    surface = box(
        "slab", np.array([0.0, (y0 + y1) / 2, 0.0]), np.array([half, (y1 - y0) / 2, half]), 0
    )
    return Item("ceiling", "ceiling", ItemKind.CEILING, "0", (surface,))


def _below(lamp: House, *structure: Item) -> House:
    return lamp.with_items([*lamp.items, *structure])


def test_a_cup_that_the_ceiling_closes_keeps_its_light_and_becomes_a_shade() -> None:
    # Open at the top: without the ceiling above, half of its light would leave.
    cup = _half_ball(0.2)
    turned = cup.positions * np.float32([1, -1, 1]) + np.float32([0, 0.08, 0])
    cup = replace(cup, positions=turned, faces=cup.faces[:, ::-1].copy())
    assert _with_shades(_lamp(cup))[1] > 0.3
    house, before, after = _with_shades(_below(_lamp(cup), _slab(0.05, 0.2)))
    assert before < 0.02
    assert after > 0.2
    assert house.materials[house.items[0].surfaces[0].material].kind is MaterialKind.SHADE


def test_a_bulb_below_a_ceiling_loses_only_what_the_ceiling_absorbs() -> None:
    _, ratio, _ = _with_shades(_below(_lamp(), _slab(0.035, 0.2)))
    assert 0.8 < ratio < 0.95
    far, ratio, _ = _with_shades(_below(_lamp(), _slab(0.6, 0.8)))
    assert ratio == 1.0
    assert far.items[0].surfaces[0].name == "bulb"


def test_a_bulb_inside_the_ceiling_lights_no_room_and_the_room_gets_a_light() -> None:
    home = builtin_home()
    bulb = LightPart((2.0, 2.6, 2.0), 0.03, 0.5, PowerUnit.SWEETHOME3D)
    buried = Item("buried", "spot", ItemKind.LAMP, "0", (), lights=(bulb,))
    items = [i for i in home.items if not i.lights and i.kind is not ItemKind.CEILING]
    slab = Item("c", "c", ItemKind.CEILING, "0", (box("c", np.array([4.5, 2.6, 2.0]), np.array([6.0, 0.1, 4.0]), 0),))  # fmt: skip
    dark = replace(home, openings=(), items=(*items, slab, buried))
    house, sources = with_bulbs(dark, FIELDS)
    house, sources = with_shades(house, sources, FIELDS, EmbreeOccluder)
    assert sources[0].escape == 0.0
    house, given_to = with_room_lighting(house, fallback=True)
    assert given_to.fallback == ("0_0", "0_1")


def test_a_room_that_nothing_lights_gets_a_ceiling_light() -> None:
    home = builtin_home()
    dark = replace(home, openings=(), items=tuple(i for i in home.items if not i.lights))
    house, given_to = with_room_lighting(dark, fallback=True)
    assert given_to == GivenLights(fallback=("0_0", "0_1"), added=())
    assert {r.lit_by for r in house.rooms} == {("fallback",)}
    lamp = house.items[-1]
    assert (lamp.id, lamp.nyu40, lamp.tags) == ("fallback_0_1", 35, ("fallback", "added"))
    assert house.materials[lamp.surfaces[0].material].kind is MaterialKind.BULB
    low, high = lamp.bounds
    assert low[1] > 2.0
    assert high[1] < 2.5


def test_the_fallback_light_can_be_switched_off() -> None:
    home = builtin_home()
    dark = replace(home, openings=(), items=tuple(i for i in home.items if not i.lights))
    house, given_to = with_room_lighting(dark, fallback=False)
    assert given_to == GivenLights((), ())
    assert {r.lit_by for r in house.rooms} == {()}


def test_a_windowed_room_without_a_lamp_gets_one_if_the_recipe_asks() -> None:
    home = builtin_home()
    day = replace(home, items=tuple(i for i in home.items if not i.lights))
    lit, report = repair(day, FIELDS)
    assert {r.lit_by for r in lit.rooms} == {("windows",)}
    assert report.added_lamps == ()
    house, report = repair(day, RepairFields(lamp_in_every_room=True))
    assert report.added_lamps == ("0_0", "0_1")
    assert {r.lit_by for r in house.rooms} == {("windows", "added")}
    assert [i.tags for i in house.items if i.lights] == [("added",)] * 2
    assert "2 rooms where people live had no lamp" in summary_of_report(report)


def test_an_added_lamps_flux_follows_the_rooms_area() -> None:
    home = builtin_home()
    day = replace(home, items=tuple(i for i in home.items if not i.lights))
    house, _ = repair(day, RepairFields(lamp_in_every_room=True, lamp_lx=100))
    areas = {r.id: polygon_of_room(r.polygon).area for r in house.rooms}
    assert len(areas) == 2
    for item in house.items:
        for light in item.lights:
            assert light.unit is PowerUnit.LUMEN
            assert light.power == pytest.approx(100 * areas[item.room_id] / 0.3)


@pytest.mark.parametrize(("lux", "lumen"), [(1, 600), (1_000, 10_000)])
def test_an_added_lamp_has_the_flux_of_one_lamp(lux: float, lumen: float) -> None:
    home = builtin_home()
    day = replace(home, items=tuple(i for i in home.items if not i.lights))
    house, _ = repair(day, RepairFields(lamp_in_every_room=True, lamp_lx=lux))
    assert {light.power for i in house.items for light in i.lights} == {lumen}


def _flux_by_room(house: House) -> dict[str | None, float]:
    flux: dict[str | None, float] = {}
    for item in house.items:
        for light in item.lights:
            flux[item.room_id] = flux.get(item.room_id, 0) + flux_lm(light.power, light.unit, light.share)  # fmt: skip
    return flux


def test_too_weak_lamps_at_the_ceiling_become_brighter_and_others_get_one_beside_them() -> None:
    home = builtin_home()
    n_lamps = sum(bool(i.lights) for i in home.items)
    house, report = repair(home, RepairFields(lamp_in_every_room=True, lamp_lx=150))
    # Room 0_0 has a lamp on a table, room 0_1 one at its ceiling.
    assert (report.added_lamps, report.brightened_lamps) == (("0_0",), ("0_1",))
    assert [r.lit_by for r in house.rooms] == [("lamps", "windows", "added"), ("lamps", "windows")]
    assert sum(bool(i.lights) for i in house.items) == n_lamps + 1
    area = polygon_of_room(home.rooms[1].polygon).area
    assert _flux_by_room(house)["0_1"] == pytest.approx(150 * area / 0.3, rel=1e-3)
    assert "1 room had weak ceiling lamps" in summary_of_report(report)
    _, report = repair(home, RepairFields(lamp_in_every_room=True, lamp_lx=5))
    assert (report.added_lamps, report.brightened_lamps) == ((), ())


def test_an_added_lamp_is_a_piece_of_the_catalogue_that_touches_nothing() -> None:
    home = builtin_home()
    dark = home.with_items([i for i in home.items if not i.lights])
    fields = RepairFields(lamp_in_every_room=True, lamp_lx=100)
    lamps = partial(with_families, EMPTY)
    house, _ = repair(dark, fields, occluder_from=EmbreeOccluder, lamps_from=lamps)
    added = house.items[-2:]
    assert [i.id for i in added] == ["added_0_0", "added_0_1"]
    rest = corners_of_surfaces(s for i in house.items[:-2] for s in i.surfaces)
    for item in added:
        # It reaches up to the ceiling, keeps clear of heads and is more than a ball.
        low, high = item.bounds
        room = next(r for r in house.rooms if r.id == item.room_id)
        assert room.ceiling_y - 0.002 < high[1] < room.ceiling_y
        assert low[1] >= room.floor_y + 1.89
        assert not len(clipped_to_box(rest, low, high))
        kinds = {house.materials[s.material].kind for s in item.surfaces}
        assert MaterialKind.BULB in kinds
        assert len(kinds) > 1
        assert {house.materials[item.surfaces[k].material].kind for light in item.lights for k in light.emitting} == {MaterialKind.BULB}  # fmt: skip
        assert all(light.escape is not None for light in item.lights)
        # The flux that leaves the lamp is that which the room needs.
        out = sum(flux_lm(x.power, x.unit, x.share) * (x.escape or 0) for x in item.lights)
        assert out == pytest.approx(100 * polygon_of_room(room.polygon).area / 0.3, rel=1e-3)


def test_a_lamp_below_a_slope_hangs_from_a_cord() -> None:
    home, room = _with_slope()
    lamps = partial(with_families, EMPTY)
    house, _ = with_room_lighting(home, fallback=True, in_every_room=True, lamps_from=lamps)
    lamp = next(i for i in house.items if i.id == f"added_{room.id}")
    assert [s.name for s in lamp.surfaces] == ["bulb", "cord"]


def test_a_room_with_a_lamp_gets_no_other() -> None:
    home = builtin_home()
    _, report = repair(home, RepairFields(lamp_in_every_room=True))
    assert (report.added_lamps, report.fallback_lights) == ((), ())


@pytest.mark.parametrize(
    ("name", "types", "lived_in"),
    [
        ("Bedroom", (), True),
        ("", (), True),
        ("Balcony", (), False),
        ("Garage 2", (), False),
        ("Südterrasse", (), True),  # compounds are not split
        ("Große Terrasse", (), False),
        ("Jardín", (), False),
        ("Balcão", (), False),
        ("Trädgård", (), False),
        ("балкон", (), False),
        ("南阳台", (), False),
        ("발코니", (), False),
        ("ベランダ", (), False),
        ("x", ("Balcony",), False),
        ("x", ("Living_Room", "Balcony"), True),
        ("Terracotta room", (), True),
    ],
)
def test_people_do_not_live_on_balconies_in_any_language(
    name: str, types: tuple[str, ...], lived_in: bool
) -> None:
    room = replace(builtin_home().rooms[0], name=name, types=types)
    assert is_lived_in(room, 12.0) is lived_in
    assert not is_lived_in(room, 1.9)


def _place(home: House, room: Room) -> F64:
    place = place_of_lamp(home, room)
    assert place is not None
    return place


def test_the_added_lamp_hangs_clear_of_items_as_high_as_the_ceiling() -> None:
    home = builtin_home()
    room = home.rooms[0]
    (x0, z0), (x1, z1) = room.polygon.min(0), room.polygon.max(0)
    _, _, z = _place(home, room)
    assert (z - z0) == pytest.approx((z1 - z0) / 2, abs=0.1)
    # A wardrobe to the ceiling over the left half of the room moves the lamp to the right half.
    middle = (x0 + x1) / 2
    size = np.array([(middle - x0) / 2, 1.2, (z1 - z0) / 2])
    wardrobe = box("w", np.array([(x0 + middle) / 2, 1.2, (z0 + z1) / 2]), size, 0)
    tall = Item("tall", "tall", ItemKind.OBJECT, "0", (wardrobe,))
    assert _place(home.with_items([*home.items, tall]), room)[0] > middle + 0.5


def test_the_added_lamp_hangs_in_no_wall_inside_the_room() -> None:
    home = builtin_home()
    room = home.rooms[0]
    x, y, z = _place(home, room)
    low, high = room.floor_y, room.ceiling_y
    part = box(
        "part", np.array([x, (low + high) / 2, z]), np.array([0.06, (high - low) / 2, 9.0]), 0
    )
    wall = Item("partition", "partition", ItemKind.WALL, room.level_id, (part,))
    lamp_place = _place(home.with_items([*home.items, wall]), room)
    assert abs(lamp_place[0] - x) > 0.3
    assert lamp_place[1] == y


def _with_slope() -> tuple[House, Room]:
    """The builtin home without lamps, its first room below a sloped ceiling."""
    home = builtin_home()
    room = home.rooms[0]
    (x0, z0), (x1, z1) = room.polygon.min(0), room.polygon.max(0)
    quad = np.array([[x0, 0.9, z0], [x1, 2.4, z0], [x1, 2.4, z1], [x0, 0.9, z1]], np.float32)
    slope = Surface("slope", quad, np.array([[0, 1, 2], [0, 2, 3]], np.int32), 0)
    roof = Item("roof", "roof", ItemKind.CEILING, "0", (slope,))
    items = [i for i in home.items if i.kind is not ItemKind.CEILING and not i.lights]
    return home.with_items([*items, roof]), room


def test_the_added_lamp_hangs_below_the_high_side_of_a_sloped_ceiling() -> None:
    home, room = _with_slope()
    x0, x1 = room.polygon[:, 0].min(), room.polygon[:, 0].max()
    x, y, _ = _place(home, room)
    assert y == pytest.approx(0.9 + 1.5 * (x - x0) / (x1 - x0), abs=1e-3)
    assert y > 2.1


def test_an_added_lamp_hangs_from_existing_surfaces_and_never_from_the_sky() -> None:
    home = builtin_home()
    room = home.rooms[0]
    (x0, z0), (x1, z1) = room.polygon.min(0), room.polygon.max(0)
    # A ceiling over only the first third of the room.
    end, y = x0 + (x1 - x0) / 3, room.ceiling_y
    quad = np.array([[x0, y, z0], [end, y, z0], [end, y, z1], [x0, y, z1]], np.float32)
    part = Surface("part", quad, np.array([[0, 1, 2], [0, 2, 3]], np.int32), 0)
    items = [i for i in home.items if i.kind is not ItemKind.CEILING]
    third = Item("third", "", ItemKind.CEILING, "0", (part,))
    lamp_place = place_of_lamp(home.with_items([*items, third]), room)
    assert lamp_place is not None
    assert x0 < lamp_place[0] < end
    assert place_of_lamp(home.with_items(items), room) is None
    # A roof modelled as an item carries a lamp as well.
    high = replace(part, positions=part.positions + np.array([0, 0.3, 0], np.float32))
    thing = Item("roof", "", ItemKind.OBJECT, "0", (high,), nyu40=OTHERSTRUCTURE)
    assert place_of_lamp(home.with_items([*items, thing]), room) is not None


def test_a_room_with_a_declared_but_missing_ceiling_is_lit_by_the_sky() -> None:
    home = builtin_home()
    items = [i for i in home.items if not i.lights and i.kind is not ItemKind.CEILING]
    bare = replace(home, openings=()).with_items(items)
    house, n_added = with_room_lighting(bare, fallback=True, in_every_room=True)
    assert {r.lit_by for r in house.rooms} == {("sky",)}
    assert (n_added.fallback, n_added.added) == ((), ())


def test_a_room_without_a_ceiling_is_lit_by_the_sky_unless_a_storey_is_above() -> None:
    home = builtin_home()
    items = tuple(i for i in home.items if not i.lights and i.kind is not ItemKind.CEILING)
    rooms = tuple(replace(r, has_ceiling=False) for r in home.rooms)
    bare = replace(home, openings=(), items=items, rooms=rooms)
    house, _ = with_room_lighting(bare, fallback=True)
    assert {r.lit_by for r in house.rooms} == {("sky",)}
    slab = _slab(5.0, 5.2, half=20.0)
    house, _ = with_room_lighting(bare.with_items([*items, slab]), fallback=True)
    assert {r.lit_by for r in house.rooms} == {()}
