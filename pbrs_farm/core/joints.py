"""Joints of items: a Joint turns or slides one part of an item; frozen values, no effects.

A part is the surfaces of an item with its name (Surface.part); surfaces without one form the static body.
Geometry is flattened (ARCHITECTURE.md): surfaces are placed at the joint's value.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Final

import numpy as np

from pbrs_farm.core.arrays import F64, Matrix4, triple
from pbrs_farm.core.frames import affine

Triple = tuple[float, float, float]

JOINTS_PROPERTY: Final = "pbrs_farm.joints"
"""Property of a piece of a Sweet Home 3D file with the joints of its model, as JSON, in the model's
frame. Its n-th joint moves the groups named `..._on_hinge_<n>` or `..._on_rail_<n>`.
"""


class JointKind(StrEnum):
    """How a part moves; the words are URDF's."""

    REVOLUTE = "revolute"  # it turns about its axis; values in radians
    PRISMATIC = "prismatic"  # it slides along its axis; values in metres


@dataclass(frozen=True, slots=True)
class Joint:
    """A moving part of an item.

    Values count from the closed state, 0: radians, anticlockwise about the axis, or metres along it.
    `upper` is the fully open state.
    """

    part: str  # Surface.part of what moves; names the joint in its item
    kind: JointKind
    point: Triple  # on the axis, metres, in the frame of the surfaces: of an item, the world
    axis: Triple  # unit
    upper: float
    lower: float = 0.0
    value: float = 0.0  # of its surfaces' present place
    mass_kg: float = 0.0  # of the part; 0 = nobody knows

    @property
    def share(self) -> float:
        """Its opening as a share of `upper`, 0..1."""
        return self.value / self.upper if self.upper else 0.0

    def motion(self, value: float) -> Matrix4:
        """(4, 4) rigid motion of the part from its present place to that at a value, without limits."""
        by, axis = value - self.value, np.array(self.axis)
        if self.kind is JointKind.PRISMATIC:
            return affine(np.eye(3), by * axis)
        # Rodrigues' formula, about the point.
        x, y, z = axis
        cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        turn = np.eye(3) + np.sin(by) * cross + (1 - np.cos(by)) * (cross @ cross)
        point = np.array(self.point)
        return affine(turn, point - turn @ point)

    def placed(self, matrix: F64) -> Joint:
        """The joint of an item moved by a matrix (4, 4), scaled along and across the axis; masses follow."""
        linear = matrix[:3, :3]
        axis = linear @ np.array(self.axis)
        length = float(np.linalg.norm(axis))
        # A mirror turns the sense of a rotation over.
        is_turned = self.kind is JointKind.REVOLUTE and np.linalg.det(linear) < 0
        reach = 1.0 if self.kind is JointKind.REVOLUTE else length
        return replace(
            self,
            point=triple(linear @ np.array(self.point) + matrix[:3, 3]),
            axis=triple(axis / length * (-1.0 if is_turned else 1.0)),
            upper=self.upper * reach,
            lower=self.lower * reach,
            value=self.value * reach,
            mass_kg=self.mass_kg * abs(float(np.linalg.det(linear))),
        )
