"""Furniture and texture libraries, folders of models -> Catalogue; read once, shapes when they are used.

Effects: reads the libraries' catalogues and digests; shapes are read from them later.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from itertools import accumulate
from math import prod
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from pydantic import TypeAdapter

from pbrs_farm.assets.debian import drop_oldest, read_used, write_whole
from pbrs_farm.core import keys
from pbrs_farm.core.catalogue import Catalogue, Picture, Piece, Shape
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.house import LightPart, Material, Note, Surface, Texture
from pbrs_farm.core.joints import Joint
from pbrs_farm.read.catalogue.library_files import (
    FURNITURE,
    JAR_FURNITURE,
    Entry,
    Library,
    furniture_library,
)
from pbrs_farm.read.catalogue.library_shapes import library_shape
from pbrs_farm.read.catalogue.model_folder import model_folder
from pbrs_farm.read.catalogue.piece_groups import (
    GroupRule,
    PieceVerdict,
    group_rule,
    piece_verdicts,
)
from pbrs_farm.read.catalogue.surface_pictures import (
    JAR_TEXTURES,
    TEXTURES,
    picture_folder,
    pictures_of_models,
    texture_library,
)
from pbrs_farm.read.common.notes import Notes

FORMAT: Final = 2
MOST_BYTES: Final = 1_000_000_000  # maximum size of a store; the oldest shapes are removed first
_UNUSABLE: Final = b"\n"
_ALIGNED: Final = 8  # arrays begin at multiples of this

_Array = tuple[str, tuple[int, ...]]  # its type and shape


@dataclass(frozen=True, slots=True)
class _DescribedSurface:
    name: str
    material: int
    part: str
    arrays: tuple[_Array | None, ...]  # positions, faces, uvs, normals


@dataclass(frozen=True, slots=True)
class _Described:
    # A shape but its arrays and pictures, which follow in this order.
    surfaces: tuple[_DescribedSurface, ...]
    materials: tuple[Material, ...]
    textures: tuple[tuple[str, str, str, int], ...]  # id, name, media type, bytes
    lights: tuple[LightPart, ...]
    joints: tuple[Joint, ...]


_DESCRIBED: Final = TypeAdapter(_Described)


class ShapeStore:
    """Shapes by what they are made from, in a folder that processes may share."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def shape(self, key: StoreKey, make: Callable[[], Shape | None]) -> Shape | None:
        """The cached shape of a key, which names all inputs; made if missing. None, cached too: unreadable.

        Its arrays are read-only.
        """
        path = self._folder / f"{keys.digest(FORMAT, *key)}.shape"
        with suppress(OSError, ValueError, TypeError, OverflowError):
            return _unpacked(read_used(path))
        shape = make()
        packed = _packed(shape)
        with suppress(OSError):
            self._folder.mkdir(parents=True, exist_ok=True)
            write_whole(path, packed)
            drop_oldest(path, MOST_BYTES)
        with suppress(ValueError):  # an infinite limit of a joint cannot be stored
            return _unpacked(packed)  # what a later call returns
        return shape


def _packed(shape: Shape | None) -> bytes:
    if shape is None:
        return _UNUSABLE
    arrays = [(s.positions, s.faces, s.uvs, s.normals) for s in shape.surfaces]
    textures = shape.textures.values()
    described = _Described(
        tuple(
            _DescribedSurface(
                s.name, s.material, s.part,
                tuple(None if a is None else (a.dtype.str, a.shape) for a in of_surface),
            )
            for s, of_surface in zip(shape.surfaces, arrays, strict=True)
        ),
        shape.materials,
        tuple((t.id, t.name, t.media_type, len(t.data)) for t in textures),
        shape.lights,
        shape.joints,
    )  # fmt: skip
    parts = [a.tobytes() for of_surface in arrays for a in of_surface if a is not None]
    parts = [_DESCRIBED.dump_json(described) + b"\n", *parts, *(t.data for t in textures)]
    return b"".join(part.ljust(_aligned(len(part))) for part in parts)


