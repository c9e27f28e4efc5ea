"""COCO instances: annotations.json and a folder of pictures; panoptic.json beside it.

Effects: reads views, writes files.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

from pbrs_farm.core.classes import NYU40_NAMES
from pbrs_farm.export.chosen_view import Choice, ChosenView, camera_facts
from pbrs_farm.export.coco_panoptic import write_panoptic
from pbrs_farm.export.run_lengths import compressed_runs

# Classes of the supercategory "structure"; all others are objects.
_STRUCTURE: Final = ("wall", "floor", "ceiling", "door", "window", "otherstructure")


def write_coco(views: list[ChosenView], out: Path, _choice: Choice) -> int:
    """annotations.json, images/<house>/<view>.png and the panoptic form; the number of files.

    Categories are NYU40's; an instance without a class is left out. Masks are compressed run
    lengths (as pycocotools reads them), iscrowd 0. Fields of our own: house, view, K, lens and
    depth (where no pin-hole), world_from_camera_opencv, instance_id, visible_fraction, truncated.
    """
    images: list[dict[str, Any]] = []
    annotations: list[dict[str, Any]] = []
    for number, view in enumerate(views, start=1):
        images.append(_image(view, number, out))
        for annotation in _annotations(view):
            annotations.append({"id": len(annotations) + 1, "image_id": number, **annotation})
    document: dict[str, Any] = {
        "info": {"description": "pbrs_farm", "version": "1.0"},
        "licenses": _licences(views),
        "categories": _categories(),
        "images": images,
        "annotations": annotations,
    }
    (out / "annotations.json").write_text(json.dumps(document, separators=(",", ":")) + "\n")
    n_pictures = sum("file_name" in image for image in images)
    return 1 + n_pictures + write_panoptic(views, images, document["categories"], out)


def _categories() -> list[dict[str, Any]]:
    kinds = ["structure" if name in _STRUCTURE else "object" for name in NYU40_NAMES]
    rows = zip(NYU40_NAMES, kinds, strict=True)
    # Id 0 is no class.
    return [{"id": i, "name": n, "supercategory": k} for i, (n, k) in enumerate(rows) if i]


def _licences(views: list[ChosenView]) -> list[dict[str, Any]]:
    lines = dict.fromkeys(v.house.attribution for v in views if v.house.attribution)
    return [{"id": i, "name": line, "url": ""} for i, line in enumerate(lines, start=1)]


def _image(view: ChosenView, number: int, out: Path) -> dict[str, Any]:
    image = {
        "id": number,
        "width": view.facts["width_px"],
        "height": view.facts["height_px"],
        "house": view.house.id,
        "view": view.id,
        **camera_facts(view.facts),
    }
    # Copy the picture of the best mode there is.
    if view.picture is not None:
        name = f"images/{view.house.id}/{view.id}.png"
        (out / name).parent.mkdir(parents=True, exist_ok=True)
        (out / name).write_bytes(view.data(view.picture))
        image["file_name"] = name
    return image


def _annotations(view: ChosenView) -> Iterator[dict[str, Any]]:
    instance = view.array("instance")
    for row in view.facts["instances"]:
        if not row["nyu40"]:
            continue  # no category
        x0, y0, x1, y1 = row["box2d"]
        yield {
            "category_id": row["nyu40"],
            "bbox": [x0, y0, x1 - x0, y1 - y0],  # left, top, width, height
            "area": row["pixels"],
            "iscrowd": 0,
            "segmentation": compressed_runs(instance == row["id"]),
            "instance_id": row["id"],
            "visible_fraction": row["visible_fraction"],
            "truncated": row["truncated"],
        }
