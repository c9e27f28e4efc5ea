"""Shots: ids of views are made and parsed here, and say which views share a frame, a rig or a seed; no effects.

0_1_2            a still of room 0_1, sector 2          Shot("0_1_2")
0_1_2_right      the same, by another camera of a rig   Shot("0_1_2", eye="right")
frame_00012      a frame of the house's film            Shot.of_frame(12)
frame_00012_top  the same, by another camera of a rig   Shot.of_frame(12, "top")
"""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from typing import Any, Final, Literal

from pbrs_farm.core import keys

MOST_FRAMES: Final = 100_000
"""Of one film: ids of more would not sort."""

_FILM: Final = "clip"  # the take of all frames of a house; part of their seeds
_FRAME: Final = re.compile(r"frame_(\d{5,})")


@dataclass(frozen=True, slots=True)
class Shot:
    """One picture of a house: its take, its frame in a film and its camera in a rig.

    take: the id of a still as the rig's first camera takes it; all frames of a house are one take.
    frame: number in the film, None for a still. eye: the camera's name in the rig, "" for its first
    camera and without a rig. A stereo pair is a rig whose other camera is called right.
    """

    take: str
    frame: int | None = None
    eye: str = ""

    @classmethod
    def of_frame(cls, number: int, eye: str = "") -> Shot:
        """A frame of the house's film."""
        return cls(_FILM, number, eye)

    @classmethod
    def of_id(cls, view_id: str, eyes: Collection[str] = ()) -> Shot:
        """Parse an id. eyes: of the rig, as `RigFields.eyes` has them; other endings belong to the take.

        >>> Shot.of_id("0_1_2_far_right", ("", "right", "far_right"))
        Shot(take='0_1_2', frame=None, eye='far_right')
        """
        eye = max((e for e in eyes if e and view_id.endswith(f"_{e}")), key=len, default="")
        first = view_id.removesuffix(f"_{eye}") if eye else view_id
        match = _FRAME.fullmatch(first)
        return cls(first, None, eye) if match is None else cls.of_frame(int(match[1]), eye)

    @classmethod
    def of_row(cls, view_id: str, row: Mapping[str, Any]) -> Shot:
        """The shot of a view by the table `rig` of its view.json or its row of cameras.json."""
        rig = row.get("rig")
        return cls.of_id(
            view_id, () if rig is None or rig["instant"] == view_id else (rig["camera"],)
        )

    @property
    def id(self) -> str:
        """Id of the view; `of_id` is the inverse."""
        first = self.take if self.frame is None else f"frame_{self.frame:05d}"
        return f"{first}_{self.eye}" if self.eye else first

    @property
    def first(self) -> Shot:
        """The shot of the rig's first camera at the same instant."""
        return self.partner(eye="")

    def partner(self, frames: int = 0, eye: str | None = None) -> Shot:
        """The shot so many frames later, or earlier, and by another camera of the rig if eye is given.

        >>> Shot.of_frame(7, "right").partner(-1).id
        'frame_00006_right'
        """
        frame = None if self.frame is None else self.frame + frames
        return replace(self, frame=frame, eye=self.eye if eye is None else eye)

    def seed(self, house_id: str, *parts: str | int, per: Literal["view", "eye", "take"]) -> int:
        """Seed of one kind of random choice, which the first part names.

        per: "view", each view draws its own; "eye", all frames of one camera share it (noise that
        stays on surfaces); "take", all frames and all cameras of a rig share it (tone).
        """
        name = {"view": self.id, "eye": replace(self, frame=None).id, "take": self.take}[per]
        return keys.seed(house_id, name, *parts)


def view_id(room_id: str, sector: int, k: int | None = None) -> str:
    """`<room>_<sector>` of the camera search, `_<k>` when a sector has several: the id of a still."""
    return f"{room_id}_{sector}" if k is None else f"{room_id}_{sector}_{k}"


def room_of_id(view_id: str, rooms: Collection[str]) -> str:
    """The longest room id that a still's id begins with; without any all but the id's last part."""
    owners = [room for room in rooms if view_id.startswith(f"{room}_")]
    return max(owners, key=len, default=view_id.rpartition("_")[0])
