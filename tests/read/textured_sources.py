"""One textured source of each format, written as files for the tests common to all readers."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Final

from pbrs_farm.prepare.home_kinds import object_source
from pbrs_farm.prepare.source import resolve
from pbrs_farm.prepare.source_ref import SourceRef
from pbrs_farm.read.objects.model_folders import find_models
from tests.inputs import front3d_files, scenestate_files
from tests.inputs.usd_files import UsdHome, walls_of
from tests.read.gltf.gltf_scenes import Scene, two_rooms
from tests.read.habitat.habitat_sets import dataset
from tests.read.suncg import suncg_root
from tests.read.sweethome3d.sh3d_source import BOX_OBJ, home_xml, piece, sh3d

QUAD_OBJ: Final = """mtllib thing.mtl
v 0 0 0
v 1 0 0
v 1 1 0
v 0 1 0
vt 0 0
vt 1 0
vt 1 1
vt 0 1
usemtl paint
f 1/1 2/2 3/3 4/4
"""
MTL: Final = "newmtl paint\nKd 1 1 1\nmap_Kd picture.any\n"


def sweethome3d(folder: Path, picture: bytes | None) -> SourceRef:
    """A home with one chair that has the picture."""
    texture = "<texture name='T' width='50' height='50' image='t'/>"
    contents = {"1": BOX_OBJ} | ({} if picture is None else {"t": picture})
    path = folder / "home.sh3d"
    path.write_bytes(sh3d(home_xml(piece("name='Chair'", texture)), contents))
    return resolve(str(path))


def suncg(folder: Path, picture: bytes | None) -> SourceRef:
    """A SUNCG root of one room with one chair that has the picture."""
    house_id = suncg_root.write_root(folder)
    nodes = [
        suncg_root.room("0_0", "fr_0rm_0", [1], ["Bedroom"]),
        suncg_root.object_node("0_1", "chair", suncg_root.placement(1, 0.05, 1)),
    ]
    house = suncg_root.house_json() | {"levels": [{"id": "0", "nodes": nodes}]}
    suncg_root.write(folder / f"house/{house_id}/house.json", json.dumps(house))
    place = folder / "texture/wood.jpg"
    place.unlink() if picture is None else place.write_bytes(picture)
    return resolve(str(folder / "house" / house_id))


def gltf(folder: Path, picture: bytes | None) -> SourceRef:
    """A .glb of two rooms with a sofa whose picture is beside the file."""
    return _with_picture(folder, "scene.glb", _textured_rooms().glb(), picture)


def habitat(folder: Path, picture: bytes | None) -> SourceRef:
    """A data set whose stage has a sofa with a picture beside the stage."""
    path = dataset(folder, _textured_rooms())
    if picture is not None:
        (folder / "stages/picture.any").write_bytes(picture)
    return resolve(str(path))


def usd(folder: Path, picture: bytes | None) -> SourceRef:
    """A stage of a room with a sofa whose picture is beside the file."""
    home = UsdHome(folder / "scene.usda")
    walls_of(home, "/World", 0, 4, 0, 3)
    paint = home.material("paint", picture="./picture.any", is_cut=True)
    home.box("/World/Sofa", [1, 0, 1], [2, 1, 2], material=paint)
    return _with_picture(folder, "scene.usda", home.save().read_bytes(), picture)


def scenestate(folder: Path, picture: bytes | None) -> SourceRef:
    """Two rooms whose floors have the picture, embedded in the file."""
    path = folder / "home.scenestate.json"
    path.write_text(json.dumps(scenestate_files.rent3d_like(picture)))
    return resolve(str(path))


def front3d(folder: Path, picture: bytes | None) -> SourceRef:
    """A flat whose floors have the picture, from the folder of textures."""
    path = front3d_files.write_house(folder, picture=picture)
    house = front3d_files.front_house(picture_jid="jid-oak")
    house["scene"]["room"][0]["children"] = [
        c for c in house["scene"]["room"][0]["children"] if c["ref"] != "99999/model"
    ]
    path.write_text(json.dumps(house))
    return resolve(str(path))


def _textured_rooms() -> Scene:
    scene = two_rooms()
    colour = {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}, "alphaMode": "MASK"}
    scene.materials.append(colour)
    scene.more |= {"textures": [{"source": 0}], "images": [{"uri": "picture.any"}]}
    scene.node("Sofa", mesh=scene.box([1, 0, 1], [2, 1, 2], 0))
    return scene


def single_object(folder: Path, picture: bytes | None) -> SourceRef:
    """A lone OBJ model and its MTL, which names the picture."""
    (folder / "thing.mtl").write_text(MTL)
    return _with_picture(folder, "thing.obj", QUAD_OBJ.encode(), picture)


def _with_picture(folder: Path, name: str, data: bytes, picture: bytes | None) -> SourceRef:
    (folder / name).write_bytes(data)
    if picture is not None:
        (folder / "picture.any").write_bytes(picture)
    if name.endswith(".obj"):
        return object_source(find_models([folder])[0])
    return resolve(str(folder / name))


# IFC is excluded: its files have no pictures in practice, and its reader ignores them.
FORMATS: Final[dict[str, Callable[[Path, bytes | None], SourceRef]]] = {
    "sweethome3d": sweethome3d,
    "suncg": suncg,
    "gltf": gltf,
    "habitat": habitat,
    "usd": usd,
    "scenestate": scenestate,
    "front3d": front3d,
    "object": single_object,
}
"""Format -> writes a source with that picture (None: the file is missing) and returns it."""
