"""Walks of 300 frames in the nine example homes and in homes made by seed: blocked, fast, or none."""

from __future__ import annotations

import os
from typing import Any, Final

import numpy as np

from pbrs_farm.assets import homes_package
from pbrs_farm.core.errors import PbrsError
from pbrs_farm.core.house import House, geometry_from_house
from pbrs_farm.core.recipe import CameraFields, Recipe
from pbrs_farm.prepare.finished_house import repaired_house
from pbrs_farm.prepare.source import resolve
from pbrs_farm.raycast.caster import Caster
from pbrs_farm.run.steps import camera_seed
from pbrs_farm.sample.clearance import near_any_triangle
from pbrs_farm.sample.walks.walk_sampler import sample_walk

N_MADE: Final = int(os.environ.get("MADE", "20"))
FIELDS: Final = CameraFields(source="walk", walk_frames=300)
_NEAR_M: Final = 0.10


def figures() -> dict[str, Any]:
    """Walk every home; a home that cannot be read has no walk."""
    homes = [home.name for home in homes_package.example_homes()]
    homes += [f"made:{seed}" for seed in range(1, N_MADE + 1)]
    n_walks = n_blocked = n_fast = 0
    for word in homes:
        try:
            house, _report = repaired_house(resolve(word), Recipe())
        except PbrsError as error:
            print(f"{word}: {error}", flush=True)
            continue
        n, blocked, fast, said = _walk(house)
        n_walks += n == FIELDS.walk_frames
        n_blocked += blocked
        n_fast += fast
        print(f"{word}: {n} frames, {blocked} blocked, {fast} too fast: {said}", flush=True)
    return {
        "walks": n_walks / len(homes),
        "walks_homes": len(homes),
        "path_blocked": n_blocked,
        "speed_limit": n_fast,
    }


def _walk(house: House) -> tuple[int, int, int, str]:
    """Frames, those near a surface, those too fast, and what the report says."""
    geometry = geometry_from_house(house)
    seed = camera_seed(house.id, Recipe())
    walk = sample_walk(house, FIELDS, seed, geometry, Caster(geometry).first_hit)
    if not walk.views:
        return 0, 0, 0, walk.report.why_none
    poses = np.stack([view.camera.world_from_camera for view in walk.views])
    blocked = int(near_any_triangle(poses[:, :3, 3], geometry, _NEAR_M).sum())
    return len(walk.views), blocked, too_fast(poses, FIELDS), walk.report.notes[0]


def too_fast(poses: np.ndarray[Any, Any], fields: CameraFields) -> int:
    """Frames of poses (N, 4, 4) farther from the last, or turned by more, than the fields allow."""
    moved = np.linalg.norm(np.diff(poses[:, :3, 3], axis=0), axis=1) * fields.walk_fps
    relative = np.swapaxes(poses[:-1, :3, :3], 1, 2) @ poses[1:, :3, :3]
    cosine = (np.trace(relative, axis1=1, axis2=2) - 1) / 2
    turned = np.degrees(np.arccos(np.clip(cosine, -1, 1))) * fields.walk_fps
    fast = (moved > fields.walk_speed_mps + 1e-6) | (turned > fields.walk_turn_dps + 1e-3)
    return int(fast.sum())
