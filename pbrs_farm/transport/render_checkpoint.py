"""Checkpoints of a long render, so that a killed one resumes; interfaces, no effects."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Protocol

from numpy.typing import NDArray

Arrays = Mapping[str, NDArray[Any]]


class RenderCheckpoint(Protocol):
    """Stores a render's progress, and the state from which it resumes.

    A render has parts ("path"; "direct" and the chains of Metropolis), each with a state from which it
    continues to the same picture. The render calls `kept` once when a part begins and `keep` after each
    launch; the checkpoint decides how often the state is written. States are arrays by name, as for
    np.savez.
    """

    @property
    def spent_s(self) -> float:
        """Seconds spent on the stored state."""
        ...

    def kept(self, part: str) -> Arrays:
        """The state of a part as it was kept; {} where nothing was."""
        ...

    def keep(self, part: str, share: float, state: Callable[[], Arrays]) -> None:
        """A launch has ended, share (0..1) of the render is done; state: gives the part's arrays, now or later."""
        ...


class NoCheckpoint:
    """A render that is not kept: nothing was stored before, and nothing is stored."""

    spent_s = 0.0

    def kept(self, _part: str) -> Arrays:
        return {}

    def keep(self, _part: str, _share: float, _state: Callable[[], Arrays]) -> None:
        return None
