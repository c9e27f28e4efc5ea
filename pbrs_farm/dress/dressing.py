"""The dressing stage: make a House look lived in, from a Catalogue and a seed; no effects.

The passes are in the order in which people furnish: surfaces, furniture and its materials, lamps,
large textiles, wall items, and last the small items. The gates remove misplaced items.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from contextlib import closing
from dataclasses import replace
from typing import Final, NamedTuple

from pbrs_farm.core import keys
from pbrs_farm.core.catalogue import Catalogue, Piece
from pbrs_farm.core.house import House, Item, Source
from pbrs_farm.core.plugins import plugin
from pbrs_farm.core.recipe import DressFields
from pbrs_farm.dress.built_in import finish_built_in_parts
from pbrs_farm.dress.clutter import add_clutter
from pbrs_farm.dress.finishes import finish_furniture
from pbrs_farm.dress.furniture import add_furniture
from pbrs_farm.dress.gates import group_of, keep_gates, pass_that_added, piece_id, refit_to_walls
from pbrs_farm.dress.lamps import add_lamps
from pbrs_farm.dress.mess import move_chairs, tilt_pictures
from pbrs_farm.dress.mutable_house import CHANGED_TAG, MutableHouse
from pbrs_farm.dress.painted_bank import PaintedBank
from pbrs_farm.dress.report import Credit, DressReport, Gate, is_owed
from pbrs_farm.dress.soft_cloth import weave_soft_things
from pbrs_farm.dress.style import Style, style_for
from pbrs_farm.dress.surfaces import dress_surfaces
from pbrs_farm.dress.swap import swap_furniture
from pbrs_farm.dress.textiles import add_textiles
from pbrs_farm.dress.walls import furnish_walls
from pbrs_farm.dress.wear import add_wear

DressingPass = Callable[[MutableHouse, Catalogue, Style, float], None]


_FURNITURE: Final[tuple[tuple[str, DressingPass], ...]] = (
    ("surfaces", dress_surfaces),
    ("swap", swap_furniture),
    ("furniture", add_furniture),
    ("mess", move_chairs),
)
"""Field of the recipe that holds the pass's share, and the pass, in the order they are done."""

_THINGS: Final[tuple[tuple[str, DressingPass], ...]] = (
    ("surfaces", finish_built_in_parts),
    ("parts", finish_furniture),
    ("parts", add_wear),
    ("lamps", add_lamps),
    ("textiles", add_textiles),
    ("walls", furnish_walls),
    ("mess", tilt_pictures),
    ("clutter", add_clutter),
    ("parts", weave_soft_things),
)
"""Passes that run once the furniture is final."""


def dress(
    house: House, catalogue: Catalogue, fields: DressFields, seed: int
) -> tuple[House, DressReport]:
    """Dress a house by a seed; also reports additions, changes, refusals and measurements.

    house: as read, not repaired: its walls are still as drawn. catalogue: source of models; missing
    ones are generated, so EMPTY works. fields: shares 0..1 of each pass, 0 disables it. Deterministic
    to the bit. Raises BadRecipe for an unknown style.

        dressed, report = dress(house, EMPTY, DressFields(), seed=1)

    A house repaired afterwards needs dressed_house and refit_after_repair: repair may remove
    the wall behind a picture.
    """
    dressed = dressed_house(house, catalogue, fields, seed)
    return dressed.house, dressed.report


class Dressed(NamedTuple):
    """A dressed house, and what its gates ask again when it is repaired."""

    house: House
    report: DressReport
    pieces: Mapping[str, Piece]  # added pieces, by id
    n_source: int  # of its items were there before


def dressed_house(
    house: House,
    catalogue: Catalogue,
    fields: DressFields,
    seed: int,
    on_progress: Callable[[float], None] = lambda _share: None,
) -> Dressed:
    """Like dress, with the data for refit_after_repair. on_progress: called with the finished share of the passes."""
    bank = PaintedBank(catalogue.painted_folder)
    with closing(MutableHouse(house, seed, fields.mess, bank, fields.library_share)) as mutable:
        return Dressed(
            *dress_in_place(mutable, catalogue, fields, on_progress), mutable.used, len(house.items)
        )


def refit_after_repair(repaired: House, dressed: Dressed, catalogue: Catalogue) -> Dressed:
    """Move items that repair separated from their wall to the remaining wall, or remove them.

    repaired: `dressed.house` after repair. Returns `dressed` itself if everything added is still
    supported in the repaired house; else repair the returned house again.
    """
    house, report = refit_to_walls(
        dressed.house, dressed.n_source, repaired, dressed.report, dressed.pieces
    )
    if house is dressed.house:
        return dressed
    added = _count_added(house.items[dressed.n_source :], dressed.pieces)
    update = {"added": added, "credits": _credits_of_house(house, catalogue)}
    return dressed._replace(house=house, report=report.model_copy(update=update))


