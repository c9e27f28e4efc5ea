"""Light of four rooms recorded on a CPU in 16 blocks, as the reference for a GPU.

`python -m tests.transport.recorded_blocks` records it again (LLVM).
"""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Final

import numpy as np

from pbrs_farm.core.camera import Camera
from pbrs_farm.core.house import House
from pbrs_farm.core.lighting import Group
from pbrs_farm.core.recipe import LightFields, recipe_from_name
from pbrs_farm.transport.light_scene import LightScene
from pbrs_farm.transport.scene_tables.sky import sunsky
from pbrs_farm.transport.validation import known_rooms
from pbrs_farm.transport.validation.claims import blocks, z_scores
from tests.transport import hard_rooms

FILE: Final = Path(__file__).with_suffix(".json")
RECIPE: Final = recipe_from_name("fast")
FIELDS: Final[LightFields] = RECIPE.light.model_copy(update={"filter": "box", "spp": 128})
ROOMS: Final[dict[str, Callable[[], tuple[House, Camera]]]] = {
    "window": lambda: known_rooms.window_room(0.7, lumen=800),
    "globe": hard_rooms.glass_globe,  # glass: shadow rays pass through
    "shade": hard_rooms.open_shade,  # guided rays
    "cup": hard_rooms.covered_cup,  # both
}
N_RUNS: Final = 6


def measured(
    room: str, seeds: range, fields: LightFields = FIELDS, *, variant: str | None = None
) -> dict[str, list[list[list[float]]]]:
    """Group -> (4, 4) mean luminances of one picture for each seed."""
    house, camera = ROOMS[room]()
    sky = sunsky(RECIPE, elevation_rad=0.6, azimuth_rad=0.35)
    scene = LightScene.load(house, {}, RECIPE, sky, variant=variant)
    results = [scene.render(camera.with_size(32, 24), room, fields, seed) for seed in seeds]
    return {g.value: [blocks(r.group(g)).tolist() for r in results] for g in Group}


def largest_z(room: str, found: dict[str, list[list[list[float]]]]) -> float:
    """Largest z over all blocks and groups against the recording; black groups must be black in both."""
    recorded = json.loads(FILE.read_text())[room]
    largest = 0.0
    for group, theirs in recorded.items():
        ours, expected = np.array(found[group]), np.array(theirs)
        if not expected.any():
            assert not ours.any(), f"{group} light where there was none"
            continue
        largest = max(largest, float(np.abs(z_scores(list(ours), list(expected))).max()))
    return largest


def main() -> None:
    """Record."""
    rows = {room: measured(room, range(N_RUNS), variant="llvm_ad_rgb") for room in ROOMS}
    rounded = json.loads(json.dumps(rows), parse_float=lambda t: float(f"{float(t):.7g}"))
    FILE.write_text(json.dumps(rounded) + "\n")


if __name__ == "__main__":
    main()
