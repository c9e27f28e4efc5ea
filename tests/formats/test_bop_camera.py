"""A BOP camera.json gives size and K, and an invalid one is refused."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from pbrs_farm.core.errors import BadInput
from pbrs_farm.formats.bop_camera import camera_of_bop

YCBV = {"fx": 1066.778, "fy": 1067.487, "cx": 312.9869, "cy": 241.3109, "width": 640, "height": 480}


def test_size_and_k_are_those_of_the_file(tmp_path: Path) -> None:
    (tmp_path / "camera.json").write_text(json.dumps({**YCBV, "depth_scale": 0.1}))
    size, k = camera_of_bop(tmp_path / "camera.json")
    assert size == (640, 480)
    assert (k[0, 0], k[0, 2]) == (1066.778, 313.4869)


@pytest.mark.parametrize(
    ("change", "says"), [({"fx": 0}, "fx: expected more than 0"), ({"width": "x"}, "width")]
)
def test_an_invalid_camera_is_refused(change: dict, says: str, tmp_path: Path) -> None:
    (tmp_path / "camera.json").write_text(json.dumps({**YCBV, **change}))
    with pytest.raises(BadInput, match=rf"camera\.json: {says}"):
        camera_of_bop(tmp_path / "camera.json")
    with pytest.raises(BadInput, match="no such file"):
        camera_of_bop(tmp_path / "none.json")
