"""COCO panoptic: panoptic.json and a picture of segment ids a view. Effects: reads views, writes files."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.classes import NYU40_COLOURS
from pbrs_farm.export.chosen_view import ChosenView
from pbrs_farm.images import png_from_array


def write_panoptic(
    views: list[ChosenView],
    images: list[dict[str, Any]],
    categories: list[dict[str, Any]],
    out: Path,
) -> int:
    """panoptic.json and panoptic/<house>/<view>.png; the number of files.

    images, categories: those of the instances, view by view. A segment is an instance with a class,
    its id the instance's, in a pixel R + 256 G + 65536 B; what has no class is 0.
    """
    annotations = []
    for view, image in zip(views, images, strict=True):
        name = f"{view.house.id}/{view.id}.png"
        rows = [row for row in view.facts["instances"] if row["nyu40"]]
        file = out / "panoptic" / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(png_from_array(_segment_ids(view.array("instance"), rows)))
        segments = [_segment(row) for row in rows]
        annotations.append({"image_id": image["id"], "file_name": name, "segments_info": segments})
    # Furniture and the like are things; walls, floors, doors and other structure are stuff.
    document = {
        "images": images,
        "annotations": annotations,
        "categories": [
            c
            | {
                "isthing": int(c["supercategory"] == "object"),
                "color": NYU40_COLOURS[c["id"]].tolist(),
            }
            for c in categories
        ],
    }
    (out / "panoptic.json").write_text(json.dumps(document, separators=(",", ":")) + "\n")
    return 1 + len(views)


def _segment(row: dict[str, Any]) -> dict[str, Any]:
    x0, y0, x1, y1 = row["box2d"]
    box = [x0, y0, x1 - x0, y1 - y0]
    fields = {"category_id": row["nyu40"], "area": row["pixels"], "bbox": box, "iscrowd": 0}
    return {"id": row["id"], **fields}


def _segment_ids(instance: NDArray[Any], rows: list[dict[str, Any]]) -> NDArray[np.uint8]:
    known = np.isin(instance, [row["id"] for row in rows])
    ids = np.where(known, instance, 0).astype(np.uint32)
    return np.stack([ids & 255, ids >> 8 & 255, ids >> 16 & 255], axis=-1).astype(np.uint8)
