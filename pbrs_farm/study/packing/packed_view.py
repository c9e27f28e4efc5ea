"""The parts of a view as they are packed: JSON, colour of each mode, labels. Effects: reads the view."""

from __future__ import annotations

import json

from pbrs_farm.images import jpeg_from_array
from pbrs_farm.study.packing.packing_plan import Packing
from pbrs_farm.study.reading.packed_parts import label_parts
from pbrs_farm.study.reading.png_rows import png_of_rows
from pbrs_farm.study.reading.stored_layers import ViewFacts, resized_stored
from pbrs_farm.study.reading.stored_root import StoredRoot
from pbrs_farm.study.reading.view_sample import Size
from pbrs_farm.study.reading.views import ViewRef


def packed_view(root: StoredRoot, ref: ViewRef, packing: Packing) -> dict[str, bytes]:
    """Part name -> bytes of a view, json first; BadInput where a file is missing or damaged."""
    facts = root.facts(ref)
    size = packing.size or facts.size
    parts = {"json": _facts_json(facts, size)}
    labels, *pictures = packing.requests()
    for request in pictures:
        colour = resized_stored(root.arrays(ref, request), size)["colour"]
        if packing.colour == "jpeg":
            parts[f"{request.mode}.jpg"] = jpeg_from_array(colour, packing.quality)
        else:
            parts[f"{request.mode}.png"] = png_of_rows(colour)
    return parts | label_parts(resized_stored(root.arrays(ref, labels), size))


def _facts_json(facts: ViewFacts, size: Size) -> bytes:
    row = {
        "house": facts.house,
        "view": facts.view,
        "room": facts.room,
        "width_px": size[0],
        "height_px": size[1],
        "K": facts.k_at(size).tolist(),
        "world_from_camera_opencv": facts.world_from_camera_opencv,
    }
    return json.dumps(row, separators=(",", ":")).encode()
