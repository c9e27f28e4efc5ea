"""A home as a Python value: its items and rooms, edits that give new homes, cameras, pictures.

Effects: reads the home's files at first use; renders on request.
"""

from __future__ import annotations

import html
import json
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from functools import cached_property
from numbers import Real
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core import keys
from pbrs_farm.core.arrays import F64, triple
from pbrs_farm.core.camera import Camera, camera_of_recipe, intrinsics_from_k, rigid_motion
from pbrs_farm.core.checked_calls import (
    MAX_EDGE_PX,
    Count,
    NotNegative,
    Positive,
    Share,
    Size,
    Span,
    Vector,
    Where,
    Whole,
    checked_call,
    warn_caller,
)
from pbrs_farm.core.classes import NYU40_NAMES
from pbrs_farm.core.edits import (
    AddLight,
    CoverItems,
    Edit,
    FloatModel,
    KeyJoints,
    MoveItems,
    OpenJoints,
    PaintItems,
    PlaceModel,
    RecordBodies,
    RemoveItems,
    SetLight,
    StandAt,
    rows_of_matrix,
)
from pbrs_farm.core.errors import BadInput, BadRecipe
from pbrs_farm.core.frames import affine, linear_from_srgb, rotation_y
from pbrs_farm.core.house import House, Item, Room
from pbrs_farm.core.recipe import Recipe, recipe_from_name, with_settings
from pbrs_farm.core.shown_text import did_you_mean, shown
from pbrs_farm.core.table import Table
from pbrs_farm.crash_notes import waiting_lines
from pbrs_farm.dress.style import check_style
from pbrs_farm.formats.cameras_json import views_from_json
from pbrs_farm.prepare.source import SAVED_SUFFIX, resolve, saved_home, variants
from pbrs_farm.prepare.source_ref import SourceRef
from pbrs_farm.regular_files import MAX_DIGEST_BYTES, fault_of, read_given
from pbrs_farm.run import plan
from pbrs_farm.sample.camera_report import CameraReport
from pbrs_farm.scene.models import Model
from pbrs_farm.scene.rendering import Renderer
from pbrs_farm.scene.viewpoints import Viewpoint, Viewpoints, viewpoint_of
from pbrs_farm.transport.scene_tables.area_emitters import rgb_from_kelvin

if TYPE_CHECKING:
    from pbrs_farm.repair import RepairReport

Row = Annotated[Mapping[str, Any], Where("a row of home.items", lambda row: "id" in row)]
ItemLike = str | Item | Row | Iterable[str | Item | Row]
Colour = str | Sequence[float]
Flux = Annotated[float, Where("0 to 10,000,000 lumen", lambda lm: 0 <= lm < 1e7)]
Kelvin = Annotated[float, Where("1,000 to 20,000 kelvin", lambda k: 1000 <= k <= 20_000)]
Keys = Annotated[
    Mapping[float, float],
    Where("{seconds: share}, shares in 0..1", lambda at: len(at) > 0 and _are_keys(at)),
]
Angle = Annotated[float, Where("an angle above 0, 180 degrees at most", lambda a: 0 < a <= 180)]
Minutes = Annotated[float, Where("seconds above 0, 600 at most", lambda s: 0 < s <= 600)]
CameraCount = Annotated[int, Where("a whole number in 1..10,000", lambda n: 1 <= n <= 10_000)]
Edge = Annotated[int, Where(f"1 to {MAX_EDGE_PX} pixels", lambda px: 1 <= px <= MAX_EDGE_PX)]


def _are_keys(at: Mapping[float, float]) -> bool:
    pairs = [*at.items()]
    return all(isinstance(v, Real) for pair in pairs for v in pair) and all(
        math.isfinite(t) and 0 <= share <= 1 for t, share in pairs
    )


_WARM_WHITE_K = 3000.0  # colour temperature of an added bulb


