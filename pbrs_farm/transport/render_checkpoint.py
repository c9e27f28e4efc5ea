"""What a long render keeps of itself, so that a killed one goes on from there; interfaces, no effects."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Protocol

from numpy.typing import NDArray

Arrays = Mapping[str, NDArray[Any]]


class RenderCheckpoint(Protocol):
    """Where a render says how far it is, and what it could go on from.

    A render has parts ("path"; "direct" and the chains of Metropolis), each with a state of
    its own from which it goes on to the same picture. The render calls `kept` once when a
    part begins and `keep` after each launch; the checkpoint decides how often the state is
    really stored. States are arrays by name, as np.savez takes them.
    """

    @property
    def spent_s(self) -> float:
        """Seconds that went into what was kept."""
        ...

    def kept(self, part: str) -> Arrays:
        """The state of a part as it was kept; {} where nothing was."""
        ...

    def keep(self, part: str, share: float, state: Callable[[], Arrays]) -> None:
        """A launch has ended: share (0..1) of the whole render is done.

        state: gives the part's arrays, which may be asked for now or when a later part calls.
        """
        ...


class NoCheckpoint:
    """A render that is not kept: nothing was stored before, and nothing is stored."""

    spent_s = 0.0

    def kept(self, _part: str) -> Arrays:
        return {}

    def keep(self, _part: str, _share: float, _state: Callable[[], Arrays]) -> None:
        return None
