"""radiance.exr read as one picture with all of its light."""

from __future__ import annotations

import numpy as np
import pytest

from pbrs_farm.formats.layer_file import layer_from_bytes
from pbrs_farm.formats.radiance_exr import radiance_exr


@pytest.mark.parametrize("lamps", [("indoor",), ("lamp0", "lamp1"), ("indoor", "lamp0")])
def test_the_layer_is_the_sum_of_daylight_and_lamps(lamps: tuple[str, ...]) -> None:
    names = ("outdoor", *lamps, "albedo", "normal")
    images = {n: np.full((2, 3, 3), k + 1, np.float32) for k, n in enumerate(names)}
    layer = layer_from_bytes("radiance", radiance_exr(images), "radiance.exr")
    lit = sum(images[n] for n in ("outdoor", *(lamps if lamps[0] != "indoor" else ("indoor",))))
    assert np.array_equal(layer, lit)
