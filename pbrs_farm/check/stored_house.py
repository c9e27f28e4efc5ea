"""The documents and markers of a house's folder, empty where missing or damaged; reads files, uses no House."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from pbrs_farm.check.stored_files import BadFile, stored_object
from pbrs_farm.core import keys


def _document(file: Path) -> dict[str, Any]:
    try:
        return stored_object(file)
    except BadFile:
        return {}


def _stored(name: str) -> cached_property[dict[str, Any]]:
    """A document of a house's folder, read when first asked for; {} if missing or damaged."""
    return cached_property(lambda house: _document(house.folder / name))


@dataclass(frozen=True)
class StoredHouse:
    """A houses/<house_id> folder."""

    folder: Path
    moved: dict[str, Any] | None = None  # house.json for another time

    @property
    def id(self) -> str:
        """Name of the folder."""
        return self.folder.name

    @cached_property
    def house(self) -> dict[str, Any]:
        """house.json, of a house at another time for that time."""
        return self.moved if self.moved is not None else _document(self.folder / "house.json")

    cameras = _stored("cameras.json")
    illuminance = _stored("illuminance.json")
    repair = _stored("repair.json")
    dress = _stored("dress.json")
    recipe = cached_property(lambda house: _document(house.folder.parents[1] / "recipe.json"))

    @cached_property
    def items(self) -> dict[int, dict[str, Any]]:
        """Instance id -> the item's row in house.json."""
        return {int(row["instance"]): row for row in self.house.get("items", [])}

    @cached_property
    def rooms(self) -> dict[str, dict[str, Any]]:
        """Id -> the room's row in house.json."""
        return {str(row["id"]): row for row in self.house.get("rooms", [])}

    @cached_property
    def camera_rows(self) -> dict[str, dict[str, Any]]:
        """View's id -> its row in cameras.json."""
        return {str(row["id"]): row for row in self.cameras.get("views", [])}

    @cached_property
    def lux_rows(self) -> dict[str, dict[str, Any]]:
        """Room's id -> its row in illuminance.json."""
        return {str(row["room"]): row for row in self.illuminance.get("rooms", [])}

    @cached_property
    def lamps(self) -> dict[str, tuple[int, int]]:
        """Name of each lit lamp (its item's id, `/n` behind it if it has several) -> instance and number."""
        home, seed = re.sub(r"-e[0-9a-f]{8}$", "", self.id), self.recipe.get("seed", 0)
        return {
            f"{row['id']}/{k}" if len(row["lights"]) > 1 else row["id"]: (instance, k)
            for instance, row in sorted(self.items.items())
            if keys.seed("lamp on", row["id"], home, seed) < self.lamps_on * 2**32
            for k in range(len(row["lights"]))
        }

    @property
    def lamps_on(self) -> float:
        """Share of the lamps that the recipe has on."""
        return float(self.recipe.get("emission", {}).get("lamps_on", 1.0))

    def light(self, name: str) -> dict[str, Any]:
        """The row of a light of `lamps`."""
        instance, k = self.lamps[name]
        row: dict[str, Any] = self.items[instance]["lights"][k]
        return row

    def marker_facts(self, step: str, view: str = "") -> dict[str, Any]:
        """The facts that the marker of a step holds; {} without them."""
        name = f"{step}.{view}.json" if view else f"{step}.json"
        facts = _document(self.folder / "done" / name).get("facts", {})
        return facts if isinstance(facts, dict) else {}
