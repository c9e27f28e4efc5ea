"""A view of any store as a folder, for as long as it is used. Effects: network, temporary files."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

from pbrs_farm.core import keys
from pbrs_farm.core.errors import BadInput, ObjectMissing
from pbrs_farm.formats.radiance_exr import FILE as RADIANCE_EXR
from pbrs_farm.store import StoreSettings, store_from_url
from pbrs_farm.store.folder import FolderStore

_VIEW: Final = re.compile(
    r"(?P<root>[^:]+://.+)/(?:houses|objects)/(?P<house>[^/]+)/views/(?P<view>[^/]+)/?"
)


@contextmanager
def folder_of_view(word: str, settings: StoreSettings, *, needs_light: bool) -> Iterator[Path]:
    """The folder of a view: the one that word names, or a copy of what relighting reads of a URL's.

    needs_light: radiance.exr too. Raises BadInput where a URL names no view, or its store lacks one.
    """
    if "://" not in word:
        yield Path(word)
        return
    match = _VIEW.fullmatch(word)
    if match is None:
        raise BadInput(word, "", "names no view", hint="URL/houses/HOUSE/views/VIEW")
    house, view = match["house"], match["view"]
    store = store_from_url(match["root"], settings)
    wanted = [keys.RECIPE, keys.view_key(house, view, "view.json")]
    if needs_light:
        wanted.append(keys.view_key(house, view, RADIANCE_EXR))
    with TemporaryDirectory(prefix="pbrs-view-") as folder:
        copy = FolderStore(Path(folder))
        for key in (*wanted, keys.house_key(house, "house.json")):
            try:
                copy.put(key, store.get(key))
            except ObjectMissing:
                # Only the line of credit stands in house.json.
                if key in wanted:
                    raise BadInput(word, key, "not in this store") from None
        yield Path(folder) / keys.view_key(house, view)
