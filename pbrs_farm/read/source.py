"""Where houses come from: a word of the command line -> SourceRef -> House.

Effects: reads files, and the example homes' package from the cache (or through apt).
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Final, Literal, Protocol, cast

import numpy as np
from pydantic import TypeAdapter

from pbrs_farm.core import keys
from pbrs_farm.core.checked_json import checked
from pbrs_farm.core.edits import Edit, edited_id, edits_digest
from pbrs_farm.core.errors import BadHouse, MachineFailed
from pbrs_farm.core.house import House
from pbrs_farm.core.made_home import is_made, made_homes
from pbrs_farm.core.plugins import is_plugin, marks_in_digest, plugin, plugin_homes, plugins
from pbrs_farm.core.recipe import ReadFields
from pbrs_farm.core.record import Record
from pbrs_farm.read.common.notes import Notes
from pbrs_farm.read.common.source_files import RootFolder, SourceFiles
from pbrs_farm.read.formats import kind_of_file
from pbrs_farm.regular_files import fault_of, read_given, real_path, text_given

if TYPE_CHECKING:
    from pbrs_farm.assets.homes_package import Package
    from pbrs_farm.read.objects.model_folders import ObjectModel

_MODEL_SUFFIXES: Final = (".obj", ".sh3f")  # what `objects` reads; a .glb may be a scene
_UNREAD_SUFFIXES: Final = frozenset({
    ".3dm", ".3ds", ".abc", ".blend", ".dae", ".dwg", ".dxf", ".fbx", ".max", ".mb", ".mtl", ".pln",
    ".ply", ".rvt", ".sdf", ".skp", ".stl",
})  # fmt: skip
_LONGEST_ID: Final = 255  # bytes of a folder's name
ASSETS: Final = "asset-database.json"
"""ProcTHOR's table of its assets' sizes, looked for beside a plan."""

_FAR_M: Final = 100.0  # from every room: nobody sees it, and it may be a slip of a unit

SourceKind = Literal[
    "builtin", "made", "example", "sweethome3d", "suncg", "gltf", "object", "plugin", "reader",
    "scenestate", "front3d", "habitat", "usd", "ifc", "plan",
]  # fmt: skip


class Reader(Protocol):
    """The module of a format whose files are known by their suffix or their JSON's keys."""

    def read(self, path: Path, fields: ReadFields, models: str) -> House:
        """The House of a file. models: the folder of its models, "" = beside it."""
        ...

    def companions(self, path: Path, models: str, files: SourceFiles) -> str:
        """Digest of what reading opens beside the file, "" where there is none; never raises."""
        ...


def _reader(kind: str) -> Reader | None:
    """The reader of a kind of file, imported when it is first needed."""
    if kind == "scenestate":
        from pbrs_farm.read.scenestate import scene_state

        return scene_state
    if kind == "front3d":
        from pbrs_farm.read.front3d import front_house

        return front_house
    if kind == "habitat":
        from pbrs_farm.read.habitat import scene_instance

        return scene_instance
    if kind == "usd":
        from pbrs_farm.read.usd import stage

        return stage
    if kind == "ifc":
        from pbrs_farm.read.ifc import building

        return building
    return None


class SourceRef(Record):
    """A house before it is read.

    location: a path, an example home's name, "builtin" or the word of a made home; of an object
    without context the JSON of its ObjectModel. sha256: of the file's bytes (SUNCG: of
    house.json). companions: digest of all other files that reading opens, "" = none, None = not
    known (named by an earlier version).
    dress_seed: what it is dressed by between reading and repair; its id then ends in `-d<seed>`.
    edits: what is changed of the repaired house, in order; its id then ends in `-e<digest>`.
    models: the folder of the models that the file names, "" = where its format keeps them.
    part: of a plan's file, what is meant of it: `apartment=ID`, `floor=K`; "" = the whole file.
    """

    kind: SourceKind
    location: str
    house_id: str
    sha256: str
    companions: str | None = None
    dress_seed: int = 0  # 0 = as it was drawn
    edits: tuple[Edit, ...] = ()
    models: str = ""
    part: str = ""

    @property
    def word(self) -> str:
        """The word of a command line that names the source before dressing and edits."""
        return f"{self.location}#{self.part}" if self.part else self.location

    @property
    def fingerprint(self) -> str:
        """Digest of every file the source reads; without companions that of its own file."""
        known = (self.sha256, self.companions, edits_digest(self.edits))
        return "+".join(part for part in known if part)

    @property
    def unedited(self) -> SourceRef:
        """The same house before its edits."""
        if not self.edits:
            return self
        own = self.house_id.removesuffix(edited_id("", self.edits))
        return self.model_copy(update={"house_id": own, "edits": ()})

    def edited(self, *edits: Edit) -> SourceRef:
        """The same house with these edits after its own."""
        every = (*self.edits, *edits)
        house_id = edited_id(self.unedited.house_id, every)
        return self.model_copy(update={"house_id": house_id, "edits": every})


