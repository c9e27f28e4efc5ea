"""Where houses come from: words of a command line -> SourceRefs, and whether a source is what it was.

Effects: reads files, and the example homes' package from the cache (or through apt).
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING, Final

from pydantic import TypeAdapter

from pbrs_farm.core import keys
from pbrs_farm.core.checked_json import checked
from pbrs_farm.core.edits import Edit, SavedHome, edited_id, edits_digest
from pbrs_farm.core.errors import BadHouse, MachineFailed
from pbrs_farm.core.made_home import expanded, is_made, made_homes
from pbrs_farm.core.plugins import is_plugin, marks_in_digest, plugin_homes
from pbrs_farm.core.record import Record
from pbrs_farm.formats.serialise import json_bytes
from pbrs_farm.prepare.formats import (
    format_of_file,
    format_of_kind,
    format_of_plugin,
    formats,
    is_beside_homes,
    plugin_of_file,
    summary,
)
from pbrs_farm.read.common.format import Format, GivenFile
from pbrs_farm.read.common.root_folder import RootFolder
from pbrs_farm.read.common.source_files import SourceFiles
from pbrs_farm.regular_files import fault_of, naming_kind, real_path, text_given

if TYPE_CHECKING:
    from pbrs_farm.read.objects.model_folders import ObjectModel

_MODEL_SUFFIXES: Final = (".obj", ".sh3f")  # what `objects` reads; a .glb may be a scene
_UNREAD_SUFFIXES: Final = frozenset({
    ".3dm", ".3ds", ".abc", ".blend", ".dae", ".dwg", ".dxf", ".fbx", ".max", ".mb", ".mtl", ".pln",
    ".ply", ".rvt", ".sdf", ".skp", ".stl",
})  # fmt: skip
_MOST_NAMED: Final = 3  # folders of homes that a hint names
_LONGEST_ID: Final = 255  # bytes of a folder's name
_DEFAULT_KIND: Final = "sweethome3d"  # of a path that says nothing: its reader tells what is wrong
SAVED_SUFFIX: Final = ".home.json"
"""Of a file of a home with its edits: `saved_home` writes it, `resolve` reads it."""
WORD_KINDS: Final = ("builtin", "made", "example", "plugin", "object")
"""Kinds of sources that are no file of a format."""

_ROOT_HINT: Final = (
    "a SUNCG house is ROOT/house/ID/house.json beside ROOT/room/ID (v1) or ROOT/wall/ID (v2), "
    "ROOT/object, ROOT/texture and ROOT/metadata; name ROOT/house/ID"
)


class SourceRef(Record):
    """A house before it is read.

    kind: of a format (prepare/formats.py), `reader` for a plugin's, or one of WORD_KINDS.
    location: a path, an example home's name, "builtin" or the word of a made home; `NAME:path` of a
    plugin's; of an object without context the JSON of its ObjectModel. sha256: of the file's bytes
    (SUNCG: of house.json). companions: digest of all other files that reading opens, "" = none.
    dress_seed: what it is dressed by between reading and repair; its id then ends in `-d<seed>`.
    edits: what is changed of the repaired house, in order; its id then ends in `-e<digest>`.
    models: the folder of the models that the file names, "" = where its format keeps them.
    part: of a plan's file, what is meant of it: `apartment=ID`, `floor=K`; "" = the whole file.
    """

    kind: str
    location: str
    house_id: str
    sha256: str
    companions: str = ""
    dress_seed: int = 0  # 0 = as it was drawn
    edits: tuple[Edit, ...] = ()
    models: str = ""
    part: str = ""

    @property
    def word(self) -> str:
        """The word of a command line that names the source before dressing and edits."""
        return f"{self.location}#{self.part}" if self.part else self.location

    @property
    def given(self) -> GivenFile:
        """The file, or the folder, of a source that is one."""
        path = self.location.partition(":")[2] if self.kind == "reader" else self.location
        return GivenFile(Path(path), self.models, self.part)

    @property
    def format(self) -> Format | None:
        """The format that reads it; None for a source that is no file."""
        if self.kind in WORD_KINDS:
            return None
        if self.kind == "reader":
            return format_of_plugin(self.location.partition(":")[0])
        return format_of_kind(self.kind)

    @property
    def fingerprint(self) -> str:
        """Digest of every file the source reads; without companions that of its own file."""
        known = (self.sha256, self.companions, edits_digest(self.edits))
        return "+".join(part for part in known if part)

    @property
    def unedited(self) -> SourceRef:
        """The same house before its edits.

        Itself where it has no edits. Its id is that of the house before them, dressed or not.
        """
        if not self.edits:
            return self
        own = self.house_id.removesuffix(edited_id("", self.edits))
        return self.model_copy(update={"house_id": own, "edits": ()})

    def edited(self, *edits: Edit) -> SourceRef:
        """The same house with these edits after its own.

        Edits come after those that it has; the id follows from all of them together. Nothing is
        read or checked here.
        """
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
    if source.edits and any(seeds):
        raise BadHouse(source.word, "", "has edits: a home is dressed before it is edited")
    return [
        source.model_copy(
            update={"house_id": keys.dressed_id(source.house_id, seed), "dress_seed": seed}
        )
        if seed
        else source
        for seed in seeds
    ]


def words_of_homes(words: Sequence[str]) -> list[str]:
    """The words, each that names several homes replaced by one word a home.

    That is a range, `made:1..20`, and a folder: every home in it of any format, by name, not those
    in folders below but for a format whose homes are folders. A folder without one stays what it
    is, so that `resolve` says what is wrong with it.
    """
    found: list[str] = []
    for word in expanded(list(words)):
        found += _homes_in(Path(word)) or [word]
    return found


def _homes_in(folder: Path) -> list[str]:
    return [str(path) for path in sorted(_home_files(folder))]


def _home_files(folder: Path) -> Iterator[Path]:
    """The homes that lie in a folder which is no home itself, in no order."""
    if folder.is_dir() and format_of_file(folder) is None:
        yield from filter(_is_home_file, folder.iterdir())


def homes_left_below(folder: Path) -> str:
    """Which homes of a folder are not taken, since they lie one folder deeper, and what takes them; "" = none.

    They are named and not taken: a model (.glb) below a scene may be a home or its furniture.
    """
    if not folder.is_dir() or format_of_file(folder) is not None:
        return ""
    below = [path for path in sorted(folder.iterdir()) if _holds_homes(path)]
    if not below:
        return ""
    if len(below) > _MOST_NAMED:
        names, words = f"{len(below)} folders such as {below[0].name}", f"{quote(str(folder))}/*/"
    else:
        names = " and ".join(path.name for path in below)
        words = " ".join(quote(str(path)) for path in below)
    return f"homes lie one folder deeper, in {names}: `pbrs-farm run {words}` takes them"


def _holds_homes(folder: Path) -> bool:
    try:
        return not folder.name.startswith(".") and any(True for _ in _home_files(folder))
    except OSError:
        return False


def _is_home_file(path: Path) -> bool:
    if path.name.startswith("."):
        return False
    if path.name.endswith(SAVED_SUFFIX):
        return True
    if is_beside_homes(path):
        return False
    entry = format_of_file(path, surely=True)
    is_named = plugin_of_file(path) is not None
    return is_named or (entry is not None and path.name != entry.main_file)


def resolve(word: str, files: SourceFiles | None = None, *, models: str = "") -> SourceRef:
    """The source a word names: "builtin", an example home's name, or a path. Raises BadHouse.

    files: what was looked at before, for many words that share files. models: the folder of the
    models that a file of HSSD, 3D-FRONT or Holodeck names.
    """
    word, part = _parted(word)
    path = Path(word)
    if not _is_utf8(word):
        raise BadHouse(word, "", "the path is no UTF-8", hint="rename the file or its folder")
    if path.name.endswith(SAVED_SUFFIX):
        return _of_saved_home(path, files)
    # Go by the word's form first, then by what lies at the path.
    if word.startswith('{"'):  # its JSON; a name may begin with a brace, too
        kind = "object"
    elif word == "builtin":
        kind = "builtin"
    elif is_made(word):
        kind = "made"
    elif is_plugin(word):
        kind = "plugin"
    elif (name := plugin_of_file(path)) is not None:
        kind, word = "reader", f"{name}:{real_path(path)}"
    elif not path.exists() and not path.suffix and "/" not in word:
        kind = "example"
    else:
        with naming_kind(path):
            entry = _format_at(path)
        kind = entry.kind
        is_inside = entry.main_file and path.name == entry.main_file
        word = str(real_path(path.parent if is_inside else path))
    if part and kind != "plan":
        raise BadHouse(word, f"#{part}", "names a part of a file that is no floor plan")
    folder = models and str(real_path(Path(models)))
    return _reference(kind, word, files or SourceFiles(), folder, part)


def saved_home(source: SourceRef) -> bytes:
    """The file of a home with its edits; equal sources give equal bytes."""
    return json_bytes(
        SavedHome(
            home=source.word, house_id=source.house_id, models=source.models,
            dress_seed=source.dress_seed, edits=source.edits,
        )
    )  # fmt: skip


def _of_saved_home(path: Path, files: SourceFiles | None) -> SourceRef:
    """The source that saved_home wrote; BadHouse for a damaged file and for a home that has changed."""
    held = checked(SavedHome, text_given(path, error=BadHouse).encode(), str(path), error=BadHouse)
    if held.home.endswith(SAVED_SUFFIX):
        raise BadHouse(path, "home", "names another file of a home with edits")
    (dressed,) = variants(resolve(held.home, files, models=held.models), [held.dress_seed])
    source = dressed.edited(*held.edits) if held.edits else dressed
    if source.house_id != held.house_id:
        text = f"{held.home} is another home now than when this was saved"
        raise BadHouse(path, "house_id", text, hint="save it again")
    return source


def _format_at(path: Path) -> Format:
    """The format of what lies at a path; raises BadHouse for a folder or a model that is no home."""
    entry = format_of_file(path)
    if entry is not None:
        return entry
    suffix = path.suffix.lower()
    if path.is_dir():
        text, hint = _of_folder(path)
        raise BadHouse(path, "", text, hint=hint)
    if suffix == ".json" and path.is_file():
        hint = f"read are {summary()}; {_ROOT_HINT}"
        raise BadHouse(path, "", "is no house by itself", hint=hint)
    if suffix in _MODEL_SUFFIXES:
        hint = f"`pbrs-farm objects {path} --out DIR` renders single models"
        raise BadHouse(str(path), "", "is a model or a library of models, no home", hint=hint)
    if suffix in _UNREAD_SUFFIXES:
        hint = f"export it as .glb; read are {summary()}"
        raise BadHouse(str(path), "", f"{path.suffix} files are not read", hint=hint)
    if path.is_file() and not any(suffix in one.suffixes for one in formats()):
        raise BadHouse(path, "", "is no home", hint=f"read are {summary()}")
    # A file that is not there is missing in its format's words.
    named = (one for one in formats() if suffix in one.suffixes)
    default = format_of_kind(_DEFAULT_KIND)
    assert default is not None
    return next(named, default)


def _parted(word: str) -> tuple[str, str]:
    """FILE#apartment=ID -> the file and the part of it; a file of that whole name goes first."""
    file, _, part = word.rpartition("#")
    is_part = bool(file) and part.startswith(("apartment=", "floor="))
    return (file, part) if is_part and not os.path.exists(word) else (word, "")  # noqa: PTH110


