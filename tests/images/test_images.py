"""Pictures survive encoding bit for bit, equal pictures give equal bytes, damage is reported."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from pbrs_farm import images
from pbrs_farm.core.errors import BadInput

SHAPES = [(7, 5), (7, 5, 3), (7, 5, 4)]


def random_pixels(shape: tuple[int, ...], dtype: type[np.integer]) -> np.ndarray:
    return np.random.default_rng(1).integers(0, np.iinfo(dtype).max, shape, dtype, endpoint=True)


def encoded(mode: str, kind: str, pixels: np.ndarray) -> bytes:
    file = io.BytesIO()
    Image.fromarray(pixels).convert(mode).save(file, kind)
    return file.getvalue()


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
@pytest.mark.parametrize("shape", SHAPES)
def test_png_gives_back_the_same_integers(shape: tuple[int, ...], dtype: type) -> None:
    pixels = random_pixels(shape, dtype)
    back = images.array_from_png(images.png_from_array(pixels))
    assert back.dtype == dtype
    assert np.array_equal(back, pixels)


def test_another_reader_reads_our_png() -> None:
    pixels = random_pixels((6, 9, 3), np.uint8)
    decoded = Image.open(io.BytesIO(images.png_from_array(pixels)))
    assert decoded.mode == "RGB"
    assert np.array_equal(np.asarray(decoded), pixels)


def test_a_constant_picture_is_unchanged() -> None:
    pixels = np.full((4, 6), 1234, np.uint16)
    assert np.array_equal(images.array_from_png(images.png_from_array(pixels)), pixels)


def test_only_colour_is_marked_srgb() -> None:
    assert b"sRGB" in images.png_from_array(random_pixels((4, 4, 3), np.uint8))
    for label in (random_pixels((4, 4), np.uint16), random_pixels((4, 4, 3), np.uint16)):
        png = images.png_from_array(label)
        assert b"sRGB" not in png
        assert b"gAMA" not in png


def test_exr_channels_are_found_by_name_and_exact() -> None:
    rng = np.random.default_rng(2)
    names = ["outdoor.R", "outdoor.G", "outdoor.B", "indoor.R", "albedo.B", "Z"]
    layers = {name: rng.normal(size=(5, 7)).astype(np.float32) for name in names}
    back = images.layers_from_exr(images.exr_from_layers(layers))
    assert set(back) == set(names)
    assert all(np.array_equal(back[name], layers[name]) for name in names)


def test_half_exr_is_within_half_precision_and_smaller() -> None:
    layer = {"albedo.R": np.random.default_rng(0).random((64, 64), np.float32)}
    half = images.exr_from_layers(layer, half=True)
    assert np.allclose(images.layers_from_exr(half)["albedo.R"], layer["albedo.R"], rtol=2**-11)
    assert len(half) < len(images.exr_from_layers(layer))


def test_equal_layers_give_equal_bytes_in_any_order() -> None:
    a, b = np.ones((3, 3), np.float32), np.zeros((3, 3), np.float32)
    assert images.exr_from_layers({"x.R": a, "x.G": b}) == images.exr_from_layers(
        {"x.G": b, "x.R": a}
    )


@pytest.mark.parametrize(
    ("mode", "kind"),
    [("L", "PNG"), ("LA", "PNG"), ("P", "PNG"), ("RGB", "JPEG"), ("L", "JPEG"), ("CMYK", "JPEG"),
     ("RGB", "BMP"), ("P", "BMP"), ("RGBA", "GIF"), ("RGB", "TGA"), ("RGBA", "TGA"),
     ("L", "TGA"), ("RGBA", "PNG")],
)  # fmt: skip
def test_texture_decodes_as_another_reader_decodes_it(mode: str, kind: str) -> None:
    data = encoded(mode, kind, random_pixels((20, 30, 4), np.uint8))
    texture = images.decode_texture(data, f"wood.{kind.lower()}")
    decoded = Image.open(io.BytesIO(data)).convert("RGBA" if texture.shape[2] == 4 else "RGB")
    assert np.abs(texture.astype(int) - np.asarray(decoded)).max() <= 1


def test_alpha_is_not_multiplied_into_the_colours() -> None:
    pixels = np.full((4, 4, 4), 200, np.uint8)
    pixels[..., 3] = 10
    assert np.array_equal(images.decode_texture(encoded("RGBA", "PNG", pixels), "leaf.png"), pixels)


def test_tga_is_known_by_its_media_type() -> None:
    data = encoded("RGB", "TGA", random_pixels((4, 4, 4), np.uint8))
    assert images.decode_texture(data, "texture 3", "image/x-tga").shape == (4, 4, 3)
    with pytest.raises(BadInput):
        images.decode_texture(data, "texture 3")


@pytest.mark.parametrize("kind", ["PNG", "JPEG"])
@pytest.mark.parametrize("keep", [0.0, 0.1, 0.6])
def test_a_damaged_texture_is_named(kind: str, keep: float, capfd: pytest.CaptureFixture) -> None:
    data = encoded("RGB", kind, random_pixels((90, 90, 4), np.uint8))
    with pytest.raises(BadInput, match="oak\\.x"):
        images.decode_texture(data[: int(len(data) * keep)], "oak.x")
    assert capfd.readouterr().err == ""


def test_a_damaged_exr_is_named() -> None:
    data = images.exr_from_layers({"a.R": np.ones((8, 8), np.float32)})
    for wrong in (data[:50], data[:-20], b"", b"text"):
        with pytest.raises(BadInput, match=r"views/r\.exr"):
            images.layers_from_exr(wrong, "views/r.exr")


def test_hdr_panorama_is_linear_rgb() -> None:
    layers = {c: np.full((2, 4), v, np.float32) for c, v in zip("RGB", (0.5, 2.0, 40.0))}
    panorama = images.decode_radiance(images.exr_from_layers(layers), "sky.exr")
    assert np.array_equal(panorama[0, 0], np.float32([0.5, 2.0, 40.0]))


def test_thumbnail_fits_and_keeps_the_shape_of_the_picture() -> None:
    small = images.thumbnail(np.full((480, 640, 3), 77, np.uint8), max_edge_px=320)
    assert small.shape == (240, 320, 3)
    assert np.all(small == 77)
    assert images.thumbnail(np.zeros((30, 40), np.uint8), max_edge_px=320).shape == (30, 40)


def test_nearest_resizing_invents_no_value() -> None:
    labels = random_pixels((50, 70), np.uint8)
    assert set(np.unique(images.resized(labels, 33, 21, nearest=True))) <= set(np.unique(labels))


def test_wrong_shapes_and_types_are_refused() -> None:
    with pytest.raises(ValueError, match="uint8 or uint16"):
        images.png_from_array(np.zeros((4, 4), np.float32))  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="picture is"):
        images.png_from_array(np.zeros((4, 4, 2), np.uint8))
    with pytest.raises(ValueError, match="one \\(H, W\\)"):
        images.exr_from_layers(
            {"a": np.zeros((4, 4), np.float32), "b": np.zeros((4, 5), np.float32)}
        )


def test_where_there_are_no_files_in_memory_the_bytes_are_the_same(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    rgb = np.random.default_rng(1).integers(0, 256, (9, 7, 3), np.uint8)
    planes = {"Z": rgb[..., 0].astype(np.float32)}
    encoders = (
        lambda: images.png_from_array(rgb),
        lambda: images.jpeg_from_array(rgb, 90),
        lambda: images.exr_from_layers(planes),
    )
    in_memory = [encode() for encode in encoders]
    monkeypatch.delattr("os.memfd_create")
    assert [encode() for encode in encoders] == in_memory


def test_a_picture_is_written_in_memory_and_touches_no_disk(
    tmp_path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "missing"))
    before = len(list(Path("/proc/self/fd").iterdir()))
    assert images.png_from_array(np.zeros((4, 4), np.uint8)).startswith(b"\x89PNG")
    assert len(list(Path("/proc/self/fd").iterdir())) == before


def test_no_temporary_file_stays(tmp_path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    images.array_from_png(images.png_from_array(np.zeros((4, 4), np.uint8)))
    with pytest.raises(BadInput):
        images.array_from_png(b"\x89PNG\r\n\x1a\n")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    "order", ["-Y +X", "-Y -X", "+Y +X", "+Y -X", "+X -Y", "+X +Y", "-X -Y", "-X +Y"]
)
def test_a_radiance_picture_is_upright_for_any_storage_order(order: str) -> None:
    upright = np.arange(1, 9, dtype=np.float32).reshape(2, 4)
    major, minor = order.split()
    # Scanlines run along the first axis, y upwards and x to the right.
    lines = upright if major[1] == "Y" else upright.T
    if major in ("+Y", "-X"):
        lines = lines[::-1]
    if minor in ("+Y", "-X"):
        lines = lines[:, ::-1]
    mantissa, exponent = np.frexp(lines)
    value = (mantissa * 256).astype(np.uint8)
    pixels = np.stack([value, value, value, (exponent + 128).astype(np.uint8)], axis=-1)
    head = (
        f"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n{major} {lines.shape[0]} {minor} {lines.shape[1]}\n"
    )
    decoded = images.decode_radiance(head.encode() + pixels.tobytes(), "sky.hdr")
    np.testing.assert_allclose(decoded[..., 1], upright, rtol=0.01)
