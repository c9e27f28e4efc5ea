"""Sweet Home 3D homes with doors that open."""

from __future__ import annotations

import numpy as np

from pbrs_farm.core.house import House, Item
from pbrs_farm.core.recipe import ReadFields
from pbrs_farm.read.sweethome3d.home import read_home
from tests.read.sweethome3d.sh3d_source import home_xml, piece, sh3d

WALL = "<wall id='w' xStart='0' yStart='0' xEnd='400' yEnd='0' thickness='10'/>"


NORTH = (
    "<room><point x='0' y='-300'/><point x='400' y='-300'/>"
    "<point x='400' y='0'/><point x='0' y='0'/></room>"
)


SOUTH = (
    "<room><point x='0' y='0'/><point x='400' y='0'/>"
    "<point x='400' y='300'/><point x='0' y='300'/></room>"
)


def box(group: str, low: tuple[float, ...], high: tuple[float, ...], first: int) -> str:
    """An OBJ group of a box whose vertices are numbered from `first`."""
    corners = [(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)]
    ends = np.array([low, high])
    lines = [f"g {group}"]
    lines += ["v " + " ".join(str(ends[i, k]) for k, i in enumerate(c)) for c in corners]
    faces = ("1 2 4 3", "5 7 8 6", "1 5 6 2", "3 4 8 7", "1 3 7 5", "2 6 8 4")
    lines += ["f " + " ".join(str(int(n) + first - 1) for n in f.split()) for f in faces]
    return "\n".join(lines) + "\n"


LEAF = box("sweethome3d_opening_on_hinge_1_door", (-0.4, 0, -0.02), (0.4, 2, 0.02), 1)


FRAME = box("frame", (-0.5, 2, -0.1), (0.5, 2.1, 0.1), 9)


HINGED = LEAF + FRAME + box("sweethome3d_hinge_1_1", (-0.42, 1, 0.02), (-0.4, 1.1, 0.04), 17)


def read(
    doors: str, rooms: str = NORTH + SOUTH, obj: str = HINGED, more: str = "", inner: str = "",
    **given: str,
) -> House:  # fmt: skip
    attributes = " ".join(f"{k}='{v}'" for k, v in given.items())
    door = piece(
        f"{attributes} catalogId='eTeks#door' x='200' y='0' width='100' depth='20' height='210'"
        " wallCutOutOnBothSides='true'",
        inner,
        tag="doorOrWindow",
    )
    home = home_xml(WALL + door + more, room=rooms)
    fields = ReadFields.model_validate({"doors": doors})
    return read_home(sh3d(home, {"1": obj.encode()}), "test.sh3d", fields=fields)


def door_of(house: House) -> Item:
    return next(i for i in house.items if i.id == "piece_0")
