"""Motions of a home over time: a Motion holds key values of one joint, or of one whole item; frozen values, no effects.

Geometry is stored at rest. Between two keys values change linearly, before the first and after the last one they
are constant.
"""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from pbrs_farm.core.arrays import F64, Matrix4
from pbrs_farm.core.frames import rotation_of_quaternion

JOINT_VALUES, BODY_VALUES = 1, 7


@dataclass(frozen=True, slots=True)
class Motion:
    """Motion of one part of an item, or all of it, over time.

    A row of `values` for each of the ascending `times_s`. Of a joint: its value, radians or metres from the
    closed state. Of the whole item (`part` is ""): its `pivot`, x, y, z in metres, and its turn from rest
    about that as a unit quaternion w, x, y, z. A joint moves with its item.
    """

    item: str  # id of the item
    part: str  # of its joint; "" = the whole item
    times_s: tuple[float, ...]
    values: tuple[tuple[float, ...], ...]
    pivot: tuple[float, float, float] = (0.0, 0.0, 0.0)  # at rest, world; of a whole item alone

    @property
    def is_of_joint(self) -> bool:
        """True if it moves a door, drawer or lid, not the whole item."""
        return bool(self.part)

    def value_at(self, time_s: float) -> float:
        """A joint's value at a time, radians or metres from shut."""
        k, share = self._place(time_s)
        if share == 0:
            return self.values[k][0]
        return (1 - share) * self.values[k][0] + share * self.values[k + 1][0]

    def matrix_at(self, time_s: float) -> Matrix4:
        """(4, 4) rigid motion of a whole item from rest to a time."""
        k, share = self._place(time_s)
        row = np.array(self.values[k], np.float64)
        if share > 0:
            row = _between(row, np.array(self.values[k + 1], np.float64), share)
        matrix = np.eye(4)
        matrix[:3, :3] = rotation_of_quaternion(*row[3:])
        matrix[:3, 3] = row[:3] - matrix[:3, :3] @ np.array(self.pivot)
        return matrix

    def _place(self, time_s: float) -> tuple[int, float]:
        """The key at or before a time, and the share of the way to the next one."""
        k = bisect_right(self.times_s, time_s) - 1
        if k < 0:
            return 0, 0.0
        if k + 1 >= len(self.times_s):
            return len(self.times_s) - 1, 0.0
        begin, end = self.times_s[k], self.times_s[k + 1]
        return k, (time_s - begin) / (end - begin)


def fault_of_motion(motion: Motion) -> str:
    """The error of a single motion; "" without one."""
    width = JOINT_VALUES if motion.is_of_joint else BODY_VALUES
    times = motion.times_s
    if not times or len(times) != len(motion.values):
        return f"has {len(times)} times and {len(motion.values)} rows of values"
    if any(b <= a for a, b in pairwise(times)):
        return "has times that do not ascend"
    if any(len(row) != width for row in motion.values):
        return f"has rows of other than {width} values"
    if not np.isfinite([*times, *(v for row in motion.values for v in row)]).all():
        return "has a value that is not a finite number"
    if not motion.is_of_joint:
        length = np.linalg.norm(np.array(motion.values)[:, 3:], axis=1)
        if np.abs(length - 1).max() > 1e-6:
            return "has a quaternion that is not of length 1"
    return ""


def _between(a: F64, b: F64, share: float) -> F64:
    """Between two rows of a body: positions evenly, turns along the shorter arc (Shoemake 1985)."""
    p, q = a[3:], b[3:]
    cos = float(p @ q)
    if cos < 0:
        q, cos = -q, -cos
    angle = float(np.arccos(min(cos, 1.0)))
    if angle > 1e-6:
        turn = (np.sin((1 - share) * angle) * p + np.sin(share * angle) * q) / np.sin(angle)
    else:
        turn = (1 - share) * p + share * q
    return np.concatenate([(1 - share) * a[:3] + share * b[:3], turn / np.linalg.norm(turn)])
