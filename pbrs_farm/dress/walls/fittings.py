"""Mirrors, clocks, sockets, radiators, shelves and cloths of one room; no effects but on the draft."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from pbrs_farm.core.arrays import F64, Srgb8Image
from pbrs_farm.core.catalogue import Catalogue, Piece, Shape
from pbrs_farm.core.classes import MIRROR, OTHERPROP, SINK
from pbrs_farm.core.house import Material
from pbrs_farm.dress.built_in import coat_material, joinery_scheme
from pbrs_farm.dress.draft import Draft
from pbrs_farm.dress.space import HouseSpace, Passage
from pbrs_farm.dress.style import Rgb, Style, shade
from pbrs_farm.dress.textiles.rug_patterns import RUGS, rug_pixels
from pbrs_farm.dress.things import hung as hung_furniture
from pbrs_farm.dress.things import radiators
from pbrs_farm.dress.things.assembly import Made, Part, hung, transformed
from pbrs_farm.dress.things.bodies import turned
from pbrs_farm.dress.things.materials import plain
from pbrs_farm.dress.walls.hanging import IN_FRONT_M, WANTS, Hanging, faces_behind
from pbrs_farm.dress.walls.hung_things import (
    CUPBOARD_FORMS,
    SWITCH_FORMS,
    clock,
    faced_slab,
    frame_material,
    jpeg_texture,
    mirror,
)
from pbrs_farm.home.names import RADIATORS, words_of_item
from pbrs_farm.home.room_use import RoomKind

_SWITCH_M, _SOCKET_M = 1.05, 0.3  # heights of their middles above the floor
_CASING_M = 0.16  # from a door's hole to the middle of its switch


def hang_mirrors(hanging: Hanging, space: HouseSpace, style: Style, share: float) -> None:
    """A mirror over each washbasin of a bathroom, and one in most halls, where none is."""
    room = hanging.room
    rng = hanging.draft.rng("mirrors", room.room.id)
    if any(hanging.draft.items[n].nyu40 == MIRROR for n in room.items):
        return
    if room.kind is RoomKind.BATHROOM and rng.random() < share:
        for number in room.items:
            if hanging.draft.items[number].nyu40 == SINK:
                _over_basin(hanging, space.bounds[number], rng, style)
    if rng.random() < WANTS[room.kind].mirror * share:
        _tall_mirror(hanging, rng, style)


def _over_basin(hanging: Hanging, bounds: F64, rng: np.random.Generator, style: Style) -> None:
    basin = float(max(bounds[1, 0] - bounds[0, 0], bounds[1, 2] - bounds[0, 2]))
    rim = min(float(bounds[1, 1]), hanging.floor_y + 0.95)
    frame = frame_material(rng, style) if rng.random() < 0.4 else None
    for k, s0, s1 in faces_behind(hanging.room, bounds[0], bounds[1])[:2]:
        for factor in (1.0, 0.75, 0.5):
            width = float(np.clip(basin * 0.95, 0.4, 1.1)) * factor
            height = float(rng.uniform(0.6, 0.85)) * (0.5 + 0.5 * factor)
            low = rim + float(rng.uniform(0.15, 0.3))
            s = (s0 + s1) / 2
            if hanging.faces[k].free_m(s - width / 2, s + width / 2, low, low + height) > 0.12:
                hanging.hang(*mirror(width, height, frame), k, s, low)
                return
    hanging.draft.refused["walls: no free wall for a mirror"] += 1


def _tall_mirror(hanging: Hanging, rng: np.random.Generator, style: Style) -> None:
    frame = frame_material(rng, style)
    if rng.random() < 0.35:
        diameter = float(rng.uniform(0.45, 0.75))
        made, low = (
            hung_furniture.round_mirror.make(rng, style, diameter, frame),
            1.55 - diameter / 2,
        )
    else:
        width, height = float(rng.uniform(0.4, 0.6)), float(rng.uniform(1.1, 1.5))
        made, low = mirror(width, height, frame, 0.03), 0.45
    hang_anywhere(hanging, made, low, 0.4, rng)


def hang_clock(hanging: Hanging, style: Style, share: float) -> None:
    """A clock in some kitchens, living rooms and studies."""
    rng = hanging.draft.rng("clock", hanging.room.room.id)
    if rng.random() >= WANTS[hanging.room.kind].clock * share:
        return
    frame = frame_material(rng, style)
    light = rng.random() < 0.75
    dial = jpeg_texture("dial", _dial(rng, (0.93, 0.92, 0.88) if light else (0.1, 0.1, 0.11)))
    hang_anywhere(hanging, clock(float(rng.uniform(0.24, 0.36)), dial, frame), 1.85, 0.3, rng)


def _dial(rng: np.random.Generator, ground: Rgb) -> Srgb8Image:
    image = Image.new("RGB", (320, 320), tuple(int(255 * c) for c in ground))
    pen = ImageDraw.Draw(image)
    ink = (25, 25, 28) if ground[0] > 0.5 else (230, 228, 220)
    numerals = rng.random() < 0.5
    font = ImageFont.load_default(size=30.0)
    for k in range(60 if rng.random() < 0.5 else 12):
        n = 60 if k >= 12 else 12
        a = 2 * np.pi * k / n
        inner = 0.42 if n == 12 else 0.445
        tip = [(160 + 320 * r * np.sin(a), 160 - 320 * r * np.cos(a)) for r in (inner, 0.465)]
        pen.line(tip, fill=ink, width=6 if n == 12 else 2)
        if numerals and n == 12:
            at = (160 + 115 * np.sin(a), 160 - 115 * np.cos(a))
            pen.text(at, str(k or 12), font=font, fill=ink, anchor="mm")
    # Set the hands to some time of day.
    hour = float(rng.uniform(0, 12))
    for turn, length, width in ((hour / 12, 78, 9), (hour % 1.0, 118, 6)):
        a = 2 * np.pi * turn
        pen.line([(160 - 20 * np.sin(a), 160 + 20 * np.cos(a)),
                  (160 + length * np.sin(a), 160 - length * np.cos(a))], fill=ink, width=width)  # fmt: skip
    pen.ellipse((151, 151, 169, 169), fill=ink)
    return np.asarray(image, np.uint8)


def hang_anywhere(
    hanging: Hanging, made: Made, low_m: float, depth_m: float, rng: np.random.Generator, *,
    above_m: float = 0.05, tags: tuple[str, ...] = (),
) -> bool:  # fmt: skip
    """Hang the thing at that height at a place drawn from all that have depth_m free before them.

    above_m: free above it. False, and a reason counted, where there is no place.
    """
    piece, shape = made
    (x0, _y0, _z0), (x1, y1, _z1) = shape.bounds
    low, width = hanging.floor_y + low_m, float(x1 - x0)
    places = [
        (k, float(s))
        for k, face in enumerate(hanging.faces)
        for s in face.starts(width + 0.1, low - 0.05, low + float(y1) + above_m, depth_m)
    ]
    if not places:
        hanging.draft.refused[f"walls: no free wall for a {piece.group}"] += 1
        return False
    k, s = places[int(rng.integers(len(places)))]
    hanging.hang(piece, shape, k, s + 0.05 + width / 2, low, tags=tags)
    return True


def fit_switches(hanging: Hanging, catalogue: Catalogue, style: Style, share: float) -> None:
    """A switch beside each door on its room's side, and sockets low on the walls."""
    room = hanging.room
    rng = hanging.draft.rng("switches", room.room.id)
    colour = (0.9, 0.9, 0.88) if rng.random() < 0.8 else shade(style.metal.colour, 0.8)
    if rng.random() >= share:
        return
    # All switches of a home are of one make.
    form = int(hanging.draft.rng("switches", "form").integers(SWITCH_FORMS))
    switch = _fitting(catalogue, "switch", rng) or hung_furniture.wall_switch.make(
        rng, style, 1, colour, form
    )
    lit = 0
    for door in room.doors:
        side = door.side_of(room.room.id)
        if side is not None and lit < 3 and _beside(hanging, door, side, switch, rng):
            lit += 1
    for _ in range(WANTS[room.kind].sockets):
        n = int(rng.choice([1, 1, 2, 3]))
        socket = _fitting(catalogue, "socket", rng) or hung_furniture.wall_socket.make(
            rng, style, n, colour
        )
        hang_anywhere(hanging, socket, _SOCKET_M - 0.04, 0.05, rng)


