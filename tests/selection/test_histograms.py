"""Histograms count every pixel once, in the defined bin, and nest exactly."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from pbrs_farm import selection
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.lighting import Mode
from pbrs_farm.core.recipe import HistogramFields
from pbrs_farm.formats.histogram_json import SparseCounts, ViewRecord, record_from_json
from pbrs_farm.selection.histograms import (
    coarser_colour,
    coarser_depth,
    colour_counts,
    depth_counts,
    normalised,
)
from tests.hypothesis_profiles import examples

RNG = np.random.default_rng(5)
PICTURE = RNG.integers(0, 256, (30, 40, 3), np.uint8)
DEPTH = RNG.integers(0, 14_000, (30, 40)).astype(np.uint16)
FIELDS = HistogramFields()


def brute_colour(rgb: np.ndarray, bins: int) -> np.ndarray:
    counts = np.zeros(bins**3, int)
    for r, g, b in rgb.reshape(-1, 3).tolist():
        counts[(r * bins // 256 * bins + g * bins // 256) * bins + b * bins // 256] += 1
    return counts


def brute_depth(depth_mm: np.ndarray, fields: HistogramFields) -> np.ndarray:
    counts = np.zeros(fields.depth_bins, int)
    width = (fields.depth_max_m - fields.depth_min_m) / fields.depth_bins
    for mm in depth_mm.reshape(-1).tolist():
        if mm > 0:
            place = math.floor((mm / 1000 - fields.depth_min_m) / width + 1e-9)
            counts[min(max(place, 0), fields.depth_bins - 1)] += 1
    return counts


@pytest.mark.parametrize("bins", [2, 4, 8, 16])
def test_colour_bins_are_those_of_the_definition(bins: int) -> None:
    fields = HistogramFields(colour_bins=bins)
    assert np.array_equal(colour_counts(PICTURE, fields), brute_colour(PICTURE, bins))


@pytest.mark.parametrize(("bins", "low", "high"), [(128, 0, 10), (8, 0.5, 4.5), (64, 0, 8)])
def test_depth_bins_are_those_of_the_definition(bins: int, low: float, high: float) -> None:
    fields = HistogramFields(depth_bins=bins, depth_min_m=low, depth_max_m=high)
    assert np.array_equal(depth_counts(DEPTH, fields), brute_depth(DEPTH, fields))


def test_unknown_depth_is_left_out_and_far_depth_is_not() -> None:
    depth = np.array([[0, 0, 20_000, 1]], np.uint16)
    counts = depth_counts(depth, FIELDS)
    assert counts.sum() == 2
    assert (counts[0], counts[-1]) == (1, 1)


def test_grey_is_one_chroma_in_ycbcr() -> None:
    greys = np.repeat(np.arange(256, dtype=np.uint8)[None, :, None], 3, axis=2)
    counts = colour_counts(greys, HistogramFields(colour_space="ycbcr")).reshape(8, 8, 8)
    assert counts[:, 4, 4].tolist() == [32] * 8


def test_coarser_bins_are_exact_sums() -> None:
    fine = colour_counts(PICTURE, HistogramFields(colour_bins=16))
    for bins in (2, 4, 8):
        coarse = colour_counts(PICTURE, HistogramFields(colour_bins=bins))
        assert np.array_equal(coarser_colour(fine, (bins, bins, bins)), coarse)
    uneven = coarser_colour(fine, (4, 4, 2)).reshape(4, 4, 2)
    four = coarser_colour(fine, (4, 4, 4)).reshape(4, 4, 4)
    assert np.array_equal(uneven, four[..., ::2] + four[..., 1::2])
    depth = depth_counts(DEPTH, HistogramFields(depth_bins=128))
    assert np.array_equal(
        coarser_depth(depth, 16), depth_counts(DEPTH, HistogramFields(depth_bins=16))
    )


def test_bins_that_do_not_divide_are_rejected() -> None:
    with pytest.raises(ValueError, match="cannot be summed"):
        coarser_colour(np.zeros(512, np.uint32), (16, 16, 16))
    with pytest.raises(ValueError, match="cannot be summed"):
        coarser_depth(np.zeros(64, np.uint32), 128)


def test_normalised_sums_to_one_and_empty_stays_empty() -> None:
    shares = normalised(np.array([[1, 3, 0], [0, 0, 0]], np.uint32))
    assert shares.tolist() == [[0.25, 0.75, 0.0], [0.0, 0.0, 0.0]]


def test_wrong_pictures_are_rejected() -> None:
    with pytest.raises(ValueError, match="uint8"):
        selection.histogram(PICTURE.astype(np.float32), DEPTH, FIELDS)
    with pytest.raises(ValueError, match="millimetres"):
        selection.histogram(PICTURE, DEPTH.astype(np.float32), FIELDS)
    with pytest.raises(ValidationError, match="depth_max_m"):
        HistogramFields(depth_min_m=3, depth_max_m=2)


@settings(max_examples=examples(30), deadline=None)
@given(st.lists(st.integers(0, 3), min_size=1, max_size=64))
def test_sparse_counts_give_back_the_dense_ones(counts: list[int]) -> None:
    dense = np.array(counts, np.uint32)
    assert np.array_equal(SparseCounts.of(dense).dense(), dense)


def record(modes: tuple[Mode, ...] = (Mode.MLT_IL_OL,)) -> ViewRecord:
    return selection.view_record(
        {"house": "h", "view": "0_0_1", "room": "0_0", "room_type": "Kitchen"},
        dict.fromkeys(modes, PICTURE),
        DEPTH,
        selection.scene_quality(DEPTH, [{"kind": "wall", "fraction": 0.5}], FIELDS),
        FIELDS,
    )


def test_a_record_survives_its_file_and_is_about_a_kilobyte_for_a_plain_picture() -> None:
    first = record()
    assert record_from_json(first.json_bytes(), "x") == first
    assert first.json_bytes() == record().json_bytes()
    flat = np.zeros((48, 64, 3), np.uint8)
    flat[:, 32:] = 200
    small = selection.view_record(
        {"house": "h", "view": "v", "room": "r", "room_type": "t"},
        {Mode.MLT_OL: flat},
        np.full((48, 64), 900, np.uint16),
        first.scene,
        FIELDS,
    )
    assert len(small.json_bytes()) < 1200


def test_only_the_scored_mode_is_kept_and_others_replace_a_missing_one() -> None:
    assert set(record(tuple(Mode)).colour) == {Mode.MLT_IL_OL}
    rest = (Mode.OPENGL_DL, Mode.MLT_OL)
    assert set(record(rest).colour) == set(rest)


def test_every_modes_brightness_is_kept_and_a_record_of_before_is_read() -> None:
    whole = record(tuple(Mode))
    assert set(whole.picture) == set(Mode)
    former = json.loads(whole.json_bytes())
    former["picture"] = {Mode.MLT_IL_OL: former["picture"][Mode.MLT_IL_OL]}
    assert set(record_from_json(json.dumps(former).encode(), "x").picture) == {Mode.MLT_IL_OL}


def test_a_damaged_record_is_named() -> None:
    plain = json.loads(record().json_bytes())
    wrong = [
        b"",
        b"{",
        json.dumps(plain | {"format": "something 2"}).encode(),
        json.dumps(plain | {"depth": {"size": 64, "bins": [], "counts": []}}).encode(),
        json.dumps(plain | {"depth": {"size": 128, "bins": [128], "counts": [1]}}).encode(),
        json.dumps(plain | {"depth": {"size": 128, "bins": [1], "counts": []}}).encode(),
    ]
    for data in wrong:
        with pytest.raises(BadInput, match="h/0_0_1/histogram"):
            record_from_json(data, "h/0_0_1/histogram.json")


def test_quality_numbers_are_those_of_the_definition() -> None:
    picture = np.full((10, 10, 3), 51, np.uint8)
    picture[:2, :, 1] = 255
    quality = selection.picture_quality(picture)
    assert quality.brightness == pytest.approx(51 / 255, abs=0.005)
    assert quality.blown == pytest.approx(0.2)

    depth = np.full((10, 10), 2000, np.uint16)
    depth[0, :5] = 100
    depth[1, :3] = 0
    rows = [
        {"kind": "wall", "fraction": 0.6},
        {"kind": "object", "fraction": 0.02},
        {"kind": "lamp", "fraction": 0.01},
        {"kind": "door", "fraction": 0.009},
    ]
    rows[0]["nyu40"], rows[1]["nyu40"], rows[2]["nyu40"] = 1, 5, 5
    scene = selection.scene_quality(depth, rows, FIELDS, noise=0.25, missing_textures=2)
    assert scene.classes == {1: 0.6, 5: 0.03}
    assert (scene.surface, scene.near, scene.n_objects) == (0.6, 0.05, 2)
    assert (scene.noise, scene.missing_textures) == (0.25, 2)


def test_an_empty_view_has_numbers_too() -> None:
    scene = selection.scene_quality(np.zeros((4, 4), np.uint16), [], FIELDS)
    assert (scene.surface, scene.near, scene.n_objects, scene.noise) == (0.0, 0.0, 0, None)
