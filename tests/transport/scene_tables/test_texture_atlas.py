"""The texture atlas: colours and maps packed into texels."""

from __future__ import annotations

import numpy as np
import pytest

from pbrs_farm.core.house import Material
from pbrs_farm.transport.scene_tables.texture_atlas import texture_atlas, unpacked_maps
from pbrs_farm.transport.validation import known_rooms as rooms


def test_maps_are_packed_unchanged_at_the_larger_size() -> None:
    material = Material("m", roughness_texture_id="r", normal_texture_id="n")
    rough = np.zeros((4, 4, 3), np.uint8)
    rough[..., 1] = np.arange(16).reshape(4, 4) * 17
    normal = np.array([0.5, -0.25, np.sqrt(1 - 0.5**2 - 0.25**2)])
    bent = np.full((2, 2, 3), np.round((normal + 1) * 127.5), np.uint8)
    house = rooms.house([], [material])
    packed = texture_atlas(house, {"r": rough, "n": bent})
    first, width, height = packed.map_slots["r", "n", 1.0]
    assert (first, width, height) == (1, 4, 4)
    normals, roughness = unpacked_maps(packed.texels[1:].reshape(4, 4))
    np.testing.assert_allclose(roughness, rough[..., 1] / 255, atol=1e-3)
    np.testing.assert_allclose(normals[..., 0], 0.5, atol=6e-3)
    np.testing.assert_allclose(normals[..., 1], -0.25, atol=6e-3)
    np.testing.assert_allclose(np.linalg.norm(normals, axis=-1), 1, atol=1e-6)


def test_a_picture_too_large_is_averaged_and_not_thinned_out() -> None:
    # Stripes one pixel wide: sampling every second pixel would give black.
    stripes = np.zeros((6, 4096, 3), np.uint8)
    stripes[:, 1::2] = 255
    house = rooms.house([], [Material("t", texture_id="t")])
    packed = texture_atlas(house, {"t": stripes})
    assert packed.slots["t"] == (1, 2048, 3)
    assert np.ptp(packed.texels[1:]) == 0
    assert ((packed.texels[1] & 1023) / 1023) ** 2 == pytest.approx(0.5, abs=2e-3)


def test_texels_keep_every_8_bit_value() -> None:
    ramp = np.arange(256, dtype=np.uint8).reshape(16, 16, 1).repeat(3, -1)
    house = rooms.house([], [Material("t", texture_id="ramp")])
    packed = texture_atlas(house, {"ramp": ramp})
    root = (packed.texels[1:] & 1023) / 1023
    v = np.arange(256) / 255
    linear = np.where(v <= 0.04045, v / 12.92, ((v + 0.055) / 1.055) ** 2.4)
    np.testing.assert_allclose(root**2, linear, atol=1.2e-3)
    assert packed.slots["ramp"] == (1, 16, 16)
