"""One scheme of finishes per home for doors, windows, stairs and fittings."""

from dataclasses import replace

import numpy as np
import pytest

from pbrs_farm.core.catalogue import EMPTY
from pbrs_farm.core.classes import OTHERFURNITURE
from pbrs_farm.core.house import House, Item, ItemKind, Material, MaterialKind
from pbrs_farm.core.recipe import DressFields
from pbrs_farm.dress.built_in import finish_built_in_parts
from pbrs_farm.dress.dressing import dress
from pbrs_farm.dress.finish_scheme import finish_scheme
from pbrs_farm.dress.gates.bodies import bodies_of, has_same_mesh
from pbrs_farm.dress.mutable_house import MutableHouse
from pbrs_farm.dress.style import style_for
from pbrs_farm.read.builtin.builtin_home import builtin_home
from tests.dress.furniture import boards, house, solid

FRAME = [
    ([0.0, 0.0, 0.0], [0.9, 2.1, 0.05]), ([0.05, 0.0, 0.06], [0.85, 2.0, 0.1]),
    ([0.7, 1.0, 0.12], [0.8, 1.02, 0.15]),
]  # fmt: skip


def door() -> Item:
    """A door with frame, leaf and handle in one surface of one colour."""
    item = boards("door", FRAME, 8)
    starts = np.cumsum([0, *(len(s.positions) for s in item.surfaces)])
    whole = replace(
        item.surfaces[0],
        positions=np.concatenate([s.positions for s in item.surfaces]),
        faces=np.concatenate([s.faces + n for s, n in zip(item.surfaces, starts, strict=False)]),
        uvs=None,
        normals=None,
    )
    return replace(item, name="Door", kind=ItemKind.DOOR, surfaces=(whole,))


def joined(source: House, seed: int, share: float = 1.0) -> House:
    mutable = MutableHouse(source, seed)
    finish_built_in_parts(mutable, EMPTY, style_for(mutable.rng("style")), share)
    return mutable.frozen()


def materials_of(home: House, index: int = 0) -> list[Material]:
    return [home.materials[s.material] for s in home.items[index].surfaces]


def test_a_door_is_parted_into_frame_leaf_and_handle_and_keeps_its_mesh() -> None:
    counts = set()
    for seed in range(1, 9):
        home = joined(house(door()), seed)
        assert has_same_mesh(home.items[0], door())
        counts.add(len(home.items[0].surfaces))
        assert any(m.specular[0] > 0.1 for m in materials_of(home))
    # In some homes the leaf matches its frame, in others it does not.
    assert counts == {2, 3}


def test_one_home_has_one_scheme_and_seeds_give_several() -> None:
    two = house(door(), replace(door(), id="another"))
    looks = set()
    for seed in range(1, 7):
        home = joined(two, seed)
        assert materials_of(home, 0) == materials_of(home, 1)
        looks.add(materials_of(home)[0].name)
    assert len(looks) >= 5


@pytest.mark.parametrize(
    "material",
    [
        Material("glass", MaterialKind.PANE),
        Material("carved", texture_id="0123456789abcdef"),
        Material("etched", opacity=0.5),
        Material("m2_satin_glass"),
    ],
)
def test_panes_and_pictures_of_a_door_stay(material: Material) -> None:
    source = replace(house(door()), materials=(material,))
    home = joined(source, 1)
    assert materials_of(home) == [material]
    assert home.items[0].tags == source.items[0].tags


@pytest.mark.parametrize(
    ("name", "n_fittings"), [("m1_handle", 3), ("m0_joinery", 0), ("paint", 1)]
)
def test_fittings_are_parts_so_named_or_small_ones(name: str, n_fittings: int) -> None:
    source = replace(house(door()), materials=(Material(name),))
    home = joined(source, 1)
    metals = [s for s in home.items[0].surfaces if home.materials[s.material].is_metal]
    n_faces = sum(len(s.faces) for s in metals)
    assert n_faces == 12 * n_fittings


@pytest.mark.parametrize(
    ("name", "is_coated"),
    [("Woven basket", False), ("Home theater", False), ("Oven", True), ("panelHeater", True)],
)
def test_whole_words_of_a_name_select_the_coat(name: str, is_coated: bool) -> None:
    thing = replace(solid("thing", [0.0, 0.0, 0.0], [0.6, 0.8, 0.6], OTHERFURNITURE), name=name)
    home = joined(house(thing), 1)
    assert ("changed:joinery" in home.items[0].tags) is is_coated


@pytest.mark.parametrize("name", ["Radiator", "Oven"])
def test_an_item_without_a_coat_counts_as_unchanged(name: str) -> None:
    thing = replace(solid("thing", [0.0, 0.0, 0.0], [0.6, 0.8, 0.6], OTHERFURNITURE), name=name)
    source = replace(house(thing), materials=(Material("print", texture_id="0123456789abcdef"),))
    assert joined(source, 1).items[0].tags == thing.tags


def test_the_gates_identify_a_split_door_with_the_original() -> None:
    moved = replace(door(), surfaces=tuple(replace(s, positions=s.positions + 0.01) for s in door().surfaces))  # fmt: skip
    assert not has_same_mesh(door(), moved)
    parted = joined(house(door()), 1).items[0]
    assert len(parted.surfaces) > 1
    assert has_same_mesh(parted, door())
    # Items of the original home are not measured as added ones.
    mutable = MutableHouse(house(door(), replace(door(), id="moved")), 1)
    mutable.items = [parted, replace(moved, id="moved")]
    assert [body.is_new for body in bodies_of(mutable, {})] == [False, True]


def test_a_share_of_nothing_changes_no_door() -> None:
    source = house(door())
    assert joined(source, 1, share=0.0).items[0].tags == source.items[0].tags


def test_the_scheme_does_not_depend_on_the_order_of_requests() -> None:
    mutable = MutableHouse(house(door()), 3)
    style = style_for(mutable.rng("style"))
    first = finish_scheme(mutable, style)
    mutable.rng("surfaces").random(100)
    assert finish_scheme(mutable, style) == first


@pytest.mark.slow
def test_furniture_parts_keep_coats_unchanged() -> None:
    home, report = dress(builtin_home(), EMPTY, DressFields(), 2)
    doors = [i for i in home.items if i.kind is ItemKind.DOOR]
    assert doors
    for item in doors:
        assert "changed:joinery" in item.tags
        assert "changed:parts" not in item.tags
    assert report.changed["joinery"] >= len(doors)
