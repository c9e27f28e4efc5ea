"""The 3D page gets a home's scene, its cameras with their pictures, and every refused viewpoint."""

from __future__ import annotations

import json
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from pbrs_farm.board.pages.tried_viewpoints import candidates
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.house import geometry_from_house
from pbrs_farm.core.recipe import recipe_from_name
from pbrs_farm.formats.house_bundle import bundle_from_house
from pbrs_farm.formats.serialise import json_bytes
from pbrs_farm.prepare.finished_house import repaired_house
from pbrs_farm.prepare.source import resolve
from pbrs_farm.raycast.caster import Caster
from pbrs_farm.run.steps import camera_seed
from pbrs_farm.sample.house_sampler import sample_cameras
from pbrs_farm.store import MemoryStore
from tests.board.roots import write_root
from tests.board.served import served

POSE = np.eye(4).tolist()
SIZE = {"width_px": 640, "height_px": 480, "fx": 500.0, "fy": 500.0, "cx": 320.0, "cy": 240.0}


def test_a_scene_has_rooms_cameras_and_counts_without_damaged_parts(tmp_path: Path) -> None:
    root = write_root(tmp_path / "root", {"a-1": ("0_0_1",)})
    views = [
        {"id": "0_0_1", "room": "0_0", "intrinsics": SIZE, "world_from_camera_opengl": POSE},
        {"id": "0_0_5", "room": "0_0", "intrinsics": SIZE, "world_from_camera_opengl": POSE},
        {"id": "bad", "room": "0_0", "intrinsics": SIZE, "world_from_camera_opengl": [[1]]},
        {"id": "worse"},
    ]
    report = {"refused": {"near_obstacle": 7, "below_min_score": 2}}
    folder = root / "houses/a-1"
    (folder / "cameras.json").write_text(json.dumps({"views": views, "report": report}))
    (folder / "house.glb").write_bytes(b"glTF")
    with served(str(root), tmp_path / "cache") as client:
        scene = client.get("/homes/a-1/scene.json").json()
        assert [room["name"] for room in scene["rooms"]] == ["Kitchen", "Bath"]
        assert [camera["id"] for camera in scene["cameras"]] == ["0_0_1", "0_0_5"]
        # The rendered viewpoint links to its picture.
        assert scene["cameras"][0]["url"] == "/homes/a-1/views/0_0_1"
        assert scene["cameras"][1]["url"] == ""
        assert scene["refused"] == report["refused"]
        assert client.get("/homes/a-1/house.glb").content == b"glTF"
        # An empty home gives one line rather than a traceback.
        answer = client.get("/homes/a-1/candidates.json")
        assert answer.status_code == 422
        assert "Traceback" not in answer.text


@pytest.mark.long
def test_the_candidates_are_those_that_the_run_refused() -> None:
    recipe = recipe_from_name(
        "preview",
        {
            "cameras.cell_m": "1.0",
            "cameras.score_width_px": "160",
            "cameras.score_height_px": "120",
        },
    )
    house, _report = repaired_house(resolve("builtin"), recipe)
    store = MemoryStore()
    store.put("recipe.json", json_bytes(recipe))
    for name, data in zip(("house.glb", "house.json"), bundle_from_house(house), strict=True):
        store.put(f"houses/{house.id}/{name}", data)
    answer = candidates(store, house.id)
    caster = Caster(geometry_from_house(house))
    counters = caster.item_counts, caster.item_pictures
    sampling = sample_cameras(house, recipe.cameras, camera_seed(house.id, recipe), *counters)
    counted = Counter(answer["verdicts"][row[3]] for row in answer["rows"])
    refused = {k: n for k, n in counted.items() if k not in ("winner", "lower_score")}
    assert refused == {k: n for k, n in sampling.report.refused.items() if n}
    assert counted["winner"] == sampling.report.n_views
    assert answer["n"] == sampling.report.n_candidates


def test_an_object_was_not_sampled() -> None:
    store = MemoryStore()
    store.put("recipe.json", json_bytes(recipe_from_name("preview")))
    with pytest.raises(BadInput, match="given, not sampled"):
        candidates(store, "object_chair-12345678")
