"""Plans that would take minutes to repair are refused with one line; large homes are not."""

import math

import pytest

from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.recipe import ReadFields
from pbrs_farm.read.common.rooms import MAX_OVERLAPS
from pbrs_farm.read.sweethome3d.home import MAX_CROSSINGS, read_home
from tests.read.sweethome3d.sh3d_source import ROOM, home_xml


def wall(k: int, start: tuple[float, float], end: tuple[float, float], level: str = "") -> str:
    return (
        f"<wall id='w{k}' {level} xStart='{start[0]}' yStart='{start[1]}' xEnd='{end[0]}'"
        f" yEnd='{end[1]}' thickness='5'/>"
    )


def square(x: float, y: float, edge: float) -> str:
    corners = [(x, y), (x + edge, y), (x + edge, y + edge), (x, y + edge)]
    return "<room>" + "".join(f"<point x='{a}' y='{b}'/>" for a, b in corners) + "</room>"


def spokes(n: int) -> str:
    """Walls that all cross at one point: n (n - 1)
    2 times.
    """
    ends = [(300 * math.cos(math.pi * k / n), 300 * math.sin(math.pi * k / n)) for k in range(n)]
    return "".join(wall(k, (-x, -y), (x, y)) for k, (x, y) in enumerate(ends))


@pytest.mark.parametrize(
    ("body", "room", "said"),
    [
        (
            "".join(wall(k, (0, 9 * k), (50, 9 * k)) for k in range(3001)),
            ROOM,
            "3001 walls, at most",
        ),
        (spokes(40), ROOM, f"walls cross 780 times, at most {MAX_CROSSINGS}"),
        ("", "".join(square(9 * k, 0, 5) for k in range(501)), "501 rooms, at most"),
        ("", square(0, 0, 100) * 40, f"780 pairs of rooms overlap; the maximum is {MAX_OVERLAPS}"),
    ],
)
def test_a_plan_beyond_any_home_is_refused_by_a_line(body: str, room: str, said: str) -> None:
    with pytest.raises(BadHouse, match=said):
        read_home(home_xml(body, room=room), "vast.xml", fields=ReadFields())


def test_walls_that_touch_and_rooms_side_by_side_are_no_crossings() -> None:
    # A grid of 6 x 6 rooms: walls meet end on at the corners, rooms share edges.
    body = "".join(
        wall(10 * i + k, (100 * k, 100 * i), (100 * k + 100, 100 * i))
        for i in range(7)
        for k in range(6)
    )
    rooms = "".join(square(100 * i, 100 * k, 100) for i in range(6) for k in range(6))
    assert len(read_home(home_xml(body, room=rooms), "grid.xml", fields=ReadFields()).rooms) == 36


def test_too_many_pieces_are_refused_by_their_commonest_name() -> None:
    body = "<pieceOfFurniture name='Tile' model='1' x='1' y='1' width='1' depth='1' height='1'/>"
    with pytest.raises(BadHouse, match="10001 of them are called 'Tile'"):
        read_home(home_xml(body * 10_001), "vast.xml", fields=ReadFields())


def test_a_hidden_level_is_not_counted() -> None:
    levels = (
        "<level id='up' elevation='0' floorThickness='12' height='250'/>"
        "<level id='cellar' elevation='-300' floorThickness='12' height='250' visible='false'/>"
    )
    crossing = spokes(40).replace("<wall ", "<wall level='cellar' ")
    room = ROOM.replace("<room ", "<room level='up' ")
    assert read_home(home_xml(levels + crossing, room=room), "cellar.xml", fields=ReadFields())
