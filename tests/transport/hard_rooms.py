"""Rooms whose light is hard to sample, for the Metropolis tests and benchmarks/light/shots.py."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pbrs_farm.core.camera import Camera
from pbrs_farm.core.house import House, Material, MaterialKind, Surface
from pbrs_farm.transport.validation.known_rooms import (
    BULB,
    Triple,
    box,
    bulb,
    camera,
    door_ajar,
    house,
    matte,
    panel,
    shell,
    sphere,
)

__all__ = ["covered_cup", "door_ajar", "glass_globe", "open_shade", "sunlit"]


def glass_globe(radius: float = 0.12) -> tuple[House, Camera]:
    """A bulb inside two globes of thin glass in a closed room."""
    surfaces = shell((4.0, 2.5, 4.0), 0)
    surfaces.append(sphere((2.0, 1.9, 2.0), radius, 2, n=32))
    surfaces.append(box((2.4, 0.0, 2.4), (3.2, 0.6, 3.2), 1, "block"))
    glass = Material("glass", kind=MaterialKind.GLASS, opacity=0.1)
    materials = [matte("wall", 0.7), matte("block", 0.6, 0.2, 0.15), glass, BULB]
    return (
        house(surfaces, materials, lamps=[bulb((2.0, 1.9, 2.0), 3, 800.0, radius=0.03)]),
        camera((0.5, 1.5, 0.5), (2.4, 1.0, 2.4)),
    )


def open_shade(*, n: int = 32, east: float = 0.0) -> tuple[House, Camera]:
    """A bulb deep in an opaque shade, open above and below, in a room with a window.

    n: facets of the shade. east: shift of everything along +x, metres.
    """
    surfaces = shell((4.0, 2.5, 4.0), 0, front=False)
    surfaces += panel((0, 0, -0.1), (4.0, 2.5, 0.0), (1.5, 1.0, 2.5, 2.0), 0)
    surfaces.append(cylinder((2.0, 1.3, 2.2), 0.12, 0.35, 1, n=n))
    surfaces.append(box((2.6, 0.0, 2.4), (3.4, 0.6, 3.2), 2, "block"))
    shift = np.array([east, 0, 0], np.float32)
    surfaces = [replace(s, positions=s.positions + shift) for s in surfaces]
    materials = [matte("wall", 0.7), matte("shade", 0.5), matte("block", 0.2, 0.5, 0.3), BULB]
    lamp = bulb((2.0 + east, 1.45, 2.2), 3, 800.0, radius=0.03)
    return (
        house(surfaces, materials, lamps=[lamp]),
        camera((0.5 + east, 1.5, 3.6), (2.4 + east, 0.9, 1.8)),
    )


def covered_cup() -> tuple[House, Camera]:
    """A bulb in a white cup in a globe of thin glass: all light is reflected by the inside of the cup."""
    surfaces = shell((4.0, 2.5, 4.0), 0)
    surfaces.append(sphere((2.0, 1.5, 2.2), 0.12, 2, n=32))
    surfaces.append(cylinder((2.0, 1.42, 2.2), 0.06, 0.1, 3))
    surfaces.append(box((2.4, 0.0, 2.4), (3.2, 0.6, 3.2), 1, "block"))
    glass = Material("glass", kind=MaterialKind.GLASS, opacity=0.1)
    white = matte("white", 0.8)
    materials = [matte("wall", 0.7), matte("block", 0.6, 0.2, 0.15), glass, white, BULB]
    lamp = bulb((2.0, 1.47, 2.2), 4, 800.0, radius=0.03)
    return house(surfaces, materials, lamps=[lamp]), camera((0.5, 1.5, 0.5), (2.4, 1.0, 2.4))


def sunlit() -> tuple[House, Camera]:
    """A room with one window and no lamp, lit by the sky."""
    from pbrs_farm.transport.validation.known_rooms import window_room

    return window_room(0.7)


def cylinder(base: Triple, radius: float, height: float, material: int, *, n: int = 32) -> Surface:
    """An open tube around +y."""
    angle = np.arange(n) / n * 2 * np.pi
    ring = np.stack([radius * np.cos(angle), np.zeros(n), radius * np.sin(angle)], -1)
    points = np.concatenate([ring, ring + np.array([0.0, height, 0.0])]) + np.array(base)
    faces = [
        f
        for i in range(n)
        for f in ((i, i + n, (i + 1) % n + n), (i, (i + 1) % n + n, (i + 1) % n))
    ]
    return Surface("tube", points.astype(np.float32), np.array(faces, np.int32), material)
