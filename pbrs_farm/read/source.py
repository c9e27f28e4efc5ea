"""Where houses come from: a word of the command line -> SourceRef -> House.

Effects: reads files, and the example homes' package from the cache (or through apt).
"""

from __future__ import annotations

import hashlib
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from pydantic import BaseModel, ConfigDict, TypeAdapter, ValidationError

from pbrs_farm.core import keys
from pbrs_farm.core.errors import BadHouse, MachineFailed
from pbrs_farm.core.house import House
from pbrs_farm.core.recipe import ReadFields

if TYPE_CHECKING:
    from pbrs_farm.read.objects.model_folders import ObjectModel

Kind = Literal["builtin", "example", "sweethome3d", "suncg", "gltf", "object"]


class SourceRef(BaseModel):
    """A house before it is read. location: a path, an example home's name, or "builtin"; of an
    object without context the JSON of its ObjectModel.

    sha256: of the source's bytes, "" where the source is a folder (SUNCG: of its house.json).
    """

    model_config = ConfigDict(frozen=True, extra="forbid")
    kind: Kind
    location: str
    house_id: str
    sha256: str


def resolve(word: str) -> SourceRef:
    """The source a word names: "builtin", an example home's name, or a path. Raises BadHouse."""
    if word.startswith("{"):
        return object_source(_object_model(word))
    path = Path(word)
    if word == "builtin":
        from pbrs_farm.read.builtin.builtin_home import builtin_home

        home = builtin_home()
        return SourceRef(kind="builtin", location=word, house_id=home.id, sha256=home.source.sha256)
    if not path.exists() and not path.suffix and "/" not in word:
        return _example(word)
    if path.is_dir() or path.name == "house.json":
        return _suncg(path)
    sha = _sha256(path)
    kind: Kind = "gltf" if path.suffix.lower() in (".glb", ".gltf") else "sweethome3d"
    house_id = keys.house_id(path.stem, sha)
    return SourceRef(kind=kind, location=str(path.resolve()), house_id=house_id, sha256=sha)


def suncg_list(root: Path, list_file: Path) -> list[str]:
    """The words `ROOT/house/<id>` for every id in a list file, blank and # lines left out."""
    try:
        lines = list_file.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise BadHouse(list_file, "", f"cannot be read: {error}") from None
    ids = [line.strip() for line in lines]
    return [str(root / "house" / i) for i in ids if i and not i.startswith("#")]


def read_house(source: SourceRef, fields: ReadFields) -> House:
    """The house as its source gives it, unrepaired. Raises BadHouse with the place."""
    if source.kind == "object":
        return _read_object(source, fields)
    path = Path(source.location)
    if source.kind == "builtin":
        from pbrs_farm.read.builtin.builtin_home import builtin_home

        return builtin_home()
    if source.kind == "example":
        return _read_example(source, fields)
    if source.kind == "suncg":
        from pbrs_farm.read.suncg.suncg_house import read_suncg

        _check_unchanged(path / "house.json", _bytes(path / "house.json"), source)
        return read_suncg(path.parent.parent, path.name, fields)
    data = _bytes(path)
    _check_unchanged(path, data, source)
    if source.kind == "gltf":
        from pbrs_farm.read.gltf.scene import read_gltf_file

        return read_gltf_file(path, fields)
    from pbrs_farm.assets import homes
    from pbrs_farm.read.sweethome3d import read_home

    package = homes.cached()
    resources = package.resources() if package else None
    return read_home(data, path.name, resources=resources, fields=fields)


def object_source(model: ObjectModel) -> SourceRef:
    """The source of an object without context."""
    location = TypeAdapter(type(model)).dump_json(model).decode()
    house_id = keys.OBJECT_PREFIX + model.id
    return SourceRef(
        kind="object", location=location, house_id=house_id, sha256=_sha256(model.path)
    )


def _object_model(location: str) -> ObjectModel:
    from pbrs_farm.read.objects.model_folders import ObjectModel

    try:
        return TypeAdapter(ObjectModel).validate_json(location)
    except ValidationError:
        raise BadHouse(location[:80], "", "not a model's description") from None


def _read_object(source: SourceRef, fields: ReadFields) -> House:
    from pbrs_farm.read.objects.single_object import read_object

    house = read_object(_object_model(source.location), fields)
    return replace(house, id=source.house_id, is_repaired=True)


def _check_unchanged(path: Path, data: bytes, source: SourceRef) -> None:
    if keys.sha256(data) != source.sha256:
        raise BadHouse(path, "", "changed since the run began", hint="run, or submit, again")


def _read_example(source: SourceRef, fields: ReadFields) -> House:
    from pbrs_farm.assets import homes
    from pbrs_farm.read.sweethome3d import read_home

    package = homes.fetch()
    data, file = package.home(source.location)
    if keys.sha256(data) != source.sha256:
        raise MachineFailed(
            f"{package.label} holds another {source.location} than was asked for",
            hint="another version of the package; `pbrs-farm homes --fetch`",
        )
    resources = package.resources()
    return read_home(
        data,
        file,
        resources=resources,
        fields=fields,
        package=package.label,
        package_note=package.note,
    )


def _example(name: str) -> SourceRef:
    from pbrs_farm.assets import homes

    data, file = homes.fetch().home(name)
    sha = keys.sha256(data)
    house_id = keys.house_id(Path(file).stem, sha)
    return SourceRef(kind="example", location=name, house_id=house_id, sha256=sha)


def _suncg(path: Path) -> SourceRef:
    folder = path.parent if path.name == "house.json" else path
    if not (folder / "house.json").exists():
        raise BadHouse(
            folder, "", "holds no house.json and no home file", hint=_folder_hint(folder)
        )
    sha = _sha256(folder / "house.json")
    return SourceRef(kind="suncg", location=str(folder.resolve()), house_id=folder.name, sha256=sha)


def _folder_hint(folder: Path) -> str:
    if (folder / "house").is_dir():
        return "SUNCG's root: name ROOT/house/ID, or ROOT and --houses LIST"
    return "a SUNCG house folder, or .sh3d, .glb files"


def _sha256(path: Path) -> str:
    return hashlib.sha256(_bytes(path)).hexdigest()


def _bytes(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except FileNotFoundError:
        raise BadHouse(path, "", "no such file") from None
    except OSError as error:
        raise BadHouse(path, "", f"cannot be read: {error.strerror}") from None
