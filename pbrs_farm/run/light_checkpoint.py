"""A checkpoint of a view's light, written every minute, from which a killed run resumes; uses store and clock."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from typing import Final

from pbrs_farm.core.errors import StoreFailed
from pbrs_farm.formats.checkpoint_npz import KeptParts, checkpoint_from_npz, checkpoint_npz
from pbrs_farm.store.object_store import Store, get_or_none
from pbrs_farm.transport.render_checkpoint import Arrays

KEEP_EVERY_S: Final = 60.0
TELL_EVERY_S: Final = 5.0
_MAX_BYTES: Final = 2**30  # larger states are not kept


class LightCheckpoint:
    """Implements transport.render_checkpoint.RenderCheckpoint over an object of the store.

    digest: of the step; checkpoints with another digest are ignored. tell: called with the finished share,
    at most every few seconds. clock: monotonic seconds.
    """

    def __init__(
        self,
        store: Store,
        key: str,
        digest: str,
        tell: Callable[[float], None],
        *,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._store = store
        self._key = key
        self._digest = digest
        self._tell = tell
        self._clock = clock
        self._began_s = self._kept_s = self._told_s = clock()
        parts = self._found()
        self.spent_s = parts.spent_s if parts else 0.0
        self._loaded = parts.parts if parts else {}
        self._states: dict[str, Callable[[], Arrays]] = {
            part: partial(self.kept, part) for part in self._loaded
        }

    def kept(self, part: str) -> Arrays:
        """The stored arrays of a part, by name; {} without a checkpoint of this digest."""
        return self._loaded.get(part, {})

    def keep(self, part: str, share: float, state: Callable[[], Arrays]) -> None:
        """Report the finished share of the step, 0..1; write the states of all parts once a minute.

        state is called only before a write, so copying from the GPU costs nothing in between. It may be
        called later, for another part's write, and must still be right then.
        """
        self._states[part] = state
        now = self._clock()
        if now - self._told_s >= TELL_EVERY_S:
            self._told_s = now
            self._tell(share)
        if now - self._kept_s >= KEEP_EVERY_S:
            self._kept_s = now
            self._write(self.spent_s + now - self._began_s)

    def _found(self) -> KeptParts | None:
        data = get_or_none(self._store, self._key)
        parts = None if data is None else checkpoint_from_npz(data)
        return parts if parts and parts.digest == self._digest else None

    def _write(self, spent_s: float) -> None:
        parts = {part: state() for part, state in self._states.items()}
        if sum(a.nbytes for arrays in parts.values() for a in arrays.values()) > _MAX_BYTES:
            return
        # A full or unreachable store costs the checkpoint, not the render.
        try:
            self._store.put(self._key, checkpoint_npz(KeptParts(self._digest, spent_s, parts)))
        except StoreFailed:
            return
