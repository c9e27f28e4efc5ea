from __future__ import annotations

import io

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from pbrs_farm.read.common.material_library import texture_from_bytes
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
    texture, has_holes = texture_from_bytes(data, "a")
    assert texture.data == data
    assert texture.media_type == f"image/{kind.lower()}"
    assert not has_holes


@pytest.mark.parametrize("kind", ["GIF", "BMP", "TIFF", "WEBP"])
def test_other_kinds_become_png_with_the_same_pixels(kind: str) -> None:
    data = encoded(kind)
    texture, _ = texture_from_bytes(data, "a")
    assert texture.media_type == "image/png"
    ours, theirs = (Image.open(io.BytesIO(d)).convert("RGB") for d in (texture.data, data))
    assert ours.tobytes() == theirs.tobytes()
    assert texture_from_bytes(data, "a")[0] == texture


def test_alpha_is_a_hole_only_where_it_is_below_one_half() -> None:
    for alpha, holes in ((255, False), (130, False), (100, True)):
        image = Image.new("RGBA", (4, 4), (1, 2, 3, 255))
        image.putpixel((1, 1), (1, 2, 3, alpha))
        buffer = io.BytesIO()
        image.save(buffer, "PNG")
        assert texture_from_bytes(buffer.getvalue(), "a")[1] is holes


def test_a_picture_of_absurd_size_is_refused_before_it_is_decoded() -> None:
    bomb = bytearray(encoded("BMP"))
    bomb[18:26] = (60_000).to_bytes(4, "little") * 2
    for data in (bytes(bomb), png(16_385, 1)):
        with pytest.raises(ValueError, match="too large"):
            texture_from_bytes(data, "a")


def test_bytes_that_are_no_picture_are_refused() -> None:
    for data in (b"", b"x" * 1000, png()[:40], encoded("JPEG")[:200]):
        with pytest.raises(ValueError, match=r"no picture|decoded"):
            texture_from_bytes(data, "a")


edits = st.lists(
    st.tuples(st.integers(0, 10**6), st.binary(max_size=4), st.integers(0, 8)), max_size=5
)


@settings(max_examples=200, deadline=5000)
@given(st.sampled_from(KINDS), edits)
def test_whatever_the_bytes_the_outcome_is_a_texture_or_a_value_error(
    kind: str, changes: list[tuple[int, bytes, int]]
) -> None:
    data = encoded(kind)
    for at, new, n_gone in changes:
        at %= len(data) + 1
        data = data[:at] + new + data[at + n_gone :]
    try:
        texture, _ = texture_from_bytes(data, "a")
    except ValueError:
        return
    assert texture.media_type in ("image/png", "image/jpeg")