@dataclass(frozen=True)
class Home:
    """A home as an immutable value: each change gives a new one.

    It is read, dressed, repaired and edited at first use, by the same steps as `pbrs-farm run`, and stays
    in memory for the next call. Its id covers all of its inputs: equal homes have equal ids on every machine.

        >>> home = pf.load("builtin", recipe="preview")
        >>> home.rooms["Living room"].name, len(home.items.near("dining table")) > 0
        ('Living room', True)
        >>> pf.render(home, home.cameras("photo", n=1)[0], modes=[]).size
        (320, 240)
    """

    source: SourceRef
    base: Recipe
    settings: tuple[tuple[str, Any], ...] = ()  # overridden recipe fields

    renderer: ClassVar[Renderer] = Renderer()
    """Shared by all homes of this process, since Mitsuba, Dr.Jit and OpenGL have state a process."""

    @property
    def id(self) -> str:
        """The home's name in folders, tables and seeds.

        >>> home.id == pf.load("builtin").id
        True
        """
        return self.source.house_id

    @cached_property
    def recipe(self) -> Recipe:
        """The recipe for making and rendering it.

        >>> home.recipe.name
        'preview'
        """
        return with_settings(self.base, dict(self.settings))

    @property
    def house(self) -> House:
        """Its geometry, materials, lamps and rooms as frozen arrays (pbrs_farm.core.house).

        The process keeps those of its last homes, so a list of a thousand homes fits in memory.

            >>> len(home.house.rooms) == len(home.rooms)
            True
        """
        return self.renderer.house(self.source, self.recipe).house

    @property
    def report(self) -> RepairReport:
        """Changes and measurements of repair.

        >>> type(home.report).__name__
        'RepairReport'
        """
        return self.renderer.house(self.source, self.recipe).report

    @property
    def rooms(self) -> Rooms:
        """Its rooms as a table; home.rooms["Kitchen"] finds one by name or id.

        >>> home.rooms["Living room"].name
        'Living room'
        """
        return Rooms(self.house)

    @property
    def items(self) -> Items:
        """Its items as a table; home.items["table 2"], .near(name), .named("chair*").

        >>> len(home.items) > 10
        True
        """
        return Items(self.house)

    @property
    def joints(self) -> Joints:
        """Its doors, drawers and lids as a table: item, kind of motion, state.

        >>> home.joints.columns[:4]
        ('item', 'name', 'part', 'kind')
        """
        return Joints(self.house)

    @property
    def motions(self) -> Table:
        """Its motions over time as a table: item, name, part ("" = all of it), start, end.

        >>> len(home.motions)
        0
        """
        names = {item.id: item.name for item in self.house.items}
        rows = [
            {
                "item": m.item,
                "name": names[m.item],
                "part": m.part,
                "from_s": m.times_s[0],
                "until_s": m.times_s[-1],
                "keys": len(m.times_s),
            }
            for m in self.house.motions
        ]
        return Table(("item", "name", "part", "from_s", "until_s", "keys"), rows)

    def __repr__(self) -> str:
        edits = f", {len(self.source.edits)} edits" if self.source.edits else ""
        return f"<Home {self.id}: {self.recipe.name}{edits}>"

    def _repr_html_(self) -> str:
        return f"<div><code>{html.escape(self.id)}</code><br>{self.plan()}</div>"

    # Changes before the first edit.

    @checked_call
    def dress(self, seed: Count, **fields: Any) -> Home:
        """The home with the clutter, textiles and wear of daily life, by a seed (docs/dress.md).

        fields: of the recipe's group `dress`, such as clutter=0.5 or style="loft".
        Raises BadInput for seed 0 and for a home that has edits already.

            >>> home.dress(seed=3).id == home.id
            False
        """
        if self.source.edits:
            raise BadInput(self.id, "dress", "dress a home before editing it")
        if self.source.dress_seed:
            raise BadInput(self.id, "dress", f"is dressed already, seed {self.source.dress_seed}")
        (source,) = variants(self.source, [seed])
        return replace(self, source=source).set(**{f"dress.{k}": v for k, v in fields.items()})

    @checked_call
    def repair(self, **fields: Any) -> Home:
        """The home made watertight and lit, now; other homes are repaired at first use.

        fields: of the recipe's group `repair`, such as lamp_lx=150. `report` has the changes.

            >>> home.repair(lamp_lx=150).recipe.repair.lamp_lx
            150.0
        """
        home = self.set(**{f"repair.{k}": v for k, v in fields.items()})
        _ = home.house
        return home

    @checked_call
    def export(self, folder: str | Path, to: str = "gltf", **options: Any) -> Path:
        """Write the home for another program: to = gltf, habitat, mjcf, sdf, urdf, usd or usdz.

        Each item is one node, prim or model with a collider and its lamps; docs/formats/simulators.md describes
        the forms, and `pf.load` reads all of them. options: of the form. Raises BadInput if the
        folder is not empty, or for an option that the form does not have.

            >>> home.export("as_gltf").is_dir()
            True
        """
        from pbrs_farm.export.export_homes import export_house

        house = self.house
        with waiting_lines(f"{self.id} to {to}"):
            export_house(house, Path(folder), to, **options)
        return Path(folder)

    @checked_call
    def save(self, path: str | Path) -> Path:
        """Write the home as a small file, <name>.home.json, which every command takes as a home.

        It has the source, seeds of dressing, edits and motions, and files by their path on this machine.
        Fields of the recipe are the command's. Raises BadInput for another ending.

            >>> moving = home.open("door*", at={0: 0, 2: 1})
            >>> pf.load(moving.save("moving.home.json")).id == moving.id
            True
        """
        file = Path(path)
        if not file.name.endswith(SAVED_SUFFIX):
            raise BadInput("save", str(path), f"expected a name that ends in {SAVED_SUFFIX}")
        try:
            file.write_bytes(saved_home(self.source))
        except OSError as error:
            raise BadInput(file, "", fault_of(error)) from None
        return file

    @checked_call
    def set(self, **fields: Any) -> Home:
        """The home under other recipe fields: home.set(**{"light.spp": 64}).

        Raises BadRecipe for an unknown field or a value that does not fit.

            >>> home.set(**{"light.spp": 64}).recipe.light.spp
            64
        """
        if not fields:
            return self
        home = replace(self, settings=tuple({**dict(self.settings), **fields}.items()))
        check_style(home.recipe.dress.style)
        return home

    @checked_call
    def sun(self, azimuth: float | None = None, elevation: float | None = None) -> Home:
        """The home with the sun there, in degrees: azimuth from -z towards +x, elevation -90 to 90.

        Below 0 it is dusk, below -12 night.

            >>> home.sun(azimuth=120, elevation=5).recipe.sky.sun_elevation_deg
            5.0
        """
        fields = {"sky.sun_azimuth_deg": azimuth, "sky.sun_elevation_deg": elevation}
        changes = {name: value for name, value in fields.items() if value is not None}
        if not changes:
            raise BadInput("sun", "azimuth", "give this, elevation= or both")
        return self.set(**{"sky.kind": "sunsky", **changes})

    @checked_call
    def sky(self, panorama: str | Path) -> Home:
        """The home under a latitude-longitude HDR picture (.hdr or .exr), or one of a folder of them.

        >>> home.sky("panorama.hdr").recipe.sky.kind
        'panorama'
        """
        if not Path(panorama).exists():
            raise BadInput(panorama, "", "no such file or folder")
        return self.set(**{"sky.kind": "panorama", "sky.panoramas": str(Path(panorama).resolve())})

    # Edits.

    @checked_call
    def place(
        self,
        model: Model,
        *,
        on: str | Item | Room | None = None,
        pose: Any = None,
        at: Vector | None = None,
        seed: Whole = 0,
        name: str = "",
    ) -> Home:
        """The home with one more item.

        on: the support, upright at a free place drawn by the seed: an item, a name that one or several
        items have, or a room's floor. pose: (4, 4) world_from_model instead: metres, world y up, the
        model's axes; or at: (3,) position of the middle of its foot, upright. name: of the new item
        (default: its model's id and a number).

        Raises BadInput if no place is free, the pose is not a rigid motion, the name is in use, or the item
        is unknown. A place in no room is a warning.

            >>> home.place(can, on="dining table", seed=1).items["can 1"].id
            'can 1'
        """
        from pbrs_farm.scene.placing import free_pose, upright_at

        if sum(argument is not None for argument in (on, pose, at)) != 1:
            raise BadInput(self.id, model.id, "give one of on=, pose= and at=")
        if pose is not None:
            matrix = rigid_motion(pose, "place", "pose")
        elif at is not None:
            matrix = upright_at(model, np.asarray(at, np.float64), 0.0)
        else:
            house, supports = self.house, self._supports_named(on)
            matrix = self.renderer.call(lambda: free_pose(house, model, supports, seed))
        return self._edited(self._placing(model, matrix, name))

    @checked_call
    def scatter(
        self,
        models: Sequence[Model],
        n: Count,
        *,
        on: str | Item | Room | None = None,
        in_: str = "",
        seed: Whole = 0,
        physics: bool = False,
        floating: bool = False,
    ) -> Home:
        """The home with n more items, models in turn by the seed.

        on: an item or room that supports them; in_: a room, on all its tables, shelves and floor; else
        anywhere in the home. physics: they are dropped and come to rest against each other and the home by
        rigid-body simulation (extra `physics`); after four falls off the support an item stays where it is.
        Without physics, items are upright and do not touch each other. floating: they are placed in the air
        of rooms at random rotations and touch nothing, to teach geometry.

        Raises BadInput if less than n fit, MachineFailed if the extra is not installed.

            >>> len(home.scatter([can], n=2, on="dining table").items) - len(home.items)
            2
        """
        if not models:
            raise BadInput("scatter", "models", "give at least one model")
        if on is not None and in_:
            raise BadInput("scatter", "in_", "cannot be combined with on=", hint="one of the two")
        if floating and on is not None:
            text = "floating items have no support: cannot be combined with on="
            raise BadInput("scatter", "floating", text, hint='in_="Kitchen" chooses a room')
        if floating and physics:
            raise BadInput(
                "scatter", "floating", "floating objects do not fall", hint="omit physics"
            )
        if floating:
            from pbrs_farm.scene.placing import floating_poses as poses
        elif physics:
            from pbrs_farm.scene.physics import settled_poses as poses
        else:
            from pbrs_farm.scene.placing import scattered_poses as poses
        targets = self._supports(in_) if on is None else self._supports_named(on)
        house = self.house
        edits: list[PlaceModel | FloatModel] = []
        with waiting_lines(f"{self.id}: scatter"):
            placed = self.renderer.call(lambda: poses(house, models, n, targets, seed))
        for model, matrix in placed:
            name = self._free_name(model.id, [edit.item for edit in edits])
            kind = FloatModel if floating else PlaceModel
            rows = rows_of_matrix(matrix)
            edits.append(kind(item=name, model=model.ref, world_from_model=rows))
        return self._edited(*edits)

    @checked_call
    def without(self, items: ItemLike) -> Home:
        """The home without items: ids, names, patterns such as "chair*", or items.

        >>> len(home.without("sofa").items) < len(home.items)
        True
        """
        return self._edited(RemoveItems(items=self._ids(items)))

    @checked_call
    def move(
        self, items: ItemLike, by: Vector | None = None, turn_deg: float | None = None
    ) -> Home:
        """The home with items moved by (x, y, z) metres and turned about the vertical of their middle.

        Give one or both. A place in no room is a warning.

        >>> moved = home.move("sofa", by=(0.1, 0, 0))
        >>> np.round(moved.items["sofa"].bounds - home.items["sofa"].bounds, 3)[0].tolist()
        [0.1, 0.0, 0.0]
        """
        if by is None and turn_deg is None:
            raise BadInput("move", "by", "give this, turn_deg= or both")
        ids = self._ids(items)
        bounds = np.array([item.bounds for item in self.house.items if item.id in ids])
        middle = (np.nanmin(bounds[:, 0], 0) + np.nanmax(bounds[:, 1], 0)) / 2
        turn = rotation_y(math.radians(turn_deg or 0.0))
        shift = np.asarray((0, 0, 0) if by is None else by)
        matrix = affine(turn, middle - turn @ middle + shift)
        return self._edited(MoveItems(items=ids, world_from_world=rows_of_matrix(matrix)))

    @checked_call
    def open(
        self,
        items: ItemLike,
        share: Share | None = None,
        part: str = "*",
        *,
        at: Keys | None = None,
    ) -> Home:
        """The home with doors, drawers and lids of items open by a share of their way; 0 closes them.

        items: as of `without`; share: 1 if not given; part: name or pattern of parts in `home.joints`, as "drawer*". at: seconds ->
        share instead, {0: 0, 2: 1}: linear motion between these times, for films. A blocked part opens as far
        as it can, with a warning. Raises BadInput if no part of the items opens.

            >>> max(home.open("door*", 0.7).joints.column("open"))
            0.7
            >>> home.open("door*", at={0: 0, 2: 1}).motions.column("until_s")[0]
            2.0
        """
        if at is not None and share is not None:
            raise BadInput("open", "at", "cannot be combined with share", hint="one of the two")
        joints = self._joints_of(items, part)
        if at is None:
            return self._opened(OpenJoints(joints=joints, share=1.0 if share is None else share))
        keys = tuple((float(t), float(at[t])) for t in sorted(at))
        return self._opened(KeyJoints(joints=joints, keys=keys))

    def _joints_of(self, items: ItemLike, part: str) -> tuple[tuple[str, str], ...]:
        """(item, part) of the matching joints; raises BadInput without a match."""
        ids = frozenset(self._ids(items))
        joints = tuple(
            (item.id, joint.part)
            for item in self.house.items
            if item.id in ids
            for joint in item.joints
            if fnmatchcase(joint.part, part)
        )
        if not joints:
            openable = sorted(
                {joint.part for i in self.house.items if i.id in ids for joint in i.joints}
            )
            text = f"has no {part!r} that opens" if openable else "has no part that opens"
            raise BadInput(self.id, shown(sorted(ids)[0]), text, hint=", ".join(openable[:5]))
        return joints

    def _opened(self, edit: OpenJoints | KeyJoints) -> Home:
        home = self._edited(edit)
        before = len(self.house.notes)
        for note in home.house.notes[before:]:
            warn_caller(f"{home.id}: {note.place} {note.text}")
        return home

    @checked_call
    def at(self, time_s: NotNegative) -> Home:
        """The home at a time, seconds, with all motions stopped there.

        >>> moving = home.open("door*", at={0: 0, 2: 1})
        >>> max(moving.at(1.0).joints.column("open"))
        0.5
        """
        return self._edited(StandAt(time_s=float(time_s)))

    @checked_call
    def drop(
        self,
        items: ItemLike,
        *,
        push: Vector = (0.0, 0.0, 0.0),
        spin: Vector = (0.0, 0.0, 0.0),
        from_s: float = 0.0,
        seconds: Minutes = 5.0,
    ) -> Home:
        """The home in which items fall from from_s on, slide and come to rest, for films.

        By rigid-body simulation (extra `physics`), 60 keys a second; all other items are static. push: initial
        velocity, m/s; spin: initial rad/s; both along the world's axes. An item with a support and without
        either stays there: place it in the air, or push it.

        Raises BadInput, naming the item, if it starts inside another, flies off, leaves the home or still
        moves after so many seconds; MachineFailed if the extra is not installed.

            >>> falling = home.place(can, at=(2.0, 1.0, 2.0)).drop("can 1")
            >>> falling.motions[0]["part"] == "" and falling.motions[0]["keys"] > 20
            True
        """
        from pbrs_farm.scene.falling import recorded_falls

        house, ids = self.house, self._ids(items)
        with waiting_lines(f"{self.id}: drop"):
            bodies = recorded_falls(
                house,
                ids,
                seconds=seconds,
                from_s=float(from_s),
                push=np.asarray(push, np.float64),
                spin=np.asarray(spin, np.float64),
            )
        return self._edited(RecordBodies(bodies=bodies))

    @checked_call
    def paint(self, items: ItemLike, colour: Colour, roughness: Share | None = None) -> Home:
        """The home with items in one plain colour: "#c8b8a0", or sRGB in 0..1.

        >>> home.paint("sofa", "#c8b8a0").id == home.id
        False
        """
        edit = PaintItems(items=self._ids(items), rgb=_rgb(colour), roughness=roughness)
        return self._edited(edit)

    @checked_call
    def material(self, items: ItemLike, picture: str | Path, scale_m: Positive = 1.0) -> Home:
        """The home with items covered by a picture, repeated every scale_m metres.

        >>> home.material("sofa", "wood.png", scale_m=0.5).id == home.id
        False
        """
        path = Path(picture)
        data = read_given(path, MAX_DIGEST_BYTES)
        edit = CoverItems(
            items=self._ids(items),
            path=str(path.resolve()),
            sha256=keys.sha256(data),
            scale_m=scale_m,
        )
        return self._edited(edit)

    @checked_call
    def light(
        self, items: ItemLike, lm: Flux, kelvin: Kelvin | None = None, colour: Colour | None = None
    ) -> Home:
        """The home with lamps of another flux in lumen, and of another colour if given.

        kelvin: of a black body; or colour: "#ff9040", or sRGB in 0..1 without its brightness.

            >>> home.light("floor lamp", lm=800, kelvin=2700).id == home.id
            False
        """
        rgb = _rgb_of_light("light", kelvin, colour)
        return self._edited(SetLight(items=self._ids(items), lm=float(lm), rgb_linear=rgb))

    @checked_call
    def add_light(
        self,
        at: Vector,
        lm: Flux,
        *,
        kelvin: Kelvin | None = None,
        colour: Colour | None = None,
        towards: Vector | None = None,
        angle_deg: Angle | None = None,
        name: str = "",
    ) -> Home:
        """The home with one more bulb at (x, y, z), or with towards a spot of a full angle, 60 degrees if not given.

        kelvin and colour as of light; 3000 kelvin without either. A bulb in no room is a warning.

            >>> len(home.add_light((2, 2.2, 2), lm=400).items) - len(home.items)
            1
        """
        if angle_deg is not None and towards is None:
            raise BadInput("add_light", "angle_deg", "is of a spot: give towards=, too")
        aim = None if towards is None else np.asarray(towards, np.float64) - np.asarray(at)
        if aim is not None and not np.linalg.norm(aim) > 0:
            raise BadInput("add_light", "towards", "is the position of the light")
        rgb = _rgb_of_light("add_light", kelvin, colour) or _rgb_of_kelvin(_WARM_WHITE_K)
        edit = AddLight(
            item=name or self._free_name("light", ()),
            position=triple(np.asarray(at, np.float64)),
            lm=float(lm),
            rgb_linear=rgb,
            direction=None if aim is None else triple(aim / np.linalg.norm(aim)),
            cutoff_rad=math.radians(60.0 if angle_deg is None else angle_deg) / 2,
        )
        return self._edited(edit)

    def _edited(self, *edits: Edit) -> Home:
        home = replace(self, source=self.source.edited(*edits))
        # Load it now, so that a wrong edit raises here.
        self._warn_of_what_left(home.house, edits)
        return home

    def _warn_of_what_left(self, after: House, edits: Sequence[Edit]) -> None:
        """Warn of items that edits placed or moved outside all rooms, if the home has rooms."""
        was_in = {item.id: item.room_id is not None for item in self.house.items}
        put: list[str] = []
        for edit in edits:
            if isinstance(edit, PlaceModel | FloatModel | AddLight):
                put.append(edit.item)
            elif isinstance(edit, MoveItems):
                put += [name for name in edit.items if was_in[name]]
        outside = [i for i in after.items if i.id in set(put) and i.room_id is None]
        if outside and after.rooms:
            x, y, z = outside[0].bounds.mean(0)
            more = f", nor are {len(outside) - 1} more" if outside[1:] else ""
            text = f"{shown(outside[0].id)} at ({x:.2f}, {y:.2f}, {z:.2f}) is in no room"
            warn_caller(f"{after.id}: {text}{more}")

    def _placing(self, model: Model, matrix: F64, name: str) -> PlaceModel:
        item = name or self._free_name(model.id, ())
        return PlaceModel(item=item, model=model.ref, world_from_model=rows_of_matrix(matrix))

    def _free_name(self, stem: str, taken: Sequence[str]) -> str:
        used = {*(item.id for item in self.house.items), *taken}
        return next(f"{stem} {k}" for k in range(1, len(used) + 2) if f"{stem} {k}" not in used)

    def _ids(self, items: ItemLike) -> tuple[str, ...]:
        words = [items] if isinstance(items, str | Item | Mapping) else list(items)
        ids: dict[str, None] = {}
        for word in words:
            if isinstance(word, Item):
                ids[word.id] = None
            elif isinstance(word, Mapping) and "id" in word:
                ids[self.items[str(word["id"])].id] = None
            elif not isinstance(word, str):
                raise BadInput("items", repr(word), "expected names of items, or items")
            else:
                ids |= dict.fromkeys(item.id for item in self.items.named(word))
        if not ids:
            raise BadInput(self.id, "items", "give at least one")
        return tuple(ids)

    def _supports_named(self, on: str | Item | Room | None) -> list[Item | Room]:
        if isinstance(on, Item | Room):
            return [on]
        rooms = self.rooms
        return [rooms[on]] if on is not None and rooms.has(on) else list(self.items.named(on or ""))

    def _supports(self, room: str) -> list[Item | Room]:
        from pbrs_farm.scene.placing import furniture_of

        rooms = [self.rooms[room]] if room else list(self.house.rooms)
        return [target for r in rooms for target in (*furniture_of(self.house, r), r)]

    # Looking and rendering.

    @checked_call
    def plan(self, cameras: Sequence[Camera | Viewpoint] = ()) -> str:
        """Its plan as SVG text: rooms with names, outlines of items, lamps, and cameras if given.

        >>> home.plan().startswith("<svg")
        True
        """
        from pbrs_farm.sample.camera_map import plan_svg

        return plan_svg(self.house, [self.viewpoint(camera).view for camera in cameras])

    @checked_call
    def sketches(
        self, cameras: Sequence[Camera | Viewpoint], edge_px: Edge = 160
    ) -> list[NDArray[np.uint8]]:
        """A small quick picture (H, W, 3) sRGB from each camera, edge_px along its longer edge.

        By OpenGL, or its diffuse colours by rays on a machine without OpenGL.

        >>> home.sketches([camera], edge_px=32)[0].shape
        (24, 32, 3)
        """
        small = []
        for camera in (self.viewpoint(place).camera for place in cameras):
            width, height = camera.intrinsics.width_px, camera.intrinsics.height_px
            scale = edge_px / max(width, height)
            size = max(1, round(scale * width)), max(1, round(scale * height))
            small.append(camera.with_size(*size))
        return self.renderer.sketches(self.source, self.recipe, small)

    @checked_call
    def cameras(
        self,
        preset: str | None = None,
        n: Count | None = None,
        *,
        size: Size | None = None,
        **fields: Any,
    ) -> Viewpoints:
        """Viewpoints by the rules of a preset, best first in each room.

        preset: photo, paper or released; None = the recipe's. n: so many, spread over rooms; None =
        all. size: (width, height) of the pictures, pixels; None = the recipe's. fields: of the recipe's
        group `cameras`, such as hfov_rad=1.2 or source="walk".

            >>> len(home.cameras("photo", n=2))
            2
        """
        changes = {"preset": preset, **fields} if preset is not None else fields
        settings = {f"cameras.{name}": value for name, value in changes.items()}
        if size is not None:
            settings |= {"image.width_px": size[0], "image.height_px": size[1]}
        home = self.set(**settings)
        data = self.renderer.sampled(self.source, home.recipe)
        views = views_from_json(data, "cameras.json")
        rows = [(view.id, view.room_id, view.score) for view in views.values()]
        chosen = plan.chosen_views(rows, n or 0, home.recipe)
        # Their scores come from a small picture: set the final size.
        size = home.recipe.image.width_px, home.recipe.image.height_px
        viewpoints = [
            Viewpoint(
                replace(views[name], camera=views[name].camera.with_size(*size)),
                home.recipe.cameras,
            )
            for name in chosen
        ]
        report = CameraReport.model_validate(json.loads(data)["report"])
        return Viewpoints(viewpoints, report, self)

    @checked_call
    def cameras_around(
        self,
        items: ItemLike | None = None,
        n: CameraCount = 1,
        *,
        distance_m: Span = (0.5, 1.2),
        elevation_deg: Span = (15.0, 65.0),
        min_visible: Share = 0.5,
        size: Size | None = None,
        hfov_deg: float = 50.0,
        K: Any = None,
        seed: Whole = 0,
    ) -> Viewpoints:
        """n viewpoints that look at items each: at placed models where none are named.

        distance_m and elevation_deg: ranges for drawing. min_visible: minimum visible share of the item. size:
        of the pictures, that of the recipe for None. K: 3 x 3, for that size, instead of hfov_deg. Equal seeds
        give equal cameras. Raises BadInput if fewer are found.

            >>> len(home.cameras_around("sofa", n=1))
            1
        """
        from pbrs_farm.scene.aiming import cameras_around

        ids = set(self._ids(items)) if items is not None else None
        viewpoints = [
            item
            for item in self.house.items
            if (item.pose is not None if ids is None else item.id in ids)
        ]
        if not viewpoints:
            raise BadInput(self.id, "cameras", "no model was placed", hint="give items to look at")
        if not distance_m[0] > 0:
            raise BadInput("cameras_around", "distance_m", "expected metres above 0")
        image = self.recipe.image
        size = (image.width_px, image.height_px) if size is None and K is None else size
        house, intrinsics = self.house, intrinsics_from_k(size, K, hfov_deg)
        cameras = self.renderer.call(
            lambda: cameras_around(
                house,
                viewpoints,
                n,
                distance_m=distance_m,
                elevation_deg=elevation_deg,
                min_visible=min_visible,
                intrinsics=intrinsics,
                seed=seed,
            )
        )
        return Viewpoints([self.viewpoint(camera) for camera in cameras], home=self)

    @checked_call
    def viewpoint(self, camera: Camera | Viewpoint) -> Viewpoint:
        """A camera as a viewpoint of this home, with its room.

        >>> home.viewpoint(camera).room in {room.id for room in home.house.rooms}
        True
        """
        if isinstance(camera, Viewpoint):
            return camera
        rigid_motion(camera.world_from_camera, "camera", "world_from_camera")
        image = self.recipe.image
        sized = camera_of_recipe(camera, image.width_px, image.height_px)
        return viewpoint_of(sized, self.house, self.recipe.cameras)


