"""Sources of houses by words of a command line, and the check that they are unchanged. Reads their files."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from pathlib import Path
from shlex import quote
from typing import Final

from pbrs_farm.core import keys
from pbrs_farm.core.checked_json import checked
from pbrs_farm.core.edits import SavedHome
from pbrs_farm.core.errors import BadHouse, MachineFailed
from pbrs_farm.core.plugins import marks_in_digest
from pbrs_farm.formats.serialise import json_bytes
from pbrs_farm.prepare.formats import (
    format_of_file,
    format_of_kind,
    format_of_source,
    formats,
    is_beside_homes,
    plugin_of_file,
    summary,
)
from pbrs_farm.prepare.home_kinds import HOME_KIND, digest_of_file, kind_of_word
from pbrs_farm.prepare.source_ref import SourceRef
from pbrs_farm.read.common.format import Format
from pbrs_farm.read.common.source_files import SourceFiles
from pbrs_farm.regular_files import naming_kind, real_path, text_given

_MODEL_SUFFIXES: Final = (".obj", ".sh3f")  # files of `objects`; a .glb may be a scene
# fmt: off
_UNREAD_SUFFIXES: Final = frozenset({
    ".3dm", ".3ds", ".abc", ".blend", ".dae", ".dwg", ".dxf", ".fbx", ".max", ".mb", ".mtl", ".pln",
    ".ply", ".rvt", ".skp", ".stl",
})
# fmt: on
_MOST_NAMED: Final = 3  # maximum number of folders of homes in a hint
_LONGEST_ID: Final = 255  # bytes of a folder's name
_DEFAULT_KIND: Final = "sweethome3d"  # of an unrecognised path: its reader explains the problem
SAVED_SUFFIX: Final = ".home.json"
"""Suffix of a file of a home with its edits, written by `saved_home` and read by `resolve`."""

_ROOT_HINT: Final = (
    "a SUNCG house is ROOT/house/ID/house.json beside ROOT/room/ID (v1) or ROOT/wall/ID (v2), "
    "ROOT/object, ROOT/texture and ROOT/metadata; name ROOT/house/ID"
)


def variants(source: SourceRef, seeds: Sequence[int]) -> list[SourceRef]:
    """The source dressed by each seed, as separate houses, undressed for 0; an object alone, undressed."""
    if source.kind in HOME_KIND and not HOME_KIND[source.kind].is_home:
        return [source]
    if source.edits and any(seeds):
        raise BadHouse(source.word, "", "has edits: dress a home before editing it")
    return [
        source.model_copy(
            update={"house_id": keys.dressed_id(source.house_id, seed), "dress_seed": seed}
        )
        if seed
        else source
        for seed in seeds
    ]


def words_of_homes(words: Sequence[str]) -> list[str]:
    """Expand ranges (`made:1..20`) and folders of homes into one word per home; other words remain."""
    homes: list[str] = []
    for word in words:
        kind = kind_of_word(word)
        homes += kind.words(word) if kind is not None else _homes_in(Path(word)) or [word]
    return homes


def _homes_in(folder: Path) -> list[str]:
    return [str(path) for path in sorted(_home_files(folder))]


def _home_files(folder: Path) -> Iterator[Path]:
    """The homes in a folder that is not itself a home, in no order."""
    if folder.is_dir() and format_of_file(folder) is None:
        yield from filter(_is_home_file, folder.iterdir())


def homes_left_below(folder: Path) -> str:
    """Message about homes one folder deeper, which are ignored, with a command that includes them; or "".

    They are ignored because a model (.glb) below a scene may be a home or its furniture.
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
    return f"the homes are one folder deeper, in {names}: `pbrs-farm run {words}`"


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
    """The source of a word: "builtin", an example home's name, or a path. Raises BadHouse.

    files: cache for many words that share files. models: folder of the models that a file of HSSD,
    3D-FRONT or Holodeck names.
    """
    word, part = _parted(word)
    path = Path(word)
    if not word:
        raise BadHouse("home", "", "is empty", hint="a file, an example home's name, or builtin")
    if not _is_utf8(word):
        raise BadHouse(word, "", "the path is not UTF-8", hint="rename the file or its folder")
    if path.name.endswith(SAVED_SUFFIX):
        return _of_saved_home(path, files)
    # The form of the word decides first, then the file at the path.
    home_kind = kind_of_word(word)
    if home_kind is not None:
        kind = home_kind.name
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
        raise BadHouse(word, f"#{part}", "#PART is only for floor plans")
    folder = models and str(real_path(Path(models)))
    return _source_of(kind, word, files or SourceFiles(), folder, part)


