"""The argument of a check: a root, a house with its scenes, or a view of it. No effects."""

from __future__ import annotations

import glob
import zlib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.check.certificate import Expect, Tally
from pbrs_farm.check.embree_caster import Rays
from pbrs_farm.check.fields import row_and_names
from pbrs_farm.check.moved_house import MovedHouse, house_at
from pbrs_farm.check.stored_files import stored_object
from pbrs_farm.check.stored_house import StoredHouse
from pbrs_farm.check.stored_mesh import Triangles
from pbrs_farm.check.stored_set import StoredForm, StoredSet
from pbrs_farm.check.stored_view import StoredView
from pbrs_farm.core.arrays import F32, F64, I64, Bools

SAMPLE = 2000  # pixels of each view to recompute by default
_MOST_TIMES = 4  # cached scenes of a moving house: at rest, a frame and its neighbours
Layers = Mapping[str, NDArray[Any]]  # name -> (H, W) or (H, W, C)
Channels = Mapping[str, F32]  # of radiance.exr
Pixels = tuple[I64, I64]  # rows and columns, each (N,)

_T = TypeVar("_T")


class Tracer(Protocol):
    """Traces light of a stored view again, at another size."""

    @property
    def variant(self) -> str:
        """Mitsuba's variant."""

    def light(
        self, house_id: str, view_id: str, width_px: int, height_px: int
    ) -> Mapping[str, F32]:
        """(H, W, 3) radiance of each light group; BadInput or RenderFailed if it cannot be traced."""


class Scene(NamedTuple):
    """Triangles, and rays among them."""

    triangles: Triangles
    rays: Rays


@dataclass(frozen=True, eq=False)
class Cast:
    """N rays of a view, and the triangles that they hit first or are assumed to hit."""

    scene: Scene
    rows: NDArray[Any]
    columns: NDArray[Any]
    origin: F64  # (3,)
    directions: F64  # (N, 3)
    face: I64  # (N,), -1 = nothing

    @staticmethod
    def of(view: StoredView, rows: NDArray[Any], columns: NDArray[Any], scene: Scene) -> Cast:
        """The first hits of pixels' rays in a scene."""
        origin, directions = view.rays(rows, columns)
        face = scene.rays.first(origin, directions)
        return Cast(scene, rows, columns, origin, directions, face)

    def some(self, index: NDArray[Any]) -> Cast:
        """Some of the pixels."""
        rows, columns = self.rows[index], self.columns[index]
        directions, face = self.directions[index], self.face[index]
        return Cast(self.scene, rows, columns, self.origin, directions, face)

    def at(self, face: I64) -> Cast:
        """The same rays, assumed to hit other triangles."""
        return replace(self, face=face)

    @property
    def hit(self) -> Bools:
        """(N,) True for rays that hit anything."""
        return self.face >= 0

    @cached_property
    def z(self) -> F64:
        """(N,) distance of the hits in lengths of directions."""
        return self.scene.rays.distance(self.face, self.origin, self.directions)

    @cached_property
    def point(self) -> F64:
        """(N, 3) the hits."""
        return np.asarray(self.origin + self.directions * self.z[:, None])

    @cached_property
    def normal(self) -> F64:
        """(N, 3) unit normals of the faces, towards the camera."""
        return self.scene.rays.normal(self.face, self.directions)

    @property
    def instance(self) -> I64:
        """(N,) instances, 0 = nothing."""
        return self.of_face(self.scene.triangles.instance)

    def of_face(self, table: NDArray[Any]) -> NDArray[Any]:
        """(N,) table[face], 0 where face is -1."""
        if not len(table):
            return np.zeros(len(self.face), table.dtype)
        return np.where(self.hit, table[self.face], table.dtype.type(0))

    def __len__(self) -> int:
        return len(self.face)