def _fitting(catalogue: Catalogue, group: str, rng: np.random.Generator) -> Made | None:
    """A socket or switch of the catalogue that is as small as they are; None = make one."""
    fit = [p for p in catalogue.of(group) if max(p.size) < 0.2 and p.size[1] < 0.06]
    if not fit or rng.random() < 0.4:
        return None
    piece: Piece = fit[int(rng.integers(len(fit)))]
    shape: Shape | None = catalogue.shape(piece)
    return (piece, shape) if shape is not None else None


def _beside(
    hanging: Hanging, door: Passage, side: int, made: Made, rng: np.random.Generator
) -> bool:
    """Hang a switch on one side of a door: the handle's side is unknown, so either that is free."""
    piece, shape = made
    low = hanging.floor_y + _SWITCH_M - float(shape.bounds[1, 1]) / 2
    half = float(np.abs(shape.bounds[:, 0]).max()) + 0.02
    order = (1.0, -1.0) if rng.random() < 0.5 else (-1.0, 1.0)
    for sign in order:
        at = door.face_point(side) + door.along * sign * (door.width / 2 + _CASING_M)
        for k, face in enumerate(hanging.faces):
            out = float(face.out_of(at[None])[0])
            if abs(out) > 0.06 or float(face.normal @ door.inward(side)) < 0.95:
                continue
            s = float(face.s_of(at[None])[0])
            if face.free_m(s - half, s + half, low, low + 0.1) > 0.03:
                hanging.hang(piece, shape, k, s, low, margin_m=0.02)
                return True
    return False


