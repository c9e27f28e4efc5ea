"""Items on walls: place, shape, and dependence on the seed."""

from __future__ import annotations

from collections import Counter
from functools import cache
from itertools import pairwise

import numpy as np
import pytest

from benchmarks.homes.variety import effective
from pbrs_farm.core.catalogue import EMPTY, PRINTS, Catalogue, Picture
from pbrs_farm.core.classes import (
    CLOTHES,
    MIRROR,
    OTHERFURNITURE,
    OTHERPROP,
    PICTURE,
    SHELVES,
    WHITEBOARD,
)
from pbrs_farm.core.house import Item, ItemKind, Material, MaterialKind, Texture
from pbrs_farm.core.mesh import signed_volume, triangle_corners
from pbrs_farm.dress.mutable_house import MutableHouse
from pbrs_farm.dress.space import HouseSpace, WallFace, house_space
from pbrs_farm.dress.style import Style, style_for
from pbrs_farm.dress.walls import furnish_walls, hung_things
from pbrs_farm.dress.walls.hung_things import CLOCK_RIMS
from pbrs_farm.dress.walls.pictures import Gallery
from pbrs_farm.furnishings.prints import FAMILIES, palette_of, print_pixels
from pbrs_farm.furnishings.things.hung import round_mirror
from pbrs_farm.images import decode_photo, jpeg_from_array
from pbrs_farm.read.builtin.builtin_home import builtin_home

_HUNG = (PICTURE, MIRROR, SHELVES, CLOTHES, WHITEBOARD, OTHERFURNITURE, OTHERPROP)


def _style(seed: int = 1) -> Style:
    return style_for(np.random.default_rng(seed))


def _dressed(seed: int, share: float = 1.0, catalogue: Catalogue = EMPTY) -> MutableHouse:
    mutable = MutableHouse(builtin_home(), seed)
    furnish_walls(mutable, catalogue, _style(seed), share)
    return mutable


_SEEN = cache(_dressed)  # for tests that only look


def _added(mutable: MutableHouse) -> list[Item]:
    return mutable.items[len(mutable.source.items) :]


def _face_of(item: Item, space: HouseSpace) -> WallFace:
    """The face nearest to the item's back, of those that its back faces."""
    points = np.concatenate([s.positions for s in item.surfaces]).astype(np.float64)
    faces = [f for r in space.rooms if r.room.id == item.room_id for f in r.faces]
    return min(faces, key=lambda f: abs(float(f.out_of(points).min())))


@pytest.mark.quick(2)
@pytest.mark.parametrize("seed", range(1, 6))
def test_items_hang_within_a_millimetre_of_the_wall(seed: int) -> None:
    mutable = _SEEN(seed)
    space = house_space(MutableHouse(builtin_home(), 1))
    assert _added(mutable)
    for item in _added(mutable):
        points = np.concatenate([s.positions for s in item.surfaces]).astype(np.float64)
        out = _face_of(item, space).out_of(points)
        assert 0.0005 <= out.min() <= 0.001, item.name


@pytest.mark.quick(2)
@pytest.mark.parametrize("seed", range(1, 6))
def test_nothing_hangs_over_an_opening_or_above_the_ceiling(seed: int) -> None:
    mutable = _SEEN(seed)
    space = house_space(MutableHouse(builtin_home(), 1))
    for item in _added(mutable):
        low, high = item.bounds
        assert low[1] > 0.0
        assert high[1] < 2.5
        for hole in space.passages:
            box = [hole.centre - 0.3 * hole.normal, hole.centre + 0.3 * hole.normal]
            box += [hole.centre - hole.along * hole.width / 2, hole.centre + hole.along * hole.width / 2]  # fmt: skip
            a, b = np.min(box, 0), np.max(box, 0)
            a[1], b[1] = hole.bottom_y, hole.top_y
            assert (low >= b).any() or (high <= a).any(), (item.name, hole.id)


@pytest.mark.quick(2)
@pytest.mark.parametrize("seed", range(1, 6))
def test_wall_items_keep_clear_of_furniture_and_of_each_other(seed: int) -> None:
    mutable = _SEEN(seed)
    space = house_space(mutable)
    added = range(len(mutable.source.items), len(mutable.items))
    for n in added:
        low, high = space.bounds[n]
        for m, neighbour in enumerate(mutable.items):
            if m != n and len(space.points[m]) and neighbour.kind is not ItemKind.DOOR:
                inside = ((space.points[m] > low) & (space.points[m] < high)).all(1)
                assert not inside.any(), (mutable.items[n].name, neighbour.name)


def test_a_home_gets_pictures_and_every_item_has_class_source_and_seed() -> None:
    mutable = _dressed(3)
    classes = [i.nyu40 for i in _added(mutable)]
    assert classes.count(PICTURE) >= 2
    for item in _added(mutable):
        assert item.nyu40 in _HUNG
        assert item.tags[:2] == (f"dressed:{item.source_class}", "seed:3")
        assert item.room_id in ("0_0", "0_1")
    ids = [i.id for i in _added(mutable)]
    assert len(set(ids)) == len(ids)


def test_a_seed_decides_every_bit() -> None:
    a, b, c = _dressed(4), _dressed(4), _dressed(5)
    assert [i.id for i in a.items] == [i.id for i in b.items]
    assert a.textures.keys() == b.textures.keys()
    for x, y in zip(_added(a), _added(b), strict=True):
        for s, t in zip(x.surfaces, y.surfaces, strict=True):
            assert np.array_equal(s.positions, t.positions)
    assert a.textures.keys() != c.textures.keys()