@dataclass(frozen=True, eq=False)
class Scenes:
    """A house at a time, ready for rays."""

    moved: MovedHouse
    _shared: dict[Any, Any] = field(default_factory=dict)

    @property
    def house(self) -> StoredHouse:
        """Its documents, with items where they are at that time."""
        return self.moved.house

    @property
    def triangles(self) -> Triangles:
        """All its triangles."""
        return self.moved.triangles

    @cached_property
    def rays(self) -> Rays:
        """Rays among all triangles."""
        return Rays(self.triangles)

    @cached_property
    def opaque(self) -> Rays:
        """Rays among all triangles but glass and panes."""
        return Rays(self.triangles, ~self.triangles.see_through)

    def shared(self, kind: Callable[[StoredHouse, Triangles], _T]) -> _T:
        """A value made of the house once, for all views at that time."""
        if kind not in self._shared:
            self._shared[kind] = kind(self.house, self.triangles)
        value: _T = self._shared[kind]
        return value


class ScenesInTime:
    """The scenes of a house at one time after another. State: those of the last times."""

    def __init__(self, house: StoredHouse, triangles: Triangles) -> None:
        self._house, self._triangles = house, triangles
        self._cache: dict[float | None, Scenes] = {}

    def at(self, time_s: float | None) -> Scenes:
        """The scenes at a time in seconds, None: at rest; a house in which nothing moves has one."""
        time_s = time_s if self._house.house.get("motions") else None
        if time_s not in self._cache:
            while len(self._cache) >= _MOST_TIMES:
                del self._cache[next(iter(self._cache))]
            self._cache[time_s] = Scenes(house_at(self._house, self._triangles, time_s))
        return self._cache[time_s]


@dataclass(frozen=True, slots=True)
class RootCase:
    """A root, with all of its house folders or one of them."""

    root: Path
    houses: tuple[Path, ...]
    tally: Tally

    def has(self, file: str) -> bool:
        """True if the root has the file."""
        return (self.root / file).is_file()


class SeenView(NamedTuple):
    """A checked view with the layers that reprojection needs."""

    view: StoredView
    depth: NDArray[Any]  # as depth.png stores it
    normal: NDArray[Any]  # as normal.png stores it
    moves: Bools  # (H, W) shows an item that may be elsewhere in other views


@dataclass(frozen=True)
class HouseCase:
    """The documents of a house, and its views once they are checked."""

    house: StoredHouse
    glb: bytes
    times: ScenesInTime
    tally: Tally
    views: tuple[SeenView, ...] = ()
    tracer: Tracer | None = None

    @cached_property
    def rest(self) -> Scenes:
        """The house at rest."""
        return self.times.at(None)

    def has(self, file: str) -> bool:
        """True if the house's folder has the file."""
        return (self.house.folder / file).is_file()

    def expect(self, check: str, place: str = "") -> Expect:
        """Reports facts of a check, at a place of the house."""
        return self.tally.at(check, f"{self.house.id} {place}".rstrip())


@dataclass(frozen=True)
class ViewCase:
    """A view, with the house at its time."""

    view: StoredView
    now: Scenes
    times: ScenesInTime
    n_pixels: int | None  # to recompute by rays; None = all
    tally: Tally
    radiance: Callable[[], Channels]  # reads radiance.exr once
    is_halved: bool  # denoised light is recomputed at half the picture's size
    arrays: Layers = field(default_factory=dict)
    tracer: Tracer | None = None

    @property
    def house(self) -> StoredHouse:
        """The house at the view's time."""
        return self.now.house

    @property
    def place(self) -> str:
        """House and view, as messages name them."""
        return self.view.place

    @property
    def scene(self) -> Scene:
        """All triangles at the view's time."""
        return Scene(self.now.triangles, self.now.rays)

    @property
    def light(self) -> Channels:
        """The channels of radiance.exr; {} if it is missing or cannot be read."""
        return self.radiance()

    @cached_property
    def pixels(self) -> Pixels:
        """The pixels to recompute."""
        return self.sample(self.n_pixels)

    def has(self, name: str) -> bool:
        """True if the view has the layer or file; radiance that can be read."""
        if name == "radiance":
            return bool(self.light)
        return name in self.arrays or ("." in name and self.view.has(name))

    def expect(self, check: str, file: str = "") -> Expect:
        """Reports facts of a check, about the view or a file of it."""
        return self.tally.at(check, f"{self.place}/{file}".rstrip("/"))

    def cast(self, rows: NDArray[Any], columns: NDArray[Any]) -> Cast:
        """The first hits of pixels' rays among all triangles."""
        return Cast.of(self.view, rows, columns, self.scene)

    def sample(self, n_pixels: int | None) -> Pixels:
        """Rows and columns of all pixels, or of a sample that the view's name fixes."""
        height, width = self.view.size
        if n_pixels is None or n_pixels >= height * width:
            index = np.arange(height * width)
        else:
            rng = np.random.default_rng(zlib.crc32(self.place.encode()))
            index = rng.choice(height * width, n_pixels, replace=False)
        return index // width, index % width


