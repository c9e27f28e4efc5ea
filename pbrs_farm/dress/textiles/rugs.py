"""Lays rugs under sofas, beds and tables, mats before doors and in bathrooms; no effects."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import shapely
from scipy import ndimage
from shapely.geometry.base import BaseGeometry

from pbrs_farm.core.arrays import F32, F64, Srgb8Image
from pbrs_farm.core.catalogue import Place
from pbrs_farm.core.classes import BATHTUB, BED, FLOOR_MAT, SINK, SOFA, TABLE
from pbrs_farm.core.house import Item, ItemKind, Material
from pbrs_farm.dress.draft import Draft
from pbrs_farm.dress.space import HouseSpace, RoomSpace, house_space
from pbrs_farm.dress.style import Rgb, Style, mix, room_style, shade
from pbrs_farm.dress.things.assembly import Made, hung, plain
from pbrs_farm.dress.walls.hanging import next_id
from pbrs_farm.dress.walls.hung_things import faced_slab, jpeg_texture
from pbrs_farm.home.room_use import RoomKind

# Pictures of rugs and mats by a seed: bordered, striped, lattice, diamonds, shag, plain.
# Every family is a function (rng, size, inks) -> (H, W, 3) float32, sRGB-encoded, 0..1.


Size = tuple[int, int]  # width and height in pixels
Inks = tuple[Rgb, ...]  # ground first
Family = Callable[[np.random.Generator, Size, Inks], F32]

_PX_PER_M = 190.0


def rug_pixels(
    rng: np.random.Generator, width_m: float, length_m: float, style: Style, family: str = ""
) -> Srgb8Image:
    """(H, W, 3) uint8 of a rug so large, its length across the picture."""
    size = max(int(length_m * _PX_PER_M), 48), max(int(width_m * _PX_PER_M), 48)
    name = family or str(rng.choice(list(FAMILIES)))
    picture = FAMILIES[name](rng, size, inks_of(rng, style))
    # Yarn is never dyed evenly, and knots show.
    pile = rng.standard_normal(picture.shape[:2], np.float32)
    tone = 1 + 0.05 * pile + 0.12 * ndimage.gaussian_filter(pile, 5.0, mode="wrap")
    if name != "shag":
        tone *= 1 + 0.03 * np.sin(np.arange(size[1]) * np.pi / 1.5)[:, None]
    return np.asarray(np.clip(picture * tone[..., None], 0.02, 0.95) * 255 + 0.5, np.uint8)


def inks_of(rng: np.random.Generator, style: Style) -> Inks:
    """A ground and four inks of the style, or wool as the sheep wear it."""
    if rng.random() < 0.25:
        wool: Rgb = (0.84, 0.8, 0.72)
        return (wool, (0.25, 0.22, 0.2), (0.55, 0.48, 0.4), (0.7, 0.65, 0.57), (0.4, 0.34, 0.28))
    own = [*style.textiles, style.accent]
    own = [own[int(k)] for k in rng.permutation(len(own))]
    ground = mix(own[0], (0.85, 0.81, 0.74), float(rng.uniform(0, 0.6)))
    return (ground, *own[1:4], shade(own[4 % len(own)], 0.7))


def _coordinates(size: Size) -> tuple[F32, F32]:
    # Metres from the middle.
    x = (np.arange(size[0]) + 0.5 - size[0] / 2) / _PX_PER_M
    y = (np.arange(size[1]) + 0.5 - size[1] / 2) / _PX_PER_M
    u, v = np.meshgrid(x, y)
    return u.astype(np.float32), v.astype(np.float32)


def _filled(size: Size, colour: Rgb) -> F32:
    return np.broadcast_to(np.array(colour, np.float32), (size[1], size[0], 3)).copy()


def _to_edge(u: F32, v: F32) -> F32:
    # Metres to the nearest edge.
    half_u, half_v = float(u.max()), float(v.max())
    return np.asarray(np.minimum(half_u - np.abs(u), half_v - np.abs(v)), np.float32)


def _bordered(rng: np.random.Generator, size: Size, inks: Inks) -> F32:
    """Borders within borders round a field of small figures and a medallion."""
    u, v = _coordinates(size)
    edge, picture = _to_edge(u, v), _filled(size, inks[1])
    step = float(rng.uniform(0.07, 0.1))
    figures = np.sin(2 * np.pi * u / step) * np.sin(2 * np.pi * v / step)
    picture[figures > 0.55] = inks[2]
    picture[figures < -0.75] = inks[0]
    # Lay a medallion in the middle.
    radius = 0.42 * float(v.max()) * 2
    star = np.hypot(u * 0.72, v) * (1 + 0.12 * np.cos(8 * np.arctan2(v, u * 0.72)))
    for k, part in enumerate((0.62, 0.54, 0.36, 0.3, 0.12)):
        picture[star < part * radius] = inks[(k * 2 + 4) % 5]
    for k, (low, high) in enumerate(
        ((0.0, 0.03), (0.03, 0.06), (0.06, 0.2), (0.2, 0.225), (0.225, 0.26))
    ):
        band = (edge >= low) & (edge < high)
        picture[band] = inks[(4, 0, 2, 0, 4)[k]]
        if k == 2:
            run = np.where(np.abs(u) > np.abs(v) * float(u.max() / v.max()), v, u)
            leaf = np.abs(np.sin(2 * np.pi * run / 0.14)) * 0.06 > np.abs(edge - 0.13)
            picture[band & leaf] = inks[3]
    return picture


def _striped(rng: np.random.Generator, size: Size, inks: Inks) -> F32:
    """Stripes of uneven width across the rug."""
    u, _v = _coordinates(size)
    cuts = np.sort(rng.uniform(float(u.min()), float(u.max()), int(rng.integers(6, 16))))
    colours = np.array(inks, np.float32)[rng.integers(0, 5, len(cuts) + 1)]
    return np.asarray(colours[np.searchsorted(cuts, u)], np.float32)


def _lattice(rng: np.random.Generator, size: Size, inks: Inks) -> F32:
    """Dark lines crossing as lozenges on a light ground."""
    u, v = _coordinates(size)
    wide, high = float(rng.uniform(0.28, 0.45)), float(rng.uniform(0.28, 0.6))
    picture = _filled(size, mix(inks[0], (0.86, 0.83, 0.76), 0.6))
    wobble = 0.012 * np.sin(11 * v + 7 * u)
    a, b = (u + wobble) / wide + v / high, (u + wobble) / wide - v / high
    line = np.minimum(np.abs(a - np.round(a)), np.abs(b - np.round(b)))
    picture[line < 0.04] = shade(inks[1], 0.55)
    return picture


def _diamonds(rng: np.random.Generator, size: Size, inks: Inks) -> F32:
    """Rows of diamonds in several colours, woven in steps."""
    u, v = _coordinates(size)
    pitch = float(rng.uniform(0.22, 0.4))
    snap = 0.018
    # Snap coordinates to 18 mm, so that oblique lines climb in steps.
    u, v = np.floor(u / snap) * snap, np.floor(v / snap) * snap
    column, row = np.round(u / pitch), np.round(v / (1.3 * pitch))
    # The L1 distance to the nearest diamond's middle; bands of it take turns in three colours.
    ring = np.abs(u / pitch - column) + np.abs(v / (1.3 * pitch) - row)
    picture = _filled(size, inks[0])
    pick = (column + 2 * row).astype(int) % 3 + 1
    for k, (low, high) in enumerate(((0.0, 0.13), (0.2, 0.34), (0.34, 0.42))):
        band = (ring >= low) & (ring < high)
        picture[band] = np.array(inks, np.float32)[(pick[band] + k) % 5]
    edge = _to_edge(u.astype(np.float32), v.astype(np.float32))
    picture[edge < 0.07] = inks[4]
    picture[(edge > 0.03) & (edge < 0.045)] = inks[0]
    return picture


def _shag(rng: np.random.Generator, size: Size, inks: Inks) -> F32:
    """Long pile in one colour: tufts with dark between."""
    tuft = ndimage.gaussian_filter(rng.standard_normal((size[1], size[0])), 1.2, mode="wrap")
    lie = ndimage.gaussian_filter(rng.standard_normal((size[1], size[0])), 14.0, mode="wrap")
    tone = 0.9 + 0.07 * tuft / tuft.std() + 0.05 * lie / lie.std()
    return np.asarray(_filled(size, inks[0]) * tone[..., None], np.float32)


def _plain(rng: np.random.Generator, size: Size, inks: Inks) -> F32:
    """One colour with a bound edge, or a wide border."""
    u, v = _coordinates(size)
    picture, edge = _filled(size, inks[0]), _to_edge(u, v)
    picture[edge < (0.03 if rng.random() < 0.6 else 0.16)] = inks[1]
    return picture


def _blocks(rng: np.random.Generator, size: Size, inks: Inks) -> F32:
    """Large areas of colour with round corners: a modern rug."""
    u, v = _coordinates(size)
    picture = _filled(size, inks[0])
    for k in range(4):
        x, y = float(rng.uniform(u.min(), u.max())), float(rng.uniform(v.min(), v.max()))
        a, b = float(rng.uniform(0.3, 0.8)), float(rng.uniform(0.25, 0.6))
        inside = (np.abs(u - x) / a) ** 3 + (np.abs(v - y) / b) ** 3 < 1
        picture[inside] = inks[1 + k % 4]
    return picture


FAMILIES: dict[str, Family] = {
    "bordered": _bordered, "striped": _striped, "lattice": _lattice, "diamonds": _diamonds,
    "shag": _shag, "plain": _plain, "blocks": _blocks,
}  # fmt: skip


# Lays rugs under sofas, beds and tables, mats before doors and in bathrooms.


PART = "textiles"
RUG_TAG = "rug"
_FROM_WALL_M = 0.3
_GAP_M = 0.0005  # between the floor and the rug's back
_SIZES = ((1.6, 2.3), (1.7, 2.4), (2.0, 3.0), (2.0, 2.9), (1.4, 2.0), (1.2, 1.7))
# Turns a slab that hangs to one that lies, its picture up.
_LYING = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]], np.float32)


def rug(
    rng: np.random.Generator, width: float, length: float, style: Style, family: str = ""
) -> Made:
    """A rug with its length along x, lying with its back at y = 0."""
    thick = float(rng.uniform(0.008, 0.0095))
    pixels = rug_pixels(rng, width, length, style, family)
    texture = jpeg_texture(f"rug {family or 'any'}", pixels)
    low, high = np.array([-length / 2, -width / 2]), np.array([length / 2, width / 2])
    face, back = faced_slab("rug", low, high, (0.0, thick))
    shown = Material(f"rug {texture.id[:8]}", texture_id=texture.id, roughness=1.0)
    # The back and the edge take the mean colour of the face.
    r, g, b = (round(float(c) / 255, 2) for c in pixels.reshape(-1, 3).mean(0))
    parts = [(face, shown), (back, plain("rug edge", (r, g, b), 1.0))]
    # Slabs stand upright like what hangs on walls: lay it down.
    lying = [(replace(s, positions=s.positions @ _LYING.T), m) for s, m in parts]
    return hung("rug", "rug", FLOOR_MAT, lying, [texture], Place.FLOOR)


def lay_rugs(
    draft: Draft, room_id: str, style: Style, rng: np.random.Generator, share: float
) -> None:
    """The rugs and mats of one room."""
    space = house_space(draft)
    room = space.room(room_id)
    lay = {
        RoomKind.LIVING: _by_sofa, RoomKind.BEDROOM: _by_bed, RoomKind.DINING: _by_table,
        RoomKind.BATHROOM: _bath_mat, RoomKind.HALL: _runner, RoomKind.OTHER: _by_sofa,
    }.get(room.kind)  # fmt: skip
    likely = {RoomKind.DINING: 0.45, RoomKind.HALL: 0.6}.get(room.kind, 0.8)
    if lay is not None and rng.random() < likely * share:
        lay(draft, space, room, style, rng)
    if rng.random() < 0.8 * share:
        _doormats(draft, space, room, style, rng)


def _by_sofa(
    draft: Draft, space: HouseSpace, room: RoomSpace, style: Style, rng: np.random.Generator
) -> None:
    sofas = _things(draft, room, SOFA)
    if not sofas:
        if room.kind is RoomKind.LIVING:
            _by_table(draft, space, room, style, rng)
        return
    box = max((draft.items[n].oriented_box for n in sofas), key=lambda b: float(b.half[0]))
    front = box.axes[:, 2] * [1, 0, 1]
    # In front of the sofa, its feet on the rug; round the table that stands there.
    middle = box.centre + front * (float(box.half[2]) + 0.65)
    tables = [
        draft.items[n].oriented_box.centre
        for n in _things(draft, room, TABLE)
        if np.linalg.norm((draft.items[n].oriented_box.centre - middle)[[0, 2]]) < 1.0
    ]
    if tables:
        middle = np.mean([middle, *tables[:1]], axis=0)
    turn = float(np.arctan2(front[0], front[2]))
    _lay_largest(draft, space, room, style, rng, middle, turn, _shuffled(rng))


def _by_bed(
    draft: Draft, space: HouseSpace, room: RoomSpace, style: Style, rng: np.random.Generator
) -> None:
    beds = _things(draft, room, BED)
    if not beds:
        return
    box = max((draft.items[n].oriented_box for n in beds), key=lambda b: float(b.half[0]))
    front, right = box.axes[:, 2] * [1, 0, 1], box.axes[:, 0] * [1, 0, 1]
    half = box.half
    turn = float(np.arctan2(front[0], front[2]))
    # Across the bed under its foot, else a runner along a side or at the foot.
    if half[0] > 0.6 and rng.random() < 0.65:
        wide = 2 * float(half[0]) + float(rng.uniform(0.7, 1.1))
        at = box.centre + front * float(half[2]) * 0.45
        narrow = 2 * float(half[0]) + 0.3
        sizes = [(w, min(long, 3.0)) for long in (wide, narrow) for w in (2.0, 1.7, 1.4)]
        if _lay_largest(draft, space, room, style, rng, at, turn, sizes, from_wall=0.1):
            return
    for sign in (1.0, -1.0):
        at = box.centre + right * sign * (float(half[0]) + 0.42)
        if _lay_largest(draft, space, room, style, rng, at, turn + np.pi / 2, [(0.7, 1.5), (0.6, 1.1)], from_wall=0.05):  # fmt: skip
            return
    at = box.centre + front * (float(half[2]) + 0.45)
    _lay_largest(draft, space, room, style, rng, at, turn, [(0.7, 1.4), (0.6, 1.0)], from_wall=0.1)


def _by_table(
    draft: Draft, space: HouseSpace, room: RoomSpace, style: Style, rng: np.random.Generator
) -> None:
    boxes = [draft.items[n].oriented_box for n in _things(draft, room, TABLE)]
    large = [b for b in boxes if min(b.half[0], b.half[2]) > 0.35]
    if not large:
        return
    box = max(large, key=lambda b: float(b.half[0] * b.half[2]))
    # The rug lies along the table's longer side, and 0.35 to 0.6 m out for chairs.
    axis = 0 if box.half[0] >= box.half[2] else 2
    along = box.axes[:, axis]
    turn = float(np.arctan2(-along[2], along[0]))
    sizes = [
        (2 * float(box.half[2 - axis]) + more, 2 * float(box.half[axis]) + more)
        for more in (1.2, 1.0, 0.7)
    ]
    _lay_largest(draft, space, room, style, rng, box.centre, turn, sizes, from_wall=0.2)


def _bath_mat(
    draft: Draft, space: HouseSpace, room: RoomSpace, style: Style, rng: np.random.Generator
) -> None:
    for wanted in (BATHTUB, SINK):
        for number in _things(draft, room, wanted):
            box = draft.items[number].oriented_box
            for axis, sign in ((2, 1.0), (0, 1.0), (0, -1.0)):
                out = box.axes[:, axis] * sign * [1, 0, 1]
                at = box.centre + out * (float(box.half[axis]) + 0.3)
                turn = float(np.arctan2(out[0], out[2]))
                if _lay_largest(
                    draft, space, room, style, rng, at, turn, [(0.5, 0.8), (0.45, 0.65)],
                    from_wall=0.02, family="shag", bare=True,
                ):  # fmt: skip
                    return


def _runner(
    draft: Draft, space: HouseSpace, room: RoomSpace, style: Style, rng: np.random.Generator
) -> None:
    inner = room.area.representative_point()
    x, z = float(inner.x), float(inner.y)
    x0, z0, x1, z1 = room.area.bounds
    turn = 0.0 if x1 - x0 >= z1 - z0 else np.pi / 2
    sizes = [(0.8, 2.6), (0.8, 2.0), (0.7, 1.5), (0.6, 1.0)]
    _lay_largest(draft, space, room, style, rng, np.array([x, 0.0, z]), turn, sizes, from_wall=0.12)


def _doormats(
    draft: Draft, space: HouseSpace, room: RoomSpace, style: Style, rng: np.random.Generator
) -> None:
    # Inside every door that leads out of the home.
    for door in room.doors:
        side = door.side_of(room.room.id)
        if side is None or None not in door.room_ids or door.width > 1.4:
            continue
        at = door.face_point(side) + door.inward(side) * 0.38
        out = door.inward(side)
        turn = float(np.arctan2(out[0], out[2]))
        _lay_largest(
            draft, house_space(draft), room, style, rng, at, turn, [(0.45, 0.75), (0.4, 0.6)],
            from_wall=0.05, family="plain", bare=True, at_doors=True,
        )  # fmt: skip


def _things(draft: Draft, room: RoomSpace, nyu40: int) -> list[int]:
    # Toys of the class stand on tables; furniture stands on the floor.
    floor = room.room.floor_y
    return [
        n
        for n in room.items
        if draft.items[n].nyu40 == nyu40 and draft.items[n].bounds[0, 1] < floor + 0.3
    ]


def _shuffled(rng: np.random.Generator) -> list[tuple[float, float]]:
    # A size drawn among the large ones, smaller ones after it.
    first = int(rng.integers(0, 4))
    return [_SIZES[first], *_SIZES[first + 1 :], _SIZES[1], *_SIZES[4:]]


def _lay_largest(
    draft: Draft, space: HouseSpace, room: RoomSpace, style: Style, rng: np.random.Generator,
    middle: F64, turn: float, sizes: list[tuple[float, float]], *, from_wall: float = _FROM_WALL_M,
    family: str = "", bare: bool = False, at_doors: bool = False,
) -> bool:  # fmt: skip
    """Lay the first size (width, length) that fits near the place; length goes across `turn`'s front.

    bare: nothing may stand on it. at_doors: it may lie where a door swings.
    """
    free = shapely.buffer(shapely.difference(room.area, room.walls), -from_wall, join_style="mitre")
    taken = _floor_mats(draft, space, room)
    if not at_doors:
        swings = [d.swing(s) for d in room.doors if (s := d.side_of(room.room.id)) is not None]
        taken = shapely.union_all([taken, *swings])
    for width, length in sizes:
        for shift in (
            (0.0, 0.0),
            (0.15, 0.0),
            (-0.15, 0.0),
            (0.3, 0.0),
            (-0.3, 0.0),
            (0.0, 0.15),
            (0.0, -0.15),
        ):
            at = middle + _offset(turn, shift)
            area = _rectangle(at, turn, width, length)
            if not shapely.contains(free, area) or shapely.intersects(taken, area):
                continue
            if bare and not _is_bare(space, room, area):
                continue
            piece, shape = rug(rng, width, length, style, family)
            where = np.array([at[0], room.room.floor_y + _GAP_M, at[2]])
            item: Item = draft.placed(
                piece, shape, where, turn, item_id=next_id(draft, PART), room_id=room.room.id,
                level_id=room.room.level_id, tags=(RUG_TAG,),
            )  # fmt: skip
            draft.add(item, PART, piece)
            return True
    draft.refused[f"{PART}: no floor for a rug"] += 1
    return False


def _offset(turn: float, shift: tuple[float, float]) -> F64:
    c, s = np.cos(turn), np.sin(turn)
    return np.array([shift[0] * c + shift[1] * s, 0.0, -shift[0] * s + shift[1] * c])


def _rectangle(at: F64, turn: float, width: float, length: float) -> BaseGeometry:
    corners = [
        (at + _offset(turn, (sx * length / 2, sz * width / 2)))[[0, 2]]
        for sx, sz in ((-1, -1), (1, -1), (1, 1), (-1, 1))
    ]
    return shapely.Polygon(corners)


def _floor_mats(draft: Draft, space: HouseSpace, room: RoomSpace) -> BaseGeometry:
    """The plan area of rugs that lie in the room, and of low things that rugs would cut."""
    shapes = []
    for n in room.items:
        low, high = space.bounds[n]
        if draft.items[n].nyu40 == FLOOR_MAT or high[1] < room.room.floor_y + 0.05:
            shapes.append(shapely.box(low[0], low[2], high[0], high[2]))
    return shapely.union_all(shapes)


def _is_bare(space: HouseSpace, room: RoomSpace, area: BaseGeometry) -> bool:
    x0, z0, x1, z1 = area.bounds
    low = np.array([x0, room.room.floor_y + 0.002, z0])
    high = np.array([x1, room.room.floor_y + 0.1, z1])
    return space.is_free(low, high)


# Rugs that were drawn in one colour get a pattern and pile but on the draft.


_LEAST_M, _MOST_M = 0.3, 6.0  # of a rug's sides


def cover_drawn_rugs(draft: Draft, style: Style, share: float) -> None:
    """Give a share of the source's plain rugs a picture of the room's style; pictures stay."""
    for index, item in enumerate(draft.items[: len(draft.source.items)]):
        if item.kind is not ItemKind.OBJECT or item.nyu40 != FLOOR_MAT or not item.n_faces:
            continue
        if any(draft.materials[s.material].texture_id for s in item.surfaces):
            continue
        rng = draft.rng(PART, "drawn rug", item.id)
        if rng.random() < share:
            taste = room_style(style, draft.rng(PART, item.room_id or "", "style"))
            covered = _covered(draft, item, taste, rng)
            if covered is not None:
                draft.change(index, covered, PART)
                draft.done[f"{PART}: drawn rug"] += 1


def _covered(draft: Draft, item: Item, style: Style, rng: np.random.Generator) -> Item | None:
    box = item.oriented_box
    sides = 2 * box.half
    along, across = (0, 2) if sides[0] >= sides[2] else (2, 0)
    if sides[across] < _LEAST_M or sides[along] > _MOST_M:
        return None
    texture = jpeg_texture(
        "rug drawn", rug_pixels(rng, float(sides[across]), float(sides[along]), style)
    )
    shown = Material(f"rug {texture.id[:8]}", texture_id=texture.id, roughness=1.0)
    number = draft.material(shown, [texture])
    # Lay the picture over the plan: its edges show at the sides, which are a centimetre high.
    surfaces = []
    for surface in item.surfaces:
        local = (surface.positions.astype(np.float64) - box.centre) @ box.axes
        uvs = local[:, [along, across]] / sides[[along, across]] + 0.5
        surfaces.append(replace(surface, material=number, uvs=np.clip(uvs, 0.002, 0.998).astype(np.float32)))  # fmt: skip
    return replace(item, surfaces=tuple(surfaces))