class Rooms(Table):
    """A home's rooms: rows of id, name, floor area in m2, ceiling height in m, enclosure, items."""

    def __init__(self, house: House) -> None:
        """house: finished."""
        self._house = house
        rows = [
            {
                "id": room.id,
                "name": room.name,
                "area": round(_area(room), 2),
                "height": round(room.ceiling_y - room.floor_y, 2),
                "enclosure": str(room.enclosure),
                "items": sum(item.room_id == room.id for item in house.items),
            }
            for room in house.rooms
        ]
        super().__init__(("id", "name", "area", "height", "enclosure", "items"), rows)

    def __getitem__(self, at: Any) -> Any:
        """A room by id or name (a Room), else a row by number."""
        if not isinstance(at, str):
            return super().__getitem__(at)
        matches = [r for r in self._house.rooms if at in (r.id, r.name)]
        matches = matches or [r for r in self._house.rooms if r.name.lower() == at.lower()]
        if not matches:
            names = [name for r in self._house.rooms for name in (r.name, r.id)]
            raise BadInput(self._house.id, at, "no such room", hint=did_you_mean(at, names))
        return matches[0]

    @checked_call
    def has(self, name: str) -> bool:
        """True if a room has this id or name.

        >>> home.rooms.has("Living room"), home.rooms.has("Ballroom")
        (True, False)
        """
        return any(name in (r.id, r.name) for r in self._house.rooms)


