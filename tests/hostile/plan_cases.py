"""Sweet Home 3D plans that cannot be built: numbers, polygons, crowds. No effects until written."""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import partial
from typing import Final

from tests.hostile.case import Case, by_verb, home
from tests.hostile.shape_cases import BOX, room_xml, walls
from tests.hostile.sound_inputs import CHAIRS, archive, chair
from tests.read.sweethome3d.sh3d_source import ROOM, WALLS, WINDOW_OBJ, home_xml, piece, sh3d

NUMBERS: Final = ("NaN", "inf", "-1", "0", "1e308", "1e400", "abc", "", "0x10", "1_000")
"""Values for a length."""


def cases() -> Iterator[Case]:
    """Numbers, then outlines, then crowds."""
    for text in NUMBERS:
        body = WALLS + CHAIRS + piece(f"id='9' width='{text}'")
        yield home(f"plan/width_{text or 'blank'}", "format", "bad.sh3d", archive(body))
    for attribute, text in (
        ("x", "NaN"), ("angle", "inf"), ("elevation", "1e30"), ("height", "1e30"), ("depth", "-5"),
        ("modelRotation", "0 0 0 0 0 0 0 0 0"), ("modelRotation", "NaN 0 0 0 1 0 0 0 1"),
        ("modelRotation", "1 2"), ("level", "nobody"), ("color", "GGGGGGGG"), ("visible", "maybe"),
        ("dropOnTopElevation", "NaN"), ("pitch", "NaN"), ("shininess", "1e30"),
    ):  # fmt: skip
        data = archive(WALLS + CHAIRS + piece(f"id='9' {attribute}='{text}'"))
        yield home(f"plan/piece_{attribute}_{text[:6]}", "format", "bad.sh3d", data)
    for name, body in _bodies().items():
        yield home(f"plan/{name}", "format", "bad.sh3d", archive(body))
    for name, outline in _rooms().items():
        yield home(f"plan/room_{name}", "format", "bad.sh3d", archive(room=outline))
    for metres, lossy in ((900, True), (2000, False), (10**7, False)):
        far = archive(WALLS + CHAIRS + chair(9, 100 * metres, 100))
        yield home(f"plan/piece_{metres}_m_away", "silence", "bad.sh3d", far, lossy=lossy)
    yield home("plan/overlapping_19000", "bounds", "bad.sh3d", _crowd)
    yield home("plan/room_99000_corners", "bounds", "bad.sh3d", partial(_round_room, 99_000))
    yield home("plan/room_9000_corners", "bounds", "bad.sh3d", partial(_round_room, 9_000))
    yield home("plan/room_comb_4000", "bounds", "bad.sh3d", _comb)
    yield home("plan/walls_9900_crossing", "bounds", "bad.sh3d", _crossing_walls)
    yield home("plan/rooms_4900", "bounds", "bad.sh3d", _many_rooms)
    yield home("plan/windows_500", "bounds", "bad.sh3d", _windows)
    yield home("plan/levels_1000", "bounds", "bad.sh3d", _levels)
    yield home("plan/hidden_levels", "silence", "bad.sh3d", _hidden_level, lossy=True)
    yield by_verb("plan/repair_overlapping_19000", "bounds", "repair", "bad.sh3d", _crowd())
    yield by_verb("plan/cameras_99000", "bounds", "cameras", "bad.sh3d", _round_room(99_000))


def _wall(more: str) -> str:
    return f"<wall id='z' xStart='50' yStart='50' xEnd='300' yEnd='200' thickness='10' {more}/>"


def _bodies() -> dict[str, str]:
    light = "<light id='l' name='Lamp' model='1' x='150' y='150' width='30' depth='30' height='30'"
    source = "<lightSource x='.5' y='.5' z='.5' color='FFFFFF'/></light>"
    door = "<doorOrWindow id='d' name='Door' model='1' x='200' y='0' width='{}' depth='10' height='200'"
    stray = WALLS.replace("wallAtStart='d'", "wallAtStart='a'").replace("'c'", "'nobody'")
    return {
        "nothing": "",
        "walls_alone": WALLS.replace("thickness='10'", "thickness='0'"),
        "wall_no_length": WALLS + CHAIRS + "<wall id='z' xStart='5' yStart='5' xEnd='5' yEnd='5'/>",
        "wall_thick": (WALLS + CHAIRS).replace("thickness='10'", "thickness='100000'"),
        "wall_thickness_minus": (WALLS + CHAIRS).replace("thickness='10'", "thickness='-10'"),
        "wall_nan": WALLS.replace("xEnd='400'", "xEnd='NaN'") + CHAIRS,
        "wall_far": WALLS.replace("xEnd='400'", "xEnd='4e9'") + CHAIRS,
        "wall_stray_joins": stray + CHAIRS,
        "wall_same_ids": WALLS.replace("id='b'", "id='a'") + CHAIRS,
        "wall_twice": WALLS + WALLS + CHAIRS,
        "wall_arc_turns": WALLS + CHAIRS + _wall("arcExtent='1000'"),
        "wall_arc_nan": WALLS + CHAIRS + _wall("arcExtent='NaN'"),
        "wall_height_0": WALLS + CHAIRS + _wall("height='0' heightAtEnd='-50'"),
        "wall_height_1e9": WALLS + CHAIRS + _wall("height='1e9'"),
        "baseboard_huge": WALLS + CHAIRS + _wall("").replace(
            "/>", "><baseboard attribute='leftSideBaseboard' thickness='1e6' height='1e6'/></wall>"
        ),
        "light_power_huge": WALLS + CHAIRS + f"{light} power='1e30'>{source}",
        "light_power_nan": WALLS + CHAIRS + f"{light} power='NaN'>{source}",
        "light_power_minus": WALLS + CHAIRS + f"{light} power='-1'>{source}",
        "lights_2000": WALLS + CHAIRS + f"{light} power='0.5'>{source}" * 2000,
        "door_wider_than_wall": WALLS + CHAIRS + door.format(5000) + "/>",
        "door_cut_out_bad": WALLS + CHAIRS + door.format(90) + " cutOutShape='M0,0 L NaN z'/>",
        "door_cut_out_long": WALLS + CHAIRS + door.format(90)
        + f" cutOutShape='M0,0 {'L1,1 L0,1 ' * 20_000}z'/>",
        "door_cut_out_arcs": WALLS + CHAIRS + door.format(90)
        + f" cutOutShape='M0,0 {'A1e9,1e-9 0 1 1 1,1 ' * 500}z'/>",
        "door_sash_nan": WALLS + CHAIRS + door.format(90)
        + "><sash xAxis='NaN' yAxis='1' width='1e9' startAngle='0' endAngle='9'/></doorOrWindow>",
        "levels_equal": "<level id='L' elevation='0' height='250'/>" * 3 + WALLS + CHAIRS,
        "level_far_up": "<level id='L' elevation='1e9' height='250'/>" + WALLS + CHAIRS,
        "level_nan": "<level id='L' elevation='NaN' height='250'/>" + WALLS + CHAIRS,
        "camera_nan": WALLS + CHAIRS + "<camera attribute='storedCamera' name='c' x='NaN' y='1'/>",
        "piece_same_ids": WALLS + chair(1, 100, 100) * 20,
    }  # fmt: skip


