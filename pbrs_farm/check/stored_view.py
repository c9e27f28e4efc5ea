"""A finished view by its stored files: camera, instances, layers; reads files, uses neither House nor Camera."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.check.certificate import Tally
from pbrs_farm.check.lens_rays import StoredCamera, StoredLens
from pbrs_farm.check.stored_files import BadFile, stored_bytes, stored_object
from pbrs_farm.core.arrays import F32, F64
from pbrs_farm.core.errors import BadInput, BadRecipe
from pbrs_farm.core.layers import LAYERS, Layer
from pbrs_farm.core.recipe import Recipe, recipe_from_json
from pbrs_farm.core.shot import Shot
from pbrs_farm.images import array_from_png, layers_from_exr

_STACKED = {x.file: x.n_stacked for x in LAYERS if x.n_stacked > 1}
BASIC = tuple(x.name for x in LAYERS if x.step == "truth" and not x.optional)


@dataclass(frozen=True)
class StoredView(StoredCamera):
    """A views/<view_id> folder."""

    folder: Path
    table: dict[str, Any]  # view.json

    @property
    def place(self) -> str:
        """House and view, as messages name them."""
        return f"{self.folder.parent.parent.name}/{self.folder.name}"

    @property
    def shot(self) -> Shot:
        """The view's take, frame and camera of a rig."""
        return Shot.of_row(self.folder.name, self.table)

    @cached_property
    def size(self) -> tuple[int, int]:  # type: ignore[override]
        """(height, width) in pixels."""
        return int(self.table["height_px"]), int(self.table["width_px"])

    @cached_property
    def recipe(self) -> Recipe | None:
        """The recipe of its root; None where recipe.json is missing or damaged."""
        file = self.folder.parents[3] / "recipe.json"
        try:
            return recipe_from_json(stored_bytes(file), str(file))
        except (BadFile, BadRecipe):
            return None

    @cached_property
    def k(self) -> F64:  # type: ignore[override]
        """(3, 3) K."""
        return np.array(self.table["K"], np.float64)

    @cached_property
    def lens(self) -> StoredLens | None:  # type: ignore[override]
        """The lens, None for a pinhole."""
        return StoredLens.of(self.table["lens"]) if "lens" in self.table else None

    @cached_property
    def world_from_camera(self) -> F64:  # type: ignore[override]
        """(4, 4) pose with OpenCV axes (x right, y down, z forward)."""
        return np.array(self.table["world_from_camera_opencv"], np.float64)

    @cached_property
    def nyu40(self) -> dict[int, int]:
        """Instance id -> class, of the instances in the table."""
        return {int(row["id"]): int(row["nyu40"]) for row in self.table["instances"]}

    @cached_property
    def parts(self) -> list[dict[str, Any]]:
        """The rows of articulation.json; [] where it is missing or damaged."""
        try:
            rows = stored_object(self.folder / "articulation.json")["parts"]
        except (BadFile, KeyError):
            return []
        return list(rows) if isinstance(rows, list) else []

    def has(self, file: str) -> bool:
        """True if the view has this file."""
        return (self.folder / file).is_file()

    def png(self, file: str) -> NDArray[Any]:
        """Pixels of a PNG, pictures below one another as channels; BadInput if it cannot be read."""
        array = array_from_png(self._bytes(file), f"{self.place}/{file}")
        n = _STACKED.get(file, 1)
        return np.stack(np.split(array, n), axis=-1) if n > 1 and len(array) % n == 0 else array

    def exr(self, file: str) -> dict[str, F32]:
        """Channels of an EXR; BadInput if it cannot be read."""
        return layers_from_exr(self._bytes(file), f"{self.place}/{file}")

    def _bytes(self, file: str) -> bytes:
        try:
            return stored_bytes(self.folder / file)
        except BadFile as error:
            raise BadInput(f"{self.place}/{file}", "", str(error)) from None


def views_of_house(house: Path) -> tuple[list[StoredView], dict[Path, str]]:
    """Views of a house folder with a readable view.json, by name, and the faults of the others by file."""
    views, faults = [], {}
    for file in sorted(house.glob("views/*/view.json")):
        try:
            views.append(StoredView(file.parent, stored_object(file)))
        except BadFile as error:
            faults[file] = str(error)
    return views, faults


def read_labels(view: StoredView, tally: Tally) -> dict[str, NDArray[Any]] | None:
    """Layers by name, without radiance; faults are tallied, and a wrong basic layer gives None."""
    arrays = {}
    for layer in LAYERS:
        if layer.name in BASIC or (view.has(layer.file) and layer.name != "radiance"):
            array = _read_layer(view, layer, tally)
            if array is not None:
                arrays[layer.name] = array
    return arrays if all(name in arrays for name in BASIC) else None


def read_radiance(view: StoredView, tally: Tally) -> dict[str, F32]:
    """The channels of radiance.exr; {} if it is missing or cannot be read."""
    if not view.has("radiance.exr"):
        return {}
    try:
        return view.exr("radiance.exr")
    except BadInput as error:
        tally.expect("radiance", view.place, False, str(error))
        return {}


def _read_layer(view: StoredView, layer: Layer, tally: Tally) -> NDArray[Any] | None:
    expect = tally.at("layers", f"{view.place}/{layer.file}")
    if not expect(view.has(layer.file), "is missing"):
        return None
    try:
        array = view.png(layer.file) if layer.file.endswith(".png") else _planes(view, layer)
    except (BadInput, KeyError) as error:
        expect(False, str(error))
        return None
    n = 3 if layer.channels == "RGB" else len(layer.channels.split())
    shape = view.size if n == 1 else (*view.size, n)
    # EXR files are read as 32-bit floats, whatever they hold.
    dtype = "float32" if layer.dtype == "float16" else layer.dtype
    fits = array.shape == shape and str(array.dtype) == dtype
    fault = f"{array.shape} {array.dtype}, expected {shape} {layer.dtype}"
    return array if expect(fits, fault) else None


def _planes(view: StoredView, layer: Layer) -> F32:
    """The channels of an EXR layer, stacked if there are several."""
    channels = view.exr(layer.file)
    planes = [channels[name] for name in layer.channels.split()]
    return planes[0] if len(planes) == 1 else np.stack(planes, axis=-1)