class Joints(Table):
    """A home's doors, drawers and lids: rows of item id, its name, part, kind, value, upper limit, open
    share, mass; a row has the axis and a point on it (world, metres), lower limit and instance id, too.

    Values are radians (revolute) or metres (prismatic) from closed.
    """

    def __init__(self, house: House) -> None:
        """house: finished."""
        rows = [
            {
                "instance": k,
                "item": item.id,
                "name": item.name,
                "part": joint.part,
                "kind": str(joint.kind),
                "value": joint.value,
                "lower": joint.lower,
                "upper": joint.upper,
                "open": round(joint.share, 4),
                "mass_kg": round(joint.mass_kg, 3),
                "axis": joint.axis,
                "point": joint.point,
            }
            for k, item in enumerate(house.items, 1)
            if not item.is_outside
            for joint in item.joints
        ]
        super().__init__(
            ("item", "name", "part", "kind", "value", "upper", "open", "mass_kg"), rows
        )


class Items(Table):
    """A home's items: rows of instance id, item id, name, class, room, size and middle in metres."""

    def __init__(self, house: House, items: Sequence[Item] | None = None) -> None:
        """house: finished. items: some of its items; None: all but the outdoors and removed ones."""
        self._house = house
        inside = (item for item in house.items if not item.is_outside and not item.is_removed)
        self._items = tuple(inside if items is None else items)
        instance = {item.id: k for k, item in enumerate(house.items, 1)}
        room_names = {room.id: room.name for room in house.rooms}
        rows = [_row(item, instance[item.id], room_names) for item in self._items]
        super().__init__(("instance", "id", "name", "class", "room", "size", "middle"), rows)

    def __getitem__(self, at: Any) -> Any:
        """An item by id, by a name that one item alone has, or as "table 2"; else a row by number."""
        if not isinstance(at, str):
            return super().__getitem__(at)
        matches = [i for i in self._items if i.id == at] or self._same_name(at)
        stem, _, number = at.rpartition(" ")
        if not matches and number.isdecimal():
            matches = self._same_name(stem)[int(number) - 1 :][: int(number) > 0]
        if not matches:
            raise self._unknown(at)
        if len(matches) > 1:
            hint = f'"{at} 1", or an id: {", ".join(item.id for item in matches[:5])}'
            raise BadInput(self._house.id, at, f"{len(matches)} items have this name", hint=hint)
        return matches[0]

    def _same_name(self, name: str) -> list[Item]:
        return [item for item in self._items if item.name.lower() == name.lower()]

    @checked_call
    def named(self, pattern: str) -> tuple[Item, ...]:
        """The items whose id, name or class matches, as "chair*"; raises BadInput without a match.

        >>> len(home.items.named("floor*")) > 0
        True
        """
        for key in (_ids, _words):
            # A name may contain characters of patterns: "chair [2]".
            items = tuple(
                i
                for i in self._items
                if any(w == pattern or fnmatchcase(w, pattern) for w in key(i))
            )
            if items:
                return items
        low = pattern.lower()
        items = tuple(i for i in self._items if any(fnmatchcase(w.lower(), low) for w in _words(i)))
        if not items:
            raise self._unknown(pattern)
        return items

    @checked_call
    def near(self, name: str, within_m: Positive = 1.5) -> Items:
        """The items whose box is within a distance of an item's box, nearest first.

        >>> len(home.items.near("dining table")) > 0
        True
        """
        target = self.named(name)[0]
        low, high = target.bounds
        nearby = []
        for item in self._items:
            a, b = item.bounds
            gap = float(np.linalg.norm(np.maximum(0, np.maximum(low - b, a - high))))
            if item.id != target.id and not item.kind.is_structure and gap <= within_m:
                nearby.append((gap, item.id, item))
        return Items(self._house, [item for _gap, _id, item in sorted(nearby, key=lambda f: f[:2])])

    def _unknown(self, name: str) -> BadInput:
        words = dict.fromkeys(w for item in self._items for w in (*_ids(item), *_words(item)))
        return BadInput(self._house.id, name, "no such item", hint=did_you_mean(name, words))


