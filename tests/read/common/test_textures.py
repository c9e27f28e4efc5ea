from __future__ import annotations

import io

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from pbrs_farm.read.common.material_library import (
    OPAQUE_ALPHA,
    picture_with_alpha,
    texture_from_bytes,
)
from tests.hypothesis_profiles import examples
from tests.read.small_houses import png

KINDS = ["PNG", "JPEG", "GIF", "BMP", "TIFF", "WEBP"]


def encoded(kind: str, mode: str = "RGB", size: tuple[int, int] = (20, 10)) -> bytes:
    picture = Image.linear_gradient("L").resize(size).convert(mode)
    buffer = io.BytesIO()
    picture.save(buffer, kind)
    return buffer.getvalue()


@pytest.mark.parametrize("kind", ["PNG", "JPEG"])
def test_png_and_jpeg_keep_their_bytes(kind: str) -> None:
    data = encoded(kind)
    texture, alpha = texture_from_bytes(data, "a")
    assert texture.data == data
    assert texture.media_type == f"image/{kind.lower()}"
    assert alpha == OPAQUE_ALPHA


@pytest.mark.parametrize("kind", ["GIF", "BMP", "TIFF", "WEBP"])
def test_other_kinds_become_png_with_the_same_pixels(kind: str) -> None:
    data = encoded(kind)
    texture, _ = texture_from_bytes(data, "a")
    assert texture.media_type == "image/png"
    ours, theirs = (Image.open(io.BytesIO(d)).convert("RGB") for d in (texture.data, data))
    assert ours.tobytes() == theirs.tobytes()
    assert texture_from_bytes(data, "a").texture == texture


def rgba(alpha: list[list[int]]) -> bytes:
    image = Image.new("RGBA", (len(alpha[0]), len(alpha)), (1, 2, 3, 255))
    image.putalpha(grey(alpha))
    return saved(image)


def grey(values: list[list[int]]) -> Image.Image:
    return Image.fromarray(np.array(values, np.uint8))


def saved(image: Image.Image) -> bytes:
    buffer = io.BytesIO()
    image.save(buffer, "PNG")
    return buffer.getvalue()


def test_alpha_is_a_hole_only_below_the_cutoff() -> None:
    for alpha, holes in ((255, False), (130, False), (100, True)):
        assert texture_from_bytes(rgba([[255, alpha]]), "a").has_holes() is holes
    texture = texture_from_bytes(rgba([[200, 100], [200, 100]]), "a")
    assert (texture.has_holes(0.2), texture.has_holes(0.9)) == (False, True)
    assert np.allclose(texture.alpha, [100 / 255, 200 / 255, 150 / 255])


@pytest.mark.parametrize(
    ("channel", "expected"), [("r", 10), ("g", 20), ("b", 30), ("a", 40), ("", 40)]
)
def test_opacity_is_the_named_channel_of_another_picture(channel: str, expected: int) -> None:
    mask = saved(Image.new("RGBA", (2, 2), (10, 20, 30, 40)))
    colour = saved(Image.new("RGB", (4, 2), (7, 8, 9)))
    merged = Image.open(io.BytesIO(picture_with_alpha(colour, mask, channel)))
    assert merged.size == (4, 2)
    assert merged.getpixel((0, 0)) == (7, 8, 9, expected)
    assert Image.open(io.BytesIO(picture_with_alpha(None, mask, channel))).getpixel((0, 0)) == (
        255, 255, 255, expected,
    )  # fmt: skip


def test_opacity_without_alpha_is_luminance_scaled_and_moved() -> None:
    luminance = saved(grey([[0, 100, 200]]))
    merged = Image.open(io.BytesIO(picture_with_alpha(None, luminance, "", -1.0, 1.0)))
    assert list(np.asarray(merged)[0, :, 3]) == [255, 155, 55]
    deep = saved(Image.fromarray(np.array([[0, 65535]], np.uint16)))
    merged = Image.open(io.BytesIO(picture_with_alpha(None, deep)))
    assert list(np.asarray(merged)[0, :, 3]) == [0, 255]


def test_a_picture_of_absurd_size_is_refused_before_it_is_decoded() -> None:
    bomb = bytearray(encoded("BMP"))
    bomb[18:26] = (60_000).to_bytes(4, "little") * 2
    for data in (bytes(bomb), png(16_385, 1)):
        with pytest.raises(ValueError, match="too large"):
            texture_from_bytes(data, "a")


def test_bytes_that_are_no_picture_are_refused() -> None:
    for data in (b"", b"x" * 1000, png()[:40], encoded("JPEG")[:200]):
        with pytest.raises(ValueError, match=r"not a picture|decoded"):
            texture_from_bytes(data, "a")


edits = st.lists(
    st.tuples(st.integers(0, 10**6), st.binary(max_size=4), st.integers(0, 8)), max_size=5
)


@settings(max_examples=examples(200), deadline=5000)
@given(st.sampled_from(KINDS), edits)
def test_whatever_the_bytes_the_outcome_is_a_texture_or_a_value_error(
    kind: str, changes: list[tuple[int, bytes, int]]
) -> None:
    data = encoded(kind)
    for start, new, n_gone in changes:
        start %= len(data) + 1
        data = data[:start] + new + data[start + n_gone :]
    try:
        texture, _ = texture_from_bytes(data, "a")
    except ValueError:
        return
    assert texture.media_type in ("image/png", "image/jpeg")
