"""The rigid bodies of a home: each piece's body, and the parts moved by joints; no effects.

They form a tree: the parent of a piece's body, fixed or loose, is the world, and that of its parts is the
body. Every form with joints writes this tree; meshes, convex parts, masses and joints are computed here,
once.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Final

import numpy as np

from pbrs_farm.core import keys
from pbrs_farm.core.arrays import F64
from pbrs_farm.core.frames import transform_points
from pbrs_farm.core.house import Item, Material, Surface, corners_of_surfaces
from pbrs_farm.core.joints import Joint, JointKind
from pbrs_farm.crash_notes import note_step
from pbrs_farm.geometry.convex_parts import close_parts, slabs
from pbrs_farm.geometry.opened import moved_surface
from pbrs_farm.home.masses import class_of_material, surfaces_kg

_LEAST_KG, _MOST_KG = 0.05, 150.0
BODY: Final = ""
"""The part of a piece without a joint."""


@dataclass(frozen=True, eq=False)
class Shape:
    """Meshes, convex parts and inertia of a body in a frame of choice."""

    surfaces: tuple[Surface, ...]
    colliders: tuple[F64, ...]  # (V, 3) each
    middle: F64  # (3,) of its box, the centre of mass
    inertia: F64  # (3, 3) kg m2 about the middle


@dataclass(frozen=True, eq=False)
class Body:
    """A rigid body of a piece, in the piece's frame, in the pose of the home.

    part: Surface.part; BODY of the piece's own body. joint: with the body, in the piece's frame; None of
    the body. materials: of the house. nyu40: the class that suggests its material. is_wall: or floor, or ceiling.
    """

    name: str  # unique in the home: `Fridge`, `Fridge.door_1`
    part: str
    surfaces: tuple[Surface, ...]
    joint: Joint | None
    materials: Sequence[Material]
    nyu40: int
    is_wall: bool

    @cached_property
    def triangles(self) -> F64:
        """(F, 3, 3) metres."""
        return corners_of_surfaces(self.surfaces)

    @cached_property
    def colliders(self) -> tuple[F64, ...]:
        """Convex parts (V, 3) within 5 mm of its faces; () without a face."""
        note_step(self.name, "convex parts")
        return _convex_parts(_Mesh(self.triangles)) if len(self.triangles) else ()

    @property
    def solids(self) -> tuple[F64, ...]:
        """The convex parts for contacts: slabs behind the faces of walls, floors and ceilings, else colliders."""
        return tuple(slabs(self.triangles)) if self.is_wall else self.colliders

    @cached_property
    def mass_kg(self) -> float:
        """Its joint's, or from its materials (`home.masses.surfaces_kg`), 0.05 to 150."""
        if self.joint is not None and self.joint.mass_kg > 0:
            return max(self.joint.mass_kg, _LEAST_KG)
        mass = surfaces_kg(self.surfaces, self.materials, self.nyu40)
        return float(np.clip(mass, _LEAST_KG, _MOST_KG))

    @cached_property
    def bounds(self) -> F64:
        """(2, 3) lowest and highest corner; zeros without a face."""
        points = self.triangles.reshape(-1, 3)
        return np.array([points.min(0), points.max(0)]) if len(points) else np.zeros((2, 3))

    @property
    def middle(self) -> F64:
        """(3,) of its box, the centre of mass."""
        return np.asarray(self.bounds.mean(0))

    @property
    def inertia(self) -> F64:
        """(3,) kg m2 about its middle, along the piece's axes: a solid box's."""
        return box_inertia(self.mass_kg, np.ptp(self.bounds, axis=0))

    @property
    def shut(self) -> F64:
        """(4, 4) the rigid motion that closes it."""
        return np.eye(4) if self.joint is None else self.joint.motion(0.0)

    def shape(self, frame: F64) -> Shape:
        """Its meshes and inertia in another frame; frame: (4, 4) from the piece's frame to that one."""
        turn = frame[:3, :3]
        return Shape(
            tuple(moved_surface(s, frame) for s in self.surfaces),
            tuple(transform_points(frame, part) for part in self.solids),
            transform_points(frame, self.middle[None])[0],
            np.asarray(turn @ np.diag(self.inertia) @ turn.T),
        )


def bodies_of(
    name: str,
    surfaces: Sequence[Surface],
    item: Item,
    materials: Sequence[Material],
    local_from_world: F64,
) -> tuple[Body, ...]:
    """The body of a piece, then a body for each joint of its item whose part has faces.

    name: of the piece. surfaces: the item's, in the piece's frame. materials: of its house.
    """
    moving = {joint.part for joint in item.joints}
    is_wall = item.kind.is_structure
    still = tuple(s for s in surfaces if s.part not in moving)
    nyu40 = class_of_material(item)
    bodies = [Body(name, BODY, still, None, materials, nyu40, is_wall)]
    for joint in item.joints:
        of_part = tuple(s for s in surfaces if s.part == joint.part)
        if of_part:
            placed = joint.placed(local_from_world)
            part_name = f"{name}.{word_of(joint.part)}"
            row = Body(part_name, joint.part, of_part, placed, materials, nyu40, is_wall)
            bodies.append(row)
    return tuple(bodies)


def box_inertia(mass_kg: float, size: F64) -> F64:
    """(3,) kg m2 of a solid box of that size (3,), metres, about its middle."""
    x, y, z = np.maximum(size, 0.01) ** 2
    return np.asarray(mass_kg / 12 * np.array([y + z, x + z, x + y]))


def by_material(surfaces: Sequence[Surface]) -> Iterator[tuple[int, list[Surface]]]:
    """Material -> its surfaces, in the order of the house's materials."""
    for material in sorted({s.material for s in surfaces}):
        yield material, [s for s in surfaces if s.material == material]


def effort_of(joint: Joint) -> tuple[float, float]:
    """(damping, friction) typical of furniture: N s/m and N of slides, N m s and N m of hinges.

    A drawer moves at a push of 3 N, a door at 3 N at its handle; heavy ones need more.
    """
    mass = max(joint.mass_kg, 1.0)
    if joint.kind is JointKind.PRISMATIC:
        return 2.0 + mass, 1.0 + 0.2 * mass
    return 0.2 + 0.05 * mass, 0.2 + 0.02 * mass


def word_of(text: str) -> str:
    """A part's or class's name as a word of letters, digits and _; "part" if none is left."""
    return re.sub(r"[^A-Za-z0-9]+", "_", text).strip("_") or "part"


class _Mesh:
    """Triangles as a key, so that equal meshes are decomposed once."""

    def __init__(self, triangles: F64) -> None:
        self.triangles = triangles
        self._key = keys.sha256(np.ascontiguousarray(triangles.round(6)).tobytes())

    def __hash__(self) -> int:
        return hash(self._key)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Mesh) and self._key == other._key


@lru_cache(maxsize=4096)
def _convex_parts(mesh: _Mesh) -> tuple[F64, ...]:
    return close_parts(mesh.triangles)
