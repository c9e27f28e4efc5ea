"""Which joints move anything of an item, and what they move weighs; no effects."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

from pbrs_farm.core.house import Material, Surface
from pbrs_farm.core.joints import Joint
from pbrs_farm.core.mesh import triangle_corners
from pbrs_farm.home.masses import mass_kg


def joints_of_surfaces(
    joints: Iterable[Joint], surfaces: Sequence[Surface], materials: Sequence[Material]
) -> tuple[Joint, ...]:
    """The joints that move one of some surfaces at all, with the mass of what they move."""
    moving = []
    for joint in joints:
        moved = [s for s in surfaces if s.part == joint.part]
        mass = sum(
            mass_kg(triangle_corners(s.positions, s.faces), materials[s.material]) for s in moved
        )
        if moved:
            moving.append(replace(joint, mass_kg=joint.mass_kg or mass))
    return tuple(moving)
