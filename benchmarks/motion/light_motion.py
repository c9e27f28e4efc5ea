"""How well the light of neighbouring frames agrees: each second picture, drawn into the first one by its flow.

Beside it OpenGL's pictures by the same measure, which have no noise: what is left of them is what
looking up a picture between its pixels costs, and highlights that move.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Final, NamedTuple

import numpy as np
from scipy import ndimage

from pbrs_farm.core import keys
from pbrs_farm.core.arrays import F64, Bools, RadianceImage
from pbrs_farm.core.layers import LAYER
from pbrs_farm.core.recipe import ToneFields, recipe_from_name
from pbrs_farm.core.shot import Shot
from pbrs_farm.formats.layer_file import layer_from_bytes
from pbrs_farm.formats.radiance_exr import radiance_from_exr
from pbrs_farm.prepare.source import resolve
from pbrs_farm.run.house_cache import HouseCache
from pbrs_farm.run.relight import linear_aovs
from pbrs_farm.run.step_cache import Work
from pbrs_farm.run.steps import run_step
from pbrs_farm.store import MemoryStore
from pbrs_farm.transport.develop.mode_pictures import denoise_aovs
from pbrs_farm.transport.develop.tone_mapping import tone

HOME: Final = "Studio"
FIRST: Final = (3, 14, 27)  # frames of a walk at 30 a second, each looked at with the next one
LAYERS: Final = ("depth_z", "flow_forward", "occlusion_forward")
_SEEN: Final = 0
_EDGE: Final = 0.05  # of the depth, between neighbours: an edge, where a pixel holds two things


def figures() -> dict[str, Any]:
    """PSNR in dB along the flow by light and by OpenGL, of `fast`, and CPU seconds a frame.

    light_psnr is of denoised light by the exposure and white balance of the pair's first frame.
    """
    fields = {"cameras.source": "walk", "cameras.walk_frames": "60"}
    recipe, source, store = recipe_from_name("fast", fields), resolve(HOME), MemoryStore()
    house = Work(store, recipe, source.house_id, HouseCache(), source=source)
    for step in ("house", "cameras", "illuminance"):
        run_step(step, house)
    squared: dict[str, list[float]] = {"light": [], "picture": [], "opengl": []}
    cpu: list[float] = []
    for first in FIRST:
        here, there = (_frame(house, first + k, cpu) for k in range(2))
        for name, errors in squared.items():
            errors.append(_squared_error(here, there, name))
        print(first, {name: round(_psnr(e[-1:]), 2) for name, e in squared.items()}, flush=True)
    return {
        **{f"{name}_psnr": round(_psnr(errors), 2) for name, errors in squared.items()},
        # The first frame also loads and compiles; each second one takes over the first one's pilot.
        "light_s": round(float(np.mean(cpu[1:])), 2),
    }


class _Frame(NamedTuple):
    """What is compared of a frame."""

    light: RadianceImage  # denoised, of both groups
    developed: Mapping[str, Any]  # gains and exposure of its picture
    tone: ToneFields
    layers: Mapping[str, Any]


def _frame(house: Work, number: int, cpu: list[float]) -> _Frame:
    """Make a frame; add the CPU seconds of its light and pictures."""
    work = replace(house, view_id=Shot.of_frame(number).id, layers=LAYERS)
    for step in ("truth", "opengl_il"):
        run_step(step, work)
    began = time.process_time()
    run_step("light", work)
    facts = run_step("develop", work).marker.facts
    cpu.append(time.process_time() - began)

    def file(name: str) -> tuple[bytes, str]:
        key = keys.view_key(work.house_id, work.view_id or "", LAYER[name].file)
        return work.store.get(key), key

    layers = {n: layer_from_bytes(n, *file(n)) for n in (*LAYERS, "mlt_il_ol", "opengl_il")}
    clean = denoise_aovs(linear_aovs(radiance_from_exr(*file("radiance"))))
    light = clean.outdoor + clean.indoor
    return _Frame(light, facts["mlt_il_ol"], work.recipe.tone, layers)


def _squared_error(here: _Frame, there: _Frame, name: str) -> float:
    """Mean square, of a range of 1, where the next frame sees the point and depth has no edge."""
    if name == "light":
        exposed = here.developed["exposure"]
        pair = [
            tone(f.light * np.float32(here.developed["gains"]), f.tone, exposure=exposed)
            for f in (here, there)
        ]
    else:
        pair = [f.layers["mlt_il_ol" if name == "picture" else "opengl_il"] for f in (here, there)]
    now, later = (picture[..., :3] / 255.0 for picture in pair)
    layers = here.layers
    seen = (layers["occlusion_forward"] == _SEEN) & ~_edges(layers["depth_z"])
    drawn = drawn_by_flow(later, layers["flow_forward"].astype(np.float64))
    return float(((drawn - now) ** 2).mean(-1)[seen].mean())


def drawn_by_flow(picture: F64, flow: F64) -> F64:
    """(H, W, 3) of each pixel what a picture shows where its flow (H, W, 2) leads, by cubic look-up."""
    rows, columns = np.indices(flow.shape[:2])
    at = np.stack([rows + flow[..., 1], columns + flow[..., 0]])
    drawn = [
        ndimage.map_coordinates(picture[..., c], at, order=3, mode="nearest")
        for c in range(picture.shape[-1])
    ]
    return np.stack(drawn, -1)


def _edges(depth: Any) -> Bools:
    return np.asarray(
        ndimage.maximum_filter(depth, 3) - ndimage.minimum_filter(depth, 3) > _EDGE * depth
    )


def _psnr(squared: list[float]) -> float:
    return float(-10 * np.log10(np.mean(squared)))
