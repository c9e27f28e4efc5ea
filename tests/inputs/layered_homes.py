"""Panes, boxes of glass and walls before a camera, with the surfaces along each ray in closed form."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pbrs_farm import truth
from pbrs_farm.core.arrays import F64
from pbrs_farm.core.house import House, Material, MaterialKind, Surface
from pbrs_farm.geometry.solids import box
from tests.inputs.label_inputs import label_inputs_of
from tests.truth.hits import camera, house, square

GLASS, PANE, WALL, MIRROR, BLACK = range(5)
MATERIALS = (
    Material("glass", MaterialKind.GLASS),
    Material("pane", MaterialKind.PANE),
    Material("wall", diffuse=(0.8, 0.7, 0.6)),
    Material("mirror", MaterialKind.MIRROR),
    Material("black", diffuse=(0.25, 0.25, 0.25)),
)
NAMES = ("depth_layers", "depth_layers_semantic", "depth_layers_instance", "depth_layers_clear")


def solid(near: float, far: float, half: float, material: int) -> Surface:
    """A box across the view axis, between two depths."""
    centre, sizes = np.array([0, 0, -(near + far) / 2]), np.array([half, half, (far - near) / 2])
    return box("box", centre, sizes, material)


def sheet(z: float, half: float, material: int) -> Surface:
    return replace(square(-z, half), material=material)


def home_of(*surfaces: Surface) -> House:
    """A house with an item for each surface, of classes 1, 2 ..."""
    home = house(*range(1, len(surfaces) + 1))
    items = [replace(i, surfaces=(s,)) for i, s in zip(home.items, surfaces, strict=True)]
    return replace(home.with_items(items), materials=MATERIALS)


def layers_of(home: House, names: Sequence[str] = NAMES) -> dict[str, np.ndarray]:
    return truth.optional_layers(names, label_inputs_of(home, camera()))


def wrong_pixels(width: int = 160, height: int = 120) -> int:
    """Number of pixels with other surfaces than by the closed forms: a pane, two panes, a box of glass, a wall of 10 cm."""
    view = camera(width, height)
    slope = np.abs(view.exact_rays()[1][..., :2]).max(-1)  # of a ray, sideways for a metre ahead
    wall = np.full(slope.shape, 5.0)

    def crossing(z: float, half: float) -> F64:
        return np.where(slope * z < half, z, np.nan)

    scenes = (
        ([sheet(2, 1, PANE), sheet(5, 50, WALL)], [(crossing(2, 1), 1, 255), (wall, 2, 0)]),
        (
            [sheet(2, 1, PANE), sheet(2.5, 1, PANE), sheet(5, 50, WALL)],
            [(crossing(2, 1), 1, 255), (crossing(2.5, 1), 2, 255), (wall, 3, 0)],
        ),
        (
            [solid(1, 1.5, 0.5, GLASS), sheet(5, 50, WALL)],
            # A ray enters by the front and leaves by the back or a side.
            [(crossing(1, 0.5), 1, 255), (np.where(slope < 0.5, np.minimum(1.5, 0.5 / slope), np.nan), 1, 255), (wall, 2, 0)],
        ),
        (
            [solid(2, 2.1, 20, WALL), sheet(5, 50, WALL)],
            [(0 * wall + 2, 1, 0), (0 * wall + 2.1, 1, 0), (wall, 2, 0)],
        ),
    )  # fmt: skip
    n_wrong = 0
    for surfaces, expected in scenes:
        layers = truth.optional_layers(NAMES, label_inputs_of(home_of(*surfaces), view))
        depth = np.full((*slope.shape, 8), np.inf)
        depth[..., : len(expected)] = np.stack(
            [np.nan_to_num(z, nan=np.inf) for z, *_ in expected], -1
        )
        order = np.argsort(depth, axis=-1)
        depth = np.take_along_axis(depth, order, -1)
        ids = np.array([i for _z, i, _clear in expected] + [0] * (8 - len(expected)))[
            order
        ] * np.isfinite(depth)
        clear = np.array([c for *_, c in expected] + [0] * (8 - len(expected)))[
            order
        ] * np.isfinite(depth)
        wrong = (
            np.abs(layers["depth_layers"] - np.where(np.isfinite(depth), 1000 * depth, 0)) > 0.501
        )
        wrong |= (layers["depth_layers_instance"] != ids) | (layers["depth_layers_clear"] != clear)
        wrong |= layers["depth_layers_semantic"] != ids  # classes are numbered as the items
        n_wrong += int(wrong.any(-1).sum())
    return n_wrong
