"""Values and paths for damaged JSON files, and the outcome of reading them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from hypothesis import strategies as st

from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.house import House
from pbrs_farm.formats.house_bundle import bundle_from_house


def assert_sound(house: House) -> None:
    """Assert that later stages can use the House: it packs, so its numbers are finite."""
    bundle_from_house(house)
    assert all(len(r.polygon) >= 3 for r in house.rooms)


def outcome(read_it: Callable[[], House]) -> str:
    """ "" for a sound House, the file for a BadHouse; any other exception propagates."""
    try:
        house = read_it()
    except BadHouse as error:
        return error.file
    assert_sound(house)
    return ""


values = st.recursive(
    st.none()
    | st.booleans()
    | st.integers(-(10**20), 10**20)
    | st.floats(allow_nan=False)
    | st.sampled_from(["", "0", "1", "chair", "..", "#ff0000", "\x00"]),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=3), inner, max_size=3),
    max_leaves=6,
)  # fmt: skip


def paths_of(plain: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Paths of all values of a JSON tree."""
    own_path = [path] if path else []
    inner = (
        plain.items()
        if isinstance(plain, dict)
        else enumerate(plain)
        if isinstance(plain, list)
        else ()
    )
    return own_path + [p for key, value in inner for p in paths_of(value, (*path, key))]
