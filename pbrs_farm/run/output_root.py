"""The output root as a whole: its one recipe and its manifests. Effects: the store's."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

from pbrs_farm.core import keys
from pbrs_farm.core.errors import BadRecipe
from pbrs_farm.core.recipe import Recipe, differences, recipe_from_json
from pbrs_farm.formats.manifest import manifest_from_markers
from pbrs_farm.formats.marker import read_marker
from pbrs_farm.formats.serialise import json_bytes
from pbrs_farm.run.attributions import write_attribution
from pbrs_farm.store import StoreSettings, store_from_url
from pbrs_farm.store.folder import FolderStore
from pbrs_farm.store.object_store import LAYOUT, Store, get_or_none


def attribution(store: Store, house_id: str) -> str:
    """The credit line of all products of the house; "" without one, or if house.json is missing or damaged."""
    key = keys.house_key(house_id, "house.json")
    data = get_or_none(store, key)
    if data is None:
        return ""
    try:
        return str(json.loads(data)["source"]["attribution"])
    except (ValueError, KeyError, TypeError):
        return ""


def finish_house(store: Store, house_id: str) -> int:
    """Write the house's manifest if it changed, remove old checkpoints; the number of listed objects."""
    read_markers = [read_marker(store, k) for k in store.list(keys.house_key(house_id, "done/"))]
    markers = [marker for marker in read_markers if marker is not None]
    data = manifest_from_markers(markers, attribution(store, house_id))
    key = keys.house_key(house_id, keys.MANIFEST)
    if get_or_none(store, key) != data:
        store.put(key, data)
    # A step killed between its marker and the removal of its checkpoint leaves one.
    done = {keys.unfinished_key(house_id, m.step, m.view_id) for m in markers if m.view_id}
    for unfinished in list(store.list(keys.unfinished_key(house_id))):
        if unfinished in done:
            store.delete(unfinished)
    return data.count(b"\n")


def merge_manifests(store: Store, house_ids: list[str]) -> None:
    """Write the root's manifest.jsonl from those of the houses that have one, in the order of the ids."""
    manifest_keys = (keys.house_key(house_id, keys.MANIFEST) for house_id in sorted(house_ids))
    store.put(keys.MANIFEST, b"".join(get_or_none(store, key) or b"" for key in manifest_keys))


def finish_root(store: Store, houses: Iterable[str]) -> None:
    """Write the manifests of these houses, the root's manifest of all its houses, and the attribution."""
    for house_id in houses:
        finish_house(store, house_id)
    below = [keys.parse_house_key(key) for top in keys.FOLDERS for key in store.list(f"{top}/")]
    merge_manifests(store, [p.house for p in below if p and p.file == keys.MANIFEST])
    write_attribution(store)


def claim_root(store: Store, recipe: Recipe, *, update: bool) -> None:
    """One root holds one recipe: write it (or replace it, to update), or BadRecipe with what differs."""
    data = json_bytes(recipe)
    if store.put_if_absent(keys.RECIPE, data):
        return
    present = recipe_from_json(store.get(keys.RECIPE), f"{store.url}: recipe.json")
    differing = differences(present, recipe)
    if differing and not update:
        hint = "--update repeats the changed steps; or choose another output"
        raise BadRecipe(f"{store.url} has another recipe: {'; '.join(differing)}", hint=hint)
    if differing:
        # From now on a marker's name alone does not say that its step is done.
        store.put(keys.RECIPE_REPLACED, json.dumps({"last": differing}).encode())
        store.put(keys.RECIPE, data)


def pull(of: Store, folder: Path, tell: Callable[[int], None] = lambda _n: None) -> tuple[int, int]:
    """Copy an output root of any layout into a folder of files; the numbers of copied and of present files.

    A file of a house that is present with its size is not read again. tell: called before each file with the
    number of finished ones.
    """
    to, n_copied, n_there = FolderStore(folder), 0, 0
    for key in of.list():
        tell(n_copied + n_there)
        if key == LAYOUT or key.startswith("jobs/"):
            continue  # of the store, not of the root
        copy = to.head(key) if key.startswith(tuple(f"{top}/" for top in keys.FOLDERS)) else None
        original = of.head(key) if copy is not None else None
        if copy is not None and original is not None and copy.n_bytes == original.n_bytes:
            n_there += 1
            continue
        to.put(key, of.get(key))
        n_copied += 1
    return n_copied, n_there


@contextmanager
def as_files(word: str, settings: StoreSettings) -> Iterator[Path]:
    """The folder of an output root; for a URL or a packed root a temporary copy of all of it."""
    if "://" not in word and not (Path(word) / LAYOUT).is_file():
        yield Path(word)
        return
    with TemporaryDirectory(prefix="pbrs-root-") as folder:
        pull(store_from_url(word, settings), Path(folder))
        yield Path(folder)
