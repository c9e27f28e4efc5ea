"""Templates of halls, stores, wardrobe rooms and balconies. No effects."""

from __future__ import annotations

from pbrs_farm.generate.furnish.pieces import MAX_CHOICES, Shelf, backed, single, slot
from pbrs_farm.generate.furnish.template import Liking, Template


def coats(shelf: Shelf) -> tuple[Template, ...]:
    """Coat racks, narrow wardrobes."""
    racks = shelf.of("clothes_rack", depth=(0.2, 0.6))[:MAX_CHOICES]
    templates = [single(p, before=0.6, rank=0.3) for p in racks]
    slim = shelf.of("wardrobe", depth=(0.3, 0.56), width=(0.8, 1.1), height=(1.4, 2.3))
    return tuple(templates + [single(p, before=0.65) for p in slim[:MAX_CHOICES]])


def consoles(shelf: Shelf) -> tuple[Template, ...]:
    """Hall furniture for keys and shoes: a low chest, narrow shelves, a bench."""
    pieces = shelf.of("dresser", "shelves", depth=(0.2, 0.56), width=(0.4, 1.5), height=(0.4, 1.3))
    templates = [single(p, before=0.6, rank=-0.5 * p.size[1]) for p in pieces[:MAX_CHOICES]]
    benches = shelf.of("stool", width=(0.7, 1.3), height=(0.35, 0.55))
    return tuple(templates + [single(p, before=0.6) for p in benches[:MAX_CHOICES]])


def stores(shelf: Shelf) -> tuple[Template, ...]:
    """Shelves of a store room."""
    pieces = shelf.of("shelves", "bookcase", width=(0.4, 1.1), depth=(0.25, 0.45))
    return tuple(single(p, before=0.5, corner=0.5) for p in pieces[:MAX_CHOICES])


def boxes(shelf: Shelf) -> tuple[Template, ...]:
    """Boxes and baskets on the floor."""
    pieces = [p for p in shelf.of("box", height=(0.25, 0.7)) if p.place == "floor"]
    pieces += shelf.of("basket", width=(0.3, 0.65))
    return tuple(single(p, before=0.0, corner=0.6) for p in pieces[:5])


def outdoor_sets(shelf: Shelf) -> tuple[Template, ...]:
    """A small table with two chairs, or two chairs alone, for a balcony."""
    tables = shelf.of("dining_table", width=(0.5, 0.85), depth=(0.5, 0.85), height=(0.6, 0.8))
    chairs = shelf.of("chair", width=(0.38, 0.65), height=(0.7, 1.0), without="office desk child")
    cafe = [c for c in chairs if "cafe" in c.id.lower() or "plastic" in c.id.lower()]
    chairs = cafe + chairs
    templates = []
    for table in tables[:3]:
        w, d, _ = table.size
        for chair in chairs[:2]:
            left, right = (
                w / 2 + chair.size[1] / 2 - shelf.under_m(chair, table, 0.0, turns, 0.1)
                for turns in (-1, 1)
            )
            v = 0.05 + max(d, chair.size[0]) / 2
            seats = (slot(chair, -left, v, turns=-1), slot(chair, right, v, turns=1))
            templates.append(
                Template(
                    "table and two chairs",
                    (slot(table, 0.0, v), *seats),
                    rank=0.5,
                    liking=Liking(corner=0.4),
                )
            )
    templates += [Template("chair", (backed(c, gap=0.06),)) for c in chairs[:2]]
    return tuple(templates)