def home_id(source: SourceRef) -> str:
    """The id of the source's house as it was drawn, whatever it is dressed by."""
    return source.unedited.house_id.removesuffix(keys.dressed_id("", source.dress_seed))


def variants(source: SourceRef, seeds: Sequence[int]) -> list[SourceRef]:
    """The source dressed by each seed, a house of its own each; itself for seed 0.

    An object without context is never dressed: it is given back once.
    """
    if source.kind == "object":
        return [source]
    return [
        source.model_copy(
            update={"house_id": keys.dressed_id(source.house_id, seed), "dress_seed": seed}
        )
        if seed
        else source
        for seed in seeds
    ]


def resolve(word: str, files: SourceFiles | None = None, *, models: str = "") -> SourceRef:
    """The source a word names: "builtin", an example home's name, or a path. Raises BadHouse.

    files: what was looked at before, for many words that share files. models: the folder of the
    models that a file of HSSD, 3D-FRONT or Holodeck names.
    """
    word, part = _parted(word)
    path = Path(word)
    if not _is_utf8(word):
        raise BadHouse(word, "", "the path is no UTF-8", hint="rename the file or its folder")
    # Go by the word's form first, then by what lies at the path.
    kind: SourceKind
    if word.startswith("{"):
        kind = "object"
    elif word == "builtin":
        kind = "builtin"
    elif is_made(word):
        kind = "made"
    elif is_plugin(word):
        kind = "plugin"
    elif (reader := _reader_of(path)) is not None:
        kind, word = "reader", f"{reader}:{real_path(path)}"
    elif not path.exists() and not path.suffix and "/" not in word:
        kind = "example"
    elif path.is_dir() or path.name == "house.json":
        kind, word = "suncg", str(real_path(path.parent if path.name == "house.json" else path))
    elif path.is_file() and (known := kind_of_file(path)) not in ("", "gltf"):
        kind, word = cast(SourceKind, known), str(real_path(path))
    elif path.suffix.lower() == ".json" and path.is_file():
        raise BadHouse(path, "", "is no house by itself", hint=_ROOT_HINT)
    elif path.suffix.lower() in _MODEL_SUFFIXES:
        hint = f"`pbrs-farm objects {word} --out DIR` renders single models"
        raise BadHouse(word, "", "is a model or a library of models, no home", hint=hint)
    elif path.suffix.lower() in _UNREAD_SUFFIXES:
        hint = "export it as .glb; homes are .sh3d, .glb, .gltf and SUNCG's house folders"
        raise BadHouse(word, "", f"{path.suffix} files are not read", hint=hint)
    else:
        kind = "gltf" if path.suffix.lower() in (".glb", ".gltf") else "sweethome3d"
        word = str(real_path(path))
    if part and kind != "plan":
        raise BadHouse(word, f"#{part}", "names a part of a file that is no floor plan")
    folder = models and str(real_path(Path(models)))
    return _reference(kind, word, files or SourceFiles(), folder, part)


def _parted(word: str) -> tuple[str, str]:
    """FILE#apartment=ID -> the file and the part of it; a file of that whole name goes first."""
    file, _, part = word.rpartition("#")
    is_part = bool(file) and part.startswith(("apartment=", "floor="))
    return (file, part) if is_part and not os.path.exists(word) else (word, "")  # noqa: PTH110


