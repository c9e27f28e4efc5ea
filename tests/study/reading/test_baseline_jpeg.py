import io

import numpy as np
import pytest
from PIL import Image

from pbrs_farm.images import jpeg_from_array
from pbrs_farm.study.reading.baseline_jpeg import NotBaseline, array_of_jpeg


def picture(height: int, width: int) -> np.ndarray:
    """Smooth colours, an edge and some noise."""
    y, x = np.mgrid[:height, :width]
    rgb = np.stack([x * 3 % 256, (x + y) * 2 % 256, np.where(x > y, 200, 30)], -1).astype(float)
    return np.clip(rgb + np.random.default_rng(0).normal(0, 8, rgb.shape), 0, 255).astype(np.uint8)


@pytest.mark.parametrize("size", [(16, 16), (40, 56), (37, 51), (1, 1), (8, 100)])
@pytest.mark.parametrize("quality", [30, 95])
@pytest.mark.parametrize("subsampling", [0, 1, 2])
def test_it_decodes_what_libjpeg_does_within_rounding(size, quality, subsampling):
    file = io.BytesIO()
    Image.fromarray(picture(*size)).save(file, "JPEG", quality=quality, subsampling=subsampling)
    theirs = np.asarray(Image.open(file).convert("RGB")).astype(int)
    error = np.abs(array_of_jpeg(file.getvalue()) - theirs)
    assert error.max() <= 4
    assert error.mean() < 0.6


def test_it_decodes_what_pack_writes():
    data = jpeg_from_array(picture(60, 80), 95)
    theirs = np.asarray(Image.open(io.BytesIO(data)).convert("RGB")).astype(int)
    assert np.abs(array_of_jpeg(data) - theirs).mean() < 0.6


def test_grey_is_repeated():
    file = io.BytesIO()
    Image.fromarray(picture(20, 30)[..., 0]).save(file, "JPEG", quality=90)
    ours = array_of_jpeg(file.getvalue())
    assert np.abs(ours[..., 1] - np.asarray(Image.open(file)).astype(int)).max() <= 1
    assert (ours[..., 0] == ours[..., 2]).all()


def test_other_kinds_and_damaged_ones_are_refused():
    file = io.BytesIO()
    Image.fromarray(picture(20, 30)).save(file, "JPEG", progressive=True)
    whole = jpeg_from_array(picture(60, 80), 95)
    for data in (file.getvalue(), b"", b"\x89PNG", whole[:100], whole[: len(whole) // 2]):
        with pytest.raises(NotBaseline):
            array_of_jpeg(data)
    with pytest.raises(NotBaseline):
        array_of_jpeg(whole[: len(whole) // 2] + b"\xff\xd9")