# Panel radiators below the windows of a home that has none but on the draft.


_HEATED: Final = 0.75  # of homes without any, that are heated so
_LOW_M, _SPACE_M = 0.12, 0.1  # above the floor; below the sill
_LEAST_SILL_M: Final = 0.6
_OTHER_HEAT: Final = frozenset({"fireplace", "stove"})
_UNHEATED = (RoomKind.STORE, RoomKind.OUTDOOR)


def wants_radiators(draft: Draft) -> bool:
    """Whether the home is heated neither by what was drawn nor from its floors."""
    drawn = any(words_of_item(item) & (RADIATORS | _OTHER_HEAT) for item in draft.source.items)
    return not drawn and float(draft.rng("radiators").random()) < _HEATED


def hang_radiators(hanging: Hanging, style: Style, share: float) -> None:
    """A radiator below each window of the room whose wall is free there, in the home's scheme."""
    room, rng = hanging.room, hanging.draft.rng("radiators", hanging.room.room.id)
    if room.kind in _UNHEATED or rng.random() >= share:
        return
    paint = coat_material(joinery_scheme(hanging.draft, style).radiator)

    def make(wide: float, high: float) -> Made:
        return radiators.wall_radiator.make(rng, style, wide, high, paint)

    for window in room.windows:
        side = window.side_of(room.room.id)
        sill = window.bottom_y - hanging.floor_y
        if side is None or not _LEAST_SILL_M <= sill <= 1.4:
            continue
        height = min(sill - _LOW_M - _SPACE_M, 0.6)
        at = window.face_point(side)
        for k, face in enumerate(hanging.faces):
            if face.normal @ window.inward(side) < 0.99 or abs(face.out_of(at[None])[0]) > 0.03:
                continue
            s, width = float(face.s_of(at[None])[0]), window.width
            if _hang_below(hanging, k, s, (width, height), make):
                break


def _hang_below(
    hanging: Hanging,
    face: int,
    s: float,
    size: tuple[float, float],
    make: Callable[[float, float], Made],
) -> bool:
    width, height = size
    low = hanging.floor_y + _LOW_M
    for factor in (0.85, 0.6, 0.45):
        wide = round(min(width * factor, 1.6) / 0.1) * 0.1
        half = wide / 2 + 0.08
        if wide < 0.4:
            return False
        if (
            hanging.faces[face].free_m(s - half, s + half, hanging.floor_y + 0.05, low + height)
            > 0.3
        ):
            made = make(wide, height)
            hanging.hang(*made, face, s, low, margin_m=0.02)
            return True
    return False


# Shelves, boxes and cupboards on walls, towel radiators and woven cloth.


_RADIATORS: Final = 0.65  # of bathrooms
_LADDER_M: Final = 0.45  # of a towel radiator's foot above the floor
_ABOVE_M: Final = 0.32  # free over the highest board: things stand there
_BEFORE_M: Final = 0.3  # free before it


