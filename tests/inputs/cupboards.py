"""Cupboards with doors and drawers, and boxes as obstacles."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pbrs_farm.core.house import Box, Item, ItemKind
from pbrs_farm.core.joints import Joint, JointKind
from pbrs_farm.geometry.solids import box

WIDE, DEEP = 0.6, 0.02  # of a door and of a drawer's front


def box_item(name: str, low: tuple[float, float, float], high: tuple[float, float, float]) -> Item:
    a, b = np.array(low), np.array(high)
    return Item(name, name, ItemKind.OBJECT, "0", (box("box", (a + b) / 2, (b - a) / 2, 0),))


def cupboard(kind: JointKind, x: float = 0.0, name: str = "cupboard") -> Item:
    """A box of 60 cm with a front at z = 0: a door hinged at the left, or a drawer."""
    body = box_item("body", (x, 0, -0.5), (x + WIDE, 0.7, 0.0)).surfaces[0]
    front = box_item("front", (x + 0.0015, 0.002, 0), (x + WIDE - 0.0015, 0.698, DEEP)).surfaces[0]
    joint = (
        Joint("front", kind, (x + 0.0015, 0, DEEP), (0, -1, 0), np.radians(110))
        if kind is JointKind.REVOLUTE
        else Joint("front", kind, (0, 0, 0), (0, 0, 1), 0.4)
    )
    box_ = Box(np.array([x + 0.3, 0.35, -0.24]), np.array([0.3, 0.35, 0.26]), np.eye(3))
    return Item(
        name, name, ItemKind.OBJECT, "0", (body, replace(front, part="front")), box=box_,
        joints=(joint,),
    )  # fmt: skip
