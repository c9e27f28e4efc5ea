"""Which files below a SUNCG root a house is made of. Effect: reads its JSON and MTL files."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Final

from pbrs_farm.core.errors import BadHouse
from pbrs_farm.formats.serialise import json_from_bytes
from pbrs_farm.read.common.companion_files import SourceFiles
from pbrs_farm.read.common.root_folder import RootFolder
from pbrs_farm.read.suncg.house_json import NAME
from pbrs_farm.read.suncg.metadata import (
    CLASS_TABLES,
    LAMP_TABLE,
    LIGHT_TABLE,
    VARIANT_TABLE,
    table_places,
)

MAX_HOUSE_BYTES: Final = 64_000_000


def arch_file(house_id: str) -> str:
    """Name of v2's structure of a house."""
    return f"wall/{house_id}/{house_id}.arch.json"


def suncg_companions(folder: RootFolder, house_id: str, files: SourceFiles) -> Iterator[str]:
    """Names of all files beside house.json that reading the house may open; some may not exist."""
    for table in (*CLASS_TABLES, VARIANT_TABLE, LAMP_TABLE, LIGHT_TABLE):
        yield from table_places(table)
    yield arch_file(house_id)
    # Collect what the house's own JSON files name.
    documents = (f"house/{house_id}/house.json", arch_file(house_id))
    named = [pair for name in documents for pair in _named(_document(folder, name))]
    models = {value for key, value in named if key == "modelId"}
    folders = [f"room/{house_id}", *(f"object/{model}" for model in sorted(models))]
    # A model's folder holds its meshes in every state; a material library names its pictures.
    for place in folders:
        for name in folder.names(place, (".obj", ".mtl")):
            yield name
            if name.endswith(".mtl"):
                yield from files.pictures(folder, name)
    for texture in {value for key, value in named if key == "texture"}:
        yield from (f"texture/{texture}{suffix}" for suffix in (".png", ".jpg"))


def _document(folder: RootFolder, name: str) -> Any:
    try:
        return json_from_bytes(folder.read(name, max_bytes=MAX_HOUSE_BYTES) or b"{}", name)
    except BadHouse:
        return {}  # the reader will say what is wrong with it


def _named(document: Any) -> Iterator[tuple[str, str]]:
    """(key, value) of every model and texture named anywhere in a JSON document."""
    waiting = [document]
    while waiting:
        value = waiting.pop()
        if isinstance(value, list):
            waiting += value
        elif isinstance(value, dict):
            waiting += value.values()
            for key in ("modelId", "texture"):
                name = value.get(key)
                if isinstance(name, str) and NAME.fullmatch(name):
                    yield key, name
