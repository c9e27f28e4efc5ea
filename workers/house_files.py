"""Arguments of the user -> entries of a job, with their files through the store into a worker's cache."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Final

from pbrs_farm.assets import furniture_package, homes_package
from pbrs_farm.assets.debian import DebFiles, cache_folder, write_whole
from pbrs_farm.core import keys
from pbrs_farm.core.plugins import plugin, plugin_homes, plugins
from pbrs_farm.core.recipe import CAMERA_SOURCES, Recipe
from pbrs_farm.crash_notes import note_step
from pbrs_farm.prepare.dress_catalogue import GENERATED, has_furniture
from pbrs_farm.prepare.formats import format_of_source
from pbrs_farm.prepare.home_kinds import HOME_KIND
from pbrs_farm.prepare.passes import uses_catalogue
from pbrs_farm.prepare.source import resolve, variants, words_of_homes
from pbrs_farm.prepare.source_ref import SourceRef, home_id
from pbrs_farm.read.common.source_files import SourceFiles
from pbrs_farm.store.object_store import Store
from workers.job import HouseEntry

# Where sources lie in the store.
FOLDER: Final = "jobs/sources/"
_LIBRARIES: Final = f"{FOLDER}libraries/"  # the user's own, to dress with


def entries_from_arguments(
    arguments: Sequence[str], seeds: Sequence[int] = (0,), *, models: str = ""
) -> list[tuple[HouseEntry, SourceRef]]:
    """Resolve arguments to houses, one per home and dressing seed, without a store; BadHouse."""
    # Take each house once, whatever arguments name it.
    entries: dict[str, tuple[HouseEntry, SourceRef]] = {}
    files = SourceFiles()
    for word in words_of_homes(arguments):
        note_step(word, "read")
        for ref in variants(resolve(word, files, models=models), seeds):
            entries.setdefault(ref.house_id, (entry_of_source(ref), ref))
    return list(entries.values())


def entry_of_source(ref: SourceRef) -> HouseEntry:
    """The entry of a resolved home in a job."""
    source = _source_in_store(ref).model_dump_json()
    return HouseEntry(house_id=ref.house_id, source=source, sha256=ref.fingerprint)


def upload(store: Store, refs: Sequence[SourceRef]) -> None:
    """Put files and the example homes' package into the store; folders must be at the same path for workers."""
    # A source in one file goes into the store, below its home's id, once for all its variants.
    for place, path in {_source_in_store(ref).location: ref.location for ref in refs}.items():
        if place != path:
            store.put_if_absent(place, Path(path).read_bytes())
    # Homes take furniture from the examples' package: workers need it too.
    if any(_uses_packages(ref) for ref in refs):
        _upload_package(store, homes_package.FILES)
    if any(has_own_furniture(ref) for ref in refs):
        _upload_package(store, furniture_package.FILES)


def _uses_packages(ref: SourceRef) -> bool:
    """Whether a home has models of the examples' package."""
    if ref.kind in HOME_KIND:
        return ref.kind == "example" or has_own_furniture(ref)
    entry = format_of_source(ref)
    return entry is not None and entry.uses_packages


def has_own_furniture(ref: SourceRef) -> bool:
    """True if a home takes furniture from the package before it is dressed."""
    return ref.kind in HOME_KIND and HOME_KIND[ref.kind].has_furniture(ref)


def needed_plugins(
    refs: Sequence[SourceRef], recipe: Recipe, layers: Sequence[str]
) -> tuple[str, ...]:
    """The marks of the plugins that workers need for homes under a recipe.

    layers: names of label layers, of which only plugins' are looked at. Homes, readers, passes,
    pictures, cameras, layers and, where the recipe uses the catalogue, furniture; each mark once,
    in that order. A plugin that is not installed here raises.
    """
    named = [("homes", plugin_homes(ref.location)[0].name) for ref in refs if ref.kind == "plugin"]
    named += [("readers", ref.location.partition(":")[0]) for ref in refs if ref.kind == "reader"]
    named += [("passes", name) for name in recipe.dress.passes.split(":") if name]
    if any(uses_catalogue(ref, recipe) for ref in refs):
        named += [("furniture", name) for name in plugins("furniture")]
    named += [("pictures", name) for name in recipe.tone.pictures.split(":") if name]
    source = recipe.cameras.source_name
    named += [("cameras", source)] * (source not in CAMERA_SOURCES.own_names())
    named += [("layers", name) for name in layers if name in plugins("layers")]
    return tuple(dict.fromkeys(plugin(group, name).mark for group, name in named))


def _upload_package(store: Store, files: DebFiles) -> None:
    for path in files.cached_files():
        names = path.relative_to(cache_folder()).parts
        key = FOLDER + "/".join(map(_key_name, names))
        if store.head(key) is None:
            store.put_if_absent(key, path.read_bytes())


