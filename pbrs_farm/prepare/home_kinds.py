"""Kinds of homes without a file of a format: a table beside that of the formats (prepare/formats.py).

    builtin | made:7 | an example home's name | plugin:NAME,7 | a model on its own

Effects: reads the example homes' package from the cache (or through apt) and the files of a model.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Final, TypeAlias, TypeVar

from pydantic import TypeAdapter

from pbrs_farm.core import keys
from pbrs_farm.core.catalogue import EMPTY
from pbrs_farm.core.checked_json import checked
from pbrs_farm.core.errors import BadHouse, BadInput, MachineFailed
from pbrs_farm.core.house import House
from pbrs_farm.core.made_home import MadeHome, is_made, made_homes
from pbrs_farm.core.plugins import PluginHome, is_plugin, marks_in_digest, plugin_homes
from pbrs_farm.core.recipe import ReadFields, Recipe, with_settings
from pbrs_farm.prepare.dress_catalogue import catalogue_of_words
from pbrs_farm.prepare.source_ref import SourceRef, home_id
from pbrs_farm.read.common.source_files import RootFolder, SourceFiles
from pbrs_farm.regular_files import fault_of, naming_kind

if TYPE_CHECKING:
    from pbrs_farm.prepare.passes import FinishedHouse
    from pbrs_farm.read.objects.model_folders import ObjectModel

_GENERATED_BY: Final = "home: made by pbrs_farm, CC0"
_GROUPS_OF_PLUGINS: Final = frozenset({"read", "dress", "repair"})  # fields that its homes may set

Licences: TypeAlias = "tuple[str, ...]"
Finish: TypeAlias = "Callable[[SourceRef, Recipe], FinishedHouse]"
_Home = TypeVar("_Home", MadeHome, PluginHome)


@dataclass(frozen=True, slots=True, kw_only=True)
class HomeKind:
    """A kind of homes named by words of a command line.

    name: SourceRef.kind. is_word: true for a word of the kind. words: one word for each home of a word.
    source: the source of a word, with the digests of its files. read: the house in its source's state, its
    furniture from libraries of these licences, () for any.
    finish: for a plugin, instead of `read`: the house after all passes; its function argument finishes
    another source. is_home: False for an object without context, which has no walls to repair and is
    never dressed. is_of_package: made from an installed package, so that another version of the package
    is the machine's fault. has_furniture: true if it takes furniture from the package.
    """

    name: str
    source: Callable[[str, SourceFiles], SourceRef]
    read: Callable[[SourceRef, ReadFields, Licences], House] | None = None
    finish: Callable[[SourceRef, Recipe, Finish], FinishedHouse] | None = None
    is_word: Callable[[str], bool] = lambda _word: False
    words: Callable[[str], list[str]] = lambda word: [word]
    is_home: bool = True
    is_of_package: bool = False
    has_furniture: Callable[[SourceRef], bool] = lambda _source: False


def _builtin_source(word: str, _files: SourceFiles) -> SourceRef:
    from pbrs_farm.read.builtin.builtin_home import builtin_home

    home = builtin_home()
    return SourceRef(kind="builtin", location=word, house_id=home.id, sha256=home.source.sha256)


def _read_builtin(_source: SourceRef, _fields: ReadFields, _licences: Licences) -> House:
    from pbrs_farm.read.builtin.builtin_home import builtin_home

    return builtin_home()


def _example_source(name: str, _files: SourceFiles) -> SourceRef:
    from pbrs_farm.assets import homes_package
    from pbrs_farm.read.sweethome3d.packaged_home import package_digest

    # An unknown name costs no download.
    exact = homes_package.exact_name(name)
    package = homes_package.fetch()
    data, file = package.home(exact)
    sha = keys.sha256(data)
    return SourceRef(
        kind="example",
        location=name,
        house_id=keys.house_id(Path(file).stem, sha),
        sha256=sha,
        companions=package_digest(package),
    )


def _read_example(source: SourceRef, fields: ReadFields, _licences: Licences) -> House:
    from pbrs_farm.read.sweethome3d.packaged_home import read_example

    return read_example(source.location, fields)


def _only(word: str, homes: Sequence[_Home]) -> _Home:
    if len(homes) != 1:
        raise BadHouse(word, "", f"names {len(homes)} homes", hint="name one at a time here")
    return homes[0]


def _made_source(word: str, _files: SourceFiles) -> SourceRef:
    """The source of a generated home; its companion is the furniture package."""
    from pbrs_farm.assets import furniture_package

    home = _only(word, made_homes(word))
    # Ask for the furniture before the run begins, if the home has any.
    companions, package = "", furniture_package.cached() if home.furniture else None
    if home.furniture and package is None:
        raise MachineFailed(
            "generated homes need the furniture package, which is not downloaded",
            hint="`pbrs-farm homes --furniture` (120 MB), or made:1,furniture=none",
        )
    if package is not None and package.note:
        companions = keys.sha256(package.note.encode())
    return SourceRef(
        kind="made",
        location=home.word,
        house_id=keys.house_id(home.name, home.digest),
        sha256=home.digest,
        companions=companions,
    )


def _read_made(source: SourceRef, fields: ReadFields, licences: Licences) -> House:
    from pbrs_farm.generate.generated_home import generate_home
    from pbrs_farm.prepare.generated_house import house_of_contents

    home = _only(source.location, made_homes(source.location))
    # An empty home needs no package, so it also works where packages cannot be read.
    catalogue = catalogue_of_words("", licences) if home.furniture else EMPTY
    contents = generate_home(home, catalogue).contents
    house = house_of_contents(contents, f"{home.name}.sh3d", source.sha256, fields)
    credit = house.source.attribution.replace("pbrs_farm", _GENERATED_BY, 1)
    its_source = replace(house.source, kind="made", file=source.location, attribution=credit)
    return replace(house, id=home_id(source), source=its_source)


def _plugin_source(word: str, _files: SourceFiles) -> SourceRef:
    """The source of a home that a plugin makes; its package and version are part of it."""
    home = _only(word, plugin_homes(word))
    sha = keys.digest(*marks_in_digest("homes", [home.name]), home.word)
    house_id = keys.house_id(f"{home.name}-{home.seed}", sha)
    return SourceRef(kind="plugin", location=home.word, house_id=house_id, sha256=sha)


def _finish_plugin(source: SourceRef, recipe: Recipe, finish: Finish) -> FinishedHouse:
    """The finished Home of a plugin's seed, under the source's id; BadInput for fields of the run in it."""
    if source.dress_seed:
        raise BadInput(source.location, "--dress", "plugins dress their homes themselves")
    home = _only(source.location, plugin_homes(source.location)).make()
    groups = {path.partition(".")[0] for path, _value in home.settings}
    if foreign := groups - _GROUPS_OF_PLUGINS:
        text = f"sets recipe fields of {', '.join(sorted(foreign))}, which are set by the run"
        raise BadInput(source.location, "", text, hint="only fields of read, dress and repair")
    finished = finish(home.source, with_settings(recipe, dict(home.settings)))
    return finished._replace(house=replace(finished.house, id=source.house_id))


def object_source(model: ObjectModel, files: SourceFiles | None = None) -> SourceRef:
    """The source of an object without context. files: cache of digests, for many models."""
    from pbrs_farm.read.objects.single_object import object_companions

    files = files or SourceFiles()
    return SourceRef(
        kind="object",
        location=TypeAdapter(type(model)).dump_json(model).decode(),
        house_id=keys.OBJECT_PREFIX + model.id,
        sha256=digest_of_file(model.path, files),
        companions=files.digest(RootFolder(model.root), object_companions(model, files)),
    )


def _model_of_object(location: str) -> ObjectModel:
    from pbrs_farm.read.objects.model_folders import ObjectModel

    return checked(ObjectModel, location.encode(), location[:80], error=BadHouse)


def _read_object(source: SourceRef, fields: ReadFields, _licences: Licences) -> House:
    from pbrs_farm.read.objects.single_object import read_object

    model = _model_of_object(source.location)
    with naming_kind(model.path):
        house = read_object(model, fields)
    return replace(house, id=source.house_id, is_repaired=True)


def digest_of_file(path: Path, files: SourceFiles) -> str:
    """The digest of a file; BadHouse if it cannot be read."""
    try:
        return files.file_digest(path)
    except OSError as error:
        raise BadHouse(path, "", fault_of(error)) from None


# fmt: off
HOME_KINDS: Final = (
    HomeKind(
        name="builtin", source=_builtin_source, read=_read_builtin,
        is_word=lambda word: word == "builtin",
    ),
    HomeKind(
        name="made", source=_made_source, read=_read_made, is_word=is_made,
        words=lambda word: [home.word for home in made_homes(word)], is_of_package=True,
        has_furniture=lambda source: _only(source.location, made_homes(source.location)).furniture,
    ),
    HomeKind(
        name="plugin", source=_plugin_source, finish=_finish_plugin, is_word=is_plugin,
        words=lambda word: [home.word for home in plugin_homes(word)],
        has_furniture=lambda _source: True,
    ),
    HomeKind(
        name="object", source=lambda word, files: object_source(_model_of_object(word), files),
        # Its JSON; a file's name may begin with a brace, too.
        read=_read_object, is_word=lambda word: word.startswith('{"'), is_home=False,
    ),
    # A word that matches neither another kind nor a path: `resolve` names it.
    HomeKind(name="example", source=_example_source, read=_read_example, is_of_package=True),
)
# fmt: on

HOME_KIND: Final = {kind.name: kind for kind in HOME_KINDS}


def kind_of_word(word: str) -> HomeKind | None:
    """The kind of home that a word names by its form; None for a path and an example home's name."""
    return next((kind for kind in HOME_KINDS if kind.is_word(word)), None)
