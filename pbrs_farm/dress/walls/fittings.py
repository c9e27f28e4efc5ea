"""Mirrors, clocks, sockets, radiators, shelves and cloths of one room; effects: changes the house."""

from __future__ import annotations

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from pbrs_farm.core.arrays import F64, Srgb8Image
from pbrs_farm.core.catalogue import Catalogue, Piece, Shape
from pbrs_farm.core.classes import MIRROR, SINK
from pbrs_farm.dress.content import content
from pbrs_farm.dress.models import Model
from pbrs_farm.dress.space import HouseSpace, Passage
from pbrs_farm.dress.style import Rgb, Style, shade
from pbrs_farm.dress.walls.hanging import WANTS, Hanging, faces_behind
from pbrs_farm.dress.walls.hung_things import (
    CLOCK_RIMS,
    PLATE_FORMS,
    SOCKET_FORMS,
    SWITCH_FORMS,
    clock,
    frame_material,
    jpeg_texture,
    mirror,
)
from pbrs_farm.home.room_use import RoomKind

_SWITCH_M, _SOCKET_M = 1.05, 0.3  # heights of their middles above the floor
_DATA_SOCKETS, _DATA_SHARE = ("antenna", "rj45"), 0.15  # words of their names, share of sockets
_CASING_M = 0.1  # distance from a door's opening to its switch, with a gap of 2 cm


def hang_mirrors(hanging: Hanging, space: HouseSpace, style: Style, share: float) -> None:
    """A mirror over each washbasin of a bathroom, and one in most halls, where none is."""
    room = hanging.room
    rng = hanging.house.rng("mirrors", room.room.id)
    if any(hanging.house.items[n].nyu40 == MIRROR for n in room.items):
        return
    if room.kind is RoomKind.BATHROOM and rng.random() < share:
        for number in room.items:
            if hanging.house.items[number].nyu40 == SINK:
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
                hanging.hang(*mirror(rng, width, height, frame), k, s, low)
                return
    hanging.house.refused["walls: no free wall for a mirror"] += 1


def _tall_mirror(hanging: Hanging, rng: np.random.Generator, style: Style) -> None:
    frame = frame_material(rng, style)
    if rng.random() < 0.35:
        diameter = float(rng.uniform(0.45, 0.75))
        model, low = (
            content().things["round_mirror"](rng, style, diameter, frame),
            1.55 - diameter / 2,
        )
    else:
        width, height = float(rng.uniform(0.4, 0.6)), float(rng.uniform(1.1, 1.5))
        model, low = mirror(rng, width, height, frame, 0.03), 0.45
    hang_anywhere(hanging, model, low, 0.4, rng)


def hang_notes(hanging: Hanging, style: Style, share: float) -> None:
    """Sheets and sticky notes on a free wall."""
    rng = hanging.house.rng("notes", hanging.room.room.id)
    if rng.random() < WANTS[hanging.room.kind].notes * share:
        low_m = float(rng.uniform(0.95, 1.25))
        hang_anywhere(hanging, content().things["wall_notes"](rng, style), low_m, 0.3, rng)


def hang_clock(hanging: Hanging, style: Style, share: float) -> None:
    """A clock in some kitchens, living rooms and studies."""
    rng = hanging.house.rng("clock", hanging.room.room.id)
    if rng.random() >= WANTS[hanging.room.kind].clock * share:
        return
    frame = frame_material(rng, style)
    light = rng.random() < 0.75
    dial = jpeg_texture("dial", _dial(rng, (0.93, 0.92, 0.88) if light else (0.1, 0.1, 0.11)))
    diameter, form = float(rng.uniform(0.24, 0.36)), int(rng.integers(len(CLOCK_RIMS)))
    marks = int(rng.choice([0, 4, 12]))
    hang_anywhere(hanging, clock(diameter, dial, frame, form, marks), 1.85, 0.3, rng)


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
            position = (160 + 115 * np.sin(a), 160 - 115 * np.cos(a))
            pen.text(position, str(k or 12), font=font, fill=ink, anchor="mm")
    # Set the hands to some time of day.
    hour = float(rng.uniform(0, 12))
    for turn, length, width in ((hour / 12, 78, 9), (hour % 1.0, 118, 6)):
        a = 2 * np.pi * turn
        pen.line(
            [
                (160 - 20 * np.sin(a), 160 + 20 * np.cos(a)),
                (160 + length * np.sin(a), 160 - length * np.cos(a)),
            ],
            fill=ink,
            width=width,
        )
    pen.ellipse((151, 151, 169, 169), fill=ink)
    return np.asarray(image, np.uint8)


