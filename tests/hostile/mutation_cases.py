"""Sound files of every format with seeded damage to bytes and words. No effects until written."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any, Final

import numpy as np

from tests.hostile.case import Case, Place, Words, home, run
from tests.hostile.sound_inputs import (
    MODELS,
    XML,
    archive,
    glb,
    glb_of_parts,
    parts_of_glb,
    suncg,
    zip_of,
)
from tests.read.suncg.suncg_root import HOUSE

_PER_FORMAT: Final = 5
_WORDS: Final = ("NaN", "-1", "1e30", "0", "null", "[]", '""', "99999999", "1e-30", "{}")


def cases() -> Iterator[Case]:
    """Five of each format."""
    for seed in range(_PER_FORMAT):
        rng = partial(np.random.default_rng, [7, seed])
        for name, file, build in (
            ("zip_bytes", "bad.sh3d", lambda r: flipped(archive(), r)),
            ("xml_words", "bad.sh3d", lambda r: zip_of({"Home.xml": words(XML, r)} | MODELS)),
            ("obj_words", "bad.sh3d", lambda r: archive(contents={"1": words(MODELS["1"], r)})),
            ("glb_bytes", "bad.glb", lambda r: flipped(glb(), r)),
            ("glb_words", "bad.glb", _glb_words),
            ("glb_values", "bad.glb", lambda r: glb(partial(_one_value, rng=r))),
        ):
            yield home(f"mutation/{name}_{seed}", "mutation", file, _later(build, rng))
        for name, path in _SUNCG.items():
            write = partial(_suncg, path, rng)
            yield Case(f"mutation/suncg_{name}_{seed}", "mutation", write)


_SUNCG: Final = {
    "house": f"house/{HOUSE}/house.json",
    "walls": f"room/{HOUSE}/fr_0rm_0w.obj",
    "model": "object/chair/chair.obj",
    "lights": "metadata/suncgModelLights.json",
    "classes": "metadata/ModelCategoryMappingNewActive.csv",
}

Rng = Callable[[], np.random.Generator]


def _later(build: Callable[[np.random.Generator], bytes], rng: Rng) -> Callable[[], bytes]:
    return lambda: build(rng())


def flipped(data: bytes, rng: np.random.Generator, n: int = 20) -> bytes:
    """Data with n bytes replaced."""
    array = np.frombuffer(data, np.uint8).copy()
    array[rng.integers(len(array), size=n)] = rng.integers(256, size=n)
    return array.tobytes()


def words(data: bytes, rng: np.random.Generator, n: int = 3) -> bytes:
    """Text with n of its numbers replaced by invalid or absurd ones."""
    for _ in range(n):
        places = [m.span() for m in re.finditer(rb"-?\d+\.?\d*", data)]
        start, end = places[rng.integers(len(places))]
        word = _WORDS[rng.integers(len(_WORDS))]
        data = data[:start] + word.encode() + data[end:]
    return data


def _glb_words(rng: np.random.Generator) -> bytes:
    document, binary = parts_of_glb(glb())
    return glb_of_parts(words(json.dumps(document).encode(), rng), binary)


def _one_value(document: dict[str, Any], rng: np.random.Generator) -> None:
    """Replace three values of the tree by values of another type."""
    replacements: tuple[Any, ...] = (None, [], {}, "a", -1, 1e30, True, [[]], 2**40)
    for _ in range(3):
        parent: Any = document
        while True:
            keys = list(parent) if isinstance(parent, dict) else list(range(len(parent)))
            key = keys[rng.integers(len(keys))]
            below = parent[key]
            if not isinstance(below, (dict, list)) or not below or rng.random() < 0.15:
                parent[key] = replacements[rng.integers(len(replacements))]
                break
            parent = below


def _suncg(file: str, rng: Rng, place: Place) -> list[Words]:
    house = suncg(place.folder)
    path: Path = house.parent.parent / file
    path.write_bytes(words(path.read_bytes(), rng()))
    return [run(place, house)]