def _ids(item: Item) -> tuple[str, ...]:
    return (item.id,)


def _words(item: Item) -> tuple[str, ...]:
    return (item.name, NYU40_NAMES[item.nyu40], str(item.kind))


def _row(item: Item, instance: int, room_names: Mapping[str, str]) -> dict[str, Any]:
    low, high = item.bounds
    return {
        "instance": instance,
        "id": item.id,
        "name": item.name,
        "class": NYU40_NAMES[item.nyu40],
        "kind": str(item.kind),
        "room": room_names.get(item.room_id or "", ""),
        "size": [round(float(v), 3) for v in high - low],
        "middle": [round(float(v), 3) for v in (low + high) / 2],
        "model": item.pose.model if item.pose else "",
        "world_from_model": item.pose.world_from_model if item.pose else None,
    }


def _area(room: Room) -> float:
    x, z = np.asarray(room.polygon).T
    return float(abs(np.dot(x, np.roll(z, -1)) - np.dot(z, np.roll(x, -1))) / 2)


def _rgb(colour: str | Sequence[float]) -> tuple[float, float, float]:
    values: list[float] = []
    if isinstance(colour, str):
        text = colour.removeprefix("#")
        if len(text) == 6 and all(c in "0123456789abcdefABCDEF" for c in text):
            values = [int(text[k : k + 2], 16) / 255 for k in (0, 2, 4)]
    else:
        values = [float(v) for v in colour]
    if len(values) != 3 or not all(0 <= v <= 1 for v in values):
        raise BadInput("colour", str(colour), 'expected "#rrggbb" or three numbers in 0..1')
    return values[0], values[1], values[2]


