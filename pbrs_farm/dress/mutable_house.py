"""A house during dressing, with counts of additions, changes and refusals; state: the house itself.

Effects: a thread paints materials.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import replace

import numpy as np

from pbrs_farm.core import keys
from pbrs_farm.core.arrays import F64
from pbrs_farm.core.catalogue import Piece, Shape
from pbrs_farm.core.frames import affine, rotation_y
from pbrs_farm.core.house import Box, House, Item, LightPart, Material, Note, Surface, Texture
from pbrs_farm.core.mesh import unit_vectors
from pbrs_farm.dress.painted_bank import PaintedBank
from pbrs_farm.dress.painted_materials import PaintedMaterials

ADDED_TAG = "dressed:"  # tag of an added item, followed by its piece's id
CHANGED_TAG = "changed:"  # tag of a changed item of the source, followed by the pass


class MutableHouse:
    """A house that dressing passes change: items are added and changed, materials drawn.

    Items of the source keep their order and indices; additions are appended. A pass draws from `rng`
    with its own words, so that passes are independent, and counts its refusals by reason. Use it in
    `contextlib.closing`: a thread paints textures in the background.

        with closing(MutableHouse(house, seed=1)) as mutable:
            item = mutable.placed(piece, shape, at, 0.0, item_id="dress-mine-0", room_id="0_0", level_id="0")
            mutable.add(item, "mine", piece)
            dressed = mutable.frozen()

    Not for edits of users: those are values (core/edits.py).
    """

    def __init__(
        self,
        house: House,
        seed: int,
        mess: float = 0.0,
        bank: PaintedBank | None = None,
        own_share: float = 0.0,
    ) -> None:
        self.source = house
        self.seed = seed
        self.mess = mess  # 0..1: how little people have tidied up
        self.own_share = own_share  # 0..1: of choices that the user's own libraries have alone
        self.items: list[Item] = list(house.items)
        self.materials = PaintedMaterials(house.materials, house.textures)
        self.bank = bank or PaintedBank(None)  # what surfaces are painted with
        self.notes: list[Note] = []
        self.done: Counter[str] = Counter()  # additions and changes, by pass and group
        self.refused: Counter[str] = Counter()  # abandoned attempts, by `<pass>: <reason>`
        self.used: dict[str, Piece] = {}  # pieces of the catalogue in the house, by id
        self.kept: dict[str, object] = {}  # what passes compute from the items and use again

    def close(self) -> None:
        """End the thread that paints: the house is frozen, or was given up."""
        self.materials.close()

    @property
    def textures(self) -> dict[str, Texture]:
        """All textures by id; waits for those that are not painted yet."""
        return self.materials.textures()

    def rng(self, *words: str | int) -> np.random.Generator:
        """An independent random stream, from its start, for each (house, seed, words)."""
        return np.random.default_rng(keys.seed(self.source.id, "dress", self.seed, *words))

    def material(self, material: Material, textures: Iterable[Texture] = ()) -> int:
        """Number of a material, added unless known, until `frozen` renumbers them; textures: those it names."""
        return self.materials.add(material, textures)

    def placed(
        self,
        piece: Piece,
        shape: Shape,
        at: F64,
        turn_rad: float,
        *,
        item_id: str,
        room_id: str | None,
        level_id: str,
        scale: F64 | float = 1.0,
        tags: tuple[str, ...] = (),
    ) -> Item:
        """The piece as an item of this house, to be passed to `add`.

        at: (3,) world metres of the shape's origin: for pieces of the catalogue the centre of the base (of
        the back for wall items). turn_rad: about +y; 0 faces +z. scale: along the piece's own axes, (3,) or
        one for all. item_id must be new in the house; ids `dress-<pass>-<n>` name the pass in the report.
        The shape's materials and textures are added to the house. Free space is not checked: gates do that
        at the end.
        """
        turn, factor = rotation_y(turn_rad), np.broadcast_to(np.asarray(scale, np.float64), 3)

        def moved(points: F64) -> F64:
            return np.asarray((points * factor) @ turn.T + at)

        # Move surfaces and lights; normals go by the inverse of the scale.
        normal_matrix = turn / factor
        surfaces = tuple(
            self._placed_surface(s, shape, moved, normal_matrix) for s in shape.surfaces
        )
        lights = tuple(_moved_light(light, moved, turn) for light in shape.lights)
        matrix = affine(turn * factor, at)
        return Item(
            id=item_id,
            name=piece.name,
            kind=piece.kind,
            level_id=level_id,
            surfaces=surfaces,
            nyu40=piece.nyu40,
            source_class=piece.id,
            room_id=room_id,
            lights=lights,
            tags=(f"{ADDED_TAG}{piece.id}", f"seed:{self.seed}", *tags),
            box=_placed_box(shape, turn, factor, at),
            joints=tuple(joint.placed(matrix) for joint in shape.joints),
        )

    def add(self, item: Item, pass_name: str, piece: Piece | None = None) -> None:
        """Add an item after all others; part: the pass that adds it, for the report."""
        self.items.append(item)
        if piece is not None:
            self.used[piece.id] = piece
            self.done[f"{pass_name}: {piece.group}"] += 1

    def change(self, index: int, item: Item, pass_name: str) -> None:
        """Put a changed item in the place of items[index] and tag it; part: the pass, for the report."""
        tag = f"{CHANGED_TAG}{pass_name}"
        self.items[index] = item if tag in item.tags else replace(item, tags=(*item.tags, tag))

    def frozen(self) -> House:
        """The house as dressed so far, as a value, without materials and textures that nothing uses."""
        used = sorted({s.material for item in self.items for s in item.surfaces})
        number = {old: new for new, old in enumerate(used)}
        items = tuple(
            replace(i, surfaces=tuple(replace(s, material=number[s.material]) for s in i.surfaces))
            for i in self.items
        )
        materials = tuple(self.materials[m] for m in used)
        named = {name for m in materials for name in m.texture_ids}
        # Openings have no visible material: their cutters are never rendered.
        openings = tuple(
            replace(o, cutter=replace(o.cutter, material=0)) for o in self.source.openings
        )
        return replace(
            self.source,
            items=items,
            materials=materials,
            openings=openings,
            textures={i: t for i, t in self.textures.items() if i in named},
            notes=(*self.source.notes, *self.notes),
        )

    def _placed_surface(
        self, surface: Surface, shape: Shape, moved: Callable[[F64], F64], normal_matrix: F64
    ) -> Surface:
        material = shape.materials[surface.material]
        names = material.texture_ids
        number = self.material(material, [shape.textures[n] for n in names if n in shape.textures])
        positions = moved(surface.positions.astype(np.float64)).astype(np.float32)
        normals = surface.normals
        if normals is not None:
            # The inverse transpose keeps normals at right angles to stretched faces, not their length.
            n = unit_vectors(normals.astype(np.float64) @ normal_matrix.T)
            normals = n.astype(np.float32)
        return replace(surface, positions=positions, normals=normals, material=number)


def _placed_box(shape: Shape, turn: F64, factor: F64, at: F64) -> Box | None:
    # The shape's own box, turned with it: its third axis points to the front.
    if not any(len(s.positions) for s in shape.surfaces):
        return None
    low, high = shape.bounds * factor
    return Box(turn @ ((low + high) / 2) + at, (high - low) / 2, turn)


def moved_item(item: Item, step: F64, turn: F64 | None = None, about: F64 | None = None) -> Item:
    """The item with all its parts turned by (3, 3) about a point (the origin), then moved by step, metres."""
    turn = np.eye(3) if turn is None else turn
    pivot = np.zeros(3) if about is None else about

    def moved(points: F64) -> F64:
        return np.asarray((points - pivot) @ turn.T + pivot + step)

    def surface(s: Surface) -> Surface:
        normals = s.normals
        if normals is not None:
            normals = (normals @ turn.T).astype(np.float32)
        points = moved(s.positions.astype(np.float64))
        return replace(s, positions=points.astype(np.float32), normals=normals)

    box = item.box and Box(moved(item.box.centre), item.box.half, turn @ item.box.axes)
    matrix = affine(turn, pivot - turn @ pivot + step)
    return replace(
        item,
        surfaces=tuple(surface(s) for s in item.surfaces),
        box=box,
        lights=tuple(_moved_light(light, moved, turn) for light in item.lights),
        joints=tuple(joint.placed(matrix) for joint in item.joints),
    )


def _moved_light(light: LightPart, moved: Callable[[F64], F64], turn: F64) -> LightPart:
    def point(p: tuple[float, float, float]) -> tuple[float, float, float]:
        x, y, z = (float(c) for c in moved(np.asarray(p, np.float64)))
        return (x, y, z)

    x, y, z = (float(c) for c in turn @ np.asarray(light.direction))
    end = point(light.position_end) if light.position_end is not None else None
    return replace(light, position=point(light.position), direction=(x, y, z), position_end=end)
