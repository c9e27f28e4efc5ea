"""The score of a blind model on minimal pairs: words and colours of pictures, no geometry; part of `make bench NAME=sets`.

Ridge regression chooses one of the two options by their words, and by the colours of a coarse picture for each kind of
answer (such as "left"). It is judged on homes that it was not fitted to.
"""

from __future__ import annotations

import json
import random
import zlib
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

import pbrs_farm as pf
from pbrs_farm.core.edits import unedited_id
from pbrs_farm.images import array_from_png

UNITS: Final = {
    "questions.pairs": "minimal pairs about pictures",
    "questions.blind_pairs": "share of right answers of a model of the words, and of one of words and coarse colours; chance is 0.5",
    "questions.blind_pairs_se": "standard error of the second",
}
_N_WORDS: Final = 256  # hashed words
_CELLS: Final = 4  # of the coarse picture, along each side
_RIDGE: Final = 10.0
_ANSWERS: Final = ("cannot be told", "left", "right", "yes", "no")


_HOMES: Final = ("builtin", "made:70101,rooms=1", "made:70102,rooms=1")
_N_SWAPS: Final = 6  # versions of a home in which two items have changed places
_N_CAMERAS: Final = 4  # in each of two rooms


def render_edits(root: Path) -> None:
    """Render homes and edited versions of them, from the same cameras."""
    for word in _HOMES:
        home = pf.load(word, "preview")
        views = home.cameras(n=24, size=(160, 120))
        rooms = [room for room, _n in Counter(v.room for v in views).most_common(2)]
        cameras = [
            v.camera for room in rooms for v in [v for v in views if v.room == room][:_N_CAMERAS]
        ]
        frames = pf.render(home, cameras, modes=["opengl_il"])
        frames.save(root)
        seen = Counter(row["item"] for f in frames for row in f.instances if row["pixels"] > 150)
        for version in _versions(home, seen, random.Random(word)):
            pf.render(version, cameras, modes=["opengl_il"]).save(root)


def _versions(home: pf.Home, seen: Counter[str], rng: random.Random) -> Iterator[pf.Home]:
    """The home with two visible items of a room swapped, with one lamp on in each room, and with its doors open."""
    items = [i for i in home.house.items if i.id in seen and not i.kind.is_structure]
    for _ in range(_N_SWAPS):
        a = rng.choice(items)
        b = rng.choice([i for i in items if i.room_id == a.room_id])
        by = b.bounds.mean(0) - a.bounds.mean(0)
        by[1] = 0
        yield home.move(a.id, by=tuple(by)).move(b.id, by=tuple(-by))
    lamps = [item for item in home.house.items if item.lights]
    for end in (0, -1):
        lit = {
            [lamp.id for lamp in lamps if lamp.room_id == room][end]
            for room in {lamp.room_id for lamp in lamps}
        }
        yield home.light([lamp.id for lamp in lamps if lamp.id not in lit], lm=0)
    yield home.open([i.id for i in home.house.items if i.id in seen and i.joints], 0.8)


def blind_figures(exports: list[Path]) -> dict[str, Any]:
    """The figures of UNITS, of folders that `pbrs-farm export --to questions` wrote."""
    rows = [
        row | {"pictures": [folder / name for name in _listed(row["media"])]}
        for folder in exports
        for row in map(json.loads, (folder / "questions.jsonl").read_text("utf-8").splitlines())
        if "pair" in row
    ]
    by_words, _ = _score(rows, with_colours=False)
    by_all, error = _score(rows, with_colours=True)
    return {
        "questions.pairs": len(rows) // 2,
        "questions.blind_pairs": {"words": round(by_words, 3), "colours": round(by_all, 3)},
        "questions.blind_pairs_se": round(error, 3),
    }


def _listed(media: str | list[str]) -> list[str]:
    return [media] if isinstance(media, str) else media


def _score(rows: list[dict[str, Any]], *, with_colours: bool) -> tuple[float, float]:
    """Mean score on left-out homes, and its standard error over pairs."""
    features = np.stack([_features(row, with_colours=with_colours) for row in rows])
    signs = np.array([1.0 if row["ground_truth"] == "A" else -1.0 for row in rows])
    homes = np.array([unedited_id(row["scene_name"].partition("__")[0]) for row in rows])
    is_right = np.zeros(len(rows))
    for home in np.unique(homes):
        train, test = homes != home, homes == home
        x = features[train]
        # The dual form: fewer questions than features.
        weights = x.T @ np.linalg.solve(x @ x.T + _RIDGE * np.eye(len(x)), signs[train])
        guess = features[test] @ weights
        # Of no preference, half is right.
        is_right[test] = np.where(guess == 0, 0.5, np.sign(guess) == signs[test])
    of_pairs = is_right.reshape(-1, 2).mean(1)
    return float(of_pairs.mean()), float(of_pairs.std() / np.sqrt(max(len(of_pairs), 1)))


def _features(row: dict[str, Any], *, with_colours: bool) -> NDArray[np.float64]:
    """Features (N,) of the first option less those of the second."""
    one, two = (option[3:] for option in row["options"])
    words = _words(f"{row['question_type']} {row['question']}", one) - _words(
        f"{row['question_type']} {row['question']}", two
    )
    if not with_colours:
        return words
    # A second picture adds its own colours, and its difference is linear in both.
    colours = np.concatenate([_colours(file) for file in (row["pictures"] * 2)[:2]])
    kinds = np.array([float(one == a) - float(two == a) for a in _ANSWERS])
    return np.concatenate([words, np.outer(kinds, colours).ravel()])


def _words(question: str, option: str) -> NDArray[np.float64]:
    """Hashed words of an option, alone and with each word of the question."""
    vector = np.zeros(_N_WORDS)
    for word in ["", *question.lower().split()]:
        vector[zlib.crc32(f"{word} {option}".encode()) % _N_WORDS] += 1 if not word else 0.2
    return vector


def _colours(file: Path) -> NDArray[np.float64]:
    """Mean colours of the cells of a picture, and its overall mean and deviation, about -1 to 1."""
    rgb = array_from_png(file.read_bytes(), str(file))[..., :3] / 127.5 - 1
    rows = np.array_split(rgb, _CELLS, axis=0)
    cells = [cell.mean((0, 1)) for row in rows for cell in np.array_split(row, _CELLS, axis=1)]
    return np.concatenate([np.ravel(cells), rgb.mean((0, 1)), rgb.std((0, 1)), [1.0]])
