"""The light summed in the browser is the stored light, as half floats, with the recipe's tone."""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest

from pbrs_farm.board.pages.light_packet import lamp_rows, light_packet, packet, scale_of
from pbrs_farm.core.recipe import recipe_from_name
from pbrs_farm.formats.serialise import json_bytes
from pbrs_farm.transport.develop.tone_mapping import add_glare
from tests.board.roots import HEIGHT, WIDTH, light_images, write_root
from tests.board.served import served

VIEW = "/homes/a-1/views/0_0_1"


def unpacked(data: bytes) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """The facts of a packet and its planes as float32."""
    assert data[:4] == b"PBLT"
    (length,) = struct.unpack_from("<I", data, 4)
    facts = json.loads(data[8 : 8 + length])
    shape = (facts["height"], facts["width"], 3)
    size = 6 * facts["height"] * facts["width"]
    assert len(data) == 8 + length + size * len(facts["planes"])
    planes = {
        name: np.frombuffer(data, "<f2", size // 2, 8 + length + k * size).reshape(shape)
        for k, name in enumerate(facts["planes"])
    }
    return facts, {name: plane.astype(np.float32) for name, plane in planes.items()}


def test_the_packet_holds_each_layer_of_light_to_a_half_floats_precision(
    client: httpx.Client,
) -> None:
    facts, planes = unpacked(client.get(f"{VIEW}/light?denoise=0").content)
    assert list(planes) == ["albedo", "outdoor", "lamp1", "lamp2"]
    assert (facts["width"], facts["height"], facts["denoised"]) == (WIDTH, HEIGHT, False)
    knee = facts["tone"].pop("knee")
    tone = recipe_from_name("preview").camera_of("a-1", "0_0_1").tone
    assert abs(0.6 + knee * np.log1p((tone.white - 0.6) / knee) - 1) < 1e-9
    assert facts["tone"] == {name: getattr(tone, name) for name in facts["tone"]}
    assert {"preset", "key", "white_balance", "exposure_ev", "contrast", "flare"} <= set(
        facts["tone"]
    )
    assert [lamp["name"] for lamp in facts["lamps"]] == ["lamp 0", "lamp 1"]
    stored = light_images(2)
    np.testing.assert_allclose(planes["albedo"], stored["albedo"], rtol=1e-3)
    for name in ("outdoor", "lamp1", "lamp2"):
        np.testing.assert_allclose(planes[name] / facts["scale"], stored[name], rtol=1e-3)


def test_a_lens_that_glares_glares_in_the_sum_that_a_browser_makes(tmp_path: Path) -> None:
    recipe = recipe_from_name("preview", {"tone.glare": "0.3"})
    write_root(tmp_path, {"a-1": ("0_0_1",)})
    view = tmp_path / "houses" / "a-1" / "views" / "0_0_1"
    files = [(view / name).read_bytes() for name in ("radiance.exr", "view.json")]
    facts, planes = unpacked(light_packet(*files, json_bytes(recipe), denoise=False))
    stored = light_images(2)
    for factor in (1.0, 0.25):
        total = sum(planes[n] for n in ("lamp1", "lamp2")) * factor + planes["outdoor"]
        expected = add_glare(stored["indoor"] * np.float32(factor) + stored["outdoor"], 0.3)
        np.testing.assert_allclose(total / facts["scale"], expected, rtol=2e-3)


def test_a_page_shows_the_command_that_makes_the_same_file(
    root: Path, client: httpx.Client
) -> None:
    html = client.get(f"{VIEW}/relight").text
    assert f"pbrs-farm relight {root}/houses/a-1/views/0_0_1" in html


def test_a_view_with_missing_or_damaged_light_reports_it(tmp_path: Path) -> None:
    root = write_root(tmp_path / "root", {"a-1": ("0_0_1", "0_0_2")})
    (root / "houses/a-1/views/0_0_1/radiance.exr").write_bytes(b"no picture")
    (root / "houses/a-1/views/0_0_2/radiance.exr").unlink()
    with served(str(root), tmp_path / "cache") as client:
        damaged = client.get(f"{VIEW}/light?denoise=0")
        assert damaged.status_code == 422
        assert "not an OpenEXR file" in damaged.text
        assert client.get("/homes/a-1/views/0_0_2/relight").status_code == 404


@pytest.mark.parametrize(
    ("exposure", "largest", "scale"), [(1.0, 100.0, 1.0), (0.3, 1.0, 0.25), (1024.0, 1e4, 4.0)]
)
def test_light_is_scaled_to_the_range_of_half_floats(
    exposure: float, largest: float, scale: float
) -> None:
    assert scale_of(exposure, largest) == scale


def test_nan_becomes_a_number() -> None:
    plane = np.float32([[[np.nan, np.inf, -1.0]]])
    _facts, planes = unpacked(packet({"outdoor": plane}, {}))
    assert planes["outdoor"].reshape(-1).tolist() == [0.0, 60_000.0, 0.0]


@pytest.mark.parametrize("text", [b"", b"[]", b"{}", b'{"modes": {"light": {"lamps": [1]}}}'])
def test_a_view_json_without_lamps_has_none(text: bytes) -> None:
    assert lamp_rows(text) == []
