"""pbrs_farm: houses designed by people in, physically-based pictures with exact labels out."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pathlib import Path

    from pbrs_farm.store import Store
    from pbrs_farm.study.reading.views import Views

__version__ = "0.1.0"


def open(place: str | Path | Store) -> Views:
    """The views of an output folder, or of shards of `pbrs-farm pack`: docs/data.md.

    place: a folder, file:///folder, s3://bucket/prefix, or a store of pbrs_farm.store. Arrays are
    read when they are asked for. Raises BadInput where there is no view, StoreFailed where the
    store does not answer.
    """
    # Imported here, so that the package itself loads at once.
    from pbrs_farm.study.reading.open_views import open_views

    return open_views(place)