def hang_shelves(hanging: Hanging, style: Style, share: float) -> None:
    """Boards, open boxes and cupboards: the clutter that follows fills them. A bath's towel radiator."""
    kind = hanging.room.kind
    rng = hanging.draft.rng("shelf", hanging.room.room.id)
    low, high = WANTS[kind].shelves, WANTS[kind].most_shelves
    wanted = int(np.floor(rng.integers(low, high + 1) * share + rng.random()))
    is_bath = kind is RoomKind.BATHROOM
    if is_bath and rng.random() < _RADIATORS * share:
        hang_anywhere(hanging, radiators.towel_radiator.make(rng, style), _LADDER_M, 0.2, rng)
    wood = plain(f"shelf {style.wood.name}", style.wood.mean, 0.4)
    board = wood if rng.random() < 0.6 else plain("shelf white", (0.9, 0.9, 0.88), 0.4)
    # What hangs in one room is of one make, of several widths.
    for _ in range(wanted):
        longest = 0.7 if is_bath else 1.7
        width = float(rng.uniform(0.35 if is_bath else 0.6, longest))
        own = int(rng.integers(1 << 30))
        for factor in (1.0, 0.65, 0.45):
            made, low_m, above_m = _shelf(
                np.random.default_rng(own), style, board, width * factor, is_bath=is_bath
            )
            depth = float(made[1].bounds[1, 2])
            if hang_anywhere(
                hanging, made, low_m, depth + _BEFORE_M, rng, above_m=above_m, tags=("support",)
            ):
                break


def _shelf(
    rng: np.random.Generator, style: Style, board: Material, width: float, *, is_bath: bool
) -> tuple[Made, float, float]:
    """Something with shelves, how high above the floor its lower edge hangs, and what stays free above it."""
    depth = float(rng.uniform(0.14, 0.18) if is_bath else rng.uniform(0.19, 0.27))
    kind = rng.random()
    if kind < 0.5:
        boards = int(rng.choice([1, 2, 2, 3]))
        return (
            hung_furniture.wall_shelf.make(rng, style, width, depth, boards, board),
            1.5 if boards == 1 else 1.38,
            _ABOVE_M,
        )
    if kind < 0.75:
        height = float(rng.choice([0.34, 0.34, 0.62]))
        made = hung_furniture.open_cupboard.make(rng, style, board, width, height, depth)
        return made, float(rng.uniform(1.35, 1.55)), _ABOVE_M
    n_doors = max(1, round(width / 0.45))
    height = float(rng.uniform(0.38, 0.6))
    given = (board, board, width, height, depth + 0.06, n_doors, int(rng.integers(CUPBOARD_FORMS)))
    made = hung_furniture.wall_cupboard.make(rng, style, *given)
    return made, float(rng.uniform(1.4, 1.6)), 0.05


def hang_cloth(hanging: Hanging, style: Style, share: float) -> None:
    """A woven cloth on a rod, in some rooms."""
    rng = hanging.draft.rng("wall cloth", hanging.room.room.id)
    if rng.random() >= WANTS[hanging.room.kind].cloth * share:
        return
    width, height = float(rng.uniform(0.5, 1.0)), float(rng.uniform(0.6, 1.1))
    hang_anywhere(hanging, wall_cloth(rng, style, width, height), 1.6 - height / 2, IN_FRONT_M, rng)


def wall_cloth(rng: np.random.Generator, style: Style, width: float, height: float) -> Made:
    """A patterned cloth that hangs from a rod, a fringe at its foot."""
    fringe, rod = 0.09, 0.009
    pixels = rug_pixels(rng, width, height, style, str(rng.choice(list(RUGS))))
    texture = jpeg_texture("wall cloth", pixels)
    shown = Material(f"cloth {texture.id[:8]}", texture_id=texture.id, roughness=1.0)
    r, g, b = (float(c) / 255 for c in pixels.reshape(-1, 3).mean(0))
    yarn = plain("yarn", (r, g, b), 1.0)
    low, high = np.array([-width / 2, fringe]), np.array([width / 2, height])
    face, back = faced_slab("cloth", low, high, (0.002, 0.008))
    parts: list[Part] = [(face, shown), (back, yarn)]
    for x in np.arange(-width / 2 + 0.01, width / 2 - 0.01, 0.02):
        ends = (
            np.array([float(x), float(rng.uniform(0.0, 0.015))]),
            np.array([float(x) + 0.012, fringe]),
        )
        parts += [(part, yarn) for part in faced_slab("fringe", *ends, (0.003, 0.007))]
    along = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    long = width + 0.1
    stick = turned([(0.0, 0.0), (rod, 0.0), (rod, long), (0.0, long)], n=12)
    parts.append(
        (
            transformed(stick, along, (-long / 2, height + rod, rod)),
            plain("rod", style.wood.mean, 0.5),
        )
    )
    return hung("wall_cloth", "wall_cloth", OTHERPROP, parts, [texture])
