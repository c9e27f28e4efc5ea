"""Rugs that were drawn in one colour get a pattern and pile; no effects but on the draft."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pbrs_farm.core.classes import FLOOR_MAT
from pbrs_farm.core.house import Item, ItemKind, Material
from pbrs_farm.dress.draft import Draft
from pbrs_farm.dress.style import Style, room_style
from pbrs_farm.dress.textiles.rug_patterns import rug_pixels
from pbrs_farm.dress.walls.hung_things import jpeg_texture

PART = "textiles"
_LEAST_M, _MOST_M = 0.3, 6.0  # of a rug's sides


def cover_drawn_rugs(draft: Draft, style: Style, share: float) -> None:
    """Give a share of the source's plain rugs a picture of the room's style; pictures stay."""
    for index, item in enumerate(draft.items[: len(draft.source.items)]):
        if item.kind is not ItemKind.OBJECT or item.nyu40 != FLOOR_MAT or not item.n_faces:
            continue
        if any(draft.materials[s.material].texture_id for s in item.surfaces):
            continue
        rng = draft.rng(PART, "drawn rug", item.id)
        if rng.random() < share:
            taste = room_style(style, draft.rng(PART, item.room_id or "", "style"))
            covered = _covered(draft, item, taste, rng)
            if covered is not None:
                draft.change(index, covered, PART)
                draft.done[f"{PART}: drawn rug"] += 1


def _covered(draft: Draft, item: Item, style: Style, rng: np.random.Generator) -> Item | None:
    box = item.oriented_box
    sides = 2 * box.half
    along, across = (0, 2) if sides[0] >= sides[2] else (2, 0)
    if sides[across] < _LEAST_M or sides[along] > _MOST_M:
        return None
    texture = jpeg_texture(
        "rug drawn", rug_pixels(rng, float(sides[across]), float(sides[along]), style)
    )
    shown = Material(f"rug {texture.id[:8]}", texture_id=texture.id, roughness=1.0)
    number = draft.material(shown, [texture])
    # Lay the picture over the plan: its edges show at the sides, which are a centimetre high.
    surfaces = []
    for surface in item.surfaces:
        local = (surface.positions.astype(np.float64) - box.centre) @ box.axes
        uvs = local[:, [along, across]] / sides[[along, across]] + 0.5
        surfaces.append(replace(surface, material=number, uvs=np.clip(uvs, 0.002, 0.998).astype(np.float32)))  # fmt: skip
    return replace(item, surfaces=tuple(surfaces))
