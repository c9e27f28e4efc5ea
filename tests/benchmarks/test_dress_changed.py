"""The count of changed surfaces: what could be told apart counts, and nothing else."""

from dataclasses import replace

import numpy as np

from benchmarks.dress.changed import looks_of, share_changed
from pbrs_farm.core.house import House, Item, Material
from tests.dress.furniture import bookcase, house, solid


def painted(home: House, *diffuse: tuple[float, float, float]) -> House:
    """The home with a material of each colour, surface by surface in turn."""
    materials = tuple(Material("paint", diffuse=d) for d in diffuse)
    items = tuple(
        replace(i, surfaces=tuple(replace(s, material=k % len(diffuse)) for k, s in enumerate(i.surfaces)))
        for i in home.items
    )  # fmt: skip
    return replace(home, items=items, materials=materials)


def changed(source: House, a: House, b: House) -> float:
    return share_changed(looks_of(a, source), looks_of(b, source))[0]


def table() -> House:
    return house(solid("table", [0, 0, 0], [1, 0.7, 1]))


def test_a_colour_that_no_one_sees_is_no_change() -> None:
    grey = painted(table(), (0.5, 0.5, 0.5))
    assert changed(table(), grey, painted(table(), (0.506, 0.5, 0.5))) == 0.0
    assert changed(table(), grey, painted(table(), (0.55, 0.5, 0.5))) == 1.0


def test_a_roughness_or_name_alone_is_no_change() -> None:
    home = table()
    other = replace(home, materials=(replace(home.materials[0], name="x", roughness=0.2),))
    assert changed(home, home, other) == 0.0


def test_each_surface_counts_alone() -> None:
    source = house(bookcase())
    a = painted(source, (0.5, 0.5, 0.5), (0.9, 0.9, 0.9))
    b = painted(source, (0.5, 0.5, 0.5), (0.2, 0.2, 0.2))
    n = len(source.items[0].surfaces)
    assert changed(source, a, b) == (n // 2) / n


def test_another_model_is_a_change_and_another_order_of_triangles_is_not() -> None:
    source = house(bookcase())
    case: Item = source.items[0]
    turned = replace(case, surfaces=tuple(replace(s, faces=s.faces[::-1]) for s in case.surfaces))
    assert changed(source, source, replace(source, items=(turned,))) == 0.0
    wider = replace(
        case,
        surfaces=tuple(replace(s, positions=s.positions * np.float32(1.1)) for s in case.surfaces),
    )
    assert changed(source, source, replace(source, items=(wider,))) == 1.0
