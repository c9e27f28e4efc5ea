"""Open an output root, shards or a folder of Hypersim, local or remote. Effects: reads the store."""

from __future__ import annotations

from pathlib import Path

from pbrs_farm.core.checked_calls import checked_call
from pbrs_farm.core.errors import BadInput
from pbrs_farm.store import Store, store_from_url
from pbrs_farm.store.folder import FolderStore
from pbrs_farm.views.views import Views


@checked_call
def open_views(place: str | Path | Store) -> Views:
    """The views of an output root, of shards that `pbrs-farm pack` wrote, or of a Hypersim folder.

    place: a folder, file:///folder, s3://bucket/prefix, or a Store. Reads only names until a view is
    requested. Raises BadInput if there is no view, StoreFailed if the store does not answer.

        >>> frame.save("opened")
        >>> pf.open("opened")[0].size
        (64, 48)
    """
    store = place if not isinstance(place, str | Path) else store_from_url(str(place))
    if isinstance(store, FolderStore) and not store.root.is_dir():
        raise BadInput(place, "", "no such folder")
    # Imported on demand: shards are read without pydantic and OpenImageIO.
    if store.head("dataset.json") is not None:
        from pbrs_farm.views.shard_set import views_of_shards

        return views_of_shards(store)
    from pbrs_farm.core import keys  # needs pydantic, unlike the reader of shards

    if isinstance(store, FolderStore) and not (store.root / keys.FOLDERS[0]).is_dir():
        from pbrs_farm.views.hypersim_folder import is_hypersim, views_of_hypersim

        if is_hypersim(store.root):
            return views_of_hypersim(store.root)
    from pbrs_farm.views.stored_root import views_of_root

    return views_of_root(store)
