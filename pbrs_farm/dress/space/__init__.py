"""Free space of a home for furniture and wall items: rooms, walls, doors, windows, floors; no effects."""

from pbrs_farm.dress.space.floor_bitmaps import FloorBitmap, FloorCells, doors_are_joined
from pbrs_farm.dress.space.footprints import item_footprint
from pbrs_farm.dress.space.house_space import HouseSpace, RoomSpace, floor_space, house_space
from pbrs_farm.dress.space.passages import Passage
from pbrs_farm.dress.space.wall_faces import WallFace

__all__ = [
    "FloorBitmap",
    "FloorCells",
    "HouseSpace",
    "Passage",
    "RoomSpace",
    "WallFace",
    "doors_are_joined",
    "floor_space",
    "house_space",
    "item_footprint",
]
