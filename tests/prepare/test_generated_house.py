"""A generated home as a House without an intermediate file equals that of its file."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pbrs_farm.core.catalogue import EMPTY, Catalogue, Piece, Place, Shape
from pbrs_farm.core.house import House, ItemKind, Material, Surface
from pbrs_farm.core.made_home import MadeHome
from pbrs_farm.core.recipe import ReadFields
from pbrs_farm.formats.house_bundle import bundle_from_house
from pbrs_farm.furnishings.things.families import with_families
from pbrs_farm.generate.drawn_plan import drawn_plan
from pbrs_farm.generate.floor_plan import PlacedPiece, Storey
from pbrs_farm.generate.generated_home import generate_home
from pbrs_farm.generate.home_file import HomeContents, home_contents
from pbrs_farm.prepare.generated_house import house_of_contents
from pbrs_farm.read.sweethome3d.home import read_home

FIELDS = ReadFields()


def both_ways(contents: HomeContents, fields: ReadFields = FIELDS) -> tuple[House, House]:
    """The house built directly, and from its file, under one digest."""
    filed = read_home(contents.archive(), "home.sh3d", fields=fields)
    direct = house_of_contents(contents, "home.sh3d", filed.source.sha256, fields)
    return direct, filed


@pytest.mark.long
@pytest.mark.parametrize("seed", [1, 4])
def test_it_is_the_house_of_its_file_bit_by_bit(seed: int) -> None:
    direct, filed = both_ways(generate_home(MadeHome(seed), with_families(EMPTY)).contents)
    assert sum(item.n_faces for item in filed.items) > 10_000
    assert bundle_from_house(direct) == bundle_from_house(filed)


def with_one_piece(surface: Surface) -> HomeContents:
    shape = Shape((surface,), (Material("lacquer"),))
    piece = Piece("test#box", "Box", "table", Place.FLOOR, 7, (1.0, 1.0, 1.0), ItemKind.OBJECT)
    plan = drawn_plan(np.random.default_rng(1))
    x0, z0, x1, z1 = plan.rooms[0].bounds
    placed = PlacedPiece(piece, (x0 + x1) / 2, (z0 + z1) / 2, 0.0, 0.0, 1.0, 1.0, 1.0, 0)
    catalogue = Catalogue((piece,), lambda _piece: shape, "test")
    return home_contents([Storey(plan, (placed,))], catalogue, np.random.default_rng(1))


def random_surface(dtype: type[np.floating]) -> Surface:
    """Triangles at coordinates of every size, with ties of rounding among them."""
    rng = np.random.default_rng(0)
    n = 300
    size = 10.0 ** rng.uniform(-9, 4.9, (n, 2))
    uvs = (size * rng.choice([-1, 1], (n, 2))).astype(dtype)
    uvs[:6] = [[0, -0.0], [0.5, 99999.5], [9.99995, 0.1], [1.00005, 3.05e-5], [1, -1], [2.5, 1e-3]]
    positions = rng.uniform(-1, 1, (n, 3)).astype(dtype)
    positions[:4] = np.array([[0.5, 1, 0], [2**-17, 0, 1], [3 * 2**-17, 1, 1], [-0.0, 0, 0]], dtype)
    normals = rng.normal(size=(n, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    faces = rng.permutation(n).reshape(-1, 3).astype(np.int32)
    return Surface("random", positions, faces, 0, uvs, normals.astype(dtype))


@pytest.mark.quick(1)
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("left_out", ["", "uvs", "normals", "both"])
def test_numbers_are_those_that_a_file_would_hold(dtype: type[np.floating], left_out: str) -> None:
    surface = random_surface(dtype)
    if left_out in ("uvs", "both"):
        surface = replace(surface, uvs=None)
    if left_out in ("normals", "both"):
        surface = replace(surface, normals=None)
    direct, filed = both_ways(with_one_piece(surface))
    assert any(item.name == "Box" for item in filed.items)
    assert bundle_from_house(direct) == bundle_from_house(filed)


@pytest.mark.long
def test_a_model_of_too_many_triangles_is_refused_as_from_a_file() -> None:
    contents = with_one_piece(random_surface(np.float32))
    fields = ReadFields(max_model_triangles=99)
    messages = []
    for read in (
        lambda: read_home(contents.archive(), "home.sh3d", fields=fields),
        lambda: house_of_contents(contents, "home.sh3d", "", fields),
    ):
        with pytest.raises(Exception, match="at most 99") as refused:
            read()
        messages.append(str(refused.value))
    assert messages[0] == messages[1]
