"""Small items on furniture touch it, nothing penetrates, and books are upright in shelves."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from manifold3d import Manifold, Mesh

from pbrs_farm.core.catalogue import EMPTY, Catalogue, Piece, Place, Shape
from pbrs_farm.core.classes import OTHERFURNITURE
from pbrs_farm.core.house import House, Item, Material
from pbrs_farm.core.mesh import triangle_corners
from pbrs_farm.dress.clutter import add_clutter, table_tops
from pbrs_farm.dress.clutter.receptacles import Row, receptacle_of, shares
from pbrs_farm.dress.clutter.stock import Stock, is_known
from pbrs_farm.dress.mutable_house import MutableHouse
from pbrs_farm.dress.style import style_for
from pbrs_farm.dress.supports import supports_of_item
from pbrs_farm.furnishings.things.book_covers import book_covers
from pbrs_farm.geometry.scene_triangles import SceneTriangles
from pbrs_farm.geometry.solids import box
from pbrs_farm.home.room_use import RoomKind
from tests.dress.furniture import bookcase, house, room, solid

_BOOKS = 23


def _dressed(home: House, seed: int = 1, share: float = 1.0) -> MutableHouse:
    mutable = MutableHouse(home, seed)
    add_clutter(mutable, EMPTY, style_for(np.random.default_rng(seed), "nordic"), share)
    return mutable


def _room() -> House:
    return house(
        bookcase(),
        solid("Desk", [2.6, 0, 0], [3.8, 0.74, 0.6], 14),
        solid("Chest", [0, 0, 2], [0.5, 0.9, 3], 17),
        solid("Table", [1.4, 0, 1.6], [2.6, 0.42, 2.2], 7),
        solid("Lamp", [2.7, 0.74, 0.1], [2.9, 1.1, 0.3], 35),
    )


def _added(mutable: MutableHouse) -> list[Item]:
    return mutable.items[len(mutable.source.items) :]


def _body(item: Item) -> Manifold:
    corners = np.concatenate([triangle_corners(s.positions, s.faces) for s in item.surfaces])
    places, number = np.unique(np.round(corners.reshape(-1, 3), 6), axis=0, return_inverse=True)
    faces = number.reshape(-1, 3).astype(np.uint32)
    return Manifold(Mesh(places.astype(np.float32), faces))


@pytest.mark.parametrize(("name", "holds"), [("Woven basket", "other_top"), ("Oven", "stove")])
def test_words_of_its_name_decide_what_a_top_carries(name: str, holds: str) -> None:
    item = replace(solid("thing", [0, 0, 0], [0.6, 0.9, 0.6], OTHERFURNITURE), name=name)
    (top,) = supports_of_item(SceneTriangles([item]), 0, room())
    assert receptacle_of(item, top, RoomKind.LIVING) == holds


def test_every_item_touches_its_support() -> None:
    mutable = _dressed(_room())
    levels = np.array([0.74, 0.9, 0.42, 0.12, 0.59, 1.06, 1.53, 2.0])
    added = _added(mutable)
    assert len(added) > 15
    for item in added:
        gap = item.bounds[0, 1] - levels
        # Touching floor, board or top; shoes and bins are on the floor.
        assert np.abs(gap).min() < 0.0005 or item.bounds[0, 1] < 0.0005, item.name


def test_nothing_penetrates_anything() -> None:
    for seed in (1, 2):
        mutable = _dressed(_room(), seed)
        bodies = [(item, _body(item)) for item in mutable.items]
        for (first_item, a), (two, b) in combinations(bodies, 2):
            is_apart = (first_item.bounds[0] > two.bounds[1] + 1e-4) | (
                two.bounds[0] > first_item.bounds[1] + 1e-4
            )
            if is_apart.any() or (
                first_item in mutable.source.items and two in mutable.source.items
            ):
                continue
            assert (a ^ b).volume() < 1e-8, f"{first_item.name} in {two.name}"


def test_books_are_upright_in_the_bookcase_with_their_spines_out() -> None:
    mutable = _dressed(_room())
    books = [i for i in _added(mutable) if i.nyu40 == _BOOKS and i.bounds[1, 2] < 0.31]
    books = [i for i in books if i.bounds[1, 0] < 2.0]  # the others are on the desk
    assert books
    for item in books:
        assert item.box is not None
        assert item.box.axes[:, 2] == pytest.approx([0, 0, 1], abs=1e-6)
        assert item.bounds[0, 2] > 0.01, "in front of the back"
        assert item.bounds[1, 2] <= 0.3 + 1e-6, "on the board"


def test_the_same_seed_gives_the_same_bits_and_another_gives_others() -> None:
    first, again, other_seed = _dressed(_room(), 3), _dressed(_room(), 3), _dressed(_room(), 4)
    assert [i.id for i in first.items] == [i.id for i in again.items]
    for a, b in zip(first.items, again.items, strict=True):
        for s, t in zip(a.surfaces, b.surfaces, strict=True):
            assert s.positions.tobytes() == t.positions.tobytes()
    assert [i.bounds.tolist() for i in first.items] != [i.bounds.tolist() for i in other_seed.items]


def test_ids_are_unique_and_every_item_has_a_class_and_a_room() -> None:
    added = _added(_dressed(_room()))
    assert len({i.id for i in added}) == len(added)
    assert all(i.id.startswith("dress-clutter-") and i.nyu40 and i.room_id == "0_0" for i in added)


@pytest.mark.long
def test_a_smaller_share_puts_less() -> None:
    def count(share: float) -> int:
        return sum(len(_added(_dressed(_room(), seed, share))) for seed in range(4))

    assert count(0.25) < 0.7 * count(1.0)


def test_a_desk_gets_one_laptop_unless_it_has_one() -> None:
    desk = solid("Desk", [1.0, 0, 0], [2.8, 0.74, 0.8], 14)
    drawn = replace(solid("Laptop", [1.1, 0.74, 0.2], [1.45, 0.98, 0.45], 40), name="Laptop")
    counts = []
    for home, most in ((house(desk), 1), (house(desk, drawn), 0)):
        for seed in range(4):
            added = _added(_dressed(home, seed))
            n = sum("laptop" in i.source_class or "monitor" in i.source_class for i in added)
            counts.append(n)
            assert n <= most + (most > 0)
            assert sum("laptop" in i.source_class for i in added) <= most
    assert max(counts) > 0


def test_a_room_has_no_more_of_a_kind_than_people_keep(monkeypatch: pytest.MonkeyPatch) -> None:
    piece = Piece("T#card_game", "Card game", "box", Place.SURFACE, 29, (0.1, 0.1, 0.05))
    surface = box("box", np.array([0, 0.025, 0]), np.array([0.05, 0.025, 0.05]), 0)
    catalogue = Catalogue((piece,), lambda _p: Shape((surface,), (Material("m"),)), "test")
    tables = [solid(f"Table {k}", [k, 0, 0], [k + 0.9, 0.45, 0.9], 7) for k in range(4)]
    rows = {"coffee_table": (Row(receptacle="coffee_table", kind="box", share=1.0, source="own"),)}
    monkeypatch.setattr(table_tops, "shares", lambda: rows)
    mutable = MutableHouse(house(*tables), 1)
    add_clutter(mutable, catalogue, style_for(np.random.default_rng(1), "nordic"), 1.0)
    on_tables = [i for i in _added(mutable) if i.bounds[0, 1] > 0.4]
    assert len(on_tables) == 2
    assert mutable.refused["clutter: enough of box in the room"] > 0


def test_a_full_table_gets_no_more_items() -> None:
    block = solid("Monitor", [2.6, 0.74, 0.0], [3.8, 1.0, 0.6], 40)
    mutable = _dressed(house(solid("Desk", [2.6, 0, 0], [3.8, 0.74, 0.6], 14), block))
    assert not any(0.1 < i.bounds[0, 1] < 0.9 for i in _added(mutable))


def test_the_table_of_shares_names_kinds_that_exist() -> None:
    for receptacle, rows in shares().items():
        for row in rows:
            assert is_known(row.kind), f"{receptacle}: {row.kind}"
            assert 0 < row.share <= 1


def test_items_of_the_tables_are_generated_without_a_library() -> None:
    # The table asks for a coffee machine and cutlery on a worktop, which no library has.
    rng, style = np.random.default_rng(0), style_for(np.random.default_rng(1), "nordic")
    stock = Stock(EMPTY, book_covers(rng, style), 1)
    kinds = {row.kind for rows in shares().values() for row in rows}
    missing = {k for k in sorted(kinds) if stock.take(rng, k, style) is None}
    assert missing == {"jewel", "table_lamp"}


def test_a_laid_table_has_a_plate_before_each_chair() -> None:
    table = solid("Table", [1.0, 0, 1.0], [2.6, 0.74, 2.0], 7)
    chairs = [solid(f"Chair {x}", [x, 0, 0.55], [x + 0.4, 0.45, 0.95], 5) for x in (1.1, 2.0)]
    for seed in range(30):
        added = _added(_dressed(house(table, *chairs, name="Dining room"), seed))
        plates = [i for i in added if i.source_class == "generated#plate"]
        near = [p for p in plates if p.bounds[1, 2] < 1.4]
        if (
            len(near) == 2
            and len([i for i in added if "glass" in i.source_class or "tumbler" in i.source_class])
            >= 2
        ):
            middles = sorted(p.bounds.mean(0)[0] for p in near)
            assert middles == pytest.approx([1.3, 2.2], abs=0.15)
            return
    pytest.fail("no table was laid")


def test_furniture_in_two_rooms_that_overlap_is_filled_once() -> None:
    home = house(solid("Desk", [2.6, 0, 0], [3.8, 0.74, 0.6], 14))
    two_rooms = (replace(home.rooms[0], id="0_1"), *home.rooms)
    once = [i for i in _added(_dressed(replace(home, rooms=two_rooms))) if i.bounds[0, 1] > 0.5]
    assert once
    assert {i.room_id for i in once} == {"0_0"}
