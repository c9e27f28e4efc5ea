"""A room without furniture."""

from __future__ import annotations

from functools import cache

from pbrs_farm.core.catalogue import EMPTY
from pbrs_farm.core.house import House
from pbrs_farm.generate.floor_plan import Plan, PlanRoom, PlanWall, RoomType
from pbrs_farm.generate.generated_home import furnish_storeys
from pbrs_farm.read.sweethome3d.home import read_home


@cache
def empty_room() -> House:
    """A room of 5 m by 4 m, its inner corner at the origin."""
    corners = ((0.0, 0.0), (5.0, 0.0), (5.0, 4.0), (0.0, 4.0))
    walls = tuple(
        PlanWall(a, b, 0.02) for a, b in zip(corners, (*corners[1:], corners[0]), strict=True)
    )
    inner = ((0.01, 0.01), (4.99, 0.01), (4.99, 3.99), (0.01, 3.99))
    plan = Plan((PlanRoom(RoomType.BEDROOM, "Room", inner),), walls, (), 2.5)
    return read_home(furnish_storeys([plan], ((),), EMPTY, "room", seed=1).data, "room.sh3d")
