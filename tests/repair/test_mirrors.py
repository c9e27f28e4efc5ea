"""A piece of class mirror gets a mirror's surface on its large flat part facing the room."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import trimesh

from pbrs_farm.core.classes import CABINET, DRESSER, MIRROR, OTHERFURNITURE, TELEVISION
from pbrs_farm.core.house import House, Item, ItemKind, Material, MaterialKind, Surface
from pbrs_farm.core.recipe import RepairFields
from pbrs_farm.read.builtin.builtin_home import builtin_home
from pbrs_farm.repair import repair
from pbrs_farm.repair.mirrors import with_clear_panes, with_mirrors


def board(name: str, size: tuple[float, float, float], at: tuple[float, float, float]) -> Surface:
    box = trimesh.creation.box(size)
    box.apply_translation(at)
    return Surface(name, box.vertices.astype(np.float32), box.faces.astype(np.int32), 0)


def with_item(surfaces: tuple[Surface, ...], *, nyu40: int = MIRROR, behind: bool = False) -> House:
    """The small home with an item near the wall at small z of its first room, or at large z if behind."""
    home = builtin_home()
    room = home.rooms[0]
    points = np.asarray(room.polygon)
    x, z = points.mean(0)
    z = points[:, 1].max() - 0.05 if behind else points[:, 1].min() + 0.05
    moved = tuple(
        replace(
            s,
            positions=s.positions + np.array([x, room.floor_y + 1.5, z], np.float32),
            material=len(home.materials) + k,
        )
        for k, s in enumerate(surfaces)
    )
    item = Item(
        "glass", "Mirror", ItemKind.OBJECT, room.level_id, moved, nyu40=nyu40, room_id=room.id
    )
    white = tuple(Material(f"white_{k}") for k in range(len(surfaces)))
    return replace(home, items=(*home.items, item), materials=(*home.materials, *white))


def glass_of(house: House) -> tuple[np.ndarray, float]:
    """Mean normal and area of the item's mirrors."""
    item = next(i for i in house.items if i.id == "glass")
    vectors = [
        np.cross(c[:, 1] - c[:, 0], c[:, 2] - c[:, 0]).sum(0) / 2
        for s in item.surfaces
        if house.materials[s.material].kind is MaterialKind.MIRROR
        for c in [s.positions[s.faces].astype(np.float64)]
    ]
    total = np.sum(vectors, axis=0) if vectors else np.zeros(3)
    area = float(np.linalg.norm(total))
    return total / max(area, 1e-9), area


@pytest.mark.parametrize("behind", [False, True])
def test_a_white_board_mirrors_on_the_side_that_faces_the_room(behind: bool) -> None:
    house, mirrors = with_mirrors(
        with_item((board("all", (0.6, 0.9, 0.02), (0, 0, 0)),), behind=behind)
    )
    assert mirrors == ("glass",)
    normal, area = glass_of(house)
    np.testing.assert_allclose(normal, [0, 0, -1.0 if behind else 1.0], atol=1e-6)
    assert area == pytest.approx(0.54, abs=1e-5)
    # No face is lost.
    item = next(i for i in house.items if i.id == "glass")
    assert item.n_faces == 12


def test_the_frame_of_a_mirror_stays() -> None:
    glass = board("glass", (0.5, 0.8, 0.01), (0, 0, 0))
    frame = [board("frame", (0.04, 0.88, 0.03), (s * 0.27, 0, 0.005)) for s in (-1, 1)] + [
        board("frame", (0.5, 0.04, 0.03), (0, s * 0.42, 0.005)) for s in (-1, 1)
    ]
    home = with_item((glass, *frame))
    house, _made = with_mirrors(home)
    normal, area = glass_of(house)
    np.testing.assert_allclose(normal, [0, 0, 1], atol=1e-6)
    assert area == pytest.approx(0.4, abs=1e-5)
    item = next(i for i in house.items if i.id == "glass")
    kinds = [house.materials[s.material].kind for s in item.surfaces]
    assert kinds.count(MaterialKind.MIRROR) == 1
    assert kinds[1:5] == [MaterialKind.OPAQUE] * 4