def _is_utf8(word: str) -> bool:
    """Whether a path can be told to others: bytes that are no UTF-8 become lone surrogates."""
    try:
        word.encode()
    except UnicodeEncodeError:
        return False
    return "\0" not in word


def _reference(
    kind: SourceKind, location: str, files: SourceFiles, models: str = "", part: str = ""
) -> SourceRef:
    """The source at a location of a known kind, with the digests of its files."""
    if kind == "builtin":
        from pbrs_farm.read.builtin.builtin_home import builtin_home

        home = builtin_home()
        return SourceRef(kind=kind, location=location, house_id=home.id, sha256=home.source.sha256)
    if kind == "made":
        return _made(location)
    if kind == "plugin":
        return _of_plugin(location)
    if kind == "reader":
        return _of_reader(location, files)
    if kind == "suncg":
        return _suncg(Path(location), files)
    if kind == "object":
        return object_source(_object_model(location), files)
    if kind == "example":
        from pbrs_farm.assets import homes_package

        # A name that is none costs no download.
        exact = homes_package.exact_name(location)
        package = homes_package.fetch()
        data, name = package.home(exact)
        companions = _package_digest(package)
    else:
        path = Path(location)
        if reader := _reader(kind):
            sha = _sha256(path, files)
            house_id = keys.house_id(path.stem, sha)
            beside = reader.companions(path, models, files)
            return SourceRef(
                kind=kind, location=location, house_id=house_id, sha256=sha, companions=beside,
                models=models,
            )  # fmt: skip
        if kind == "plan":
            return _plan(path, part, files)
        data, name = read_given(path, error=BadHouse), path.name
        companions = _companions(kind, path, data, files)
    # The house's id depends on its own file alone, so companions never rename a house.
    sha = keys.sha256(data)
    house_id = keys.house_id(Path(name).stem, sha)
    return SourceRef(
        kind=kind, location=location, house_id=house_id, sha256=sha, companions=companions
    )


def _plan(path: Path, part: str, files: SourceFiles) -> SourceRef:
    """The source of a floor plan; a table of the sizes of its things may lie beside it."""
    sha = _sha256(path, files)
    is_json = path.suffix.lower() == ".json"
    beside = [name for name in (ASSETS,) if is_json and (path.parent / name).is_file()]
    # Each part of a file is a house of its own.
    digest, stem = (keys.digest(sha, part), f"{path.stem}-{part}") if part else (sha, path.stem)
    return SourceRef(
        kind="plan", location=str(path), house_id=keys.house_id(stem, digest), sha256=sha,
        companions=files.digest(RootFolder(path.parent), beside) if beside else "", part=part,
    )  # fmt: skip


def _made(word: str) -> SourceRef:
    """The source of a home that its seed makes; its companion is the furniture's package."""
    from pbrs_farm.assets import furniture_package

    homes = made_homes(word)
    if len(homes) != 1:
        raise BadHouse(word, "", f"names {len(homes)} homes", hint="name one at a time here")
    # Ask for the furniture before the run begins, where the home wants some.
    companions, package = "", furniture_package.cached() if homes[0].furniture else None
    if homes[0].furniture and package is None:
        raise MachineFailed(
            "made homes take their furniture from a package that is not fetched",
            hint="`pbrs-farm homes --furniture` (120 MB), or made:1,furniture=none",
        )
    if package is not None and package.note:
        companions = keys.sha256(package.note.encode())
    return SourceRef(
        kind="made", location=homes[0].word, house_id=keys.house_id(homes[0].name, homes[0].digest),
        sha256=homes[0].digest, companions=companions,
    )  # fmt: skip


def _of_plugin(word: str) -> SourceRef:
    """The source of a home that a plugin makes; its package and version are part of it."""
    homes = plugin_homes(word)
    if len(homes) != 1:
        raise BadHouse(word, "", f"names {len(homes)} homes", hint="name one at a time here")
    (home,) = homes
    sha = keys.digest(*marks_in_digest("homes", [home.name]), home.word)
    house_id = keys.house_id(f"{home.name}-{home.seed}", sha)
    return SourceRef(
        kind="plugin", location=home.word, house_id=house_id, sha256=sha, companions=""
    )


def _reader_of(path: Path) -> str | None:
    """The plugin that reads what lies at a path, where one says that it does."""
    if not path.exists():
        return None
    return next((n for n, p in plugins("readers").items() if p.load().recognises(path)), None)


