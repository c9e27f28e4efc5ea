"""What became of a candidate viewpoint; no effects."""

from __future__ import annotations

from enum import IntEnum


class Verdict(IntEnum):
    """The first rule that rejected a candidate, in the order the rules are tried, or its success."""

    OUTSIDE_ROOM = 0  # not inside the room's polygon
    NEAR_OBSTACLE = 1  # closer to a triangle than the clearance
    NOT_ABOVE_FLOOR = 2  # a wall or a ceiling is below: inside a wall, or above a sloped ceiling
    ENCLOSED = 3  # inside a piece of furniture or a wall
    FILLED_BY_ONE = 4  # one object or wall covers more of the picture than it may
    FEW_OBJECTS = 5  # too few objects cover enough of the picture
    WEAK = 6  # preset photo: scores less than the least score
    TWIN = 7  # preset photo: shows what a better view of the home shows
    LOWER_SCORE = 8  # kept every rule; another one of its sector was taken
    WINNER = 9

    @property
    def label(self) -> str:
        """The name in reports: "near_obstacle"."""
        return self.name.lower()


REJECTIONS = tuple(v for v in Verdict if v < Verdict.LOWER_SCORE)
