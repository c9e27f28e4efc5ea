"""Dropped items come to rest, reproducibly for equal seeds."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pbrs_farm.core.errors import BadInput
from pbrs_farm.geometry.convex_parts import convex_parts
from pbrs_farm.scene import physics
from tests.scene.homes import can, crate, small_home


@pytest.mark.quick(1)
@pytest.mark.parametrize("on", ["dining table", "Bedroom"])
def test_dropped_items_rest_on_their_support(on: str, tmp_path: Path) -> None:
    home, models = small_home(), [can(tmp_path), crate(tmp_path)]
    first, again = (home.scatter(models, 6, on=on, seed=1, physics=True) for _ in range(2))
    assert first.id == again.id
    placed = [i for i in first.house.items if i.pose]
    assert len(placed) == 6
    lowest = np.array([i.bounds[0, 1] for i in placed])
    height = 0.75 if on == "dining table" else 0.0
    # Some are on others, none has sunk in; an item that left the table is on the surface below.
    assert (lowest > -0.001).all()
    assert (np.abs(lowest - height) < 0.001).sum() >= 3


def test_what_cannot_be_dropped_is_told(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match=r"no space above it|no level surface"):
        small_home().scatter([can(tmp_path)], 1, on="ceiling_0_0", physics=True)


def test_convex_parts_are_computed_once_for_all_processes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PBRS_CACHE", str(tmp_path / "cache"))
    model, calls = crate(tmp_path), []
    real = convex_parts
    monkeypatch.setattr(
        "pbrs_farm.scene.physics.convex_parts", lambda t: calls.append(len(t)) or real(t)
    )
    found = []
    for damage in (None, b"damaged", b"", None):
        physics.convex_parts_of.cache_clear()  # as in another process
        found.append(physics.convex_parts_of(model))
        if damage is not None:
            (file,) = (tmp_path / "cache/convex").glob("*.npz")
            file.write_bytes(damage)
    assert len(calls) == 3
    for parts in found[1:]:
        for part, other in zip(parts, found[0], strict=True):
            np.testing.assert_array_equal(part, other)
    # Another version of CoACD may make other parts.
    monkeypatch.setattr("pbrs_farm.scene.physics.version", lambda _package: "9.9")
    physics.convex_parts_of.cache_clear()
    physics.convex_parts_of(model)
    assert len(calls) == 4
