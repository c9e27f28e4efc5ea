"""Frequency of each class in an output folder, and unmapped source classes. Effects: reads files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from pbrs_farm.core import keys
from pbrs_farm.core.classes import NYU40_NAMES
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.record import Record
from pbrs_farm.core.shown_text import shown
from pbrs_farm.formats.output_folder import ViewEntry, json_object, views_of
from pbrs_farm.gallery.class_decisions import ClassDecision, class_decisions, decisions_text
from pbrs_farm.images import array_from_png
from pbrs_farm.regular_files import read_regular


class ClassRow(Record):
    """Frequency of one NYU40 class."""

    nyu40: int
    name: str
    pixel_share: float  # share of the pixels of all images
    n_images: int  # number of images that contain the class
    n_instances: int  # number of instances in all images


class ClassStatistics(Record):
    """Classes by pixel share, largest first; id 0 means no class or no surface."""

    n_views: int
    classes_per_image: float  # mean, id 0 not counted
    rows: tuple[ClassRow, ...]
    unmapped: tuple[str, ...]  # "house: source class (items)" that became otherprop, as shown
    decisions: tuple[ClassDecision, ...] = ()  # decisions over all houses

    def text(self) -> str:
        """The statistics as a Markdown table and lists of unmapped names and decisions, if any."""
        lines = [
            f"{self.n_views} views, {self.classes_per_image:.1f} classes a view",
            "",
            "| class | id | pixels | images | instances an image |",
            "|---|---|---|---|---|",
        ]
        for r in self.rows:
            per_image = r.n_instances / r.n_images if r.n_images else 0.0
            share, images = f"{100 * r.pixel_share:.2f} %", f"{r.n_images} of {self.n_views}"
            lines.append(f"| {r.name} | {r.nyu40} | {share} | {images} | {per_image:.1f} |")
        if self.unmapped:
            lines += ["", "Without a class (otherprop):"]
            lines += [f"- {line}" for line in self.unmapped]
        if self.decisions:
            lines += ["", "Rules that assigned the classes, least certain first:", ""]
            lines.append(decisions_text(self.decisions))
        return "\n".join(lines)


def class_statistics(folder: Path) -> ClassStatistics:
    """Count the seen classes of every finished view below folder; BadInput without labels."""
    views = [v for v in views_of(folder) if v.file("semantic.png") and "instances" in v.facts]
    if not views:
        raise BadInput(folder, "", "no finished view with labels")
    # Sum over all views, indexed by class id.
    pixels, images, instances = (np.zeros(256, np.int64) for _ in range(3))
    for view in views:
        counts = _pixels_of_classes(view)
        pixels += counts
        images += counts > 0
        for row in view.facts["instances"]:
            instances[int(row["nyu40"])] += 1
    total = pixels.sum()
    # Read the item tables of the homes.
    items = {
        house: json_object(folder / keys.house_key(house, "house.json")).get("items", [])
        for house in sorted({v.house.id for v in views})
    }
    return ClassStatistics(
        n_views=len(views),
        classes_per_image=float(images[1:].sum() / len(views)),
        rows=tuple(
            ClassRow(
                nyu40=int(i),
                name=NYU40_NAMES[i],
                pixel_share=float(pixels[i] / total),
                n_images=int(images[i]),
                n_instances=int(instances[i]),
            )
            for i in np.argsort(-pixels, kind="stable")
            if pixels[i]
        ),
        unmapped=_unmapped(items),
        decisions=class_decisions(item for rows in items.values() for item in rows),
    )


def _pixels_of_classes(view: ViewEntry) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
    place = f"{view.folder}/semantic.png"
    ids = array_from_png(read_regular(view.folder / "semantic.png"), place)
    if ids.max(initial=0) >= len(NYU40_NAMES):
        raise BadInput(place, "", f"has class {ids.max()}, not 0..40")
    return np.bincount(ids.reshape(-1), minlength=256).astype(np.int64)


def _unmapped(items: dict[str, list[dict[str, Any]]]) -> tuple[str, ...]:
    lines = []
    for house, rows in items.items():
        # Count the items of each class that the source names and NYU40 lacks.
        names: dict[str, int] = {}
        for item in rows:
            if "unmapped" in item.get("tags", ()):
                name = shown(item.get("source_class") or item.get("name") or item.get("id"))
                names[name] = names.get(name, 0) + 1
        lines += [f"{house}: {name} ({n})" for name, n in sorted(names.items())]
    return tuple(lines)