def _rgb_of_light(
    call: str, kelvin: float | None, colour: Colour | None
) -> tuple[float, float, float] | None:
    """Linear RGB of a light, its largest 1; None if neither is given."""
    if colour is None:
        return None if kelvin is None else _rgb_of_kelvin(kelvin)
    if kelvin is not None:
        raise BadInput(call, "colour", "give either this or kelvin")
    rgb = linear_from_srgb(np.array(_rgb(colour)))
    if not rgb.max() > 0:
        raise BadInput(call, "colour", "is black", hint="lm=0 turns the light off")
    return triple(rgb / rgb.max())


def _rgb_of_kelvin(kelvin: float) -> tuple[float, float, float]:
    rgb = rgb_from_kelvin(kelvin)
    return triple(rgb / rgb.max())


@checked_call
def load(
    home: str | Path,
    recipe: str | Path | Recipe = "fast",
    *,
    models: str | Path = "",
    **settings: Any,
) -> Home:
    """A home by any word of `pbrs-farm run`.

    home: a file of any format that `pbrs-farm inputs` lists, a SUNCG house folder, an example home's
    name ("Studio"), "builtin", "made:7", or a plugin's "plugin:NAME,7". models: the folder of the models that a scene of HSSD, 3D-FRONT or
    Holodeck names. recipe: preview, fast, paper, released, a .toml file or a Recipe.
    settings: recipe fields to override: pf.load("Studio", **{"light.spp": 64}).

    Only the file's digest is read before the home's first use. Raises BadHouse for a word that names no
    home, BadRecipe for an unknown recipe or field.

        >>> pf.load("builtin", "preview", **{"light.spp": 64}).recipe.light.spp
        64
    """
    return Home(resolve(str(home), models=str(models)), recipe_of(recipe)).set(**settings)


