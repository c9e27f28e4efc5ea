"""SUNCG's optional metadata tables in the user's root (docs/spec/suncg.md section 2); no effects."""

from __future__ import annotations

import csv
import io
import math
from dataclasses import dataclass, field
from typing import Annotated, Final, Literal

import numpy as np
from pydantic import BaseModel, BeforeValidator, Field

from pbrs_farm.core.checked_json import Finite, checked, exactly, json_from_bytes
from pbrs_farm.core.classes import NYU40_NAMES, OTHERPROP, REFRIGERATOR
from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.frames import linear_from_srgb
from pbrs_farm.core.house import ItemKind, LightPart
from pbrs_farm.core.lighting import LightForm, PowerUnit
from pbrs_farm.read.common.notes import Notes
from pbrs_farm.read.common.source_files import RootFolder
from pbrs_farm.regular_files import text_from_bytes

CLASS_TABLES: Final = ("ModelCategoryMappingNewActive.csv", "ModelCategoryMapping.csv")
VARIANT_TABLE: Final = "models.csv"
LAMP_TABLE: Final = "light_geometry_compact.txt"
LIGHT_TABLE: Final = "suncgModelLights.json"
_MAX_TABLE_BYTES: Final = 32_000_000
_NYU40_IDS: Final = {name.replace(" ", "_"): i for i, name in enumerate(NYU40_NAMES)} | {
    "void": 0,
    "refridgerator": REFRIGERATOR,
}
_KIND_OF_CLASS: Final = {name: ItemKind(name) for name in ("window", "door", "lamp", "person")}


@dataclass(frozen=True, slots=True)
class ModelClass:
    """A model's row of ModelCategoryMapping."""

    name: str  # fine-grained class
    nyu40: int
    kind: ItemKind
    structure: bool = False  # empty_struct_obj is 1


@dataclass(frozen=True, slots=True)
class LampMaterials:
    """Which materials of a lamp are bulbs and shades."""

    bulbs: tuple[int, ...]  # positions in the MTL
    shades: tuple[int, ...]  # positions in the MTL


@dataclass(frozen=True, slots=True)
class Tables:
    """Every table by model id."""

    classes: dict[str, ModelClass] = field(default_factory=dict)
    lights: dict[str, tuple[LightPart, ...]] = field(default_factory=dict)  # in the model's frame
    lamps: dict[str, LampMaterials] = field(default_factory=dict)  # bulbs and shades
    variants: dict[str, tuple[str, ...]] = field(default_factory=dict)  # meshes of a model's states


def read_tables(folder: RootFolder, notes: Notes) -> Tables:
    """The tables in metadata/ of the root, or beside it in the root itself."""
    return Tables(
        classes=_read_class_table(folder, notes),
        lights=_read_light_table(folder, notes),
        lamps=_lamps(folder, notes),
        variants=_variants(folder),
    )


def table_places(name: str) -> tuple[str, str]:
    """Candidate locations of a table below the root; the first takes precedence."""
    return f"metadata/{name}", name


def _find_table(
    folder: RootFolder, *names: str, notes: Notes | None = None, lack: str = ""
) -> tuple[str, bytes] | None:
    """(place, bytes) of the first of some tables; None without one, and a note."""
    for name in names:
        for place in table_places(name):
            data = folder.read(place, max_bytes=_MAX_TABLE_BYTES)
            if data is not None:
                return place, data
    if notes is not None:
        notes.add("missing-table", table_places(names[-1])[0], lack)
    return None


def _parse_csv(name: str, data: bytes) -> list[dict[str, str]]:
    try:
        text = text_from_bytes(data)
        rows = list(csv.DictReader(io.StringIO(text)))
    except UnicodeDecodeError as error:
        raise BadHouse(name, f"byte {error.start}", "no valid table: not UTF-8") from None
    except csv.Error:
        raise BadHouse(name, "", "no valid table: a damaged row") from None
    return [{k: v for k, v in row.items() if isinstance(v, str)} for row in rows]


def _read_class_table(folder: RootFolder, notes: Notes) -> dict[str, ModelClass]:
    table = _find_table(folder, *CLASS_TABLES, notes=notes, lack="every object is otherprop")
    rows = _parse_csv(*table) if table else []
    return {row["model_id"]: _class(row) for row in rows if row.get("model_id")}


def _class(row: dict[str, str]) -> ModelClass:
    nyu = row.get("nyuv2_40class", "").strip()
    coarse = row.get("coarse_grained_class", "").strip()
    kind = _KIND_OF_CLASS.get(nyu, ItemKind.OBJECT)
    if coarse == "plant" or (row.get("active", "1").strip() == "0" and kind is ItemKind.OBJECT):
        kind = ItemKind.PLANT
    elif coarse == "person":
        kind = ItemKind.PERSON
    elif coarse == "stairs":
        kind = ItemKind.STAIRS
    return ModelClass(
        name=row.get("fine_grained_class", "").strip() or coarse,
        nyu40=_NYU40_IDS.get(nyu, OTHERPROP),
        kind=kind,
        structure=row.get("empty_struct_obj", "2").strip() == "1",
    )