def test_a_share_of_zero_hangs_nothing() -> None:
    assert not _added(_dressed(1, 0.0))


@pytest.mark.parametrize("family", FAMILIES)
def test_every_family_of_prints_shows_something(family: str) -> None:
    rng = np.random.default_rng(7)
    picture = FAMILIES[family](rng, (120, 160), palette_of(rng, _style()))
    assert picture.shape == (160, 120, 3)
    assert np.isfinite(picture).all()
    assert picture.std() > 0.02


def test_prints_have_the_requested_shape() -> None:
    pixels, _family = print_pixels(np.random.default_rng(1), 0.7, _style())
    assert pixels.dtype == np.uint8
    assert pixels.shape[1] / pixels.shape[0] == pytest.approx(0.7, abs=0.01)


def test_pictures_hang_in_many_frames() -> None:
    texture = hung_things.jpeg_texture("t", np.zeros((8, 8, 3), np.uint8))
    counts: Counter[str] = Counter()
    for seed in range(150):
        rng = np.random.default_rng(seed)
        style = style_for(rng)
        frame = hung_things.frame_material(rng, style)
        piece, shape = hung_things.framed(rng, style, 0.5, 0.7, texture, frame)
        assert shape.bounds[0, 2] == pytest.approx(0, abs=1e-9)
        assert piece.size[0] == pytest.approx(0.5)
        counts[str(sorted(len(s.faces) for s in shape.surfaces))] += 1
    assert effective(counts) > 12


@pytest.mark.parametrize("depth_m", [0.018, 0.032])
def test_a_print_is_before_its_back_in_any_frame_and_mount(
    depth_m: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    texture = hung_things.jpeg_texture("t", np.zeros((8, 8, 3), np.uint8))
    monkeypatch.setattr(hung_things, "moulding_size", lambda _rng, _short: (0.03, depth_m))
    for seed in range(200):
        rng = np.random.default_rng(seed)
        _piece, shape = hung_things.framed(rng, _style(), 0.5, 0.7, texture, Material("frame"))
        assert shape.bounds[0, 2] == 0.0
        for face, back in pairwise(shape.surfaces):
            if back.name == f"{face.name} back":
                depths = back.positions[:, 2]
                assert face.positions[:, 2].min() == depths.max() > depths.min() + 0.0009


def test_a_framed_print_shows_its_picture_upright_and_its_faces_outward() -> None:
    texture = hung_things.jpeg_texture("t", np.zeros((8, 8, 3), np.uint8))
    rng = np.random.default_rng(2)
    piece, shape = hung_things.framed(rng, _style(), 0.5, 0.7, texture, Material("frame"))
    assert piece.size[0] == pytest.approx(0.5)
    assert piece.size[2] == pytest.approx(0.7)
    shown = next(s for s in shape.surfaces if shape.materials[s.material].texture_id)
    top = shown.positions[:, 1] == shown.positions[:, 1].max()
    right = shown.positions[:, 0] == shown.positions[:, 0].max()
    assert shown.uvs is not None
    assert (shown.uvs[top, 1] == 1).all()
    assert (shown.uvs[right, 0] == 1).all()
    assert shape.bounds[0, 2] == 0.0
    for surface in shape.surfaces:
        if surface.name == "frame":
            assert (
                signed_volume(triangle_corners(surface.positions, surface.faces), np.zeros(3)) > 0
            )


def test_a_round_item_faces_away_from_the_wall() -> None:
    dial = hung_things.jpeg_texture("t", np.zeros((8, 8, 3), np.uint8))
    for _piece, shape in (
        *(hung_things.clock(0.3, dial, Material("rim"), k) for k in range(len(CLOCK_RIMS))),
        round_mirror.make(np.random.default_rng(1), _style(), 0.5, Material("rim")),
    ):
        front = shape.surfaces[1]
        assert front.normals is not None
        assert front.normals[:, 2].min() > 0.99
        assert shape.bounds[0, 1] == pytest.approx(0, abs=1e-6)
        assert shape.bounds[0, 2] == pytest.approx(0, abs=1e-6)


def test_a_mirror_is_a_mirror() -> None:
    _piece, shape = hung_things.mirror(np.random.default_rng(1), 0.5, 0.8, None)
    assert any(m.kind is MaterialKind.MIRROR for m in shape.materials)


def _photograph(width: int, height: int) -> Picture:
    pixels = np.zeros((height, width, 3), np.uint8)
    pixels[..., 0] = 200
    data = jpeg_from_array(pixels, 95)
    return Picture(
        Texture("own", "own.jpg", "image/jpeg", data), PRINTS, (0.6, 0.6 * height / width)
    )


def test_the_users_photographs_hang_before_drawn_prints() -> None:
    photographs = Catalogue((), lambda _piece: None, "own", pictures=(_photograph(90, 60),))
    mutable = _dressed(2, catalogue=photographs)
    names = [t.name for t in mutable.textures.values() if t.name.startswith("print")]
    assert names.count("print photograph.jpg") == 1
    # The other prints are drawn, as without photographs.
    assert len(names) > 1


def test_a_photograph_fills_its_frame_and_is_not_stretched() -> None:
    gallery = Gallery(MutableHouse(builtin_home(), 1), Catalogue((), lambda _p: None, "own", pictures=(_photograph(90, 60),)), _style())  # fmt: skip
    shown = gallery.print_for(0.5)
    pixels = decode_photo(shown.texture.data, "print")
    assert pixels.shape[:2] == (60, 30)
