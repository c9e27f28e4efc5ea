"""Glossaries of the board's pages.

Each page lists the words it uses. Rules are defined in docs/cameras.md and docs/selection.md.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

OF_A_VIEW: Final = {
    "sector": "one of six viewing directions of a room, each 60 degrees wide; the best camera of each is kept",
    "origin": "source of the camera: the sampler, a walk, or you",
    "score": "rank of the camera in the sampler, by the number and size of visible objects; higher is better",
    "share": "share of the picture's pixels",
    "visible": "share of the object's pixels that other objects do not hide",
    "cropped": "the edge of the picture crops the object",
    "noise": "estimated relative error of the light",
}
OF_A_CANDIDATE: Final = {
    "outside room": "outside the room's outline",
    "near obstacle": "closer to a surface than the camera's clearance",
    "not above floor": "no floor straight below",
    "enclosed": "inside a piece of furniture or a wall",
    "filled by one": "one object or wall fills too much of the picture",
    "few objects": "too few objects, or only small ones",
    "below min score": "the score is below the minimum of the recipe",
    "near duplicate": "a better camera has almost the same view",
    "lower score": "valid, but another camera of its sector is better",
    "winner": "the chosen camera",
}
OF_A_SELECTION: Final = {
    "black": "the picture is black",
    "one-plane": "one plane fills the picture",
    "cropped-objects": "the edge of the picture crops nearly all objects",
    "twin": "a kept view of the room is almost the same",
    "failed": "the view was not rendered",
    "unscored": "the view has no score",
    "too-dark": "darker than photographs",
    "blown": "too much of the picture is white",
    "one-surface": "one surface fills the picture",
    "inside-object": "the camera is inside an object",
    "too-few-objects": "too few objects are visible",
    "too-noisy": "the light is too noisy",
    "missing-textures": "texture files are missing",
    "unlike-colour": "its colours differ from those of the reference photographs",
    "unlike-depth": "its depths differ from those of the reference photographs",
    "room-cap": "the room has enough views",
    "class-balance": "the set has enough of its classes",
}
"""Reason of a selection -> its meaning."""


def listed(words: Iterable[str], meanings: dict[str, str]) -> list[tuple[str, str]]:
    """(word, meaning) of the words with a meaning, in the order of meanings."""
    shown = set(words)
    return [(word, meaning) for word, meaning in meanings.items() if word in shown]