def _variants(folder: RootFolder) -> dict[str, tuple[str, ...]]:
    table = _find_table(folder, VARIANT_TABLE)
    parsed = _parse_csv(*table) if table else []
    rows = [(row.get("id", ""), row.get("variantIds", "")) for row in parsed]
    return {model: tuple(v.strip() for v in ids.split(",")) for model, ids in rows if ids}


def _lamps(folder: RootFolder, notes: Notes) -> dict[str, LampMaterials]:
    text = "no lamp's bulb material is known; repair adds bulbs"
    table = _find_table(folder, LAMP_TABLE, notes=notes, lack=text)
    if table is None:
        return {}
    name, data = table
    lamps = {}
    for number, line in enumerate(text_from_bytes(data, "replace").splitlines(), 1):
        words = line.split()
        if not words:
            continue
        try:
            lamps[words[0]] = _lamp_materials(words[1:])
        except (ValueError, IndexError):
            # All houses share the table: one row that nobody understands costs one lamp its bulbs.
            text = "expected counts, each with as many materials (1 material_3 1 material_2): repair adds its bulb"
            notes.add("unreadable-row", f"{name}: line {number}", f"{words[0]}: {text}")
    return lamps


def _lamp_materials(words: list[str]) -> LampMaterials:
    """The materials of a row `n material_i ... k material_j ...`: n bulbs, then k shades."""
    n_bulbs = int(words[0])
    bulbs, rest = words[1 : 1 + n_bulbs], words[1 + n_bulbs :]
    n_shades = int(rest[0])
    shades = rest[1 : 1 + n_shades]
    if len(bulbs) != n_bulbs or len(shades) != n_shades:
        raise ValueError("fewer materials than the row counts")
    return LampMaterials(*(tuple(map(_material_position, named)) for named in (bulbs, shades)))


def _material_position(word: str) -> int:
    """The position in the MTL of `material_3`, as the released table writes it, or of a bare 3."""
    position = int(word.rpartition("_")[2])
    if position < 0:
        raise ValueError("a position before the first")
    return position


def _read_light_table(folder: RootFolder, notes: Notes) -> dict[str, tuple[LightPart, ...]]:
    text = "no lamp's light is known; bulbs get an assumed power"
    table_file = _find_table(folder, LIGHT_TABLE, notes=notes, lack=text)
    if table_file is None:
        return {}
    # Rows are model id -> its lamps; values that are not lists are ignored.
    name, data = table_file
    table = checked(dict, json_from_bytes(data, name), name, error=BadHouse)
    return {
        model: tuple(
            _light_part(checked(_Light, light, name, f"{model}[{k}]", error=BadHouse))
            for k, light in enumerate(lights)
        )
        for model, lights in table.items()
        if isinstance(lights, list)
    }


_FORMS: Final = {
    "PointLight": LightForm.POINT,
    "SpotLight": LightForm.SPOT,
    "LineLight": LightForm.LINE,
}


def _parse_light_colour(value: object) -> tuple[float, ...]:
    try:
        rgb = np.array([int(str(value)[k : k + 2], 16) for k in (1, 3, 5)]) / 255
    except ValueError:
        raise ValueError("expected #rrggbb") from None
    linear = linear_from_srgb(rgb)
    return tuple(float(c) for c in linear / max(linear.max(), 1e-6))


_Coordinate = Annotated[Finite, Field(gt=-1e6, lt=1e6)]
_Triple = Annotated[tuple[_Coordinate, _Coordinate, _Coordinate], exactly(3)]
_Amount = Annotated[Finite, Field(ge=0, lt=1e6)]


class _Light(BaseModel):
    type: Literal["PointLight", "SpotLight", "LineLight"]
    position: _Triple
    power: _Amount
    color: Annotated[tuple[float, float, float], BeforeValidator(_parse_light_colour)] = (
        1.0,
        1.0,
        1.0,
    )
    direction: _Triple | None = None
    cutoff: _Amount = Field(math.pi, alias="cutoffAngle")
    dropoff: _Amount = Field(0.0, alias="dropoffRate")
    end: _Triple | None = Field(None, alias="position2")


def _light_part(light: _Light) -> LightPart:
    # Only lines have another end, only spots and lines a direction.
    form = _FORMS[light.type]
    direction = None if form is LightForm.POINT else light.direction
    return LightPart(
        position=light.position,
        radius_m=0.0,
        power=light.power,
        unit=PowerUnit.WATT,
        rgb_linear=light.color,
        form=form,
        direction=direction or (0.0, -1.0, 0.0),
        cutoff_rad=light.cutoff,
        dropoff=light.dropoff,
        position_end=light.end if form is LightForm.LINE else None,
    )
