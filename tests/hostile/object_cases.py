"""Single models and libraries for `objects`, and for `run` by mistake. Effects: they write files."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import Final

from tests.hostile.case import ONE_VIEW, Case, Place, Words, run
from tests.hostile.sound_inputs import glb, parts_of_glb, png, zip_of
from tests.read.gltf.gltf_scenes import Scene
from tests.read.sweethome3d.sh3d_source import BOX_OBJ

_CATALOGUE: Final = (
    "id#1=a\nname#1=Chair\nmodel#1=/sound.obj\nwidth#1=50\nheight#1=90\ndepth#1=50\ncategory#1=c\n"
)


def cases() -> Iterator[Case]:
    """Models beside a sound one, libraries, then the wrong verb."""
    for name, files in _models().items():
        yield Case(f"objects/{name}", "format", partial(_beside, files))
    for name, data in _libraries().items():
        yield Case(f"objects/library_{name}", "format", partial(_library, data))
    yield Case("objects/folder_empty", "format", partial(_folder, 0), neighbours=0)
    yield Case("objects/folder_missing", "format", partial(_folder, -1), neighbours=0)
    yield Case("objects/folders_nested_300", "bounds", partial(_folder, 300), neighbours=0)
    yield Case("objects/link_to_parent", "bounds", _link_to_parent)
    yield Case("objects/run_obj", "hint", partial(_run, "chair.obj", BOX_OBJ))
    yield Case("objects/run_glb", "hint", partial(_run, "chair.glb", _chair()))
    yield Case("objects/run_library", "hint", partial(_run, "a.sh3f", zip_of({"a": b""})))
    yield Case("objects/run_text", "hint", partial(_run, "notes.txt", b"no home at all"))
    yield Case("objects/run_picture", "hint", partial(_run, "picture.png", png(9, 9)))


def _chair() -> bytes:
    s = Scene()
    s.node("chair", mesh=s.box([0, 0, 0], [0.5, 0.9, 0.5]))
    return s.glb()


def _models() -> dict[str, dict[str, bytes]]:
    document, _ = parts_of_glb(_chair())
    assert document["nodes"]
    return {
        "obj_empty": {"bad.obj": b""},
        "obj_noise": {"bad.obj": bytes(range(256)) * 40},
        "obj_nan": {"bad.obj": BOX_OBJ + b"v nan 0 0\nf 1 2 9\n"},
        "obj_flat": {"bad.obj": b"v 0 0 0\nv 1 0 0\nv 1 0 1\nf 1 2 3\n"},
        "obj_point": {"bad.obj": b"v 0 0 0\nv 0 0 0\nv 0 0 0\nf 1 2 3\n"},
        "obj_huge": {"bad.obj": BOX_OBJ.replace(b"v 1 1 1", b"v 1e30 1 1")},
        "obj_tiny": {"bad.obj": BOX_OBJ.replace(b" 1", b" 1e-9").replace(b"f 1e-9", b"f 1")},
        "obj_mtl_path": {"bad.obj": b"mtllib ../../../etc/passwd\n" + BOX_OBJ},
        "glb_empty": {"bad.glb": b""},
        "glb_cut": {"bad.glb": _chair()[:400]},
        "glb_room": {"bad.glb": glb()},
        "glb_no_mesh": {"bad.glb": glb(lambda d: d.update(nodes=[], meshes=[]))},
        "texture_bomb": {
            "bad.obj": b"mtllib bad.mtl\nvt 0 0\nvt 1 0\nvt 1 1\n"
            + BOX_OBJ
            + b"usemtl a\nf 1/1 2/2 3/3\n",
            "bad.mtl": b"newmtl a\nmap_Kd bad.png\n",
            "bad.png": png(60_000, 60_000, b""),
        },
        "name_not_ascii": {"стул 椅子.obj": BOX_OBJ},
        "name_newline": {"chair\nfoo.obj": BOX_OBJ},
    }


def _libraries() -> dict[str, bytes]:
    name = "PluginFurnitureCatalog.properties"
    return {
        "empty": b"",
        "no_catalogue": zip_of({"sound.obj": BOX_OBJ}),
        "catalogue_empty": zip_of({name: b"", "sound.obj": BOX_OBJ}),
        "catalogue_noise": zip_of({name: bytes(range(256)) * 90, "sound.obj": BOX_OBJ}),
        "catalogue_bomb": zip_of({name: b"#" * 200_000_000, "sound.obj": BOX_OBJ}),
        "sizes_nan": zip_of({name: _CATALOGUE.replace("50", "NaN").encode(), "sound.obj": BOX_OBJ}),
        "sizes_huge": zip_of({name: _CATALOGUE.replace("50", "1e300").encode(), "sound.obj": BOX_OBJ}),
        "escapes": zip_of({name: (_CATALOGUE + "name#2=\\u12\\xzz\\N{}\n").encode(), "sound.obj": BOX_OBJ}),
        "model_empty": zip_of({name: _CATALOGUE.encode(), "sound.obj": b""}),
        "number_huge": zip_of(
            {name: (_CATALOGUE + f"name#{'9' * 5000}=x\n").encode(), "sound.obj": BOX_OBJ}
        ),
    }  # fmt: skip


def _words(place: Place, *models: str) -> Words:
    return ("objects", *models, "--out", str(place.out), *ONE_VIEW)


def _beside(files: dict[str, bytes], place: Place) -> list[Words]:
    folder = place.folder / "chair"
    folder.mkdir()
    for name, data in ({"sound.obj": BOX_OBJ} | files).items():
        (folder / name).write_bytes(data)
    return [_words(place, str(folder))]


def _library(data: bytes, place: Place) -> list[Words]:
    folder = place.folder / "chair"
    folder.mkdir()
    (folder / "sound.obj").write_bytes(BOX_OBJ)
    path = place.folder / "bad.sh3f"
    path.write_bytes(data)
    return [_words(place, str(path), str(folder))]


def _folder(depth: int, place: Place) -> list[Words]:
    folder = place.folder / "models"
    if depth >= 0:
        folder.mkdir()
    (folder / "/".join(["d"] * depth)).mkdir(parents=True, exist_ok=True) if depth > 0 else None
    return [_words(place, str(folder))]


def _link_to_parent(place: Place) -> list[Words]:
    folder = place.folder / "chair"
    folder.mkdir()
    (folder / "sound.obj").write_bytes(BOX_OBJ)
    (folder / "up").symlink_to("..")
    return [_words(place, str(folder))]


def _run(file: str, data: bytes, place: Place) -> list[Words]:
    path = place.folder / file
    path.write_bytes(data)
    return [run(place, path)]
