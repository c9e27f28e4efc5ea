"""Views of an output root in any store: a folder, memory, S3. Effects: reads the store."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, Final

from numpy.typing import NDArray

from pbrs_farm.core import keys
from pbrs_farm.core.errors import BadInput, ObjectMissing
from pbrs_farm.core.house_split import SplitShares, split_of_house
from pbrs_farm.core.layers import LAYER
from pbrs_farm.core.layers import LAYERS as ALL_LAYERS
from pbrs_farm.core.recipe import Recipe, recipe_from_json
from pbrs_farm.formats.cameras_json import cameras_json, views_from_json
from pbrs_farm.formats.layer_file import layer_from_bytes
from pbrs_farm.formats.marker import copy_done, read_marker
from pbrs_farm.images import array_from_png
from pbrs_farm.run.output_root import attribution, claim_root, finish_root
from pbrs_farm.store import Store, store_from_url
from pbrs_farm.store.folder import FolderStore
from pbrs_farm.views.png_rows import array_of_rows
from pbrs_farm.views.stored_layers import (
    STORED,
    ViewFacts,
    array_names,
    check_array,
    facts_from_json,
    sample_of_stored,
)
from pbrs_farm.views.view_sample import MODES, Sample, SampleRequest
from pbrs_farm.views.views import ViewRef, Views

_TABLE: Final = "view.json"  # the last file written of a view
_CAMERAS: Final = "cameras.json"


class StoredRoot:
    """An output root as pbrs-farm writes it; a ViewSource."""

    def __init__(self, store: Store) -> None:
        self._store = store
        # Messages show a folder as a path, not a URL.
        self._place = str(store.root) if isinstance(store, FolderStore) else store.url
        self._facts: dict[ViewRef, ViewFacts] = {}  # filled on demand
        self._files = _files_of_views(store)

    @property
    def url(self) -> str:
        return self._place

    @property
    def refs(self) -> tuple[ViewRef, ...]:
        """All finished views, houses before objects, by id."""
        finished = (ref for ref, files in self._files.items() if _TABLE in files)
        return tuple(sorted(finished, key=lambda ref: (ref.is_object, ref)))

    @property
    def unfinished(self) -> dict[str, str]:
        """id -> reason, for unfinished views of a run."""
        return {r.id: f"no {_TABLE}" for r, files in self._files.items() if _TABLE not in files}

    def lacks(self, ref: ViewRef, request: SampleRequest) -> str:
        files = (_file(name, request.mode) for name in array_names(request.layers))
        return next((file for file in files if file not in self._files[ref]), "")

    def modes(self, ref: ViewRef) -> tuple[str, ...]:
        return tuple(mode for mode in MODES if f"{mode}.png" in self._files[ref])

    def facts(self, ref: ViewRef) -> ViewFacts:
        if ref not in self._facts:
            place = f"{self.url}/{keys.view_key(ref.house, ref.view, _TABLE)}"
            self._facts[ref] = facts_from_json(self.table(ref), place)
        return self._facts[ref]

    def table(self, ref: ViewRef) -> dict[str, Any]:
        key = keys.view_key(ref.house, ref.view, _TABLE)
        try:
            row: dict[str, Any] = json.loads(self._get(key))
        except (ValueError, RecursionError):
            raise BadInput(f"{self.url}/{key}", "", "not JSON: damaged") from None
        return row

    def read(self, ref: ViewRef, request: SampleRequest) -> Sample:
        return sample_of_stored(self.facts(ref), self.arrays(ref, request), request)

    def arrays(self, ref: ViewRef, request: SampleRequest) -> dict[str, NDArray[Any]]:
        """The stored arrays of a request, at their original size.

        Whole numbers as in the files: depth in mm, normals in 0..65535. Raises BadInput if a file is
        damaged, or has another size than the view.
        """
        size = self.facts(ref).size
        arrays = {}
        for name in array_names(request.layers):
            key = keys.view_key(ref.house, ref.view, _file(name, request.mode))
            place = f"{self.url}/{key}"
            # Decode labels here; PNGs with other filters are left to OpenImageIO.
            data = self._get(key)
            array = array_of_rows(data, place)
            array = array_from_png(data, place) if array is None else array
            arrays[name] = check_array(name, array, size, place)
        return arrays

    def layers(self, ref: ViewRef) -> tuple[str, ...]:
        return tuple(layer.name for layer in ALL_LAYERS if layer.file in self._files[ref])

    def layer(self, ref: ViewRef, name: str) -> NDArray[Any]:
        if name not in self.layers(ref):
            hint = f"of {', '.join(self.layers(ref))}"
            raise BadInput(f"{self.url}: {ref.id}", "", f"no layer {name}", hint=hint)
        key = keys.view_key(ref.house, ref.view, LAYER[name].file)
        return layer_from_bytes(name, self._store.get(key), f"{self.url}/{key}")

    def file(self, ref: ViewRef, name: str) -> bytes:
        """The bytes of a view's file; ObjectMissing for an unknown name."""
        return self._get(keys.view_key(ref.house, ref.view, name))

    def kept_by(self, run: str) -> frozenset[ViewRef]:
        key = keys.selection_key(run, "jsonl")
        try:
            # Each line has the view and `kept`.
            rows = [json.loads(line) for line in self._store.get(key).splitlines()]
            return frozenset(ViewRef(row["house"], row["view"]) for row in rows if row["kept"])
        except ObjectMissing:
            hint = "`pbrs-farm select` makes one"
            raise BadInput(f"{self.url}/{key}", "", "no such selection", hint=hint) from None
        except (ValueError, KeyError, TypeError):
            raise BadInput(f"{self.url}/{key}", "", "not a selection: damaged") from None

    def credits(self, houses: Iterable[str]) -> tuple[str, ...]:
        """The lines that every product of these houses must carry, each once.

        In the order of the houses. Dressed homes add the credits of the whole root, which share one file.
        """
        lines = [attribution(self._store, house) for house in houses]
        # Dressed homes have their credits in a separate file.
        with suppress(ObjectMissing):
            lines += self._get(keys.ATTRIBUTION).decode("utf-8", "replace").splitlines()
        return tuple(dict.fromkeys(line for line in lines if line))

    @property
    def recipe(self) -> Recipe | None:
        """The recipe of the views; None if recipe.json is missing."""
        try:
            return recipe_from_json(self._get(keys.RECIPE), f"{self.url}: {keys.RECIPE}")
        except ObjectMissing:
            return None

    def source_of(self, house: str) -> dict[str, str]:
        """Origin and terms of a house, from its house.json; {} if missing."""
        try:
            row = json.loads(self._get(keys.house_key(house, "house.json")))["source"]
            return {str(name): str(value) for name, value in row.items()}
        except (ObjectMissing, ValueError, KeyError, TypeError, AttributeError):
            return {}

    def save(self, refs: Sequence[ViewRef], place: str | Path) -> None:
        to = store_from_url(str(place))
        recipe = recipe_from_json(self._get(keys.RECIPE), f"{self.url}: {keys.RECIPE}")
        claim_root(to, recipe, update=False)
        for ref in refs:
            copy_view(self._store, to, ref)
        finish_root(to, dict.fromkeys(ref.house for ref in refs))

    def split_of(self, ref: ViewRef, shares: SplitShares | None) -> str:
        return split_of_house(ref.house, shares)

    def _get(self, key: str) -> bytes:
        return self._store.get(key)