@dataclass(frozen=True, slots=True)
class SetCase:
    """A training set."""

    stored: StoredSet
    tally: Tally


@dataclass(frozen=True, eq=False)
class FormCase:
    """A part's views in a form, or those of one split."""

    form: StoredForm
    split: str  # "" for a form without folders of splits
    kept: frozenset[tuple[str, str]]  # (house, view) that the index keeps here
    root: Path  # of the part
    split_of: Callable[[str], str]  # house -> its split
    tally: Tally

    @property
    def folder(self) -> Path:
        """The folder of the split."""
        return self.form.folder / self.split

    @cached_property
    def keys(self) -> dict[str, tuple[str, str]]:
        """`<house>__<view>` -> house and view of the kept views, by name."""
        return {f"{house}__{view}": (house, view) for house, view in sorted(self.kept)}

    def view(self, key: str) -> StoredView | None:
        """The part's view of a key; None unless it is kept. BadFile if its view.json is damaged."""
        if key not in self.keys:
            return None
        house, view = self.keys[key]
        folder = next(self.root.glob(f"*/{glob.escape(house)}/views/{glob.escape(view)}"), None)
        if folder is None:
            return None
        return StoredView(folder, stored_object(folder / "view.json"))

    @cached_property
    def files(self) -> tuple[str, ...]:
        """Every file of the folder, below it."""
        paths = (p.relative_to(self.folder) for p in self.folder.rglob("*") if p.is_file())
        return tuple(sorted(path.as_posix() for path in paths))

    def place(self, file: str = "") -> str:
        """A file as messages name it."""
        names = "forms", self.form.name, self.form.part, self.split, file
        return "/".join(filter(None, names))

    def compare(
        self, check: str, place: str, stored: NDArray[Any], truth: Any, within: float | F64 = 0
    ) -> None:
        """Compare an array with the part's, pixel by pixel, within a tolerance."""
        shape = None if truth is None else np.shape(truth)
        fault = f"is {stored.shape}, the part's {shape}"
        if self.tally.expect(check, place, stored.shape == shape, fault):
            near = np.abs(stored.astype(np.float64) - truth) <= within
            self.tally.pixels(check, place, near.reshape(*near.shape[:2], -1).all(-1))

    def has(self, name: str) -> bool:
        """False for "NYU40" in a form with the classes of a user's table."""
        return name != "NYU40" or not self.form.options.get("classes")

    def matching(self, check: str) -> Iterator[tuple[str, str]]:
        """The files of a check by set_fields.csv whose names give a view, with the view's key."""
        for file in self.files:
            row, names = row_and_names(f"{self.form.to}/{file}")
            if row is not None and row.check == check and names:
                key = names.get("key") or f"{names['house']}__{names.get('view')}"
                if "number" in names:  # of the house's views
                    of_house = [k for k, pair in self.keys.items() if pair[0] == names["house"]]
                    key = dict(enumerate(of_house)).get(int(names["number"]), "")
                yield file, key
