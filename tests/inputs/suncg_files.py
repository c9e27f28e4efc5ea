"""SUNCG houses with an arch.json."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

from tests.read.suncg import suncg_root
from tests.read.suncg.suncg_root import HOUSE


def arch_json() -> dict[str, Any]:
    """Room 0_0, 4 x 3 m, in v2: walls by two points, slabs by polygons."""
    ring = [[0, 0, 0], [4, 0, 0], [4, 0, 3], [0, 0, 3]]
    paint = [{"name": "inside", "diffuse": "#ff0000"}, {"name": "outside", "texture": "stone"}]
    walls = [
        {"id": f"0_0_{k}", "type": "Wall", "roomId": "0_0", "height": 2.7, "materials": paint,
         "points": [ring[k], ring[(k + 1) % 4]], "holes": []}
        for k in range(4)
    ]  # fmt: skip
    walls[2]["holes"] = [
        {"id": "0_6", "type": "Window", "box": {"min": [1.1, 0.9], "max": [2.5, 2.3]}}
    ]
    slab = {
        "roomId": "0_0",
        "points": [ring],
        "materials": [{"name": "surface", "texture": "wood"}],
    }
    return {
        "version": "suncg-arch@1.0.2", "id": HOUSE, "up": [0, 1, 0], "front": [0, 0, 1],
        "scaleToMeters": 1,
        "defaults": {"Wall": {"depth": 0.12, "extraHeight": 0.035}, "Floor": {"depth": 0.05}},
        "elements": [
            *walls,
            slab | {"id": "0_0f", "type": "Floor", "offset": [0, 0, 0]},
            slab | {"id": "0_0c", "type": "Ceiling", "offset": [0, 2.69, 0]},
        ],
    }  # fmt: skip


def write_v2(root: Path, arch: dict[str, Any]) -> None:
    suncg_root.write_root(root)
    shutil.rmtree(root / "room")
    plain = suncg_root.house_json() | {"version": "suncg@1.0.2"}
    nodes = plain["levels"][0]["nodes"]
    plain["levels"] = [{"id": "0", "nodes": [nodes[0], {}, *nodes[2:7]]}]
    suncg_root.write(root / f"house/{HOUSE}/house.json", json.dumps(plain))
    suncg_root.write(root / f"wall/{HOUSE}/{HOUSE}.arch.json", json.dumps(arch))
