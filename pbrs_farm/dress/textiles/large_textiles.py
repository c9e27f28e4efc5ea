"""The part `textiles_large` of dressing: curtains, blinds, rugs, towels, room by room; no effects."""

from __future__ import annotations

import numpy as np

from pbrs_farm.core.catalogue import Catalogue
from pbrs_farm.dress.draft import Draft
from pbrs_farm.dress.space import RoomSpace, house_space
from pbrs_farm.dress.space.room_kinds import RoomKind
from pbrs_farm.dress.style import Style, room_style
from pbrs_farm.dress.textiles.curtains import hang_blind, hang_curtains, room_cloth, window_side
from pbrs_farm.dress.textiles.drawn_rugs import cover_drawn_rugs
from pbrs_farm.dress.textiles.rugs import lay_rugs
from pbrs_farm.dress.textiles.towels import hang_towels

# How likely a window gets curtains, and how likely a blind where it got none.
_CURTAINS = {
    RoomKind.LIVING: 0.92, RoomKind.BEDROOM: 0.92, RoomKind.DINING: 0.85, RoomKind.OFFICE: 0.75,
    RoomKind.OTHER: 0.75, RoomKind.KITCHEN: 0.4, RoomKind.HALL: 0.3, RoomKind.BATHROOM: 0.2,
}  # fmt: skip
_BLINDS = {
    RoomKind.LIVING: 0.2, RoomKind.BEDROOM: 0.3, RoomKind.KITCHEN: 0.5, RoomKind.BATHROOM: 0.5,
    RoomKind.OFFICE: 0.5, RoomKind.OTHER: 0.3, RoomKind.DINING: 0.2, RoomKind.HALL: 0.15,
}  # fmt: skip


def textiles_large(draft: Draft, catalogue: Catalogue, style: Style, share: float) -> None:
    """Hang curtains, blinds and towels, lay rugs. share: 0..1 of what rooms would get."""
    cover_drawn_rugs(draft, style, share)
    for room_id in [r.room.id for r in house_space(draft).rooms]:
        room = house_space(draft).room(room_id)
        if room.kind in (RoomKind.OUTDOOR, RoomKind.STORE) or room.area.is_empty:
            continue
        taste = room_style(style, draft.rng("textiles", room_id, "style"))
        _dress_windows(draft, room, taste, draft.rng("textiles", room_id, "windows"), share)
        if room.room.has_floor:
            lay_rugs(draft, room_id, taste, draft.rng("textiles", room_id, "rugs"), share)
        hang_towels(
            draft, catalogue, taste, room_id, draft.rng("textiles", room_id, "towels"), share
        )


def _dress_windows(
    draft: Draft, room: RoomSpace, style: Style, rng: np.random.Generator, share: float
) -> None:
    """All windows of a room alike: people buy one cloth."""
    if not room.windows:
        return
    curtains = rng.random() < _CURTAINS.get(room.kind, 0.0) * share
    blinds = rng.random() < _BLINDS.get(room.kind, 0.0) * share
    cloth = room_cloth(draft, style, room, rng) if curtains else None
    look = int(rng.integers(1 << 30))
    for window in room.windows:
        # Inner windows between two rooms stay bare.
        if None not in window.room_ids and not _looks_out(draft, window.room_ids):
            continue
        space = house_space(draft)
        seen = window_side(draft, space, space.room(room.room.id), window)
        if seen is None:
            continue
        own = np.random.default_rng(look)
        done = cloth is not None and hang_curtains(draft, space, room, seen, cloth, own)
        if not done and blinds:
            hang_blind(draft, space, room, seen, style, own)


def _looks_out(draft: Draft, room_ids: tuple[str | None, str | None]) -> bool:
    # A balcony or a terrace is outdoors, too.
    space = house_space(draft)
    return any(i is None or space.room(i).kind is RoomKind.OUTDOOR for i in room_ids)
