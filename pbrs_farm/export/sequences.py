"""Views that belong together, for the forms of sequences: by house, in time, with their right views; no effects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.errors import BadInput
from pbrs_farm.export.chosen_view import ChosenView


@dataclass(frozen=True, slots=True, eq=False)
class SequenceFrame:
    """One moment of a house: the left view, and the right one where there is a pair."""

    left: ChosenView
    right: ChosenView | None = None

    @property
    def time_s(self) -> float | None:
        """None of a view that is no frame."""
        time = self.left.facts.get("time_s")
        return None if time is None else float(time)


def frames_by_house(views: Sequence[ChosenView]) -> dict[str, list[SequenceFrame]]:
    """House id -> its moments: frames by number, then views that are no frames by id.

    Right views of stereo pairs are put beside their left; a right view alone is left out.
    """
    rights = {(v.house.id, v.facts["left"]): v for v in views if v.facts.get("left")}
    frames: dict[str, list[SequenceFrame]] = {}
    for view in views:
        if not view.facts.get("left"):
            right = rights.get((view.house.id, view.id))
            frames.setdefault(view.house.id, []).append(SequenceFrame(view, right))

    def order(frame: SequenceFrame) -> tuple[float, str]:
        return float(frame.left.facts.get("frame", float("inf"))), frame.left.id

    return {house: sorted(own, key=order) for house, own in frames.items()}


def pose_opencv(view: ChosenView) -> F64:
    """(4, 4) float64 world_from_camera, camera axes x right, y down, z forward.

    Metres, world y up: p_world = pose @ p_camera.
    """
    return np.array(view.facts["world_from_camera_opencv"], np.float64)


def required_picture(view: ChosenView, form: str) -> str:
    """The mode of the view's picture; BadInput where it has none.

    form is the name that the message uses.
    """
    if view.picture is None:
        hint = "run it with --modes, or export labels in another form"
        raise BadInput(f"{view.house.id}/{view.id}", "", f"{form} needs a picture", hint=hint)
    return view.picture
