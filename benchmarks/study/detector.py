"""Recall of a detector trained on photographs on our views, by class and size.

Effects: reads views, writes out/study/detector. `--coco` and `--pictures` measure photographs with boxes in the form of COCO's
instances_val2017.json: objects that the detector also misses there are no fault of the views.
"""

from __future__ import annotations

import argparse
import itertools
import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from benchmarks.study.centernet import Detection, detect, overlap
from benchmarks.study.shipped import FOLDER
from pbrs_farm.views.open_views import open_views

RESULTS: Final = FOLDER / "detector/results.json"
_LEAST_SCORE: Final = 0.2
_LEAST_OVERLAP: Final = 0.5
_LEAST_SEEN: Final = 0.7  # visible share of an object
_EDGES: Final = (0.0, 0.03, 0.06, 0.12, 0.25, 1.0)  # of sizes
SMALL: Final = (0.06, 0.12)  # "about .08 of the picture"

# Name of an instance -> our class; our class -> accepted classes of COCO.
_NAMES: Final = {
    "cup": "cup", "mug": "cup", "tumbler": "cup", "wine glass": "cup", "bowl": "bowl", "bottle": "bottle",
    "vase": "vase", "chair": "chair", "armchair": "chair", "sofa": "couch", "single bed": "bed", "bed": "bed",
    "double bed": "bed", "television": "tv", "tv": "tv", "monitor": "tv",
}  # fmt: skip
_ACCEPTED: Final = {
    "cup": ("cup", "wine glass"), "bowl": ("bowl",), "bottle": ("bottle",), "vase": ("vase",),
    "chair": ("chair", "couch"), "couch": ("couch",), "bed": ("bed",), "tv": ("tv",),
}  # fmt: skip
VESSELS: Final = ("cup", "bowl", "bottle", "vase")


@dataclass(frozen=True, slots=True)
class Thing:
    """An object that a detector should find."""

    picture: str
    name: str  # of _ACCEPTED
    size: float  # root of its box's share of the picture
    box: tuple[float, float, float, float]  # left, top, right, bottom
    found: bool = False


def main() -> None:
    """Ask the detector of a root's views, and of photographs where they are named."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.study.detector", description=__doc__
    )
    parser.add_argument("roots", nargs="+", metavar="ROOT", help="output folder of 640x480")
    parser.add_argument("--mode", default="", help="lighting (default: the best there is)")
    parser.add_argument("--coco", type=Path, help="photographs' boxes, COCO's JSON")
    parser.add_argument("--pictures", type=Path, help="folder of its photographs")
    parser.add_argument("--out", type=Path, default=RESULTS)
    args = parser.parse_args()
    views = (picture for root in args.roots for picture in pictures_of_root(root, args.mode))
    objects = {"views": judged(views)}
    if args.coco and args.pictures:
        objects["photographs"] = judged(pictures_of_coco(args.coco, args.pictures))
    args.out.parent.mkdir(parents=True, exist_ok=True)
    rows = {name: [as_row(thing) for thing in things] for name, things in objects.items()}
    args.out.write_text(json.dumps(rows, indent=1) + "\n")
    for name, things in objects.items():
        print(f"{name}: {len({thing.picture for thing in things})} pictures with such things\n")
        print(table(things))


Picture = tuple[str, NDArray[np.uint8], list[Thing]]


def pictures_of_root(root: str, mode: str = "") -> Iterator[Picture]:
    """Each view with its whole, visible and named instances."""
    for frame in open_views(root):
        width, height = frame.size
        things = [
            _thing(frame.id, name, row["box2d"], width, height)
            for row in frame.table["instances"]
            if (name := _NAMES.get(str(row["name"]).lower()))
            and row["visible_fraction"] >= _LEAST_SEEN
            and not row["truncated"]
        ]
        yield frame.id, frame.picture(mode) if mode else frame.colour, things


def pictures_of_coco(path: Path, folder: Path) -> Iterator[Picture]:
    """Each photograph of a COCO file with an object of our classes."""
    coco = json.loads(path.read_bytes())
    names = {row["id"]: row["name"] for row in coco["categories"]}
    boxes: dict[int, list[tuple[str, Any]]] = {}
    for row in coco["annotations"]:
        name = {"wine glass": "cup"}.get(names[row["category_id"]], names[row["category_id"]])
        if name in _ACCEPTED and not row.get("iscrowd"):
            boxes.setdefault(row["image_id"], []).append((name, row["bbox"]))
    for row in coco["images"]:
        file = folder / row["file_name"]
        if row["id"] in boxes and file.is_file():
            colour = np.asarray(Image.open(file).convert("RGB"))
            height, width = colour.shape[:2]
            yield row["file_name"], colour, [
                _thing(row["file_name"], name, (x, y, x + w, y + h), width, height)
                for name, (x, y, w, h) in boxes[row["id"]]
            ]  # fmt: skip


def _thing(picture: str, name: str, box: Sequence[float], width: int, height: int) -> Thing:
    left, top, right, bottom = (float(value) for value in box)
    size = ((right - left) * (bottom - top) / (width * height)) ** 0.5
    return Thing(picture, name, round(size, 4), (left, top, right, bottom))


def judged(pictures: Iterator[Picture]) -> list[Thing]:
    """The objects, each marked as found or not."""
    return [
        Thing(thing.picture, thing.name, thing.size, thing.box, is_found(thing, detections))
        for _, colour, things in pictures
        for detections in [detect(colour, _LEAST_SCORE) if things else []]
        for thing in things
    ]


def is_found(thing: Thing, detections: Sequence[Detection]) -> bool:
    """True if a detection with an accepted name overlaps it by half."""
    return any(
        detection.name in _ACCEPTED[thing.name]
        and overlap(detection.box, thing.box) >= _LEAST_OVERLAP
        for detection in detections
    )


def recall(
    things: Sequence[Thing], names: Sequence[str], low: float = 0, high: float = 1
) -> tuple[int, int]:
    """(number found, number of objects) of these names and sizes."""
    chosen = [t for t in things if t.name in names and low <= t.size < high]
    return sum(t.found for t in chosen), len(chosen)


def detector_figures(rows: dict[str, Any]) -> dict[str, float]:
    """The bench's figures of kept results."""
    things = [Thing(**row | {"box": tuple(row["box"])}) for row in rows["views"]]
    n_found, n = recall(things, VESSELS, *SMALL)
    return {"study.detector_small": n_found / n} if n else {}


def table(things: Sequence[Thing]) -> str:
    """Found of all, by class and size: Markdown."""
    bins = list(itertools.pairwise(_EDGES))
    heads = ["", *(f"{low:g} to {high:g}" for low, high in bins), "all"]
    lines = [f"| {' | '.join(heads)} |", "|" + "---|" * len(heads)]
    groups = {"cup, bowl, bottle, vase": VESSELS, **{name: (name,) for name in _ACCEPTED}}
    for title, names in groups.items():
        cells = [_cell(*recall(things, names, *ends)) for ends in [*bins, (0.0, 1.01)]]
        lines.append(f"| {title} | {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


def _cell(found: int, n: int) -> str:
    return f"{found} of {n}" if n else "-"


def as_row(thing: Thing) -> dict[str, Any]:
    """A JSON row of an object."""
    return {"picture": thing.picture, "name": thing.name, "size": thing.size, "box": list(thing.box), "found": thing.found}  # fmt: skip


if __name__ == "__main__":
    main()