def finished_views(store: Store) -> frozenset[tuple[str, str]]:
    """(house, view) of every finished view of a store; empty for an empty store.

    A view is finished if it has view.json, which is written last. Lists the store, which takes long for
    a remote root.
    """
    views = _files_of_views(store)
    return frozenset((ref.house, ref.view) for ref, files in views.items() if _TABLE in files)


def copy_view(of: Store, to: Store, ref: ViewRef) -> None:
    """Copy a view with the files of its house and the markers of both.

    If the view exists at the target, the pictures and layers of both are kept.
    """
    if to.head(keys.marker_key(ref.house, "view", ref.view)) is not None:
        _merge_view(of, to, ref)
        return
    for key in of.list(keys.house_key(ref.house)):
        place = keys.parse_house_key(key)
        if place is None or place.file == keys.MANIFEST or place.view not in (None, ref.view):
            continue
        if place.view is None and place.file != _CAMERAS and place.step != "cameras":
            to.put(key, of.get(key))
        elif place.step and place.view is not None:
            copy_done(of, to, key)
    _copy_cameras(of, to, ref.house)


def _merge_view(of: Store, to: Store, ref: ViewRef) -> None:
    """Add a view's pictures to those at the target, and merge the labels and tables."""
    from pbrs_farm.run.house_cache import HouseCache
    from pbrs_farm.run.plan import STEPS
    from pbrs_farm.run.step_cache import Work
    from pbrs_farm.run.steps import run_step

    truth = None
    for step in STEPS.values():
        key = keys.marker_key(ref.house, step.name, ref.view)
        if step.name == "truth":
            truth = read_marker(of, key)
        elif step.per_view and step.name != "view":
            copy_done(of, to, key)
    _copy_cameras(of, to, ref.house)
    layers = tuple(truth.facts.get("layers", ())) if truth is not None else ()
    recipe = recipe_from_json(of.get(keys.RECIPE), f"{of.url}: {keys.RECIPE}")
    cache = HouseCache()
    work = Work(to, recipe, ref.house, cache, view_id=ref.view, layers=layers)
    try:
        for name in ("truth", "view"):
            run_step(name, work)
    finally:
        cache.clear()