def _of_reader(location: str, files: SourceFiles) -> SourceRef:
    """The source of a file that a plugin reads."""
    name, _, path = location.partition(":")
    (mark,) = marks_in_digest("readers", [name])
    house_id = keys.house_id(Path(path).stem, sha := _sha256(Path(path), files))
    return SourceRef(
        kind="reader", location=location, house_id=house_id, sha256=sha,
        companions=keys.sha256(mark.encode()),
    )  # fmt: skip


def _companions(kind: SourceKind, path: Path, data: bytes, files: SourceFiles) -> str:
    """Digest of what a scene or a home reads beside its own file."""
    if kind == "gltf":
        from pbrs_farm.read.gltf.document import files_of_gltf
        from pbrs_farm.read.gltf.scene import side_files

        names = [*side_files(path), *files_of_gltf(data, path.name)]
        return files.digest(RootFolder(path.parent), names)
    from pbrs_farm.assets import homes_package
    from pbrs_farm.read.sweethome3d.home_file.home_xml import needs_program

    return _package_digest(homes_package.cached()) if needs_program(data, path.name) else ""


def _package_digest(package: Package | None) -> str:
    """Digest of the package of example homes and models; "" for the tested version.

    The tested version is part of a release: one that tests another raises the house step's version.
    """
    is_tested = package is not None and not package.note
    return "" if is_tested else keys.sha256((package.label if package else "none").encode())


def suncg_list(root: Path, list_file: Path) -> list[str]:
    """The words `ROOT/house/<id>` for every id in a list file, blank and # lines left out."""
    ids = [line.strip() for line in text_given(list_file, error=BadHouse).splitlines()]
    for number, house in enumerate(ids, 1):
        if len(house.encode()) > _LONGEST_ID and not house.startswith("#"):
            text = f"an id of {len(house)} letters is no folder's name"
            raise BadHouse(list_file, f"line {number}", text)
    return [str(root / "house" / i) for i in ids if i and not i.startswith("#")]


def read_house(source: SourceRef, fields: ReadFields) -> House:
    """The house as its source gives it, unrepaired; what stands far away is a note.

    Raises BadHouse with the place, also where a file of the source has changed since it was named.
    """
    check_unchanged(source)
    return _with_far_noted(_house_of(source, fields), fields)


def _with_far_noted(house: House, fields: ReadFields) -> House:
    """The house with a note for each item that stands far from every room."""
    if not house.rooms:
        return house
    notes = Notes(house.source.file, strict=fields.strict)
    # Measure from the rectangle around all rooms.
    plans = np.concatenate([room.polygon for room in house.rooms])
    low, high = plans.min(0), plans.max(0)
    for item in house.items:
        bounds = item.bounds[:, [0, 2]]
        away = float(np.maximum(bounds[0] - high, low - bounds[1]).max())
        if away > _FAR_M:
            notes.add("far-away", item.id, f"{item.name!r} stands {away:.0f} m from the rooms")
    return replace(house, notes=(*house.notes, *notes.all())) if notes.all() else house


def _house_of(source: SourceRef, fields: ReadFields) -> House:
    path = Path(source.location)
    if source.kind == "object":
        return _read_object(source, fields)
    if source.kind == "builtin":
        from pbrs_farm.read.builtin.builtin_home import builtin_home

        return builtin_home()
    if source.kind == "suncg":
        from pbrs_farm.read.suncg.suncg_house import read_suncg

        return read_suncg(path.parent.parent, path.name, fields)
    if source.kind == "reader":
        name, _, location = source.location.partition(":")
        house: House = plugin("readers", name).load().read(Path(location), fields)
        return replace(house, id=home_id(source))
    if reader := _reader(source.kind):
        return reader.read(path, fields, source.models)
    if source.kind == "gltf":
        from pbrs_farm.read.gltf.scene import read_gltf_file

        return read_gltf_file(path, fields)
    return _read_home(source, fields)


