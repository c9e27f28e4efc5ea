"""Edits of a finished home, as frozen values that travel; no effects.

An edit names items by their ids and files by path and sha256, so that another worker makes the same house
or says why it cannot. prepare/apply_edits.py carries edits out, in their order.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated, Final, Literal

import numpy as np
from pydantic import Field

from pbrs_farm.core import keys
from pbrs_farm.core.arrays import Matrix4
from pbrs_farm.core.record import Record

if TYPE_CHECKING:
    from pbrs_farm.core.recipe import Recipe

Row = tuple[float, float, float, float]
Rows = tuple[Row, Row, Row, Row]
Vector = tuple[float, float, float]
BodyRow = tuple[float, float, float, float, float, float, float]
Share = Annotated[float, Field(ge=0, le=1)]


class ModelRef(Record):
    """A mesh file and how its coordinates become metres in its own frame."""

    path: str
    sha256: str  # of the file
    companions: str = ""  # digest of the files beside it that reading opens: materials, pictures
    id: str  # what its instances are called in tables: "mug", "obj_000005"
    category: str = ""  # source class
    nyu40: int = 0
    scale: float = 1.0  # metres of a unit of the file
    credit: str = ""  # the line that pictures of it must carry


class PlaceModel(Record):
    """Add a model at a pose."""

    do: Literal["place"] = "place"
    item: str  # the new item's id
    model: ModelRef
    world_from_model: Rows  # rigid; model coordinates in metres


class FloatModel(Record):
    """As PlaceModel, of a model that hangs in the air: nothing holds it."""

    do: Literal["float"] = "float"
    item: str
    model: ModelRef
    world_from_model: Rows


class RemoveItems(Record):
    """Take items away; holes of doors and windows among them, and the others' instance ids, stay."""

    do: Literal["remove"] = "remove"
    items: tuple[str, ...]


class MoveItems(Record):
    """Move items rigidly, lamps with their light."""

    do: Literal["move"] = "move"
    items: tuple[str, ...]
    world_from_world: Rows


class OpenJoints(Record):
    """Open or close doors, drawers and lids, as far as no obstacle stops them."""

    do: Literal["open"] = "open"
    joints: tuple[tuple[str, str], ...]  # (item, part)
    share: Share  # of the way to the joint's upper limit


class KeyJoints(Record):
    """Open and close doors, drawers and lids over time, as far as no obstacle stops them."""

    do: Literal["key_joints"] = "key_joints"
    joints: tuple[tuple[str, str], ...]  # (item, part)
    keys: tuple[tuple[float, Share], ...]  # (seconds, share of the way to the joint's upper limit)


class BodyMotion(Record):
    """Where an item is over time; the fields are those of a Motion of a whole item."""

    item: str
    times_s: tuple[float, ...]
    values: tuple[BodyRow, ...]
    pivot: Vector


class RecordBodies(Record):
    """Let items move as they were recorded: a fall, a push."""

    do: Literal["record"] = "record"
    bodies: tuple[BodyMotion, ...]


class StandAt(Record):
    """Freeze all motion at a time."""

    do: Literal["at"] = "at"
    time_s: float


class PaintItems(Record):
    """Give items one plain colour."""

    do: Literal["paint"] = "paint"
    items: tuple[str, ...]
    rgb: Vector  # sRGB, 0..1
    roughness: float | None = None  # 0..1, None = as it was


class CoverItems(Record):
    """Cover items with a picture, repeated every scale_m metres."""

    do: Literal["cover"] = "cover"
    items: tuple[str, ...]
    path: str
    sha256: str
    scale_m: float


class SetLight(Record):
    """Give lamps another flux, and a colour where one is given."""

    do: Literal["light"] = "light"
    items: tuple[str, ...]
    lm: float
    rgb_linear: Vector | None = None


class AddLight(Record):
    """Add a bare bulb, or a spot that shines along a direction."""

    do: Literal["add_light"] = "add_light"
    item: str
    position: Vector  # metres, world
    lm: float
    rgb_linear: Vector = (1.0, 1.0, 1.0)
    radius_m: float = 0.0325
    direction: Vector | None = None  # of a spot
    cutoff_rad: float = 0.5


Edit = Annotated[
    PlaceModel
    | FloatModel
    | RemoveItems
    | MoveItems
    | OpenJoints
    | KeyJoints
    | RecordBodies
    | StandAt
    | PaintItems
    | CoverItems
    | SetLight
    | AddLight,
    Field(discriminator="do"),
]


class SavedHome(Record):
    """A home with its edits as a file holds it: the home, its dressing, its edits."""

    format: Literal["pbrs_farm home 1"] = "pbrs_farm home 1"
    home: str  # a word of a command line; files by their whole path
    house_id: str  # which it is then: another one means that a file has changed
    models: str = ""
    dress_seed: Annotated[int, Field(ge=0)] = 0
    edits: tuple[Edit, ...] = ()


SUFFIX: Final = "-e"
"""Before the digest of the edits in an edited house's id."""


def edits_digest(edits: Sequence[Edit]) -> str:
    """Digest of edits in their order, "" for none; the content of files counts, not their paths."""
    if not edits:
        return ""
    rows = [edit.model_dump(mode="json") for edit in edits]
    for row in rows:
        row.pop("path", None)
        row.get("model", {}).pop("path", None)
    return keys.digest(rows)


def edited_id(house_id: str, edits: Sequence[Edit]) -> str:
    """The id of a house with edits: `<house>-e<8 hex of edits_digest>`; its own without any."""
    return f"{house_id}{SUFFIX}{edits_digest(edits)[:8]}" if edits else house_id


def unedited_id(house_id: str) -> str:
    """The id of a house without its edits, whose sky an edited house keeps."""
    return re.sub(rf"{SUFFIX}[0-9a-f]{{8}}$", "", house_id)


def is_lamp_on(item_id: str, house_id: str, recipe: Recipe) -> bool:
    """True if the recipe has a lamp on, with all its light sources; edits of a home keep the draw."""
    draw = keys.seed("lamp on", item_id, unedited_id(house_id), recipe.seed) / 2**32
    return draw < recipe.emission.lamps_on


def rows_of_matrix(matrix: Matrix4) -> Rows:
    """A (4, 4) matrix as a record holds it."""
    a, b, c, d = (tuple(float(x) for x in row) for row in np.asarray(matrix, np.float64))
    return a, b, c, d  # type: ignore[return-value]
