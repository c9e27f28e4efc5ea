"""Irregular and huge files in place of every input file. Effects: writes them."""

from __future__ import annotations

import os
import socket
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Final

from tests.hostile.case import Case, Place, Words, run
from tests.hostile.sound_inputs import MODELS, glb, suncg
from tests.read.suncg.suncg_root import HOUSE

Maker = Callable[[Path], None]


def _link(target: str, path: Path) -> None:
    path.symlink_to(target)


def _sparse(path: Path) -> None:
    with path.open("wb") as file:
        file.truncate(20 * 10**9)


def _socket(path: Path) -> None:
    with socket.socket(socket.AF_UNIX) as s:
        s.bind(str(path))


FORMS: Final[dict[str, Maker]] = {
    "zero": partial(_link, "/dev/zero"),
    "fifo": os.mkfifo,
    "directory": Path.mkdir,
    "sparse_20_gb": _sparse,
    "loop": lambda path: path.symlink_to(path.name),
    "dangling": partial(_link, "nobody"),
    "socket": _socket,
    "full": partial(_link, "/dev/full"),
    "empty": Path.touch,
}
"""Things other than a sound file at a file's path."""

_SUNCG_FILES: Final = {
    "room": f"room/{HOUSE}/fr_0rm_0w.obj",
    "room_mtl": f"room/{HOUSE}/fr_0rm_0f.mtl",
    "object": "object/chair/chair.obj",
    "object_mtl": "object/chair/chair.mtl",
    "texture": "texture/wood.jpg",
    "classes": "metadata/ModelCategoryMappingNewActive.csv",
    "lights": "metadata/suncgModelLights.json",
}
"""Files of a SUNCG root. The first is the one that a house requires."""


def cases() -> Iterator[Case]:
    """Each form in place of each file."""
    for form, make in FORMS.items():
        suffixes = (".sh3d", ".glb") if form in ("zero", "fifo", "sparse_20_gb") else (".sh3d",)
        for suffix in suffixes:
            yield Case(f"file/{form}{suffix}", "bounds", partial(_home, make, f"bad{suffix}"))
    for form in ("zero", "fifo", "directory"):
        yield Case(f"file/{form}_house.json", "bounds", partial(_house_json, FORMS[form]))
        yield Case(f"file/{form}_rooms.json", "bounds", partial(_beside, FORMS[form]))
    for part, name in _SUNCG_FILES.items():
        for form in ("zero", "fifo") if part in ("room", "texture") else ("zero",):
            write = partial(_suncg, FORMS[form], name)
            yield Case(f"file/{form}_suncg_{part}", "bounds", write)
    for part in ("object", "texture"):
        write = partial(_suncg, FORMS["directory"], _SUNCG_FILES[part])
        yield Case(f"file/directory_suncg_{part}", "silence", write, is_lossy=True)
    yield Case("file/zero_gltf_bin", "bounds", partial(_gltf, FORMS["zero"]))
    yield Case("file/fifo_gltf_bin", "bounds", partial(_gltf, FORMS["fifo"]))
    for form in ("zero", "fifo", "directory"):
        yield Case(f"file/{form}_object", "bounds", partial(_objects, FORMS[form]))
    for form in ("zero", "fifo", "directory", "sparse_20_gb"):
        write = partial(_cameras, FORMS[form])
        yield Case(f"file/{form}_camera_file", "bounds", write, neighbours=0)
    for form in ("zero", "fifo", "loop"):
        yield Case(f"file/{form}_houses_list", "bounds", partial(_list, FORMS[form]), neighbours=0)


def _home(make: Maker, file: str, place: Place) -> list[Words]:
    path = place.folder / file
    make(path)
    return [run(place, path)]


def _house_json(make: Maker, place: Place) -> list[Words]:
    house = suncg(place.folder)
    (house / "house.json").unlink()
    make(house / "house.json")
    return [run(place, house)]


def _suncg(make: Maker, file: str, place: Place) -> list[Words]:
    house = suncg(place.folder)
    path = house.parent.parent / file
    path.unlink()
    make(path)
    return [run(place, house)]


def _beside(make: Maker, place: Place) -> list[Words]:
    path = place.folder / "bad.glb"
    path.write_bytes(glb())
    make(place.folder / "bad.rooms.json")
    return [run(place, path)]


def _gltf(make: Maker, place: Place) -> list[Words]:
    path = place.folder / "bad.gltf"
    path.write_text(
        '{"asset": {"version": "2.0"}, "buffers": [{"uri": "a.bin", "byteLength": 36}],'
        '"bufferViews": [{"buffer": 0, "byteLength": 36}], "scene": 0, "scenes": [{"nodes": [0]}],'
        '"accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}],'
        '"meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],'
        '"nodes": [{"name": "floor", "mesh": 0}]}'
    )
    make(place.folder / "a.bin")
    return [run(place, path)]


def _objects(make: Maker, place: Place) -> list[Words]:
    models = place.folder / "chair"
    models.mkdir()
    (models / "sound.obj").write_bytes(MODELS["1"])
    make(models / "bad.obj")
    words = run(place, models)
    return [("objects", *(w for w in words[1:] if w != str(place.sound)))]


def _cameras(make: Maker, place: Place) -> list[Words]:
    path = place.folder / "cameras.json"
    make(path)
    return [(*run(place, place.sound), "--camera-file", str(path))]


def _list(make: Maker, place: Place) -> list[Words]:
    root = suncg(place.folder).parent.parent
    path = place.folder / "list.txt"
    make(path)
    out = str(place.out)
    return [("run", str(root), "--houses", str(path), "--out", out, *run(place, root)[5:])]