def _rooms() -> dict[str, str]:
    return {
        "none": "",
        "no_points": "<room name='Hall'/>",
        "two_points": room_xml(BOX[:2]),
        "one_place": room_xml([(5, 5)] * 9),
        "no_area": room_xml([(5, 5), (395, 5), (200, 5)]),
        "sliver": room_xml([(5, 5), (395, 5), (395, 5.001), (5, 5.001)]),
        "bow_tie": room_xml([(5, 5), (395, 295), (395, 5), (5, 295)]),
        "pentagram": room_xml(
            [(200 + 150 * math.cos(2.513 * k), 150 + 140 * math.sin(2.513 * k)) for k in range(5)]
        ),
        "spike": room_xml([*BOX[:2], (4000, 0), (400, 0), *BOX[2:]]),
        "points_thrice": room_xml([p for p in BOX for _ in range(3)]),
        "nan": room_xml([(5, 5), (float("nan"), 5), (395, 295)]),
        "inf": room_xml([(5, 5), (float("inf"), 5), (395, 295)]),
        "huge": room_xml([(-9e4, -9e4), (9e4, -9e4), (9e4, 9e4), (-9e4, 9e4)]),
        "clockwise": room_xml(BOX[::-1]),
        "touching_itself": room_xml([(5, 5), (200, 150), (395, 5), (395, 295), (200, 150), (5, 295)]),
    }  # fmt: skip


def _crowd() -> bytes:
    """19,000 pieces at nearly the same place."""
    body = "".join(chair(k, 150 + k % 97, 120 + k % 89) for k in range(19_000))
    return archive(WALLS + body)


def _round_room(n: int) -> bytes:
    angles = [2 * math.pi * k / n for k in range(n)]
    return archive(
        room=room_xml([(200 + 190 * math.cos(a), 150 + 140 * math.sin(a)) for a in angles])
    )


def _comb() -> bytes:
    """A room whose outline is a comb of 2,000 teeth."""
    teeth = [(5 + 0.19 * k, 5 if k % 2 else 250) for k in range(2000)]
    return archive(room=room_xml([*teeth, (390, 295), (5, 295)]))


def _crossing_walls() -> bytes:
    ends = [(200 + 300 * math.cos(0.01 * k), 150 + 300 * math.sin(0.01 * k)) for k in range(9900)]
    return archive(
        "".join(
            f"<wall id='w{k}' xStart='{400 - x}' yStart='{300 - y}' xEnd='{x}' yEnd='{y}' thickness='9'/>"
            for k, (x, y) in enumerate(ends)
        )
    )


def _many_rooms() -> bytes:
    rooms = "".join(
        room_xml([(x, y), (x + 200, y), (x + 200, y + 200), (x, y + 200)], f"r{x}-{y}")
        for x in range(0, 7000, 100)
        for y in range(0, 7000, 100)
    )
    return archive(room=rooms)


def _windows() -> bytes:
    body = "".join(
        f"<doorOrWindow id='d{k}' name='Window' model='w' x='{20 + 0.7 * k}' y='0' width='60'"
        f" depth='20' height='100' elevation='{50 + k % 40}'/>"
        for k in range(500)
    )
    return archive(WALLS + CHAIRS + body, {"w": WINDOW_OBJ})


def _levels() -> bytes:
    levels = "".join(f"<level id='L{k}' elevation='{250 * k}' height='250'/>" for k in range(1000))
    rooms = "".join(room_xml(BOX, f"r{k}", f"level='L{k}'") for k in range(1000))
    return sh3d(home_xml(levels + walls(BOX), room=rooms))


def _hidden_level() -> bytes:
    """A visible level above and below a hidden one."""
    levels = "".join(
        f"<level id='L{k}' elevation='{250 * k}' height='250' viewable='{'false' if k == 1 else 'true'}'/>"
        for k in range(3)
    )
    rooms = "".join(ROOM.replace("<room ", f"<room level='L{k}' ") for k in range(3))
    shown = "".join(WALLS.replace("<wall id='", f"<wall level='L{k}' id='{k}") for k in range(3))
    return archive(levels + shown + CHAIRS, room=rooms)