def _read_home(source: SourceRef, fields: ReadFields) -> House:
    """A Sweet Home 3D home, with the program's own models where they are cached."""
    from pbrs_farm.assets import homes_package
    from pbrs_farm.read.sweethome3d import read_home

    if source.kind == "example":
        package = homes_package.fetch()
        data, file = package.home(source.location)
        return read_home(
            data, file, resources=package.resources(), fields=fields,
            package=package.label, package_note=package.note,
        )  # fmt: skip
    path, cached = Path(source.location), homes_package.cached()
    resources = cached.resources() if cached else None
    return read_home(
        read_given(path, error=BadHouse), path.name, resources=resources, fields=fields
    )


def object_source(model: ObjectModel, files: SourceFiles | None = None) -> SourceRef:
    """The source of an object without context; files as in resolve."""
    from pbrs_farm.read.objects.single_object import object_companions

    files = files or SourceFiles()
    return SourceRef(
        kind="object",
        location=TypeAdapter(type(model)).dump_json(model).decode(),
        house_id=keys.OBJECT_PREFIX + model.id,
        sha256=_sha256(model.path, files),
        companions=files.digest(RootFolder(model.root), object_companions(model, files)),
    )


def _object_model(location: str) -> ObjectModel:
    from pbrs_farm.read.objects.model_folders import ObjectModel

    return checked(ObjectModel, location.encode(), location[:80], error=BadHouse)


def _read_object(source: SourceRef, fields: ReadFields) -> House:
    from pbrs_farm.read.objects.single_object import read_object

    house = read_object(_object_model(source.location), fields)
    return replace(house, id=source.house_id, is_repaired=True)


def check_unchanged(source: SourceRef) -> None:
    """Raise BadHouse or MachineFailed where a file is not what it was when the source was named."""
    # Name the source again and compare the digests, where both are known.
    now = _reference(source.kind, source.location, SourceFiles(), source.models, source.part)
    is_known = source.companions is not None
    if now.sha256 == source.sha256 and (not is_known or now.companions == source.companions):
        return
    if source.kind in ("plugin", "reader") and now.house_id[:-8] == source.house_id[:-8]:
        text = f"the plugin of {source.location} here is another one than was asked for"
        raise MachineFailed(text, hint="install the same version everywhere")
    if source.kind in ("example", "made") or (
        source.kind == "sweethome3d" and now.sha256 == source.sha256
    ):
        # The file is the same or comes from the package: this machine's package differs.
        raise MachineFailed(
            f"the package here holds another {source.location} or other models than was asked for",
            hint="another version of the package; `pbrs-farm homes --fetch`",
        )
    raise BadHouse(source.location, "", "changed since the run began", hint="run, or submit, again")


def _suncg(folder: Path, files: SourceFiles) -> SourceRef:
    from pbrs_farm.read.suncg.suncg_house import suncg_companions

    if not (folder / "house.json").exists():
        raise BadHouse(
            folder, "", "holds no house.json and no home file", hint=_folder_hint(folder)
        )
    if folder.parent.name != "house":
        raise BadHouse(folder, "", "does not lie in a folder named house", hint=_ROOT_HINT)
    root = RootFolder(folder.parent.parent)
    return SourceRef(
        kind="suncg",
        location=str(folder),
        house_id=folder.name,
        sha256=_sha256(folder / "house.json", files),
        companions=files.digest(root, suncg_companions(root, folder.name, files)),
    )


_ROOT_HINT: Final = (
    "a SUNCG house is ROOT/house/ID/house.json beside ROOT/room/ID (v1) or ROOT/wall/ID (v2), "
    "ROOT/object, ROOT/texture and ROOT/metadata; name ROOT/house/ID"
)


def _folder_hint(folder: Path) -> str:
    if (folder / "house").is_dir():
        return "SUNCG's root: name ROOT/house/ID, or ROOT and --houses LIST"
    if list(folder.glob("*.json")):
        return _ROOT_HINT
    if any(next(folder.glob(f"*{suffix}"), None) for suffix in _MODEL_SUFFIXES):
        return f"`pbrs-farm objects {folder} --out DIR` renders single models"
    return "a SUNCG house folder, or .sh3d, .glb files"


def _sha256(path: Path, files: SourceFiles) -> str:
    try:
        return files.file_digest(path)
    except OSError as error:
        raise BadHouse(path, "", fault_of(error)) from None
