"""Homes with loose items, for the exports of homes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pbrs_farm.core.house import Box, House, Item, ItemKind, Material, Source
from tests.inputs.cupboards import box_item


def small_home(*items: Item) -> House:
    """Items on a floor of 4 m."""
    floor = replace(box_item("floor", (-2, -0.1, -2), (2, 0, 2)), kind=ItemKind.FLOOR)
    source = Source("builtin", "", "", licence="CC0")
    return House("small", "small", source, (), (), (floor, *items), (Material("wood"),), {})


def loose(name: str, low: tuple[float, float, float], high: tuple[float, float, float]) -> Item:
    item = box_item(name, low, high)
    a, b = np.array(low), np.array(high)
    return replace(item, box=Box((a + b) / 2, (b - a) / 2, np.eye(3)))
