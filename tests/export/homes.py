"""A repaired home in an output folder, and the comparison of two readings of one home."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np

from pbrs_farm.core.house import House
from pbrs_farm.core.recipe import Recipe
from pbrs_farm.export.home_pieces import exported_home
from pbrs_farm.formats.house_bundle import bundle_from_house
from pbrs_farm.prepare.finished_house import repaired_house
from pbrs_farm.prepare.source import resolve
from pbrs_farm.read.builtin.builtin_home import builtin_home


@cache
def repaired_home() -> House:
    """The built-in home after repair: doors, windows, lamps, furniture."""
    assert builtin_home().items
    return repaired_house(resolve("builtin"), Recipe())[0]


def stored(folder: Path, house: House) -> Path:
    """An output folder with the house."""
    below = folder / "houses" / house.id
    below.mkdir(parents=True)
    for name, data in zip(("house.glb", "house.json"), bundle_from_house(house), strict=True):
        (below / name).write_bytes(data)
    return folder


def differences(expected: House, got: House) -> list[str]:
    """Differences of items, classes, boxes (a millimetre), rooms and lamps, by id."""
    got_items = {item.id: item for item in got.items}
    lines = [f"more: {i}" for i in got_items if i not in {item.id for item in expected.items}]
    for item in expected.items:
        got_item = got_items.get(item.id)
        if got_item is None:
            lines.append(f"missing: {item.id}")
            continue
        facts = [(x.name, x.kind, x.nyu40, x.room_id) for x in (item, got_item)]
        if facts[0] != facts[1]:
            lines.append(f"{item.id}: {facts}")
        if item.surfaces and np.abs(item.bounds - got_item.bounds).max() > 1e-3:
            lines.append(f"{item.id}: bounds {item.bounds} {got_item.bounds}")
        corners = item.oriented_box.corners[:, None] - got_item.oriented_box.corners[None]
        off = np.linalg.norm(corners, axis=-1).min(1).max()
        if not item.kind.is_structure and item.surfaces and not off < 1e-3:
            lines.append(f"{item.id}: box off by {off}")
    for room, got_item in zip(expected.rooms, got.rooms, strict=False):
        same = (room.name, room.types) == (got_item.name, got_item.types)
        heights = np.abs(
            [room.floor_y - got_item.floor_y, room.ceiling_y - got_item.ceiling_y]
        ).max()
        outline = np.asarray(room.polygon), np.asarray(got_item.polygon)
        if not same or heights > 1e-3 or not _same_ring(*outline):
            lines.append(f"room {room}, {got_item}")
    if len(expected.rooms) != len(got.rooms):
        lines.append(f"{len(got.rooms)} rooms")
    lines += _lamp_differences(expected, got)
    return lines


def _same_ring(a: np.ndarray, b: np.ndarray) -> bool:
    if len(a) != len(b):
        return False
    return any(np.allclose(np.roll(b, k, 0), a, atol=1e-3) for k in range(len(b)))


def _lamp_differences(expected: House, got: House) -> list[str]:
    lamps = [
        {p.item.id: p.lamps for p in exported_home(h).pieces if p.lamps} for h in (expected, got)
    ]
    if lamps[0].keys() != lamps[1].keys():
        return [f"lamps {lamps[0].keys() ^ lamps[1].keys()}"]
    lines = []
    for name, expected_lamp in lamps[0].items():
        got_lamp = lamps[1][name]
        if len(expected_lamp) != len(got_lamp):
            lines.append(f"{name}: {len(got_lamp)} lights")
        for a, b in zip(expected_lamp, got_lamp, strict=False):
            same = np.allclose(a.rgb_linear, b.rgb_linear, atol=1e-3)
            if not same or abs(a.flux_lm / b.flux_lm - 1) > 1e-3:
                lines.append(f"{name}: {a} {b}")
            if np.abs(a.position - b.position).max() > 1e-3:
                lines.append(f"{name}: at {b.position}, not {a.position}")
    return lines
