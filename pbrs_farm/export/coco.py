"""COCO instances: annotations.json and a folder of pictures. Effects: reads views, writes files."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.classes import NYU40_NAMES
from pbrs_farm.core.lighting import Mode
from pbrs_farm.formats.output_folder import ViewEntry
from pbrs_farm.images import array_from_png
from pbrs_farm.regular_files import read_regular

# The picture of a view is the first of these it has.
PICTURES: Final = (Mode.MLT_IL_OL, Mode.MLT_OL, Mode.OPENGL_IL, Mode.OPENGL_DL)

# Classes of the supercategory "structure"; all others are objects.
_STRUCTURE: Final = ("wall", "floor", "ceiling", "door", "window", "otherstructure")


def write_coco(views: list[ViewEntry], out: Path) -> int:
    """annotations.json and images/<house>/<view>.png; the number of files.

    Categories are NYU40's; an instance without a class is left out. Masks are uncompressed
    run lengths (column by column, as pycocotools reads them), iscrowd 0. Fields of
    our own: house, view, K, world_from_camera_opencv, instance_id, visible_fraction, truncated.
    """
    images: list[dict[str, Any]] = []
    annotations: list[dict[str, Any]] = []
    for number, view in enumerate(views, start=1):
        images.append(_image(view, number, out))
        for annotation in _annotations(view):
            annotations.append({"id": len(annotations) + 1, "image_id": number, **annotation})
    document = {
        "info": {"description": "pbrs_farm", "version": "1.0"},
        "licenses": _licences(views),
        "categories": _categories(),
        "images": images,
        "annotations": annotations,
    }
    (out / "annotations.json").write_text(json.dumps(document, separators=(",", ":")) + "\n")
    return 1 + sum("file_name" in image for image in images)


def _categories() -> list[dict[str, Any]]:
    kinds = ["structure" if name in _STRUCTURE else "object" for name in NYU40_NAMES]
    rows = zip(NYU40_NAMES, kinds, strict=True)
    # Id 0 is no class.
    return [{"id": i, "name": n, "supercategory": k} for i, (n, k) in enumerate(rows) if i]


def _licences(views: list[ViewEntry]) -> list[dict[str, Any]]:
    lines = dict.fromkeys(v.house.attribution for v in views if v.house.attribution)
    return [{"id": i, "name": line, "url": ""} for i, line in enumerate(lines, start=1)]


def _image(view: ViewEntry, number: int, out: Path) -> dict[str, Any]:
    image = {
        "id": number,
        "width": view.facts["width_px"],
        "height": view.facts["height_px"],
        "house": view.house.id,
        "view": view.id,
        "K": view.facts["K"],
        "world_from_camera_opencv": view.facts["world_from_camera_opencv"],
    }
    # Copy the picture of the best mode there is.
    picture = next((f for f in (view.file(f"{m}.png") for m in PICTURES) if f), None)
    if picture is not None:
        name = f"images/{view.house.id}/{view.id}.png"
        (out / name).parent.mkdir(parents=True, exist_ok=True)
        (out / name).write_bytes(read_regular(picture))
        image["file_name"] = name
    return image


def _annotations(view: ViewEntry) -> Iterator[dict[str, Any]]:
    instance = array_from_png(read_regular(view.folder / "instance.png"), str(view.folder))
    for row in view.facts["instances"]:
        if not row["nyu40"]:
            continue  # no category
        x0, y0, x1, y1 = row["box2d"]
        yield {
            "category_id": row["nyu40"],
            "bbox": [x0, y0, x1 - x0, y1 - y0],  # left, top, width, height
            "area": row["pixels"],
            "iscrowd": 0,
            "segmentation": run_lengths(instance == row["id"]),
            "instance_id": row["id"],
            "visible_fraction": row["visible_fraction"],
            "truncated": row["truncated"],
        }


def run_lengths(mask: NDArray[np.bool_]) -> dict[str, list[int]]:
    """COCO's uncompressed run lengths of mask (H, W): column by column, zeros first."""
    # Cut where the value changes; a mask that starts with ones has a first run of 0.
    flat = mask.T.reshape(-1)
    changes = np.nonzero(np.diff(flat, prepend=False))[0]
    counts = np.diff(np.concatenate([[0], changes, [flat.size]]))
    return {"size": [int(n) for n in mask.shape], "counts": [int(n) for n in counts]}
