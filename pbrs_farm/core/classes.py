"""The label sets NYU40 and NYU13: names, colours and the map between them; no effects.

Ids start at 1; 0 is "nothing". NYU40: Gupta, Arbelaez, Malik 2013. NYU13: Couprie et al. 2013, by
the usual 40 to 13 table (SceneNet).
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

# Name of each NYU40 id, 0..40.
# fmt: off
NYU40_NAMES: Final = (
    "none", "wall", "floor", "cabinet", "bed", "chair", "sofa", "table", "door", "window",
    "bookshelf", "picture", "counter", "blinds", "desk", "shelves", "curtain", "dresser", "pillow",
    "mirror", "floor mat", "clothes", "ceiling", "books", "refrigerator", "television", "paper",
    "towel", "shower curtain", "box", "whiteboard", "person", "night stand", "toilet", "sink",
    "lamp", "bathtub", "bag", "otherstructure", "otherfurniture", "otherprop",
)
# fmt: on

# Each id by its name; "otherprop" has no class of its own.
# fmt: off
(
    WALL, FLOOR, CABINET, BED, CHAIR, SOFA, TABLE, DOOR, WINDOW, BOOKSHELF, PICTURE, COUNTER, BLINDS,
    DESK, SHELVES, CURTAIN, DRESSER, PILLOW, MIRROR, FLOOR_MAT, CLOTHES, CEILING, BOOKS, REFRIGERATOR,
    TELEVISION, PAPER, TOWEL, SHOWER_CURTAIN, BOX, WHITEBOARD, PERSON, NIGHT_STAND, TOILET, SINK,
    LAMP, BATHTUB, BAG, OTHERSTRUCTURE, OTHERFURNITURE, OTHERPROP,
) = range(1, len(NYU40_NAMES))
# fmt: on

# Name of each NYU13 id, 0..13.
# fmt: off
NYU13_NAMES: Final = (
    "none", "bed", "books", "ceiling", "chair", "floor", "furniture", "objects", "picture", "sofa",
    "table", "television", "wall", "window",
)
# fmt: on

# (41,) NYU13 id of each NYU40 id.
# fmt: off
NYU13_FROM_NYU40: Final[NDArray[np.uint8]] = np.array(
    [
        0, 12, 5, 6, 1, 4, 9, 10, 12, 13, 6, 8, 6, 13, 10, 6, 13, 6, 7, 7, 5,
        7, 3, 2, 6, 11, 7, 7, 7, 7, 7, 7, 6, 7, 7, 7, 7, 7, 7, 6, 7,
    ],
    np.uint8,
)
# fmt: on

_NYU40_HEX: Final = """
0c0e12 cec8be 9c7654 9454c4 1c5c24 149cfc 8c1444 2c3cb4 ec6cc4 64bc34 fc8414
148c14 ec5454 544c74 34c4c4 2c9c94 ecdc14 fca4fc 1c7494 8c4c14 9c84ac dcb414
e8ecf0 aca474 7c249c aca4dc fc94a4 849414 8cd484 845c7c cc4ca4 5c744c c42c5c
54e4fc 9c7cfc 2cfcac 2474e4 5c54b4 cc7c14 d4848c c44c14
"""

# (41, 3) sRGB of NYU40 ids 0..40. Structure is muted; each further class, the most frequent first,
# is the colour farthest in Oklab from those before it, so any two differ by 0.085 at least.
NYU40_COLOURS: Final[NDArray[np.uint8]] = np.array(
    [list(bytes.fromhex(text)) for text in _NYU40_HEX.split()], np.uint8
)