def _aligned(n_bytes: int) -> int:
    return -(-n_bytes // _ALIGNED) * _ALIGNED


def _unpacked(data: bytes) -> Shape | None:
    """Inverse of _packed; ValueError, TypeError or OverflowError for any other data."""
    if data == _UNUSABLE:
        return None
    end = data.index(b"\n") + 1
    d = _DESCRIBED.validate_json(data[:end])
    start = _aligned(end)

    def taken(n_bytes: int) -> int:
        nonlocal start
        start += _aligned(n_bytes)
        if n_bytes < 0 or start > len(data):
            raise ValueError("cut short")
        return start - _aligned(n_bytes)

    def array(described: _Array | None) -> NDArray[Any] | None:
        if described is None:
            return None
        kind, shape = np.dtype(described[0]), described[1]
        if kind.kind not in "fiu":
            raise ValueError("not numbers")
        n = prod(shape)
        first = taken(n * kind.itemsize)
        return np.frombuffer(data, kind, n, first).reshape(shape)

    surfaces = []
    for s in d.surfaces:
        positions, faces, uvs, normals = map(array, s.arrays)
        if positions is None or faces is None:
            raise ValueError("a surface without triangles")
        surfaces.append(Surface(s.name, positions, faces, s.material, uvs, normals, s.part))
    textures = {}
    for id_, name, kind, n_bytes in d.textures:
        first = taken(n_bytes)
        textures[id_] = Texture(id_, name, kind, data[first : first + n_bytes])
    if start != len(data):
        raise ValueError("too long")
    return Shape(tuple(surfaces), d.materials, textures, d.lights, d.joints)


VERSION: Final = 3
"""Of the rules, the tables and the reading of models: part of the digest, and of what stored shapes
are known by. Raised when a piece or its shape changes."""
_AS_WRITTEN: Final = PieceVerdict("", 0.0, "")

Loader = Callable[[], Shape | None]
StoreKey = tuple[str | int, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Found:
    """Contents of a library or folder."""

    sha256: str
    pieces: tuple[tuple[Piece, Loader], ...] = ()
    pictures: tuple[Picture, ...] = ()


def catalogue_from(
    libraries: Sequence[Path],
    *,
    jar: Path | None = None,
    given: Sequence[Path] = (),
    store: Path | None = None,
    may_be_empty: bool = False,
) -> Catalogue:
    """Merge libraries into a catalogue; for repeated ids the later library wins.

    libraries: .sh3f files of the packages. jar: the program's, with its own models. given: the
    user's .sh3f and .sh3t libraries and folders of models. store: a folder that caches shapes.
    Damaged entries become notes; BadInput for a path that does not exist or is no library, and for a
    library without any usable piece, unless may_be_empty.
    """
    notes = Notes("", strict=False)
    libraries_read = []
    if jar is not None:
        libraries_read.append(_read_furniture_library(jar, notes, JAR_FURNITURE))
        libraries_read.append(_textures(jar, notes, JAR_TEXTURES))
    libraries_read += [_read_furniture_library(path, notes, FURNITURE) for path in libraries]
    users = [_given(path, notes, store, may_be_empty=may_be_empty) for path in given]
    libraries_read += users
    usable = [f for f in libraries_read if f is not None]
    # Later libraries replace pieces of earlier ones.
    shapes = ShapeStore(store) if store is not None else None
    pieces: dict[str, Piece] = {}
    loaders: dict[str, Loader] = {}
    stored: dict[str, StoreKey] = {}
    for library in usable:
        for piece, loader in library.pieces:
            pieces[piece.id], loaders[piece.id] = piece, loader
            if shapes is not None:
                stored[piece.id] = key = _store_key(library.sha256, piece)
                loaders[piece.id] = partial(shapes.shape, key, loader)
    return Catalogue(
        pieces=tuple(pieces.values()),
        load=lambda piece: loaders[piece.id]() if piece.id in loaders else None,
        digest=keys.digest({"version": VERSION, "libraries": [f.sha256 for f in usable]}),
        pictures=tuple({p.texture.id: p for f in usable for p in f.pictures}.values()),
        notes=notes.all(),
        own=frozenset(piece.id for f in users if f is not None for piece, _ in f.pieces),
        stored=stored,
    )


def _store_key(sha256: str, piece: Piece) -> StoreKey:
    return VERSION, sha256, piece.id, piece.group, piece.place.value


@dataclass(frozen=True, slots=True)
class _Index:
    # A catalogue without the data of its pictures, which follow, and its shapes.
    pieces: tuple[Piece, ...]
    digest: str
    pictures: tuple[Picture, ...]
    sizes: tuple[int, ...]  # of their data, bytes
    notes: tuple[Note, ...]
    stored: dict[str, StoreKey]


_INDEX: Final = TypeAdapter(_Index)


def indexed(path: Path, make: Callable[[], Catalogue]) -> Catalogue:
    """The catalogue whose index is stored at path, else made and stored; made as well for a missing shape.

    make: gives a catalogue without the user's own pieces, all of them `stored`, and knows it the next time.
    path: beside the shapes; its name holds everything that the catalogue depends on.
    """
    shapes = ShapeStore(path.parent)
    with suppress(OSError, ValueError):
        data = read_used(path)
        end = data.index(b"\n") + 1
        index = _INDEX.validate_json(data[:end])
        ends = [end + n for n in accumulate(index.sizes)]
        if len(data) != (ends[-1] if ends else end):
            raise ValueError("cut short")
        pictures = tuple(
            replace(p, texture=replace(p.texture, data=data[e - n : e]))
            for p, n, e in zip(index.pictures, index.sizes, ends, strict=True)
        )

        def load(piece: Piece) -> Shape | None:
            key = index.stored.get(piece.id)
            if key is None:
                return make().load(piece)
            return shapes.shape(key, lambda: make().load(piece))

        return Catalogue(
            index.pieces, load, index.digest, pictures, index.notes, stored=index.stored
        )
    catalogue = make()
    pictures = catalogue.pictures
    bare = tuple(replace(p, texture=replace(p.texture, data=b"")) for p in pictures)
    sizes = tuple(len(p.texture.data) for p in pictures)
    index = _Index(
        catalogue.pieces, catalogue.digest, bare, sizes, catalogue.notes, dict(catalogue.stored)
    )
    with suppress(OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
        write_whole(
            path, _INDEX.dump_json(index) + b"\n" + b"".join(p.texture.data for p in pictures)
        )
        drop_oldest(path, MOST_BYTES, every=1)
    return catalogue


def _given(path: Path, notes: Notes, store: Path | None, *, may_be_empty: bool) -> Found | None:
    if not path.exists():
        raise BadInput(path, "", "no such file or folder", hint="of --catalogue")
    library: Found | None
    n_before = len(notes.all())
    if path.is_dir():
        library = _read_folder(path, notes, store)
    elif path.suffix.lower() == ".sh3t":
        library = _textures(path, notes, TEXTURES)
    elif path.suffix.lower() == ".sh3f":
        library = _read_furniture_library(path, notes, FURNITURE)
    else:
        hint = "supported: .sh3f, .sh3t, a folder of OBJ and GLB, a folder of pictures"
        raise BadInput(path, "", "is not a catalogue", hint=hint)
    if not may_be_empty and (library is None or not (library.pieces or library.pictures)):
        why = next((n.text for n in notes.all()[n_before:]), "")
        raise BadInput(path, "", "no usable piece or picture", hint=why)
    return library


def _read_folder(path: Path, notes: Notes, store: Path | None) -> Found:
    """Models; pictures for the walls where there are no models."""
    try:
        sha256, pieces = model_folder(path, notes, store)
    except BadInput:
        sha256, pictures = picture_folder(path, notes)
        if not pictures:
            raise
        return Found(sha256, pictures=pictures)
    return Found(sha256, pieces)


def _textures(path: Path, notes: Notes, catalogue: str) -> Found | None:
    library = texture_library(path, notes, catalogue)
    return Found(library[0], pictures=library[1]) if library else None


def _read_furniture_library(path: Path, notes: Notes, catalogue: str) -> Found | None:
    library = furniture_library(path, notes, catalogue)
    if library is None:
        return None
    pieces = []
    for entry in library.entries:
        # Go by what people decided of this very piece, else by its name and size.
        verdict = piece_verdicts().get(entry.id)
        rule = (
            None
            if verdict and not verdict.group
            else _rule_of_entry(entry, verdict.group if verdict else "")
        )
        if rule is not None:
            pieces.append(_piece_of_entry(library, entry, rule, verdict or _AS_WRITTEN, notes))
    if not pieces:
        notes.add("no-classes", library.name, "no piece of the library has a known class")
    pictures = pictures_of_models(library.name, library.contents, library.licence, notes)
    return Found(library.sha256, tuple(pieces), pictures)


def _rule_of_entry(entry: Entry, group: str) -> GroupRule | None:
    piece, inner = entry.piece, entry.id.partition("#")[2]
    return group_rule(piece.name, entry.category, piece.size, inner=inner, group=group)


def _piece_of_entry(
    library: Library, entry: Entry, rule: GroupRule, verdict: PieceVerdict, notes: Notes
) -> tuple[Piece, Loader]:
    # Swap width and depth of a piece turned by a quarter.
    width, depth, height = entry.piece.size
    is_across = round(verdict.turn_deg / 90) % 2 == 1
    piece = Piece(
        id=entry.id,
        name=entry.piece.name,
        group=rule.group,
        place=rule.place,
        nyu40=rule.nyu40,
        size=(depth, width, height) if is_across else (width, depth, height),
        kind=rule.kind,
        library=library.name,
        creator=entry.creator,
        licence=library.licence,
        low_m=entry.piece.elevation,
    )
    load = partial(library_shape, entry, rule.place, verdict.turn_deg, library.contents, notes)
    return piece, load
