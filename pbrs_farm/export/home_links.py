"""What of a piece moves on its own: its body and each part that a joint turns or slides; no effects.

Every form that has joints writes these: meshes and convex parts in the piece's frame, where they
stand; mass and inertia; what may pass through what.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Final

import numpy as np

from pbrs_farm.core import keys
from pbrs_farm.core.arrays import F64
from pbrs_farm.core.house import Item, Material, Surface, corners_of_surfaces
from pbrs_farm.core.joints import Joint, JointKind
from pbrs_farm.geometry.convex_parts import close_parts, connected
from pbrs_farm.home.masses import body_kg

_LEAST_KG, _MOST_KG = 0.05, 150.0
BODY: Final = ""
"""The part that stands still, or falls as one where the piece is loose."""


@dataclass(frozen=True, eq=False)
class Link:
    """A rigid body of a piece, in the piece's frame."""

    part: str  # Surface.part; BODY of what has no joint
    surfaces: tuple[Surface, ...]
    joint: Joint | None  # against the body, in the piece's frame; None of the body
    materials: Sequence[Material]  # of the house
    nyu40: int  # the class of its thing

    @cached_property
    def triangles(self) -> F64:
        """(F, 3, 3) metres."""
        return corners_of_surfaces(self.surfaces)

    @cached_property
    def colliders(self) -> tuple[F64, ...]:
        """Convex parts (V, 3) within 5 mm of its faces; () without a face. Found once a shape."""
        if not len(self.triangles):
            return ()
        return _parts_of(_Shape(self.triangles))

    @cached_property
    def mass_kg(self) -> float:
        """Its joint's, or by what its surfaces are made of (`home.masses.body_kg`), 0.05 to 150."""
        if self.joint is not None and self.joint.mass_kg > 0:
            return max(self.joint.mass_kg, _LEAST_KG)
        solids = (
            (body, self.materials[surface.material])
            for surface in self.surfaces
            for body in connected(corners_of_surfaces((surface,)))
        )
        return float(np.clip(body_kg(solids, self.nyu40), _LEAST_KG, _MOST_KG))

    @cached_property
    def bounds(self) -> F64:
        """(2, 3) lowest and highest corner; zeros without a face."""
        points = self.triangles.reshape(-1, 3)
        return np.array([points.min(0), points.max(0)]) if len(points) else np.zeros((2, 3))

    @property
    def middle(self) -> F64:
        """(3,) of its box, where its mass is."""
        return np.asarray(self.bounds.mean(0))

    @property
    def inertia(self) -> F64:
        """(3,) kg m2 about its middle, along the piece's axes: a solid box's."""
        x, y, z = np.maximum(np.ptp(self.bounds, axis=0), 0.01) ** 2
        return np.asarray(self.mass_kg / 12 * np.array([y + z, x + z, x + y]))


def links_of(
    surfaces: Sequence[Surface], item: Item, materials: Sequence[Material], local_from_world: F64
) -> tuple[Link, ...]:
    """The body, then a link for each joint of the item whose part has faces.

    surfaces: the item's, in the piece's frame. materials: of its house.
    """
    joints = item.joints
    moving = {joint.part for joint in joints}
    body = tuple(s for s in surfaces if s.part not in moving)
    found = [Link(BODY, body, None, materials, item.nyu40)]
    for joint in joints:
        own = tuple(s for s in surfaces if s.part == joint.part)
        if own:
            placed = joint.placed(local_from_world)
            found.append(Link(joint.part, own, placed, materials, item.nyu40))
    return tuple(found)


def effort_of(joint: Joint) -> tuple[float, float]:
    """(damping, friction) of a joint as furniture has them: N s/m and N of slides, N m s and N m of hinges.

    A drawer runs at a push of 3 N, a door at 3 N at its handle; heavy ones take more.
    """
    mass = max(joint.mass_kg, 1.0)
    if joint.kind is JointKind.PRISMATIC:
        return 2.0 + mass, 1.0 + 0.2 * mass
    return 0.2 + 0.05 * mass, 0.2 + 0.02 * mass


class _Shape:
    """Triangles as a key: equal ones are decomposed once."""

    def __init__(self, triangles: F64) -> None:
        self.triangles = triangles
        self._key = keys.sha256(np.ascontiguousarray(triangles.round(6)).tobytes())

    def __hash__(self) -> int:
        return hash(self._key)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Shape) and self._key == other._key


@lru_cache(maxsize=4096)
def _parts_of(shape: _Shape) -> tuple[F64, ...]:
    return close_parts(shape.triangles)