def _copy_cameras(of: Store, to: Store, house: str) -> None:
    """Copy cameras.json and its marker; cameras from Python are added to those at the target."""
    key, marker_key = keys.house_key(house, _CAMERAS), keys.marker_key(house, "cameras")
    data, marker = of.get(key), read_marker(of, marker_key)
    stored = to.get(key) if to.head(key) is not None else data
    if marker is None:
        raise BadInput(of.url, marker_key, "is missing")
    if stored != data:
        views = {**views_from_json(stored, key), **views_from_json(data, key)}
        cameras = [views[name] for name in sorted(views)]
        data = cameras_json(cameras, {"source": "given", "n_views": len(cameras)})
        files = tuple(
            file.model_copy(update={"n_bytes": len(data), "sha256": keys.sha256(data)})
            for file in marker.files
        )
        facts = {"views": [[v.id, v.room_id, v.score] for v in cameras]}
        marker = marker.model_copy(update={"files": files, "facts": facts})
    to.put(key, data)
    to.put(marker_key, marker.json_bytes())


def views_of_root(store: Store) -> Views:
    """The finished views of an output root; unfinished views are in left_out.

    BadInput if the folder has no finished view, with a word about unfinished ones. Lists the store once;
    files are read on demand.
    """
    root = StoredRoot(store)
    refs = root.refs
    if not refs:
        text = "no finished view of pbrs-farm" + (
            ", though a run has begun" * bool(root.unfinished)
        )
        raise BadInput(root.url, "", text, hint="an output folder, or shards with dataset.json")
    return Views(root, refs, root.unfinished)


def _file(name: str, mode: str) -> str:
    return STORED[name].file.format(mode=mode)


def _files_of_views(store: Store) -> dict[ViewRef, set[str]]:
    """View -> its files, by listing a folder; for other stores from the manifest, if present."""
    files: dict[ViewRef, set[str]] = {}
    for key in _keys_of(store):
        place = keys.parse_house_key(key)
        if place is not None and place.view is not None and not place.step:
            files.setdefault(ViewRef(place.house, place.view), set()).add(place.file)
    return files


def _keys_of(store: Store) -> Iterable[str]:
    if isinstance(store, FolderStore) or store.head(keys.MANIFEST) is None:
        return (key for folder in keys.FOLDERS for key in store.list(f"{folder}/"))
    try:
        return [str(json.loads(line)["key"]) for line in store.get(keys.MANIFEST).splitlines()]
    except (ValueError, KeyError, TypeError):
        raise BadInput(f"{store.url}/{keys.MANIFEST}", "", "not a manifest: damaged") from None