def is_left_in_place(ref: SourceRef) -> bool:
    """True if each worker reads the source in place: SUNCG, companions or models, plugins."""
    return format_of_source(ref) is not None and _source_in_store(ref).location == ref.location


def placed_reference(path: Path) -> tuple[str, bytes]:
    """Content key and bytes of a job's reference file for select; BadInput without it."""
    from pbrs_farm.curate.reference_build import read_reference
    from pbrs_farm.selection.reference_set import bytes_from_reference

    reference = read_reference(path)
    return f"{FOLDER}references/{reference.digest}.npz", bytes_from_reference(reference)


def upload_catalogue(store: Store, recipe: Recipe) -> Recipe:
    """Upload the libraries that a recipe's dressing needs; returns the recipe with their names in the store.

    The furniture package is uploaded if it is cached; otherwise workers download it. A folder of models is
    not uploaded: workers need it at the same path. Raises BadInput for an invalid library.
    """
    from pbrs_farm.prepare.dress_catalogue import catalogue_of

    catalogue_of(recipe.dress)
    if GENERATED not in recipe.dress.catalogue.split(":"):
        _upload_package(store, furniture_package.FILES)
    # placed: key in the store -> local path; what maps to itself stays where it is.
    placed = placed_catalogue(recipe.dress.catalogue)
    for key, path in placed.items():
        if key != path:
            store.put_if_absent(key, Path(path).read_bytes())
    return with_catalogue(recipe, ":".join(placed))


def placed_catalogue(words: str) -> dict[str, str]:
    """The words of dress.catalogue as workers find them -> as they were given.

    words: separated by ":". A file becomes a key that has the digest of its content; any other word
    stays. The caller puts the files into the store under these keys; `local_catalogue` fetches
    them.
    """
    placed = {}
    for word in filter(None, words.split(":")):
        path = Path(word)
        if path.is_file():
            # Name a library by its content: two of one name do not meet.
            digest = keys.sha256(path.read_bytes())
            placed[f"{_LIBRARIES}{digest[:16]}/{_key_name(path.name)}"] = word
        else:
            placed[word] = word
    return placed


def with_catalogue(recipe: Recipe, words: str) -> Recipe:
    """The recipe with another dress.catalogue."""
    fields = recipe.dress.model_copy(update={"catalogue": words})
    return recipe.model_copy(update={"dress": fields})


def local_catalogue(store: Store, recipe: Recipe) -> Recipe:
    """On a worker: the recipe with libraries of the store as files of this machine's cache.

    Effects: reads the store and writes to the cache folder; cached libraries are not downloaded again. Other
    words are unchanged. ObjectMissing if the store lost a library.
    """
    words = []
    for word in filter(None, recipe.dress.catalogue.split(":")):
        # Fetch a library once; its name has the digest of its content.
        path = cache_folder() / "libraries" / word.removeprefix(_LIBRARIES)
        if word.startswith(_LIBRARIES) and not path.exists():
            path.parent.mkdir(parents=True, exist_ok=True)
            write_whole(path, store.get(word))
        words.append(str(path) if word.startswith(_LIBRARIES) else word)
    return with_catalogue(recipe, ":".join(words))


def fill_cache(store: Store, *, with_furniture: bool = False) -> None:
    """On a worker: take missing packages from the store, the furniture's for dressed or made houses."""
    # Download only missing packages.
    packages = [homes_package.FILES] if homes_package.cached() is None else []
    if with_furniture and not has_furniture():
        packages.append(furniture_package.FILES)
    # A note says that the files are there: notes sort after them.
    for key in sorted(store.list(FOLDER)) if packages else ():
        name = key.removeprefix(FOLDER)
        if any(files.has_file(name) for files in packages):
            (cache_folder() / name).parent.mkdir(parents=True, exist_ok=True)
            write_whole(cache_folder() / name, store.get(key))


def _source_in_store(ref: SourceRef) -> SourceRef:
    """The source as workers find it: a single file by its key in the store."""
    entry = format_of_source(ref)
    if entry is None or ref.kind == "reader" or not entry.travels:
        return ref
    # A file with others beside it cannot travel as one object; Sweet Home 3D's are a package's.
    if ref.models or (ref.companions and not entry.uses_packages):
        return ref
    key = f"{FOLDER}{home_id(ref)}/{_key_name(ref.given.path.name)}"
    return ref.model_copy(update={"location": key})


def _key_name(name: str) -> str:
    """A file name as a segment of a key; the runner gives the file its own name back."""
    return "".join(c if c.isalnum() or c in "._-+~ " else "_" for c in name).lstrip(".") or "file"
