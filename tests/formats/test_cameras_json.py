"""cameras.json keeps a lens; an old file without lenses is a pinhole."""

from __future__ import annotations

import json

import numpy as np

from pbrs_farm.core.camera import Camera, Intrinsics, View
from pbrs_farm.core.lenses import PINHOLE
from pbrs_farm.core.optics_fields import LensFields
from pbrs_farm.formats.cameras_json import cameras_json, views_from_json

PLAIN = Intrinsics.from_hfov(640, 480)


def stored(intrinsics: Intrinsics) -> bytes:
    return cameras_json([View("a", "r", 0, Camera(intrinsics, np.eye(4)))], {})


def test_a_lens_reads_back() -> None:
    bent = LensFields(preset="tum_vi").intrinsics(PLAIN)
    assert views_from_json(stored(bent), "k")["a"].camera.intrinsics == bent


def test_a_pin_hole_is_stored_as_before() -> None:
    row = json.loads(stored(PLAIN))["views"][0]["intrinsics"]
    assert set(row) == {"width_px", "height_px", "fx", "fy", "cx", "cy"}
    assert views_from_json(stored(PLAIN), "k")["a"].camera.intrinsics.lens == PINHOLE
