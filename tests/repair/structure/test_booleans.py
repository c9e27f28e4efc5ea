"""manifold3d gets closed meshes only: an open one could kill the process."""

from __future__ import annotations

import manifold3d
import numpy as np
import pytest

from pbrs_farm.core.house import Enclosure, Item, ItemKind
from pbrs_farm.core.recipe import RepairFields
from pbrs_farm.geometry.plan_surfaces import horizontal
from pbrs_farm.geometry.solids import quads_surface
from pbrs_farm.repair import repair
from pbrs_farm.repair.structure.booleans import Patch, Tag, TagTable, solid_from_patches
from tests.repair.embree import EmbreeOccluder
from tests.repair.shells import unpaired_edges
from tests.repair.wall_rooms import FLOOR, HEIGHT_M, WALL, covers, house, room

SEEDS_THAT_KILLED = (132, 142, 152, 168, 170, 186)


def _fan(n: int, seed: int) -> Patch:
    """n corners round the origin at random angles and distances; all triangles share the first."""
    rng = np.random.default_rng(seed)
    angle, distance = np.sort(rng.uniform(0, 2 * np.pi, n)), rng.uniform(1, 4, n)
    plan = np.stack([distance * np.cos(angle), distance * np.sin(angle)], 1).astype(np.float32)
    points = np.stack([plan[:, 0], 0 * plan[:, 0], plan[:, 1]], 1).astype(np.float64)
    faces = np.asarray(manifold3d.triangulate([plan.astype(np.float64)]), np.int64)
    return Patch(Tag(0, "fan", 0), points, faces, points[:, [0, 2]], np.zeros_like(points))


@pytest.fixture
def no_open_mesh(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fail if manifold3d gets an edge without its reverse."""
    real = manifold3d.Mesh64

    def watched(vertices, faces, **more):  # type: ignore[no-untyped-def]
        place = np.arange(len(vertices))
        place[more["merge_from_vert"].astype(np.int64)] = more["merge_to_vert"]
        f = place[faces.astype(np.int64)]
        edges = [tuple(e) for k in range(3) for e in f[:, [k, (k + 1) % 3]].tolist()]
        assert sorted(edges) == sorted((b, a) for a, b in edges), "an open mesh"
        return real(vertices, faces, **more)

    monkeypatch.setattr(manifold3d, "Mesh64", watched)


@pytest.mark.parametrize("n", [3, 4, 5, 6, 7, 8, 9])
@pytest.mark.parametrize("seed", SEEDS_THAT_KILLED)
def test_a_flat_fan_is_no_solid_and_never_reaches_the_library(
    n: int, seed: int, no_open_mesh: None
) -> None:
    assert solid_from_patches([_fan(n, seed)], TagTable()) is None


@pytest.mark.quick(2)
@pytest.mark.parametrize("seed", SEEDS_THAT_KILLED)
def test_a_room_of_seven_corners_under_flat_sheets_is_repaired(
    seed: int, no_open_mesh: None
) -> None:
    plan = _fan(7, seed).positions[:, [0, 2]]
    r = room("0_0", (0.0, 0.0, 1.0, 1.0))
    r = type(r)(r.id, r.name, r.level_id, plan, r.floor_y, r.ceiling_y)
    walls = []
    for k, (a, b) in enumerate(zip(plan, np.roll(plan, -1, 0), strict=True)):
        quad = np.array([[a[0], 0, a[1]], [b[0], 0, b[1]], [b[0], HEIGHT_M, b[1]], [a[0], HEIGHT_M, a[1]]])  # fmt: skip
        sheet = quads_surface("plane", quad[None], WALL)
        walls.append(Item(f"p{k}", f"p{k}", ItemKind.WALL, "0", (sheet,), nyu40=1))
    # A rug of five triangles: furniture is measured as solids, too.
    rug = Item("rug", "rug", ItemKind.OBJECT, "0", (horizontal("rug", [[plan * 0.5]], 0.01, FLOOR, up=True),))  # fmt: skip
    mat = Item("mat", "mat", ItemKind.OBJECT, "0", rug.surfaces)
    items = [*walls, *covers(r), rug, mat]
    after, report = repair(house(items, [r]), RepairFields(), occluder_from=EmbreeOccluder)
    assert after.rooms[0].enclosure is Enclosure.CLOSED
    assert len(unpaired_edges(after)) == 0
    assert report.leaks is not None
    assert report.leaks.n_sky == 0
