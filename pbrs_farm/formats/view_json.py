"""view.json: which view this is, its camera, tables and facts (docs/formats/view_json.md), written by `view`; no effects."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from pbrs_farm.core.camera import View
from pbrs_farm.core.errors import BadInput
from pbrs_farm.formats.cameras_json import rig_table
from pbrs_farm.formats.serialise import json_bytes


def view_description(
    view: View,
    house_id: str,
    facts: Mapping[str, Mapping[str, Any]],
    *,
    recipe_digest: str,
    versions: Mapping[str, str],
) -> dict[str, Any]:
    """The content of view.json. facts: step -> facts of its marker; "table" of `truth` is the top level.

    recipe_digest: of the recipe that rendered the view; versions: program or library -> version. Each
    warning appears once; frame, time_s, rig and left are there only for views of a sequence, a rig or a
    stereo pair.
    """
    table = facts.get("truth", {}).get("table", {})
    light = facts.get("light", {})
    sequence: dict[str, Any] = {}
    if view.frame is not None:
        sequence = {"frame": view.frame, "time_s": view.time_s}
    sequence |= rig_table(view)
    # Warnings of the room, and of darkness in the picture and the room.
    warnings = list(dict.fromkeys([*light.get("warnings", []), *light.get("dark", [])]))
    return {
        "house": house_id,
        "view": view.id,
        "room": view.room_id,
        "sector": view.sector,
        "origin": view.origin,
        **sequence,
        "score": view.score,
        **table,
        "warnings": warnings,
        "recipe": recipe_digest,
        "modes": {step: step_facts for step, step_facts in facts.items() if step != "truth"},
        "versions": versions,
    }


def view_json(description: Mapping[str, Any]) -> bytes:
    """The file."""
    return json_bytes(description)


def lamps_from_view_json(data: bytes, place: object) -> list[dict[str, Any]]:
    """The rows of the house's lamps; BadInput, with the command that stores light by lamp."""
    try:
        rows: list[dict[str, Any]] = json.loads(data)["modes"]["light"]["lamps"]
    except (ValueError, KeyError, TypeError):
        command = "pbrs-farm run HOME --out OUT --groups lamps"
        hint = f"render it with them: {command}, and --update if OUT is the same"
        raise BadInput(place, "", "lacks the light of each lamp", hint=hint) from None
    return rows
