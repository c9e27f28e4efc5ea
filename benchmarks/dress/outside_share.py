"""What windows show: the share of rays through them that meet something outside; no light.

`python -m benchmarks.dress.outside_share HOME`: prints a row as JSON. Rays go from 1.5 m above the floor
of each room to places spread over its windows, as pixels of views that look out would, and on behind
the glass; those that meet the home again are left out.
"""

from __future__ import annotations

import json
import sys
import time
from typing import Any

import numpy as np
import shapely

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.house import House, Opening, Room, geometry_from_house
from pbrs_farm.core.recipe import recipe_from_name
from pbrs_farm.furnishings.surroundings import with_surroundings
from pbrs_farm.prepare.read_source import read_house
from pbrs_farm.prepare.source import resolve
from pbrs_farm.raycast.caster import Caster
from pbrs_farm.repair import repair

N_RAYS = 2_000  # a window
N_SEEDS = 3
EYE_M = 1.5
NEAR_M = 5.0  # eyes stand no farther from a window


def measured(name: str) -> dict[str, Any]:
    """Rays that left a home by its windows, those that met something, triangles, seconds."""
    recipe = recipe_from_name("fast")
    house = repair(read_house(resolve(name), recipe.read), recipe.repair)[0]
    n_left = n_met = n_faces = 0
    seconds = 0.0
    for seed in range(N_SEEDS):
        start = time.process_time()
        shown = with_surroundings(house, "drawn", seed)
        seconds = max(seconds, time.process_time() - start)
        n_faces = max(n_faces, sum(i.n_faces for i in shown.items if i.is_outside))
        left, met = _counted(shown, np.random.default_rng(seed))
        n_left, n_met = n_left + left, n_met + met
    return {"left": n_left, "met": n_met, "triangles": n_faces, "seconds": round(seconds, 2)}


def _counted(house: House, rng: np.random.Generator) -> tuple[int, int]:
    geometry = geometry_from_house(house, with_panes=False)
    is_outside = np.array([False, *(item.is_outside for item in house.items)])
    caster = Caster(geometry)
    left = met = 0
    for opening in house.openings:
        for room in house.rooms:
            rays = _rays(opening, room, rng) if opening.is_window else None
            if rays is None:
                continue
            _t, face = caster.first_hit(*rays)
            beyond = np.where(face >= 0, is_outside[geometry.face_item[np.maximum(face, 0)]], True)
            left += int(beyond.sum())
            met += int((beyond & (face >= 0)).sum())
    return left, met


def _rays(opening: Opening, room: Room, rng: np.random.Generator) -> tuple[F64, F64] | None:
    """Origins in a room and directions through a window of it; None where it has not that window."""
    quad = np.asarray(opening.quad, np.float64)
    middle = quad.mean(0)
    area = shapely.Polygon(room.polygon)
    if not room.floor_y < middle[1] < room.ceiling_y or area.distance(shapely.Point(middle[[0, 2]])) > 0.4:  # fmt: skip
        return None
    low, high = room.polygon.min(0), room.polygon.max(0)
    plan = low + (high - low) * rng.random((8 * N_RAYS, 2))
    near = np.linalg.norm(plan - middle[[0, 2]], axis=1)
    plan = plan[shapely.contains_xy(area, plan[:, 0], plan[:, 1]) & (near < NEAR_M) & (near > 0.5)][:N_RAYS]  # fmt: skip
    if not len(plan):
        return None
    eyes = np.column_stack([plan[:, 0], np.full(len(plan), room.floor_y + EYE_M), plan[:, 1]])
    u, v = rng.random((2, len(eyes), 1))
    through = quad[0] + u * (quad[1] - quad[0]) + v * (quad[3] - quad[0])
    # Begin in the window itself: what stands in the room hides no part of what is asked for.
    ahead = through - eyes
    ahead /= np.linalg.norm(ahead, axis=1, keepdims=True)
    return through + 0.35 * ahead, ahead


if __name__ == "__main__":
    print(json.dumps(measured(sys.argv[1])))
