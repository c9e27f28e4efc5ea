"""Every layer of the table is drawn according to its row."""

from __future__ import annotations

from typing import get_args

import numpy as np
import pytest

from pbrs_farm.core.layers import LAYER, LAYERS, Layer, ShownAs, optional_layer
from pbrs_farm.gallery.label_colours import shown_colours

SHOWN = [layer for layer in LAYERS if layer.shown_as]


def stored(layer: Layer) -> np.ndarray:
    """An array of the layer's type: small numbers, and a pixel without a surface."""
    n = 3 if layer.channels == "RGB" else len(layer.channels.split())
    array = np.random.default_rng(0).integers(0, 200, (6, 8, n)).astype(layer.dtype)
    array[0, 0] = 0
    return array[..., 0] if n == 1 else array


@pytest.mark.parametrize("layer", SHOWN, ids=lambda layer: layer.name)
def test_a_layer_is_drawn_in_colours(layer: Layer) -> None:
    pixels = shown_colours(layer, stored(layer))
    assert (pixels.shape, pixels.dtype) == ((6, 8, 3), np.uint8)


def test_only_light_is_no_picture_and_no_way_of_drawing_is_unused() -> None:
    assert [layer.name for layer in LAYERS if not layer.shown_as] == ["radiance"]
    assert {layer.shown_as for layer in LAYERS} == set(get_args(ShownAs))


def test_near_is_pale_in_depth_and_in_disparity() -> None:
    depth = shown_colours(LAYER["depth"], np.array([[1000, 8000]], np.uint16))
    disparity = shown_colours(LAYER["disparity"], np.array([[8000, 1000]], np.uint16))
    assert depth[0, 0].sum() > depth[0, 1].sum()
    assert disparity[0, 0].sum() > disparity[0, 1].sum()


def test_a_plugins_layer_without_a_drawing_is_scaled_to_its_range() -> None:
    layer = optional_layer("height", "Y", "uint16", "mm")
    pixels = shown_colours(layer, np.array([[100, 200, 300]], np.uint16))
    assert pixels[0, :, 0].tolist() == [0, 128, 255]
    assert optional_layer("red", "RGB", "uint8", "-").shown_as == "picture"
