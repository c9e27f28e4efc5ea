"""What a view's light keeps every minute, so that a killed run goes on from its film.

Effects: reads and writes one object of the store, reads a clock.
"""

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
_TELL_EVERY_S: Final = 5.0
_MAX_BYTES: Final = 2**30  # larger states are not kept


class LightCheckpoint:
    """Implements transport.render_checkpoint.RenderCheckpoint over an object of the store.

    digest: of the step; what another one has kept is not gone on from. tell: hears the share that is
    done, at most every few seconds. clock: seconds that only grow.
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
        found = self._found()
        self.spent_s = found.spent_s if found else 0.0
        self._loaded = found.parts if found else {}
        self._states: dict[str, Callable[[], Arrays]] = {
            part: partial(self.kept, part) for part in self._loaded
        }

    def kept(self, part: str) -> Arrays:
        """The state of a part; {} where nothing was kept.

        Arrays as `keep` was given them, by name. A checkpoint of another recipe or home is never
        loaded: its digest is part of what is compared.
        """
        return self._loaded.get(part, {})

    def keep(self, part: str, share: float, state: Callable[[], Arrays]) -> None:
        """Tell the share that is done; write the states of all parts when a minute has passed.

        share is 0..1 of the whole step. state is called only when something is written, so copying
        from the GPU costs nothing in between; it is called later too, for another part's turn, and
        must then still be right.
        """
        self._states[part] = state
        now = self._clock()
        if now - self._told_s >= _TELL_EVERY_S:
            self._told_s = now
            self._tell(share)
        if now - self._kept_s >= KEEP_EVERY_S:
            self._kept_s = now
            self._write(self.spent_s + now - self._began_s)

    def _found(self) -> KeptParts | None:
        data = get_or_none(self._store, self._key)
        found = None if data is None else checkpoint_from_npz(data)
        return found if found and found.digest == self._digest else None

    def _write(self, spent_s: float) -> None:
        parts = {part: state() for part, state in self._states.items()}
        if sum(a.nbytes for arrays in parts.values() for a in arrays.values()) > _MAX_BYTES:
            return
        # A store that is full or away costs what was to be kept, not the render.
        try:
            self._store.put(self._key, checkpoint_npz(KeptParts(self._digest, spent_s, parts)))
        except StoreFailed:
            return
