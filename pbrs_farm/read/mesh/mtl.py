"""Wavefront MTL -> materials by name; and Java 3D's built-in names. Effect: reads the table of those."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from importlib.resources import files
from typing import Final

import numpy as np

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.frames import srgb_from_linear
from pbrs_farm.read.common.material_fields import noted_fields
from pbrs_farm.read.mesh.obj import Mesh
from pbrs_farm.regular_files import text_from_bytes

Rgb = tuple[float, float, float]

_MOST_BUILTIN_KS: Final = 0.48
"""A brighter highlight on a dark colour is read as metal; in the program's photos all are lacquer."""


@dataclass(frozen=True, slots=True)
class ObjMaterial:
    """A material of an MTL."""

    name: str
    kd: Rgb = (0.8, 0.8, 0.8)  # diffuse, sRGB-encoded
    ks: Rgb = (0.0, 0.0, 0.0)  # specular, sRGB-encoded
    ns: float = 0.0  # Phong exponent
    d: float = 1.0  # opacity
    map_kd: str = ""  # picture as written, "" = none
    map_d: str = ""  # picture as written, "" = none
    uv_scale: tuple[float, float] = (1.0, 1.0)  # of the colour's picture: times u and v
    uv_offset: tuple[float, float] = (0.0, 0.0)  # then added
    unread: tuple[str, ...] = ()  # statements and options that are not read


def parse_mtl(data: bytes) -> tuple[ObjMaterial, ...]:
    """The materials in the order of the file, also repeated ones; unreadable lines are skipped."""
    materials: list[ObjMaterial] = []
    fields: dict[str, object] | None = None
    for raw in text_from_bytes(data, "replace").splitlines():
        words = raw.split()
        if not words:
            continue
        key = words[0].lower()
        if key == "newmtl":
            _append_material(fields, materials)
            fields = {"name": raw.split(None, 1)[1].strip() if len(words) > 1 else ""}
        elif fields is not None:
            _read_line(key, words[1:], raw, fields)
    _append_material(fields, materials)
    return tuple(materials)


def _append_material(fields: dict[str, object] | None, materials: list[ObjMaterial]) -> None:
    if fields is not None:
        materials.append(ObjMaterial(**fields))  # type: ignore[arg-type]


def _read_line(key: str, words: list[str], raw: str, fields: dict[str, object]) -> None:
    if key in ("kd", "ks"):
        rgb = [_mtl_number(w) for w in words[:3]]
        # One number means a grey.
        if len(rgb) == 1:
            rgb *= 3
        if len(rgb) == 3 and all(v is not None for v in rgb):
            fields[key] = _parse_mtl_colour([v or 0.0 for v in rgb])
    elif key in ("ns", "d", "tr"):
        # Take the last word: "d -halo 0.5" has an option before it.
        value = _mtl_number(words[-1]) if words else None
        if value is not None:
            if key == "ns":
                fields["ns"] = max(0.0, value)
            else:
                d = value if key == "d" else 1.0 - value
                # The first of d and Tr counts; Tr is one less opacity.
                fields.setdefault("d", float(np.clip(d, 0, 1)))
    elif key in ("map_kd", "map_d") and words:
        options, fields[key] = _picture_of_line(words, raw)
        if key == "map_kd":
            fields["uv_scale"] = _pair_of_option(options.get("-s"), 1.0)
            fields["uv_offset"] = _pair_of_option(options.get("-o"), 0.0)
        for option in options:
            setting = f"{option} {' '.join(options[option])}".lower()
            if _noted_words() & {option, setting}:
                _add_unread(fields, f"{key} {setting}")
    elif key in _noted_words() and words and (key != "ke" or any(_mtl_number(w) for w in words)):
        _add_unread(fields, key)


@cache
def _noted_words() -> frozenset[str]:
    return frozenset(name.lower() for name in noted_fields("MTL"))


def _add_unread(fields: dict[str, object], what: str) -> None:
    before = fields.get("unread", ())
    assert isinstance(before, tuple)
    fields["unread"] = tuple(dict.fromkeys((*before, what)))


def _pair_of_option(words: list[str] | None, default: float) -> tuple[float, float]:
    """The first two numbers after -s or -o; the default for missing ones."""
    values = [_mtl_number(w) for w in (words or [])[:2]] + [None, None]
    u, v = (default if value is None else value for value in values[:2])
    return u, v


def _mtl_number(word: str) -> float | None:
    try:
        value = float(word)
    except ValueError:
        return None
    return value if np.isfinite(value) else None


# Options of a map_ line and how many values follow each (OBJ specification, appendix B1).
# fmt: off
_OPTIONS = {"-s": 3, "-o": 3, "-t": 3, "-mm": 2, "-bm": 1, "-clamp": 1, "-blendu": 1,
            "-blendv": 1, "-texres": 1, "-imfchan": 1, "-cc": 1, "-boost": 1}
# fmt: on


def _picture_of_line(words: list[str], raw: str) -> tuple[dict[str, list[str]], str]:
    """(option -> its arguments, picture name) of a map_ line; the name may contain spaces."""
    options: dict[str, list[str]] = {}
    position = 0
    while position < len(words) and words[position].lower() in _OPTIONS:
        option = words[position].lower()
        most, first = _OPTIONS[option], position + 1
        position = first
        while position - first < most and position < len(words):
            if most > 1 and _mtl_number(words[position]) is None:
                break
            position += 1
        options[option] = words[first:position]
    return options, " ".join(words[position:]) if position else raw.split(None, 1)[1].strip()


def laid(mesh: Mesh, material: ObjMaterial | None) -> Mesh:
    """A mesh with the texture coordinates that its material's picture has on it."""
    if material is None or mesh.uvs is None:
        return mesh
    if material.uv_scale == (1.0, 1.0) and material.uv_offset == (0.0, 0.0):
        return mesh
    return replace(mesh, uvs=mesh.uvs * material.uv_scale + material.uv_offset)


@cache
def builtin_materials() -> dict[str, ObjMaterial]:
    """Sweet Home 3D's (Java 3D's) built-in materials by name, with linear Kd; cached, do not change it."""
    text = files("pbrs_farm.read.mesh").joinpath("java3d-materials.json").read_text("utf-8")
    table = {}
    for name, m in json.loads(text).items():
        # Names that begin so are remarks about the table.
        if name.startswith("_"):
            continue
        table[name] = ObjMaterial(
            name,
            _parse_mtl_colour(srgb_from_linear(np.array(m["Kd"]))),
            _parse_mtl_colour(np.minimum(m.get("Ks", (0.0, 0.0, 0.0)), _MOST_BUILTIN_KS)),
            float(m.get("Ns", 0.0)),
            float(m.get("d", 1.0)),
        )
    return table


def _parse_mtl_colour(values: Sequence[float] | F64) -> Rgb:
    r, g, b = (min(max(float(v), 0.0), 1.0) for v in values)
    return r, g, b