def _is_utf8(word: str) -> bool:
    """Whether a path can be stored and sent: bytes that are no UTF-8 become lone surrogates."""
    try:
        word.encode()
    except UnicodeEncodeError:
        return False
    return "\0" not in word


def _reference(
    kind: str, location: str, files: SourceFiles, models: str = "", part: str = ""
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
    if kind == "object":
        return object_source(model_of_object(location), files)
    if kind == "example":
        return _example(location)
    return _of_file(kind, location, files, models, part)


def _of_file(kind: str, location: str, files: SourceFiles, models: str, part: str) -> SourceRef:
    """The source that is a file, or the folder of a home."""
    bare = SourceRef(kind=kind, location=location, house_id="", sha256="", models=models, part=part)
    entry, given = bare.format, bare.given
    if entry is None:
        raise BadHouse(location, "", f"is of a kind that is not read here: {kind}")
    if entry.main_file and given.path.parent.name != "house":
        raise BadHouse(given.path, "", "does not lie in a folder named house", hint=_ROOT_HINT)
    sha = _sha256(given.path / entry.main_file if entry.main_file else given.path, files)
    # The id depends on the file alone, so companions never rename a house; a part is its own house.
    stem = f"{given.path.stem}-{part}" if part else given.path.stem
    house_id = keys.house_id(stem, keys.digest(sha, part) if part else sha)
    companions = entry.companions(given, files)
    if kind == "reader":
        (mark,) = marks_in_digest("readers", [location.partition(":")[0]])
        companions = keys.sha256("\n".join(filter(None, (mark, companions))).encode())
    return bare.model_copy(update={
        "house_id": given.path.name if entry.main_file else house_id, "sha256": sha,
        "companions": companions,
    })  # fmt: skip


def _example(name: str) -> SourceRef:
    """The source of an example home."""
    from pbrs_farm.assets import homes_package
    from pbrs_farm.read.sweethome3d.packaged_home import package_digest

    # A name that is none costs no download.
    exact = homes_package.exact_name(name)
    package = homes_package.fetch()
    data, file = package.home(exact)
    sha = keys.sha256(data)
    return SourceRef(
        kind="example", location=name, house_id=keys.house_id(Path(file).stem, sha), sha256=sha,
        companions=package_digest(package),
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


def suncg_list(root: Path, list_file: Path) -> list[str]:
    """The words `ROOT/house/<id>` for every id in a list file, blank and # lines left out.

    BadHouse, with the line, for an id that is too long for a folder's name. That the houses exist
    is not checked.
    """
    ids = [line.strip() for line in text_given(list_file, error=BadHouse).splitlines()]
    for number, house in enumerate(ids, 1):
        if len(house.encode()) > _LONGEST_ID and not house.startswith("#"):
            text = f"an id of {len(house)} letters is no folder's name"
            raise BadHouse(list_file, f"line {number}", text)
    return [str(root / "house" / i) for i in ids if i and not i.startswith("#")]


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


def model_of_object(location: str) -> ObjectModel:
    """The model that the location of an object without context says."""
    from pbrs_farm.read.objects.model_folders import ObjectModel

    return checked(ObjectModel, location.encode(), location[:80], error=BadHouse)


def check_unchanged(source: SourceRef) -> None:
    """Raise BadHouse or MachineFailed where a file is not what it was when the source was named.

    Reads all files of the source again. MachineFailed where another version of a package or plugin
    is to blame, so that another machine may do it; BadHouse where the user's own file changed.
    """
    # Name the source again and compare the digests.
    now = _reference(source.kind, source.location, SourceFiles(), source.models, source.part)
    if now.sha256 == source.sha256 and now.companions == source.companions:
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


def _of_folder(folder: Path) -> tuple[str, str]:
    """What is wrong with a folder that is no home, and what to do."""
    n = len(_homes_in(folder))
    if n:
        return (
            f"is a folder of {n} home{'s' * (n > 1)}",
            "name one of them here; `run` and `submit` take folders",
        )
    if (folder / "house").is_dir():
        hint = "SUNCG's root: name ROOT/house/ID, or ROOT and --houses LIST"
    elif below := homes_left_below(folder):
        hint = below
    elif list(folder.glob("*.json")):
        hint = _ROOT_HINT
    elif any(next(folder.glob(f"*{suffix}"), None) for suffix in _MODEL_SUFFIXES):
        hint = f"`pbrs-farm objects {folder} --out DIR` renders single models"
    else:
        hint = f"read are {summary()}"
    return "holds no house.json and no home file", hint


def _sha256(path: Path, files: SourceFiles) -> str:
    try:
        return files.file_digest(path)
    except OSError as error:
        raise BadHouse(path, "", fault_of(error)) from None
