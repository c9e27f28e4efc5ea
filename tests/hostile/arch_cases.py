"""SUNCG v2: damaged arch.json. Effects: they write the roots."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

from tests.hostile.case import Case, Place, Words, run
from tests.hostile.sound_inputs import suncg
from tests.read.suncg.suncg_root import HOUSE, write

Spoil = Callable[[dict[str, Any]], Any]


def cases() -> Iterator[Case]:
    """Texts, then elements."""
    for name, text in _texts().items():
        yield Case(f"arch/{name}", "format", partial(_write, text))
    for name, spoil in _spoils().items():
        yield Case(f"arch/{name}", "format", partial(_spoiled, spoil))


def arch() -> dict[str, Any]:
    """Room 0_0, 4 x 3 m: four walls with a window, a floor and a ceiling."""
    ring = [[0, 0, 0], [4, 0, 0], [4, 0, 3], [0, 0, 3]]
    paint = [{"name": "inside", "diffuse": "#ff0000"}, {"name": "outside", "texture": "stone"}]
    shared = {"roomId": "0_0", "height": 2.7, "materials": paint}
    walls: list[dict[str, Any]] = [
        shared | {"id": f"0_0_{k}", "type": "Wall", "points": [ring[k], ring[(k + 1) % 4]], "holes": []}
        for k in range(4)
    ]  # fmt: skip
    box = {"min": [1.1, 0.9], "max": [2.5, 2.3]}
    walls[2]["holes"] = [{"id": "0_6", "type": "Window", "box": box}]
    slab = {
        "roomId": "0_0",
        "points": [ring],
        "materials": [{"name": "surface", "texture": "wood"}],
    }
    return {
        "version": "suncg-arch@1.0.2", "id": HOUSE, "up": [0, 1, 0], "front": [0, 0, 1],
        "scaleToMeters": 1, "defaults": {"Wall": {"depth": 0.12, "extraHeight": 0.035}},
        "elements": [
            *walls,
            slab | {"id": "0_0f", "type": "Floor", "offset": [0, 0, 0]},
            slab | {"id": "0_0c", "type": "Ceiling", "offset": [0, 2.69, 0]},
        ],
    }  # fmt: skip


def _texts() -> dict[str, bytes]:
    return {
        "empty": b"",
        "cut": json.dumps(arch()).encode()[:300],
        "list": b"[]",
        "no_elements": b"{}",
        "deep": b'{"elements":' + b"[" * 100_000,
        "noise": bytes(range(256)) * 9,
    }


def _spoils() -> dict[str, Spoil]:
    nan = float("nan")

    def wall(**more: Any) -> Spoil:
        return lambda plain: plain["elements"][2].update(more)

    def floor(**more: Any) -> Spoil:
        return lambda plain: plain["elements"][4].update(more)

    def hole(*box: list[float]) -> Spoil:
        return wall(holes=[{"id": "0_6", "type": "Window", "box": dict(zip(("min", "max"), box))}])

    return {
        "wall_nan": wall(points=[[nan, 0, 0], [4, 0, 0]]),
        "wall_no_length": wall(points=[[4, 0, 3], [4, 0, 3]]),
        "wall_one_end": wall(points=[[4, 0, 3]]),
        "wall_height_minus": wall(height=-1),
        "wall_height_1e9": wall(height=1e9),
        "wall_depth_0": wall(depth=0),
        "wall_depth_1e6": wall(depth=1e6),
        "hole_outside": hole([9, 9], [12, 12]),
        "hole_inverted": hole([2.5, 2.3], [1.1, 0.9]),
        "hole_larger": hole([-9, -9], [99, 99]),
        "hole_nan": hole([nan, 0], [1, 1]),
        "holes_500": lambda p: p["elements"][2].update(holes=p["elements"][2]["holes"] * 500),
        "floor_bow_tie": floor(points=[[[0, 0, 0], [4, 0, 3], [4, 0, 0], [0, 0, 3]]]),
        "floor_no_area": floor(points=[[[0, 0, 0], [4, 0, 0], [2, 0, 0]]]),
        "floor_hole_outside": floor(
            points=[[[0, 0, 0], [4, 0, 0], [4, 0, 3]], [[9, 0, 9], [9, 0, 8], [8, 0, 8]]]
        ),
        "floor_9000_corners": floor(
            points=[[[k / 2250, 0, 3 * (k % 2)] for k in range(9000)] + [[4, 0, 9]]]
        ),
        "unknown_type": wall(type="Moat"),
        "no_room": wall(roomId=None),
        "elements_40_000": lambda p: p.update(elements=p["elements"] * 7000),
    }  # fmt: skip


def _spoiled(spoil: Spoil, place: Place) -> list[Words]:
    plain = arch()
    spoil(plain)
    return _write(json.dumps(plain).encode(), place)


def _write(text: bytes, place: Place) -> list[Words]:
    def edit(plain: dict[str, Any]) -> None:
        nodes = plain["levels"][0]["nodes"]
        plain["version"] = "suncg@1.0.2"
        plain["levels"] = [{"id": "0", "nodes": [nodes[0], {}, *nodes[2:7]]}]

    house = suncg(place.folder, edit)
    root = house.parent.parent
    shutil.rmtree(root / "room")
    write(root / f"wall/{HOUSE}/{HOUSE}.arch.json", text)
    return [run(place, house)]
