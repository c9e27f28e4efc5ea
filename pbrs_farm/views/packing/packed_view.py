"""The packed parts of a view: JSON, colour of each mode, labels. Effects: reads the view."""

from __future__ import annotations

import json

from pbrs_farm.images import jpeg_from_array
from pbrs_farm.views.packing.packing_plan import Packing
from pbrs_farm.views.png_rows import png_of_rows
from pbrs_farm.views.shard_parts import label_parts
from pbrs_farm.views.stored_layers import Stored, ViewFacts, resize_stored
from pbrs_farm.views.stored_root import StoredRoot
from pbrs_farm.views.view_sample import Size
from pbrs_farm.views.views import ViewRef


def packed_view(root: StoredRoot, ref: ViewRef, packing: Packing) -> dict[str, bytes]:
    """Part name -> bytes of a view, json first; BadInput if a file is missing or damaged."""
    facts = root.facts(ref)
    size = packing.size or facts.size
    labels, pictures = stored_parts(root, ref, packing, size)
    return {"json": facts_json(facts, size)} | pictures | label_parts(labels)


def stored_parts(
    root: StoredRoot, ref: ViewRef, packing: Packing, size: Size
) -> tuple[Stored, dict[str, bytes]]:
    """(arrays of the labels, part name -> bytes of colour in each mode) of a view."""
    pictures = {}
    labels, *of_colour = packing.requests()
    for request in of_colour:
        colour = resize_stored(root.arrays(ref, request), size)["colour"]
        if packing.colour == "jpeg":
            pictures[f"{request.mode}.jpg"] = jpeg_from_array(colour, packing.quality)
        else:
            pictures[f"{request.mode}.png"] = png_of_rows(colour)
    return resize_stored(root.arrays(ref, labels), size), pictures


def facts_json(facts: ViewFacts, size: Size) -> bytes:
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