def saved_home(source: SourceRef) -> bytes:
    """The file of a home with its edits; equal sources give equal bytes."""
    return json_bytes(
        SavedHome(
            home=source.word,
            house_id=source.house_id,
            models=source.models,
            dress_seed=source.dress_seed,
            edits=source.edits,
        )
    )


def _of_saved_home(path: Path, files: SourceFiles | None) -> SourceRef:
    """The source that saved_home wrote; BadHouse for a damaged file and for a home that has changed."""
    saved = checked(SavedHome, text_given(path, error=BadHouse).encode(), str(path), error=BadHouse)
    if saved.home.endswith(SAVED_SUFFIX):
        raise BadHouse(path, "home", "refers to another file of a home with edits")
    (dressed,) = variants(resolve(saved.home, files, models=saved.models), [saved.dress_seed])
    source = dressed.edited(*saved.edits) if saved.edits else dressed
    if source.house_id != saved.house_id:
        text = f"{saved.home} has changed since this was saved"
        raise BadHouse(path, "house_id", text, hint="save it again")
    return source


def _format_at(path: Path) -> Format:
    """The format of a path; raises BadHouse if a folder or a model is not a home."""
    suffix = path.suffix.lower()
    # An .obj is a home if its groups say so, else a single model.
    entry = format_of_file(path, surely=suffix in _MODEL_SUFFIXES)
    if entry is not None:
        return entry
    if path.is_dir():
        text, hint = _of_folder(path)
        raise BadHouse(path, "", text, hint=hint)
    if suffix == ".json" and path.is_file():
        hint = f"supported: {summary()}; {_ROOT_HINT}"
        raise BadHouse(path, "", "not recognised as a house", hint=hint)
    if suffix in _MODEL_SUFFIXES:
        hint = f"`pbrs-farm objects {path} --out DIR` renders single models"
        raise BadHouse(str(path), "", "is a model or a library of models, not a home", hint=hint)
    if suffix in _UNREAD_SUFFIXES:
        hint = f"export it as .glb; supported: {summary()}"
        raise BadHouse(str(path), "", f"{path.suffix} files are not read", hint=hint)
    if path.is_file() and not any(suffix in home_format.suffixes for home_format in formats()):
        raise BadHouse(path, "", "is not a home", hint=f"supported: {summary()}")
    # A missing file gets the error message of its format.
    named = (home_format for home_format in formats() if suffix in home_format.suffixes)
    default = format_of_kind(_DEFAULT_KIND)
    assert default is not None
    return next(named, default)


def _parted(word: str) -> tuple[str, str]:
    """FILE#apartment=ID -> (file, part); a file with that whole name takes precedence."""
    file, _, part = word.rpartition("#")
    is_part = bool(file) and part.startswith(("apartment=", "floor="))
    return (file, part) if is_part and not os.path.exists(word) else (word, "")  # noqa: PTH110


def _is_utf8(word: str) -> bool:
    """True if a path can be stored and sent: bytes that are not UTF-8 become lone surrogates."""
    try:
        word.encode()
    except UnicodeEncodeError:
        return False
    return "\0" not in word


