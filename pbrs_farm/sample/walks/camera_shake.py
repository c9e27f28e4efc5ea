"""The shake of a camera that a walking person holds, as sums of slow waves; no effects."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from pbrs_farm.core.arrays import F64

_WAVES_HZ: Final = (0.45, 0.8, 1.3, 2.1)
_PLACE_M: Final = 0.0015  # amplitude of each wave and axis
_TURN_RAD: Final = math.radians(0.12)
_STEPS_HZ: Final = 1.7
_STEP_M: Final = 0.006  # up and down with every step


@dataclass(frozen=True, slots=True, eq=False)
class Shake:
    """Offsets from a steady camera at N times.

    The two speeds bound how fast the shake alone moves and turns a camera, so that a walk can respect its
    limits: subtract them from those of the path.
    """

    moved: F64  # (N, 3) metres, world
    turned: F64  # (N, 3) radians: azimuth, tilt, roll

    speed_mps: float  # at most, by the shake alone
    turn_rps: float


def shake(times: F64, strength: float, rng: np.random.Generator) -> Shake:
    """The shake at times (N,) s, from slow sine waves of random phase on every axis.

    strength: 1 = a steady hand's, 0 = none; it scales all amplitudes. rng: decides the
    phases, six times the number of waves, so equal generators give equal shakes. With each
    step the camera also goes up and down.
    """
    frequency = np.asarray(_WAVES_HZ)
    phases = rng.uniform(0, 2 * math.pi, (6, len(frequency)))
    waves = np.sin(2 * math.pi * frequency * times[:, None, None] + phases).sum(-1)  # (N, 6)
    moved = strength * _PLACE_M * waves[:, :3]
    moved[:, 1] += strength * _STEP_M * np.sin(2 * math.pi * _STEPS_HZ * times + phases[0, 0])
    # Bound the speed by the sum over all waves, for three axes at once.
    steepest = 2 * math.pi * float(frequency.sum())
    speed = math.sqrt(3) * _PLACE_M * steepest + 2 * math.pi * _STEPS_HZ * _STEP_M
    turn = math.sqrt(3) * _TURN_RAD * steepest
    return Shake(moved, strength * _TURN_RAD * waves[:, 3:], strength * speed, strength * turn)
