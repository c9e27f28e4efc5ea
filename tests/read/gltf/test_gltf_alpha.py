"""Alpha modes, cutoffs and pictures of glTF."""

from __future__ import annotations

import io
from typing import Any

import numpy as np
import pytest
from PIL import Image

from pbrs_farm.core.house import NOTHING_LEFT, House, Material, MaterialKind
from tests.read.gltf.gltf_scenes import item, read, two_rooms

CUTOFF, FACTOR = "alphaCutoff", "factor"


def picture(*alphas: int) -> bytes:
    pixels = np.full((1, len(alphas), 4), 90, np.uint8)
    pixels[0, :, 3] = alphas
    buffer = io.BytesIO()
    Image.fromarray(pixels).save(buffer, "PNG")
    return buffer.getvalue()


def leaf(data: bytes | None, mode: str, **more: Any) -> tuple[Material, House]:
    s = two_rooms()
    pbr: dict[str, Any] = {"metallicFactor": 0}
    if FACTOR in more:
        pbr["baseColorFactor"] = [1, 1, 1, more.pop(FACTOR)]
    if data is not None:
        s.more = {
            "images": [{"bufferView": s.writer.add_bytes(data), "mimeType": "image/png"}],
            "textures": [{"source": 0}],
        }
        pbr["baseColorTexture"] = {"index": 0}
    s.materials.append({"pbrMetallicRoughness": pbr, "alphaMode": mode, **more})
    s.node("Chair", mesh=s.mesh([[[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]], 0))
    house = read(s)
    (surface,) = item(house, "Chair").surfaces
    return house.materials[surface.material], house


@pytest.mark.parametrize(
    ("more", "cutoff"),
    [
        ({}, 0.5), ({CUTOFF: 0.2}, None), ({CUTOFF: 0.6}, 0.6), ({CUTOFF: 0}, None),
        # The factor multiplies the picture's alpha.
        ({CUTOFF: 0.3, FACTOR: 0.5}, 0.6), ({CUTOFF: 0.1, FACTOR: 0.5}, None),
    ],
)  # fmt: skip
def test_mask_cuts_below_its_cutoff_and_is_opaque_above(
    more: dict[str, Any], cutoff: float | None
) -> None:
    material, house = leaf(picture(200, 90), "MASK", **more)
    assert material.alpha_cutout is (cutoff is not None)
    assert material.alpha_cutoff == (0.5 if cutoff is None else pytest.approx(cutoff))
    assert (material.kind, material.opacity) == (MaterialKind.OPAQUE, 1.0)
    assert not [n for n in house.notes if n.kind == "wholly-cut-out"]


@pytest.mark.parametrize(
    ("data", "more"),
    [(picture(200, 90), {CUTOFF: 0.9}), (None, {FACTOR: 0.4}), (None, {CUTOFF: 1.5})],
)
def test_a_surface_that_is_cut_out_as_a_whole_is_a_note(
    data: bytes | None, more: dict[str, Any]
) -> None:
    material, house = leaf(data, "MASK", **more)
    assert (material.alpha_cutout, material.alpha_cutoff) == (True, NOTHING_LEFT)
    (note,) = [n for n in house.notes if n.kind == "wholly-cut-out"]
    assert note.place == "materials[0]"


@pytest.mark.parametrize(
    ("alphas", "factor", "cut", "kind", "opacity"),
    [
        ((255, 0), 1.0, True, MaterialKind.OPAQUE, 1.0),  # leaves
        ((200, 90), 1.0, True, MaterialKind.OPAQUE, 1.0),
        ((255, 200), 1.0, False, MaterialKind.OPAQUE, 1.0),  # a soft edge
        ((255, 0), 0.4, True, MaterialKind.GLASS, 0.4),  # clear with holes
        ((51, 51), 1.0, False, MaterialKind.GLASS, 0.2),  # uniformly transparent
        ((102, 0), 0.5, False, MaterialKind.GLASS, 0.1),  # no texel is half opaque: the mean counts
    ],
)
def test_blend_cuts_at_one_half_or_is_glass(
    alphas: tuple[int, ...], factor: float, cut: bool, kind: MaterialKind, opacity: float
) -> None:
    material, _ = leaf(picture(*alphas), "BLEND", **{FACTOR: factor})
    assert (material.alpha_cutout, material.alpha_cutoff) == (cut, 0.5)
    assert (material.kind, material.opacity) == (kind, pytest.approx(opacity))


def test_opaque_ignores_alpha() -> None:
    material, _ = leaf(picture(0, 255), "OPAQUE", **{FACTOR: 0.1})
    assert (material.alpha_cutout, material.opacity) == (False, 1.0)
