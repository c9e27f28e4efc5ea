"""A small Habitat data set written in code for the tests; effects: writes files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from tests.inputs.habitat_files import written
from tests.read.gltf.gltf_scenes import Scene, two_rooms

REGIONS = [
    {"name": "k", "label": "kitchen", "floor_height": 0.0, "extrusion_height": 2.6,
     "poly_loop": [[0, 0, 0], [4, 0, 0], [4, 0, 3], [0, 0, 3]]},
    {"name": "b", "label": "bedroom", "floor_height": 0.0, "extrusion_height": 2.6,
     "poly_loop": [[4, 0, 0], [6, 0, 0], [6, 0, 3], [4, 0, 3]]},
]  # fmt: skip


def dataset(folder: Path, stage: Scene | None = None, **scene: Any) -> Path:
    """A data set with a stage of two rooms and a sofa modelled with z up in centimetres."""
    written(folder / "x.scene_dataset_config.json", {"stages": {"paths": {".json": ["stages/*"]}}})
    written(folder / "stages/flat.stage_config.json", {"render_asset": "flat.glb"})
    written(folder / "stages/flat.glb", (stage or two_rooms()).glb())
    sofa = Scene()
    sofa.node("mesh 7", mesh=sofa.box([0, 0, 0], [200, 80, 60]))
    written(folder / "objects/ab12.glb", sofa.glb())
    config = {
        "render_asset": "ab12.glb",
        "up": [0, 0, 1],
        "front": [0, -1, 0],
        "units_to_meters": 0.01,
    }
    written(folder / "objects/ab12.object_config.json", config)
    written(folder / "metadata/objects.csv", b"id,name,main_category\nab12,thing,couch\n")
    written(folder / "semantics/flat.semantic_config.json", {"region_annotations": REGIONS})
    half = float(np.sqrt(0.5))
    instance = {
        "template_name": "ab12", "translation": [2, 0.3, 1.5], "rotation": [half, 0, half, 0],
        "translation_origin": "COM",
    }  # fmt: skip
    full = {"stage_instance": {"template_name": "stages/flat"}, "object_instances": [instance],
            "semantic_scene_instance": "flat"} | scene  # fmt: skip
    return written(folder / "scenes/one.scene_instance.json", full)
