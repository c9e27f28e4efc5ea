"""COCO instances: annotations.json and a folder of pictures; panoptic.json beside it.

Effects: reads views, writes files.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from dataclasses import replace
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.classes import NYU40_COLOURS
from pbrs_farm.export.chosen_view import Choice, ChosenView
from pbrs_farm.export.content import Content, Files, write_files
from pbrs_farm.export.form import PICTURES, Convention, ViewForm
from pbrs_farm.export.masks import compressed_runs


def write_coco(views: list[ChosenView], out: Path, choice: Choice) -> None:
    """annotations.json, images/<house>/<view>.png and the panoptic form.

    Categories are NYU40's, or those of choice.classes; an instance without a class is left out. Masks are compressed run
    lengths (as pycocotools reads them), iscrowd 0. Additional fields: house, view, K, lens and
    depth (where no pin-hole), world_from_camera_opencv, instance_id, visible_fraction, truncated.
    """
    categories = categories_of(choice)
    document: dict[str, Any] = {
        "info": {"description": "pbrs_farm", "version": "1.0"},
        "licenses": _licences(views),
        "categories": categories,
        "images": [_image(view, number) for number, view in enumerate(views, start=1)],
        "annotations": numbered_annotations(views),
    }
    # Furniture and other items are COCO "things"; walls, floors, doors and other structure are
    # "stuff".
    panoptic = {
        "images": document["images"],
        "annotations": [_panoptic_row(view, number) for number, view in enumerate(views, start=1)],
        "categories": [
            c
            | {
                "isthing": int(c["supercategory"] == "object"),
                "color": NYU40_COLOURS[1 + (c["id"] - 1) % 40].tolist(),
            }
            for c in categories
        ],
    }
    documents = {"annotations.json": document, "panoptic.json": panoptic}
    texts = {name: compact_json(table) for name, table in documents.items()}
    write_files(out, chain([texts], map(_files, views)))


def compact_json(document: Any) -> str:
    """A large document on one line."""
    return json.dumps(document, separators=(",", ":")) + "\n"


def _files(view: ChosenView) -> Files:
    """The picture of the best available mode, and the panoptic one."""
    name = f"{view.house.id}/{view.id}.png"
    files: dict[str, Content] = {f"panoptic/{name}": _segment_ids(view)}
    return files if view.picture is None else files | {f"images/{name}": view.shown}


def categories_of(choice: Choice) -> list[dict[str, Any]]:
    """COCO's categories: NYU40's classes, or the user's."""
    return [
        {"id": k, "name": n, "supercategory": "structure" if choice.is_structure(k) else "object"}
        for k, n in choice.class_names.items()
    ]


def _licences(views: list[ChosenView]) -> list[dict[str, Any]]:
    lines = dict.fromkeys(v.house.attribution for v in views if v.house.attribution)
    return [{"id": i, "name": line, "url": ""} for i, line in enumerate(lines, start=1)]


def _image(view: ChosenView, number: int) -> dict[str, Any]:
    camera = ("K", "lens", "depth", "world_from_camera_opencv")  # lens and depth unless a pin-hole
    image = {
        "id": number,
        "width": view.facts["width_px"],
        "height": view.facts["height_px"],
        "house": view.house.id,
        "view": view.id,
        **{name: view.facts[name] for name in camera if name in view.facts},
    }
    if view.picture is not None:
        image["file_name"] = f"images/{view.house.id}/{view.id}.png"
    return image


def numbered_annotations(views: Iterable[ChosenView]) -> list[dict[str, Any]]:
    """The annotations of images 1, 2, ..., numbered from 1."""
    rows = ((k, row) for k, view in enumerate(views, start=1) for row in annotations_of(view))
    return [{"id": n, "image_id": k, **row} for n, (k, row) in enumerate(rows, start=1)]


def annotations_of(view: ChosenView) -> Iterator[dict[str, Any]]:
    """COCO's annotations of a view, without id and image_id: one for each instance with a class."""
    instance = view.array("instance")
    for row in view.facts["instances"]:
        if not view.class_of(row):
            continue  # no category
        yield {
            "category_id": view.class_of(row),
            "bbox": _bbox(row),
            "area": row["pixels"],
            "iscrowd": 0,
            "segmentation": compressed_runs(instance == row["id"]),
            "instance_id": row["id"],
            "visible_fraction": row["visible_fraction"],
            "truncated": row["truncated"],
            # The 6-D pose of a placed model: 4 x 4, metres, x right, y down, z forward.
            **{name: row[name] for name in ("model", "camera_from_model_opencv") if name in row},
        }


def _panoptic_row(view: ChosenView, number: int) -> dict[str, Any]:
    """The segments of panoptic/<house>/<view>.png.

    A segment is an instance with a class, its id the instance's, in a pixel R + 256 G + 65536 B; pixels without a
    class are 0.
    """
    segments = [
        {
            "id": row["id"],
            "category_id": view.class_of(row),
            "area": row["pixels"],
            "bbox": _bbox(row),
            "iscrowd": 0,
        }
        for row in view.facts["instances"]
        if view.class_of(row)
    ]
    name = f"{view.house.id}/{view.id}.png"
    return {"image_id": number, "file_name": name, "segments_info": segments}


def _bbox(row: dict[str, Any]) -> list[int]:
    """Left, top, width, height."""
    x0, y0, x1, y1 = row["box2d"]
    return [x0, y0, x1 - x0, y1 - y0]


def _segment_ids(view: ChosenView) -> NDArray[np.uint8]:
    instance = view.array("instance")
    classed = [row["id"] for row in view.facts["instances"] if view.class_of(row)]
    ids = np.where(np.isin(instance, classed), instance, 0).astype(np.uint32)
    return np.stack([ids & 255, ids >> 8 & 255, ids >> 16 & 255], axis=-1).astype(np.uint8)


FORM = ViewForm(
    "coco",
    write_coco,
    "`annotations.json` (NYU40 categories, compressed run lengths), `images/<house>/<view>.png`;"
    " panoptic: `panoptic.json`, `panoptic/<house>/<view>.png` (id = R + 256 G + 65536 B)",
    takes=replace(
        PICTURES,
        of=lambda views: views if any(v.picture is not None for v in views) else [],
        left_out="",
    ),
    has_classes=True,
    convention=Convention(0.5, axes="OpenCV's"),
)