def test_existing_mirrors_other_items_and_curved_ones_are_unchanged() -> None:
    sheet = board("all", (0.6, 0.9, 0.02), (0, 0, 0))
    unlabelled = with_item((sheet,), nyu40=MIRROR - 1)
    assert with_mirrors(unlabelled)[1] == ()
    once, _made = with_mirrors(with_item((sheet,)))
    again, mirrors = with_mirrors(once)
    assert mirrors == ()
    assert again.items == once.items
    ball = trimesh.creation.icosphere(subdivisions=3, radius=0.3)
    round_one = Surface("ball", ball.vertices.astype(np.float32), ball.faces.astype(np.int32), 0)
    assert with_mirrors(with_item((round_one,)))[1] == ()


def test_repair_reports_the_mirrors_it_made() -> None:
    _house, report = repair(with_item((board("all", (0.6, 0.9, 0.02), (0, 0, 0)),)), RepairFields())
    assert report.mirrors == ("glass",)


DRESSING_TABLE = (
    board("wood", (1.0, 0.05, 0.4), (0, -0.4, 0)),
    board("Mirror_Glass", (0.6, 0.7, 0.02), (0, 0.2, 0)),
    board("Mirror_Frame", (0.7, 0.05, 0.02), (0, 0.6, 0)),
)


def test_the_mirror_of_another_piece_mirrors_and_its_label_stays() -> None:
    house, mirrors = with_mirrors(with_item(DRESSING_TABLE, nyu40=DRESSER))
    assert mirrors == ("glass",)
    normal, area = glass_of(house)
    np.testing.assert_allclose(normal, [0, 0, 1], atol=1e-6)
    assert area == pytest.approx(0.42, abs=1e-5)
    item = next(i for i in house.items if i.id == "glass")
    assert (item.nyu40, item.n_faces) == (DRESSER, 36)
    # The material's name counts as well; a mirror's lamp is not a mirror.
    for name, expected in (("Spiegel", ("glass",)), ("Mirror light", ())):
        home = with_item((board("part 0", (0.6, 0.9, 0.02), (0, 0, 0)),), nyu40=DRESSER)
        material = replace(home.materials[-1], name=name)
        assert (
            with_mirrors(replace(home, materials=(*home.materials[:-1], material)))[1] == expected
        )


@pytest.mark.parametrize(
    ("name", "size", "diffuse", "nyu40", "kind"),
    [
        ("Glass_door", (0.4, 0.9, 0.005), (0.8, 0.9, 0.9), CABINET, MaterialKind.GLASS),
        ("Cabinet_Pane", (0.4, 0.9, 0.005), (1.0, 1.0, 1.0), CABINET, MaterialKind.GLASS),
        ("Frosted glass", (0.4, 0.9, 0.005), (0.8, 0.9, 0.9), CABINET, MaterialKind.OPAQUE),
        ("Glass", (0.4, 0.9, 0.3), (0.8, 0.9, 0.9), CABINET, MaterialKind.OPAQUE),
        ("Glass", (0.4, 0.9, 0.005), (0.05, 0.05, 0.05), OTHERFURNITURE, MaterialKind.OPAQUE),
        ("Glass", (0.4, 0.9, 0.005), (0.8, 0.9, 0.9), TELEVISION, MaterialKind.OPAQUE),
        ("Wood", (0.4, 0.9, 0.005), (0.8, 0.9, 0.9), CABINET, MaterialKind.OPAQUE),
    ],
)
def test_a_pane_of_a_piece_is_clear_and_other_glass_stays(
    name: str,
    size: tuple[float, float, float],
    diffuse: tuple[float, float, float],
    nyu40: int,
    kind: MaterialKind,
) -> None:
    home = with_item((board(name, size, (0, 0, 0)), board("side", (0.4, 0.1, 0.3), (0, -0.5, 0))), nyu40=nyu40)  # fmt: skip
    materials = list(home.materials)
    materials[-2] = replace(materials[-2], diffuse=diffuse)
    house = with_clear_panes(replace(home, materials=tuple(materials)))
    item = next(i for i in house.items if i.id == "glass")
    assert [house.materials[s.material].kind for s in item.surfaces] == [kind, MaterialKind.OPAQUE]
    assert item.nyu40 == nyu40
