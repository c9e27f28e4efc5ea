"""Where houses come from: a word of the command line -> SourceRef -> House.

Effects: reads files, and the example homes' package from the cache (or through apt).
"""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Literal

from pydantic import BaseModel, ConfigDict

from pbrs_farm import keys
from pbrs_farm.errors import BadHouse
from pbrs_farm.house import House
from pbrs_farm.recipe import ReadFields

Kind = Literal["builtin", "example", "sweethome3d", "suncg", "gltf"]


class SourceRef(BaseModel):
    """A house before it is read. location: a path, an example home's name, or "builtin".

    sha256: of the source's bytes, "" where the source is a folder (SUNCG: of its house.json).
    """

    model_config = ConfigDict(frozen=True, extra="forbid")
    kind: Kind
    location: str
    house_id: str
    sha256: str


def resolve(word: str) -> SourceRef:
    """The source a word names: "builtin", an example home's name, or a path. Raises BadHouse."""
    path = Path(word)
    if word == "builtin":
        from pbrs_farm.read.builtin import builtin_home

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
    path = Path(source.location)
    if source.kind == "builtin":
        from pbrs_farm.read.builtin import builtin_home

        return builtin_home()
    if source.kind == "example":
        return _read_example(source.location, fields)
    if source.kind == "suncg":
        from pbrs_farm.read.suncg import read_suncg

        return read_suncg(path.parent.parent, path.name, fields)
    data = _bytes(path)
    if hashlib.sha256(data).hexdigest() != source.sha256:
        raise BadHouse(path, "", "changed since the run began", hint="run again")
    if source.kind == "gltf":
        from pbrs_farm.read.gltf import read_gltf_file

        return read_gltf_file(path, fields)
    from pbrs_farm import homes
    from pbrs_farm.read.sweethome3d import read_home

    package = homes.cached()
    resources = package.resources() if package else None
    return read_home(data, path.name, resources=resources, fields=fields)


def _read_example(name: str, fields: ReadFields) -> House:
    from pbrs_farm import homes
    from pbrs_farm.read.sweethome3d import read_home

    package = homes.fetch()
    data, file = package.home(name)
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
    from pbrs_farm import homes

    data, file = homes.fetch().home(name)
    sha = keys.sha256(data)
    house_id = keys.house_id(Path(file).stem, sha)
    return SourceRef(kind="example", location=name, house_id=house_id, sha256=sha)


def _suncg(path: Path) -> SourceRef:
    folder = path.parent if path.name == "house.json" else path
    sha = _sha256(folder / "house.json")
    return SourceRef(kind="suncg", location=str(folder.resolve()), house_id=folder.name, sha256=sha)


def _sha256(path: Path) -> str:
    return hashlib.sha256(_bytes(path)).hexdigest()


def _bytes(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except FileNotFoundError:
        raise BadHouse(path, "", "no such file") from None
    except OSError as error:
        raise BadHouse(path, "", f"cannot be read: {error.strerror}") from None
