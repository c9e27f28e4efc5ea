"""COCO instances: annotations.json and a folder of pictures; panoptic.json beside it.

Effects: reads views, writes files.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.classes import NYU40_COLOURS
from pbrs_farm.export.chosen_view import Choice, ChosenView, camera_facts
from pbrs_farm.export.form import Convention, ViewForm, views_with_picture
from pbrs_farm.export.masks import compressed_runs
from pbrs_farm.images import png_from_array


def write_coco(views: list[ChosenView], out: Path, choice: Choice) -> None:
    """annotations.json, images/<house>/<view>.png and the panoptic form.

    Categories are NYU40's, or those of choice.classes; an instance without a class is left out. Masks are compressed run
    lengths (as pycocotools reads them), iscrowd 0. Additional fields: house, view, K, lens and
    depth (where no pin-hole), world_from_camera_opencv, instance_id, visible_fraction, truncated.
    """
    views_with_picture(views)
    images: list[dict[str, Any]] = []
    annotations: list[dict[str, Any]] = []
    for number, view in enumerate(views, start=1):
        images.append(_image(view, number, out))
        for annotation in annotations_of(view):
            annotations.append({"id": len(annotations) + 1, "image_id": number, **annotation})
    document: dict[str, Any] = {
        "info": {"description": "pbrs_farm", "version": "1.0"},
        "licenses": _licences(views),
        "categories": categories_of(choice),
        "images": images,
        "annotations": annotations,
    }
    (out / "annotations.json").write_text(
        json.dumps(document, separators=(",", ":")) + "\n", "utf-8"
    )
    _write_panoptic(views, images, document["categories"], out)


def categories_of(choice: Choice) -> list[dict[str, Any]]:
    """COCO's categories: NYU40's classes, or the user's."""
    return [
        {"id": k, "name": n, "supercategory": "structure" if choice.is_structure(k) else "object"}
        for k, n in choice.class_names.items()
    ]


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
    # Copy the picture of the best available mode.
    if view.picture is not None:
        name = f"images/{view.house.id}/{view.id}.png"
        (out / name).parent.mkdir(parents=True, exist_ok=True)
        (out / name).write_bytes(view.data(view.picture))
        image["file_name"] = name
    return image


def annotations_of(view: ChosenView) -> Iterator[dict[str, Any]]:
    """COCO's annotations of a view, without id and image_id: one for each instance with a class."""
    instance = view.array("instance")
    for row in view.facts["instances"]:
        if not view.class_of(row):
            continue  # no category
        x0, y0, x1, y1 = row["box2d"]
        yield {
            "category_id": view.class_of(row),
            "bbox": [x0, y0, x1 - x0, y1 - y0],  # left, top, width, height
            "area": row["pixels"],
            "iscrowd": 0,
            "segmentation": compressed_runs(instance == row["id"]),
            "instance_id": row["id"],
            "visible_fraction": row["visible_fraction"],
            "truncated": row["truncated"],
            # The 6-D pose of a placed model: 4 x 4, metres, x right, y down, z forward.
            **{name: row[name] for name in ("model", "camera_from_model_opencv") if name in row},
        }


def _write_panoptic(
    views: list[ChosenView],
    images: list[dict[str, Any]],
    categories: list[dict[str, Any]],
    out: Path,
) -> None:
    """panoptic.json and panoptic/<house>/<view>.png.

    images, categories: those of the instances, view by view. A segment is an instance with a class,
    its id the instance's, in a pixel R + 256 G + 65536 B; pixels without a class are 0.
    """
    annotations = []
    for view, image in zip(views, images, strict=True):
        name = f"{view.house.id}/{view.id}.png"
        rows = [row for row in view.facts["instances"] if view.class_of(row)]
        file = out / "panoptic" / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(png_from_array(_segment_ids(view.array("instance"), rows)))
        segments = [_segment(row, view.class_of(row)) for row in rows]
        annotations.append({"image_id": image["id"], "file_name": name, "segments_info": segments})
    # Furniture and other items are COCO "things"; walls, floors, doors and other structure are
    # "stuff".
    document = {
        "images": images,
        "annotations": annotations,
        "categories": [
            c
            | {
                "isthing": int(c["supercategory"] == "object"),
                "color": NYU40_COLOURS[1 + (c["id"] - 1) % 40].tolist(),
            }
            for c in categories
        ],
    }
    (out / "panoptic.json").write_text(json.dumps(document, separators=(",", ":")) + "\n", "utf-8")


def _segment(row: dict[str, Any], category: int) -> dict[str, Any]:
    x0, y0, x1, y1 = row["box2d"]
    box = [x0, y0, x1 - x0, y1 - y0]
    fields = {"category_id": category, "area": row["pixels"], "bbox": box, "iscrowd": 0}
    return {"id": row["id"], **fields}


def _segment_ids(instance: NDArray[Any], rows: list[dict[str, Any]]) -> NDArray[np.uint8]:
    is_row = np.isin(instance, [row["id"] for row in rows])
    ids = np.where(is_row, instance, 0).astype(np.uint32)
    return np.stack([ids & 255, ids >> 8 & 255, ids >> 16 & 255], axis=-1).astype(np.uint8)


FORM = ViewForm(
    "coco",
    write_coco,
    "`annotations.json` (NYU40 categories, compressed run lengths), `images/<house>/<view>.png`;"
    " panoptic: `panoptic.json`, `panoptic/<house>/<view>.png` (id = R + 256 G + 65536 B)",
    has_classes=True,
    convention=Convention(0.5, axes="OpenCV's"),
)