def _source_of(kind: str, location: str, files: SourceFiles, models: str, part: str) -> SourceRef:
    """The source at a location of a known kind, with the digests of its files."""
    if kind in HOME_KIND:
        return HOME_KIND[kind].source(location, files)
    bare = SourceRef(kind=kind, location=location, house_id="", sha256="", models=models, part=part)
    entry, file = format_of_source(bare), bare.given
    if entry is None:
        raise BadHouse(location, "", f"unsupported kind: {kind}")
    if entry.main_file and file.path.parent.name != "house":
        raise BadHouse(file.path, "", "is not in a folder named house", hint=_ROOT_HINT)
    sha = digest_of_file(file.path / entry.main_file if entry.main_file else file.path, files)
    # The id depends on the file alone, so companions never rename a house; a part is its own house.
    stem = f"{file.path.stem}-{part}" if part else file.path.stem
    house_id = keys.house_id(stem, keys.digest(sha, part) if part else sha)
    try:
        companions = entry.companions(file, files)
    except (BadHouse, OSError):
        companions = ""  # the reader reports the fault
    if kind == "reader":
        (mark,) = marks_in_digest("readers", [location.partition(":")[0]])
        companions = keys.sha256("\n".join(filter(None, (mark, companions))).encode())
    return bare.model_copy(
        update={
            "house_id": file.path.name if entry.main_file else house_id,
            "sha256": sha,
            "companions": companions,
        }
    )


def suncg_list(root: Path, list_file: Path) -> list[str]:
    """The words `ROOT/house/<id>` of a list file without blank and # lines; BadHouse for a too long id."""
    ids = [line.strip() for line in text_given(list_file, error=BadHouse).splitlines()]
    for number, house in enumerate(ids, 1):
        if len(house.encode()) > _LONGEST_ID and not house.startswith("#"):
            text = f"an id of {len(house)} letters is too long for a folder name"
            raise BadHouse(list_file, f"line {number}", text)
    return [str(root / "house" / i) for i in ids if i and not i.startswith("#")]


def check_unchanged(source: SourceRef) -> None:
    """Raise an error if a file has changed since the source was named. Reads all files of the source.

    MachineFailed if another version of a package or plugin is the cause, so that another machine may do
    it; BadHouse if the user's file has changed.
    """
    # Name the source again and compare the digests.
    now = _source_of(source.kind, source.location, SourceFiles(), source.models, source.part)
    if now.sha256 == source.sha256 and now.companions == source.companions:
        return
    if source.kind in ("plugin", "reader") and now.house_id[:-8] == source.house_id[:-8]:
        text = f"{source.location} needs another version of its plugin"
        raise MachineFailed(text, hint="install the same version everywhere")
    is_of_package = source.kind in HOME_KIND and HOME_KIND[source.kind].is_of_package
    if is_of_package or (source.kind == "sweethome3d" and now.sha256 == source.sha256):
        # The file is the same or comes from the package: this machine's package differs.
        raise MachineFailed(
            f"{source.location} differs from that of the installed package",
            hint="another version of the package is installed; `pbrs-farm homes --fetch`",
        )
    raise BadHouse(source.location, "", "changed since the run began", hint="run, or submit, again")


def _of_folder(folder: Path) -> tuple[str, str]:
    """The reason why a folder is not a home, and a hint."""
    n = len(_homes_in(folder))
    if n:
        return (
            f"is a folder of {n} home{'s' * (n > 1)}",
            "name one home; only `run` and `submit` take folders",
        )
    if (folder / "house").is_dir():
        hint = "for SUNCG, name ROOT/house/ID, or ROOT and --houses LIST"
    elif below := homes_left_below(folder):
        hint = below
    elif list(folder.glob("*.json")):
        hint = _ROOT_HINT
    elif any(next(folder.glob(f"*{suffix}"), None) for suffix in _MODEL_SUFFIXES):
        hint = f"`pbrs-farm objects {folder} --out DIR` renders single models"
    else:
        hint = f"supported: {summary()}"
    return "has no house.json and no home file", hint
