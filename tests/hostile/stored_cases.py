"""Output folders damaged after a run, for verify, sheet, classes, and for a resumed run.

Effects: they copy a stored root and damage the copy.
"""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Final

from tests.hostile.case import ONE_VIEW, Case, Place, Words

Spoil = Callable[[Path], None]

_VERBS: Final = ("verify", "sheet", "classes", "run")
"""Verbs that read a stored root, in turn, since all report a fault alike."""


def cases() -> Iterator[Case]:
    """Each file of a stored root, damaged in each way."""
    number = 0
    for pattern in _FILES:
        for name, spoil in _SPOILS.items():
            verbs = _VERBS[number % 4 :][:1] if name not in ("cut", "zero") else ("verify", "sheet")
            number += 1
            for verb in verbs:
                label = f"stored/{pattern.replace('/*', '').replace('houses/', '')}_{name}_{verb}"
                yield Case(label, "stored", partial(_write, pattern, spoil, verb), neighbours=0)
    for name, edit in _EDITS.items():
        for verb in ("verify", "sheet"):
            label = f"stored/view.json_{name}_{verb}"
            yield Case(label, "stored", partial(_edited, edit, verb), neighbours=0)
    for verb in ("verify", "sheet", "classes"):
        yield Case(f"stored/no_folder_{verb}", "stored", partial(_nothing, verb), neighbours=0)


_FILES: Final = (
    "houses/*/house.json", "houses/*/house.glb", "houses/*/cameras.json", "houses/*/repair.json",
    "houses/*/views/*/view.json", "houses/*/views/*/depth.png", "houses/*/done/house.json",
    "recipe.json", "houses/*/views/*/opengl_dl.png",
)  # fmt: skip


def _cut(path: Path) -> None:
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])


def _replace(make: Callable[[Path], object], path: Path) -> None:
    path.unlink()
    make(path)


_SPOILS: Final[dict[str, Spoil]] = {
    "cut": _cut,
    "empty": lambda path: path.write_bytes(b"") and None,
    "missing": Path.unlink,
    "noise": lambda path: path.write_bytes(bytes(range(256)) * 40) and None,
    "zero": partial(_replace, lambda path: path.symlink_to("/dev/zero")),
    "fifo": partial(_replace, os.mkfifo),
    "directory": partial(_replace, Path.mkdir),
}

_EDITS: Final[dict[str, Callable[[str], str]]] = {
    "list": lambda _text: "[]",
    "numbers_huge": lambda text: text.replace("64", "99999999"),
    "nan": lambda text: text.replace("0.", "NaN, 0.", 1),
    "without_camera": lambda text: json.dumps(
        {k: v for k, v in json.loads(text).items() if k != "camera"}
    ),
    "newline": lambda text: text.replace("0_0", "a\\nb"),
    "other_format": lambda text: text.replace("pbrs_farm", "somebody"),
}


def _copy(place: Place) -> Path:
    return Path(shutil.copytree(place.stored, place.out))


def _command(verb: str, place: Place) -> Words:
    if verb == "run":
        return ("run", str(place.sound), "--out", str(place.out), *ONE_VIEW)
    return (verb, str(place.out))


def _write(pattern: str, spoil: Spoil, verb: str, place: Place) -> list[Words]:
    spoil(next(_copy(place).glob(pattern)))
    return [_command(verb, place)]


def _edited(edit: Callable[[str], str], verb: str, place: Place) -> list[Words]:
    path = next(_copy(place).glob("houses/*/views/*/view.json"))
    path.write_text(edit(path.read_text()))
    return [_command(verb, place)]


def _nothing(verb: str, place: Place) -> list[Words]:
    return [(verb, str(place.folder / "nobody"))]
