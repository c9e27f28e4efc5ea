from importlib import import_module

import numpy as np
import pytest

from pbrs_farm.core.errors import BadInput
from pbrs_farm.images import array_from_png, png_from_array
from pbrs_farm.views import png_rows
from pbrs_farm.views.png_rows import array_of_rows, png_of_rows


@pytest.fixture(
    params=["zlib", pytest.param("zlib_ng.zlib_ng", marks=pytest.mark.study)], autouse=True
)
def _inflating(request, monkeypatch):
    """Run every test of this file with each installed library."""
    monkeypatch.setattr(png_rows, "inflating", import_module(request.param))


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
@pytest.mark.parametrize("shape", [(5, 7), (5, 7, 3), (1, 1), (3, 1, 3), (70, 700, 3)])
def test_libpng_and_we_read_our_pngs(dtype, shape):
    top = np.iinfo(dtype).max + 1
    array = np.random.default_rng(1).integers(0, top, shape).astype(dtype)
    png = png_of_rows(array)
    for read in (array_of_rows(png, "x"), array_from_png(png)):
        assert read.dtype == dtype
        assert (read == array).all()


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_labels_as_views_store_them_are_read_with_all_their_bits(dtype):
    shape = (9, 8) if dtype == np.uint8 else (9, 8, 3)
    array = np.random.default_rng(2).integers(0, 60000, shape).astype(dtype)
    read = array_of_rows(png_from_array(array), "x")
    assert read is not None
    assert read.dtype == dtype
    assert (read == array).all()


def test_a_picture_filtered_otherwise_is_left_to_others():
    colour = np.random.default_rng(3).integers(0, 256, (9, 8, 3)).astype(np.uint8)
    assert array_of_rows(png_from_array(colour), "x") is None


def test_a_damaged_or_truncated_file_is_refused():
    png = png_of_rows(np.arange(600, dtype=np.uint16).reshape(20, 30))
    for damaged in (png[:-20], png[:60], b"", b"\x89PNG\r\n\x1a\n", png[:45] + b"?" + png[46:]):
        with pytest.raises(BadInput, match="x: "):
            array_of_rows(damaged, "x")
