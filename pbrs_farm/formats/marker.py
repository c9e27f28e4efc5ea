"""done/<step>[.<view>].json: the marker that says a step is done (architecture rule 4).

Effects: those of the stores it is given.
"""

from __future__ import annotations

from typing import Any

from pydantic import Field, ValidationError

from pbrs_farm.core.errors import StoreFailed
from pbrs_farm.core.record import Record
from pbrs_farm.formats.serialise import json_bytes
from pbrs_farm.store.object_store import Store, get_or_none, put_done


class StoredFile(Record):
    """One object a step wrote."""

    key: str
    n_bytes: int
    sha256: str


class Marker(Record):
    """Inputs and outputs of a finished step; written last and only if absent."""

    step: str
    house_id: str
    view_id: str | None = None
    digest: str  # of ids, the recipe's fields in use, the step's version, its inputs' digests
    files: tuple[StoredFile, ...] = ()
    # For later steps and view.json; equal for equal inputs.
    facts: dict[str, Any] = Field(default_factory=dict)
    # The only clocks in the whole output:
    seconds: float = 0.0
    worker: str = ""
    attempt: int = 1
    finished_utc: str = ""

    def json_bytes(self) -> bytes:
        """The file."""
        return json_bytes(self)


def read_marker(store: Store, key: str) -> Marker | None:
    """The marker at key; None if the step is not done. StoreFailed for a damaged one."""
    data = get_or_none(store, key)
    try:
        return None if data is None else Marker.model_validate_json(data)
    except ValidationError:
        raise StoreFailed(key, "not a marker", hint="remove it to repeat the step") from None


def copy_done(of: Store, to: Store, key: str) -> Marker | None:
    """Copy a step's files and its marker, which is returned, over existing ones; None without a marker.

    key: of the marker; files keep their keys. The old marker in `to` is removed first, so that an
    interrupted copy does not look finished. ObjectMissing if a file listed in the marker does not exist.
    """
    marker = read_marker(of, key)
    if marker is not None:
        files = {file.key: of.get(file.key) for file in marker.files}
        to.delete(key)
        put_done(to, key, marker.json_bytes(), files)
    return marker
