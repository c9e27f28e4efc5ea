"""SUNCG roots damaged file by file. Effects: they write the roots."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any, Final

from tests.hostile.case import Case, Place, Words, run
from tests.hostile.model_cases import pictures
from tests.hostile.sound_inputs import suncg
from tests.read.suncg.suncg_root import HOUSE, object_node, placement

Spoil = Callable[[dict[str, Any]], Any]

_WALLS: Final = f"room/{HOUSE}/fr_0rm_0w.obj"
_FLOOR: Final = f"room/{HOUSE}/fr_0rm_0f.obj"
_CLASSES: Final = "metadata/ModelCategoryMappingNewActive.csv"
_LIGHTS: Final = "metadata/suncgModelLights.json"
_GEOMETRY: Final = "metadata/light_geometry_compact.txt"


def cases() -> Iterator[Case]:
    """house.json, then each kind of file, then the folders."""
    for name, text in _json_texts().items():
        yield _file(f"house_{name}", "format", f"house/{HOUSE}/house.json", lambda _d, t=text: t)
    for name, spoil in _houses().items():
        lossy = name in ("unknown_type", "far_900_m", "model_unknown", "model_path")
        fault = "silence" if lossy else "format"
        yield Case(f"suncg/{name}", fault, partial(_house, spoil), is_lossy=lossy)
    for name, file, edit, lossy in _files():
        yield _file(name, "silence" if lossy else "format", file, edit, lossy=lossy)
    for name, picture in pictures().items():
        if name in ("empty", "cut", "claims_60000", "bomb_20000"):
            edit = partial(lambda _d, p: p, p=picture)
            yield _file(f"texture_{name}", "silence", "texture/wood.jpg", edit, lossy=True)
    yield Case("suncg/only_house_p", "hint", _only_house_p)
    yield Case("suncg/outside_house", "hint", _outside_house)
    yield Case("suncg/root_itself", "hint", lambda p: [run(p, suncg(p.folder).parent.parent)])
    yield Case("suncg/no_rooms_folder", "format", partial(_without, "room"))
    yield Case("suncg/no_objects_folder", "silence", partial(_without, "object"), is_lossy=True)
    yield Case("suncg/no_textures_folder", "silence", partial(_without, "texture"), is_lossy=True)
    yield Case("suncg/no_metadata_folder", "format", partial(_without, "metadata"))
    for name, listed in _lists().items():
        yield Case(f"suncg/list_{name}", "format", partial(_list, listed), neighbours=0)


def _nodes(plain: dict[str, Any]) -> list[dict[str, Any]]:
    nodes: list[dict[str, Any]] = plain["levels"][0]["nodes"]
    return nodes


def _node(k: int, **more: Any) -> Spoil:
    return lambda plain: _nodes(plain)[k].update(more)


def _top(**more: Any) -> Spoil:
    return lambda plain: plain.update(more)


def _add(*nodes: dict[str, Any]) -> Spoil:
    return lambda plain: _nodes(plain).extend(nodes)


def _json_texts() -> dict[str, bytes]:
    return {
        "empty": b"",
        "cut": b'{"levels": [{"id": "0", "nodes": [{"id": "0_0", "ty',
        "list": b"[]",
        "number": b"7",
        "null": b"null",
        "deep": b"[" * 200_000,
        "deep_levels": b'{"levels": ' + b'[{"a":' * 50_000,
        "not_utf8": b'{"id": "caf\xe9", "levels": []}',
        "utf16": '{"id": "a", "levels": []}'.encode("utf-16"),
        "nan": b'{"levels": [], "scaleToMeters": NaN}',
        "integer_5000_digits": b'{"levels": [], "scaleToMeters": ' + b"9" * 5000 + b"}",
        "no_levels": b'{"id": "a"}',
        "levels_empty": b'{"id": "a", "levels": [], "up": [0,1,0], "front": [0,0,1], "scaleToMeters": 1}',
    }


def _houses() -> dict[str, Spoil]:
    far = object_node("0_90", "chair", placement(900, 0.05, 1))
    many = [object_node(f"0_{k}", "chair", placement(2, 0.05, 1)) for k in range(100, 3000)]
    box = {"id": "0_91", "type": "Box", "valid": 1, "transform": placement(1, 0, 1)}
    return {
        "scale_0": _top(scaleToMeters=0),
        "scale_minus": _top(scaleToMeters=-1),
        "scale_1e9": _top(scaleToMeters=1e9),
        "scale_word": _top(scaleToMeters="one"),
        "up_wrong": _top(up=[0, 0, 0]),
        "up_nan": _top(up=[float("nan"), 1, 0]),
        "levels_null": _top(levels=None),
        "nodes_null": lambda plain: plain["levels"][0].update(nodes=None),
        "node_is_text": lambda plain: _nodes(plain).insert(3, "node"),  # type: ignore[arg-type]
        "level_twice": lambda plain: plain["levels"].append(plain["levels"][0]),
        "ids_twice": _node(3, id="0_2"),
        "members_out_of_range": _node(0, nodeIndices=[2, 999, -1]),
        "members_wrong": _node(0, nodeIndices=["2", None, 2.5]),
        "members_cycle": _node(0, nodeIndices=[0, 0, 0]),
        "unknown_type": _node(2, type="Spaceship"),
        "type_missing": lambda plain: _nodes(plain)[2].pop("type"),
        "transform_short": _node(2, transform=[1] * 15),
        "transform_words": _node(2, transform=["1"] * 16),
        "transform_nan": _node(2, transform=[float("nan")] * 16),
        "transform_zero": _node(2, transform=[0] * 16),
        "transform_huge": _node(2, transform=[1e30] * 15 + [1]),
        "transform_projective": _node(2, transform=[1, 0, 0, 5, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0]),
        "far_900_m": _add(far),
        "far_1e7_m": _node(2, transform=placement(1e7, 0, 0)),
        "model_unknown": _node(2, modelId="nobody_has_this_one"),
        "model_path": _node(2, modelId="../../../../etc/passwd"),
        "model_number": _node(2, modelId=7),
        "model_blank": _node(2, modelId=""),
        "room_model_path": _node(0, modelId="../fr_0rm_0"),
        "room_types_wrong": _node(0, roomTypes={"a": 1}),
        "hide_ceiling_word": _node(0, hideCeiling="no"),
        "bbox_inverted": _node(0, bbox={"min": [9, 9, 9], "max": [0, 0, 0]}),
        "materials_wrong": _node(2, materials=[7, None, {"name": []}]),
        "materials_many": _node(2, materials=[{"name": "a", "diffuse": "#fff"}] * 5000),
        "texture_path": _node(2, materials=[{"name": "a", "texture": "../../../etc/passwd"}]),
        "colour_wrong": _node(2, materials=[{"name": "a", "diffuse": "#zzzzzz"}]),
        "box_minus": _add(box | {"dimensions": [-1, 0, 1]}),
        "box_huge": _add(box | {"dimensions": [1e30, 1, 1]}),
        "box_words": _add(box | {"dimensions": "wide"}),
        "chairs_2900": _add(*many),
        "levels_300": lambda plain: plain["levels"].extend(
            {"id": str(k), "nodes": []} for k in range(10, 310)
        ),
        "door_state_wrong": _node(7, state=[9]),
        "room_twice": lambda plain: _nodes(plain).append(_nodes(plain)[0] | {"id": "0_99"}),
    }  # fmt: skip


def _files() -> Iterator[tuple[str, str, Callable[[bytes], bytes], bool]]:
    """(case, file, old bytes -> new bytes, whether something is lost)."""
    chair, look = "object/chair/chair.obj", "object/chair/chair.mtl"
    for name, file in (("walls", _WALLS), ("floor", _FLOOR), ("model", chair)):
        lost = name == "model"
        yield f"{name}_empty", file, lambda _d: b"", lost
        yield f"{name}_cut", file, lambda d: d[: 2 * len(d) // 3], True
        yield f"{name}_nan", file, lambda d: d.replace(b"\nv ", b"\nv nan ", 3), False
        yield f"{name}_index_huge", file, lambda d: d + b"f 1/1/1 2/2/2 99999/1/1\n", False
        yield f"{name}_face_words", file, lambda d: d + b"f a b c\n", False
        yield f"{name}_noise", file, lambda _d: bytes(range(256)) * 30, lost
    yield "walls_other_group", _WALLS, lambda d: d.replace(b"WallInside", b"Nothing"), False
    yield "model_mtl_empty", look, lambda _d: b"", True
    yield "model_mtl_noise", look, lambda _d: bytes(range(256)) * 9, True
    yield "walls_mtl_empty", _WALLS.replace(".obj", ".mtl"), lambda _d: b"", True
    yield "classes_empty", _CLASSES, lambda _d: b"", False
    yield "classes_noise", _CLASSES, lambda _d: bytes(range(256)) * 9, False
    yield "classes_header", _CLASSES, lambda d: d.splitlines()[0], False
    yield "classes_columns", _CLASSES, lambda d: d.replace(b",", b";"), False
    yield "classes_field_1_mb", _CLASSES, lambda d: d + b'9,"' + b"x" * 1_000_000 + b'",a\n', False
    yield "classes_quote", _CLASSES, lambda d: d + b'9,"abc', False
    yield "lights_empty", _LIGHTS, lambda _d: b"", False
    yield "lights_list", _LIGHTS, lambda _d: b"[]", False
    yield "lights_wrong", _LIGHTS, lambda _d: b'{"lamp": [7, {"type": 3}], "bare_lamp": {}}', False
    yield "lights_nan", _LIGHTS, lambda d: d.replace(b"60", b"NaN"), False
    yield "lights_huge", _LIGHTS, lambda d: d.replace(b"60", b"1e300"), False
    yield "lights_position", _LIGHTS, lambda d: d.replace(b"1.55", b"1e30"), False
    yield "geometry_words", _GEOMETRY, lambda _d: b"lamp a b c\nbare_lamp\n\n 1 1\n", False
    yield "geometry_huge", _GEOMETRY, lambda _d: b"lamp 1 999999999999 1 2\n", False


def _file(
    name: str, fault: str, file: str, edit: Callable[[bytes], bytes], *, lossy: bool = False
) -> Case:
    def write(place: Place) -> list[Words]:
        house = suncg(place.folder)
        path = house.parent.parent / file
        path.write_bytes(edit(path.read_bytes()))
        return [run(place, house)]

    return Case(f"suncg/{name}", fault, write, is_lossy=lossy)


def _house(spoil: Spoil, place: Place) -> list[Words]:
    def edit(plain: dict[str, Any]) -> None:
        spoil(plain)

    return [run(place, suncg(place.folder, edit))]


def _without(part: str, place: Place) -> list[Words]:
    house = suncg(place.folder)
    shutil.rmtree(house.parent.parent / part)
    return [run(place, house)]


def _only_house_p(place: Place) -> list[Words]:
    house = suncg(place.folder)
    (house / "house.json").rename(house / "house_p.json")
    return [run(place, house)]


def _outside_house(place: Place) -> list[Words]:
    house = suncg(place.folder)
    moved = Path(shutil.move(house, place.folder / "alone"))
    return [run(place, moved)]


def _lists() -> dict[str, bytes]:
    return {
        "empty": b"",
        "noise": bytes(range(128, 256)) * 9,
        "unknown": b"nobody\n",
        "path": f"{HOUSE}\n../../../etc\n".encode(),
        "twice": f"{HOUSE}\n".encode() * 3,
        "unknown_10_000": "".join(f"{k:032x}\n" for k in range(10_000)).encode(),
    }


def _list(listed: bytes, place: Place) -> list[Words]:
    root = suncg(place.folder).parent.parent
    path = place.folder / "list.txt"
    path.write_bytes(listed)
    words = [w for w in run(place, root) if w != str(place.sound)]
    return [[*words, "--houses", str(path)]]