def dress_in_place(
    house: MutableHouse,
    catalogue: Catalogue,
    fields: DressFields,
    on_progress: Callable[[float], None],
) -> tuple[House, DressReport]:
    style = style_for(house.rng("style"), fields.style)
    pieces = {p.id: p for p in catalogue.pieces}
    gates: tuple[Gate, ...] = ()
    # Correct misplaced furniture before adding items on top, then check everything.
    n_done = 0
    for several in (_FURNITURE, _THINGS):
        for field, dressing_pass in several:
            share = float(getattr(fields, field))
            if share > 0:
                dressing_pass(house, catalogue, style, share)
            n_done += 1
            on_progress(n_done / len(_FURNITURE + _THINGS))
        gates = _merge_gates(gates, keep_gates(house, pieces | house.used))
    if fields.passes:
        for name in fields.passes.split(":"):
            plugin("passes", name).load()(house, catalogue, style, 1.0)
        gates = _merge_gates(gates, keep_gates(house, pieces | house.used))
    dressed = house.frozen()
    credits = _credits_of_house(dressed, catalogue)
    dressed = replace(
        dressed,
        id=keys.dressed_id(house.source.id, house.seed),
        source=_credited(house.source.source, credits),
    )
    return dressed, _report_of_dressing(dressed, house, style, gates, credits)


def _merge_gates(before: tuple[Gate, ...], after: tuple[Gate, ...]) -> tuple[Gate, ...]:
    """The current gates, with the items removed for them before."""
    taken = {gate.name: gate.n_taken_out for gate in before}
    return tuple(
        gate.model_copy(update={"n_taken_out": gate.n_taken_out + taken.get(gate.name, 0)})
        for gate in after
    )


def _report_of_dressing(
    house: House,
    mutable: MutableHouse,
    style: Style,
    gates: tuple[Gate, ...],
    credits: tuple[Credit, ...],
) -> DressReport:
    changed = Counter(
        tag.removeprefix(CHANGED_TAG)
        for item in house.items
        for tag in item.tags
        if tag.startswith(CHANGED_TAG)
    )
    return DressReport(
        house_id=house.id,
        seed=mutable.seed,
        style=style.name,
        added=_count_added(house.items[len(mutable.source.items) :], mutable.used),
        changed=dict(sorted(changed.items())),
        refused=dict(sorted(mutable.refused.items())),
        gates=gates,
        credits=credits,
        notes=tuple(f"{n.kind}: {n.place}: {n.text}" for n in mutable.notes),
    )


def _count_added(items: Iterable[Item], pieces: Mapping[str, Piece]) -> dict[str, int]:
    """Added items present in the end, by part and group."""
    counts = Counter(f"{pass_that_added(item)}: {group_of(item, pieces)}" for item in items)
    return dict(sorted(counts.items()))


def _credits_of_house(house: House, catalogue: Catalogue) -> tuple[Credit, ...]:
    """The pieces and pictures of libraries that the house shows, by id."""
    pieces: dict[str, Piece] = {p.id: p for p in catalogue.pieces}
    counts = Counter(piece_id(item) for item in house.items)
    credits = [
        Credit(id=p.id, name=p.name, library=p.library, creator=p.creator, licence=p.licence, n=n)
        for p, n in ((pieces.get(i), n) for i, n in counts.items())
        if p is not None and p.library
    ]
    # A picture is known by its texture, however many surfaces show it.
    credits += [
        Credit(
            id=p.texture.id,
            name=p.texture.name,
            library="",
            creator=p.creator,
            licence=p.licence,
            n=1,
        )
        for p in catalogue.pictures
        if p.texture.id in house.textures
    ]
    return tuple(sorted(credits, key=lambda c: c.id))


def _credited(source: Source, credits: tuple[Credit, ...]) -> Source:
    """The source with a short line of the libraries that must be named."""
    owed = sorted({c.library or c.creator for c in credits if is_owed(c)} - {""})
    if not owed:
        return source
    licences = sorted({c.licence for c in credits if is_owed(c)})
    line = f"furnished with models of {', '.join(owed)}, {', '.join(licences)}, see ATTRIBUTION.txt"
    return replace(source, attribution="; ".join(t for t in (source.attribution, line) if t))
