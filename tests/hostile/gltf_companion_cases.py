"""rooms.json and classes.json beside a sound GLB. Effects: they write the files."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from functools import partial
from typing import Any, Final

from tests.hostile.case import Case, Place, Words, run
from tests.hostile.sound_inputs import glb

_RING: Final = [[0, 0], [6, 0], [6, 3], [0, 3]]


def cases() -> Iterator[Case]:
    """Room files, then class files."""
    for name, text in _rooms().items():
        yield Case(f"rooms/{name}", "format", partial(_write, "rooms", text))
    for name, text in _classes().items():
        yield Case(f"classes/{name}", "format", partial(_write, "classes", text))


def _write(kind: str, text: bytes, place: Place) -> list[Words]:
    path = place.folder / "bad.glb"
    path.write_bytes(glb())
    (place.folder / f"bad.{kind}.json").write_bytes(text)
    return [run(place, path)]


def _room(**more: Any) -> bytes:
    return json.dumps({"rooms": [{"polygon": _RING} | more]}).encode()


def _rooms() -> dict[str, bytes]:
    nan = float("nan")
    round_ring = [[3 + 2 * math.cos(k / 700), 1.5 + math.sin(k / 700)] for k in range(4398)]
    many = [{"polygon": [[k, 0], [k + 5, 0], [k + 5, 3], [k, 3]]} for k in range(900)]
    return {
        "empty": b"",
        "noise": bytes(range(256)) * 9,
        "deep": b'{"rooms":' + b"[" * 100_000,
        "none": b'{"rooms": []}',
        "list": b"[]",
        "two_corners": _room(polygon=_RING[:2]),
        "bow_tie": _room(polygon=[_RING[0], _RING[2], _RING[1], _RING[3]]),
        "no_area": _room(polygon=[[0, 0], [1, 0], [2, 0]]),
        "nan": _room(polygon=[[nan, 0], [6, 0], [6, 3]]),
        "words": _room(polygon=[["a", "b"], [6, 0], [6, 3]]),
        "three_numbers": _room(polygon=[[0, 0, 0], [6, 0, 0], [6, 0, 3]]),
        "huge": _room(polygon=[[-1e5, -1e5], [1e5, -1e5], [1e5, 1e5], [-1e5, 1e5]]),
        "outside": _room(polygon=[[100, 100], [104, 100], [104, 103]]),
        "ceiling_below_floor": _room(floor_y=2.0, ceiling_y=-3.0),
        "ceiling_at_floor": _room(floor_y=0.0, ceiling_y=0.0),
        "ceiling_1e5": _room(floor_y=0.0, ceiling_y=1e5),
        "height_word": _room(floor_y="low"),
        "corners_4398": _room(polygon=round_ring),
        "rooms_900_overlap": json.dumps({"rooms": many}).encode(),
        "name_wrong": _room(name={"a": 1}, types=[[], 7]),
    }


def _classes() -> dict[str, bytes]:
    def nodes(**more: Any) -> bytes:
        return json.dumps({"nodes": more}).encode()

    return {
        "empty": b"",
        "noise": bytes(range(256)) * 9,
        "list": b"[]",
        "nodes_list": b'{"nodes": []}',
        "unknown_class": nodes(chair_0="spaceship"),
        "number": nodes(chair_0=7),
        "kind_wrong": nodes(chair_0={"class": "chair", "kind": "spaceship"}),
        "all_walls": nodes(**{"*": "wall"}),
        "all_lamps": nodes(**{"*": {"class": "lamp", "kind": "lamp"}}),
        "all_doors": nodes(**{"*": "door"}),
        "all_windows": nodes(**{"*": "window"}),
        "all_void": nodes(**{"*": "void"}),
        "chairs_are_floor": nodes(**{"chair*": "floor"}),
        "pattern_bomb": nodes(**{"*c" * 2000 + "x": "chair"}),
        "pattern_brackets": nodes(**{"[" * 5000: "chair", "[z-a]": "bed", "[!": "bed"}),
        "rows_100_000": nodes(**{f"n{k}*": "chair" for k in range(100_000)}),
    }
