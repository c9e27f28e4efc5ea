"""Words of the board's own, and what they mean; no effects.

A page lists those that it shows. What a rule measures exactly is in docs/cameras.md and docs/selection.md.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

OF_A_VIEW: Final = {
    "sector": "one of six directions, each 60 degrees wide, in which a room is looked at; the best camera of each stays",
    "origin": "what chose the camera: the sampler, a walk, or you",
    "score": "what the sampler ranks cameras by: how many objects a picture shows and how, more is better",
    "share": "of the picture's pixels",
    "visible": "of the thing's pixels if it stood alone before this camera",
    "cut": "the picture's edge cuts the thing off",
    "noise": "the estimated relative error of the picture's light",
}
OF_A_CANDIDATE: Final = {
    "outside room": "not inside the room's outline",
    "near obstacle": "closer to a surface than the camera's clearance",
    "not above floor": "straight below is a wall or a ceiling",
    "enclosed": "inside a piece of furniture or a wall",
    "filled by one": "one object or wall fills too much of the picture",
    "few objects": "too few objects, or each too small",
    "below min score": "weak: its score is below the least that the recipe takes",
    "near duplicate": "a better camera shows the same",
    "lower score": "breaks no rule; another camera of its sector is better",
    "winner": "the camera that was taken",
}
OF_A_SELECTION: Final = {
    "black": "the picture is black", "one-plane": "one plane fills the picture",
    "cut-things": "the picture's edge cuts nearly all things",
    "twin": "a kept view of the room shows the same",
    "failed": "the view was not rendered", "unscored": "no score was made",
    "too-dark": "darker than photographs are", "blown": "too much of it is white",
    "one-surface": "one surface fills the picture", "inside-object": "the camera stands in a thing",
    "too-few-objects": "too few objects are seen", "too-noisy": "its light has too much noise",
    "missing-textures": "texture files of its surfaces are missing",
    "unlike-colour": "its colours are unlike those of the photographs compared with",
    "unlike-depth": "its depths are unlike those of the photographs compared with",
    "room-cap": "the room has enough views already", "class-balance": "the set has enough of its classes",
}  # fmt: skip
"""Reason of a selection -> what it says of a view."""


def listed(words: Iterable[str], meanings: dict[str, str]) -> list[tuple[str, str]]:
    """The words with their meanings, in the meanings' order; those without one are left out."""
    wanted = set(words)
    return [(word, meaning) for word, meaning in meanings.items() if word in wanted]