def hang_anywhere(
    hanging: Hanging,
    model: Model,
    low_m: float,
    depth_m: float,
    rng: np.random.Generator,
    *,
    above_m: float = 0.05,
    tags: tuple[str, ...] = (),
) -> bool:
    """Hang the item at a height, at a random place free by depth_m and above_m; else False, counted."""
    piece, shape = model
    (x0, _y0, _z0), (x1, y1, _z1) = shape.bounds
    low, width = hanging.floor_y + low_m, float(x1 - x0)
    places = [
        (k, float(s))
        for k, face in enumerate(hanging.faces)
        for s in face.starts(width + 0.1, low - 0.05, low + float(y1) + above_m, depth_m)
    ]
    if not places:
        hanging.house.refused[f"walls: no free wall for a {piece.group}"] += 1
        return False
    k, s = places[int(rng.integers(len(places)))]
    hanging.hang(piece, shape, k, s + 0.05 + width / 2, low, tags=tags)
    return True


def fit_switches(hanging: Hanging, catalogue: Catalogue, style: Style, share: float) -> None:
    """A switch beside each door on its room's side, and sockets low on the walls."""
    room = hanging.room
    rng = hanging.house.rng("switches", room.room.id)
    colour = (0.9, 0.9, 0.88) if rng.random() < 0.8 else shade(style.metal.colour, 0.8)
    if rng.random() >= share:
        return
    # All switches of a home are of one make, all plates alike.
    form = int(hanging.house.rng("switches", "form").integers(SWITCH_FORMS))
    plate = int(hanging.house.rng("switches", "plate").integers(PLATE_FORMS))
    switch = _draw_fitting(catalogue, "switch", rng) or content().things["wall_switch"](
        rng, style, 1 + int(rng.random() < 0.35), colour, form, plate
    )
    lit = 0
    for door in room.doors:
        side = door.side_of(room.room.id)
        if side is not None and lit < 3 and _fit_beside_door(hanging, door, side, switch, rng):
            lit += 1
    for _ in range(WANTS[room.kind].sockets):
        n = int(rng.choice([1, 1, 2, 3]))
        # All mains sockets of a home are of one standard.
        of_home = hanging.house.rng("sockets", "make")
        form = int(of_home.integers(SOCKET_FORMS))
        socket = _draw_fitting(catalogue, "socket", of_home, leave_out=_DATA_SOCKETS)
        if rng.random() < _DATA_SHARE:
            socket = _draw_fitting(catalogue, "socket", rng, only=_DATA_SOCKETS) or socket
        socket = socket or content().things["wall_socket"](rng, style, n, colour, form, plate)
        hang_anywhere(hanging, socket, _SOCKET_M - 0.04, 0.05, rng)


def _draw_fitting(
    catalogue: Catalogue,
    group: str,
    rng: np.random.Generator,
    *,
    only: tuple[str, ...] = ("",),
    leave_out: tuple[str, ...] = (),
) -> Model | None:
    """A socket or switch of realistic size, words of its name required or excluded; None = generate one."""
    fit = [
        p
        for p in catalogue.of(group)
        if max(p.size) < 0.2
        and p.size[1] < 0.06
        and any(word in p.name.lower() for word in only)
        and not any(word in p.name.lower() for word in leave_out)
    ]
    if not fit or rng.random() < 0.4:
        return None
    piece: Piece = fit[int(rng.integers(len(fit)))]
    shape: Shape | None = catalogue.shape(piece)
    return (piece, shape) if shape is not None else None


def _fit_beside_door(
    hanging: Hanging, door: Passage, side: int, model: Model, rng: np.random.Generator
) -> bool:
    """Hang a switch on one side of a door: the handle's side is unknown, so any free side."""
    piece, shape = model
    low = hanging.floor_y + _SWITCH_M - float(shape.bounds[1, 1]) / 2
    half = float(np.abs(shape.bounds[:, 0]).max()) + 0.02
    order = (1.0, -1.0) if rng.random() < 0.5 else (-1.0, 1.0)
    for sign in order:
        position = door.face_point(side) + door.along * sign * (door.width / 2 + _CASING_M + half)
        for k, face in enumerate(hanging.faces):
            out = float(face.out_of(position[None])[0])
            if abs(out) > 0.06 or float(face.normal @ door.inward(side)) < 0.95:
                continue
            s = float(face.s_of(position[None])[0])
            if face.free_m(s - half, s + half, low, low + 0.1) > 0.03:
                hanging.hang(piece, shape, k, s, low, margin_m=0.02)
                return True
    return False