@checked_call
def make(seed: Whole, rooms: str | int = "", **options: Any) -> Home:
    """A home of a seed: drawn, furnished, the same on every machine (docs/homes.md).

    rooms: of bedrooms, "2" or "1..3". options: as of `made:` words, such as area="60..90".

        >>> pf.make(7, rooms="1..2").id == pf.make(8, rooms="1..2").id
        False
    """
    words = {**({"rooms": rooms} if rooms else {}), **options}
    recipe = words.pop("recipe", "fast")
    text = ",".join([f"made:{int(seed)}", *(f"{name}={value}" for name, value in words.items())])
    return Home(resolve(text), recipe_of(recipe))


def recipe_of(recipe: str | Path | Recipe) -> Recipe:
    """A recipe by name, by .toml file, or itself. Raises BadRecipe.

    A name is one of the presets; a path or text that ends in .toml is read from disk. Any other value
    raises BadRecipe.
    """
    if isinstance(recipe, Recipe):
        return recipe
    if str(recipe).endswith(".toml"):
        from pbrs_farm.formats.recipe_toml import recipe_from_toml

        return recipe_from_toml(Path(recipe), {})
    if not isinstance(recipe, str):
        raise BadRecipe(f"{recipe!r} is not a recipe")
    return recipe_from_name(recipe)
