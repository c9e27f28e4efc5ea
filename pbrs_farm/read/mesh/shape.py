"""Triangles of a shape in its own frame, and those of solids that files give by their size; no effects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from pbrs_farm.core.arrays import F64, I64
from pbrs_farm.core.house import Surface
from pbrs_farm.geometry.solids import lathe, sphere

ROUND: Final = 24  # segments around a round shape
ABOUT_Z: Final = (2, 0, 1)  # order of a turned solid's axes: a lathe turns about y
ABOUT_X: Final = (1, 2, 0)


@dataclass(frozen=True, slots=True, eq=False)
class Shape:
    """Triangles in a shape's own frame and unit."""

    positions: F64  # (V, 3)
    faces: I64  # (F, 3)
    uvs: F64 | None = None  # (V, 2)
    normals: F64 | None = None  # (V, 3)
    # (F,) the polygon that a triangle was cut from; empty for solids
    polygon: I64 = field(default_factory=lambda: np.zeros(0, np.int64))


def shape_of_surface(surface: Surface, order: Sequence[int] = (0, 1, 2)) -> Shape:
    """The shape of a surface with its axes in another order."""
    return Shape(
        surface.positions[:, order].astype(np.float64),
        surface.faces.astype(np.int64),
        None if surface.uvs is None else surface.uvs.astype(np.float64),
        None if surface.normals is None else surface.normals[:, order].astype(np.float64),
    )


def ball(radius: float) -> Shape:
    """A sphere about the origin."""
    return shape_of_surface(sphere("", np.zeros(3), radius, 0, n=ROUND))


def turned(profile: F64, order: Sequence[int] = ABOUT_Z) -> Shape:
    """A profile (P, 2) of radius and height, turned about z, or about another axis by its order."""
    return shape_of_surface(lathe("", profile, np.zeros(3), 0, n=ROUND), order)


def cylinder_profile(radius: float, half: float) -> F64:
    """The profile of a cylinder of a radius and half a height."""
    return np.array([[0, -half], [radius, -half], [radius, half], [0, half]], np.float64)


def capsule_profile(radius: float, half: float) -> F64:
    """The profile of a cylinder that ends in half spheres; half: of the cylinder's height."""
    angles = np.linspace(-np.pi / 2, np.pi / 2, 13)
    lift = np.where(angles < 0, -half, half)
    return np.column_stack([radius * np.cos(angles), radius * np.sin(angles) + lift])
