"""The label sets NYU40 and NYU13: names and the map between them; no effects.

Ids start at 1; 0 is "nothing". NYU40: Gupta, Arbelaez, Malik 2013. NYU13: Couprie et al. 2013, by
the usual 40 to 13 table (SceneNet).
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

# Name of each NYU40 id, 0..40.
NYU40_NAMES: Final = (
    "none", "wall", "floor", "cabinet", "bed", "chair", "sofa", "table", "door", "window",
    "bookshelf", "picture", "counter", "blinds", "desk", "shelves", "curtain", "dresser", "pillow",
    "mirror", "floor mat", "clothes", "ceiling", "books", "refrigerator", "television", "paper",
    "towel", "shower curtain", "box", "whiteboard", "person", "night stand", "toilet", "sink",
    "lamp", "bathtub", "bag", "otherstructure", "otherfurniture", "otherprop",
)  # fmt: skip

# Each id by its name; "otherprop" is a thing of no class.
(
    WALL, FLOOR, CABINET, BED, CHAIR, SOFA, TABLE, DOOR, WINDOW, BOOKSHELF, PICTURE, COUNTER, BLINDS,
    DESK, SHELVES, CURTAIN, DRESSER, PILLOW, MIRROR, FLOOR_MAT, CLOTHES, CEILING, BOOKS, REFRIGERATOR,
    TELEVISION, PAPER, TOWEL, SHOWER_CURTAIN, BOX, WHITEBOARD, PERSON, NIGHT_STAND, TOILET, SINK,
    LAMP, BATHTUB, BAG, OTHERSTRUCTURE, OTHERFURNITURE, OTHERPROP,
) = range(1, len(NYU40_NAMES))  # fmt: skip

# Name of each NYU13 id, 0..13.
NYU13_NAMES: Final = (
    "none", "bed", "books", "ceiling", "chair", "floor", "furniture", "objects", "picture", "sofa",
    "table", "television", "wall", "window",
)  # fmt: skip

# (41,) NYU13 id of each NYU40 id.
NYU13_FROM_NYU40: Final[NDArray[np.uint8]] = np.array(
    [
        0, 12, 5, 6, 1, 4, 9, 10, 12, 13, 6, 8, 6, 13, 10, 6, 13, 6, 7, 7, 5,
        7, 3, 2, 6, 11, 7, 7, 7, 7, 7, 7, 6, 7, 7, 7, 7, 7, 7, 6, 7,
    ],
    np.uint8,
)  # fmt: skip
