"""Light, denoiser, OpenGL, two processes, a large home and training on a GPU: `make gpu-check` -> out/bench/gpu.json.

Run by scripts/gpu_check.sh (`make gpu-check`). Each preset renders one view to compile, then a second one that
counts; `paper` with a sixteenth of its samples and mutations, its time taken sixteen times. Launches are those
of one view. A part that fails says why and leaves its figures at -1; the others are measured.

    python -m benchmarks.light.gpu PART...     some parts, without a report
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from importlib.util import find_spec
from typing import Any, Final

import numpy as np

from benchmarks.figures import write_report
from pbrs_farm.core.camera import Camera, Intrinsics
from pbrs_farm.core.house import House, Surface
from pbrs_farm.core.recipe import LightFields, Recipe, recipe_from_name
from pbrs_farm.operating_system import resident_mb
from pbrs_farm.raycast.variant import choose_variant
from pbrs_farm.repair import repair
from pbrs_farm.transport.develop.mode_pictures import LinearAovs, develop
from pbrs_farm.transport.light_scene import LightScene
from pbrs_farm.transport.scene_tables.sky import sky_for_house

SIZE: Final = (640, 480)
DENOISER: Final = find_spec("pyoidn") is not None
PRESETS: Final = {"fast": 1, "paper": 16}  # preset -> by what its samples are divided
LARGE_FACES: Final = 4_000_000
_SLOT_VIEWS: Final = 4
_STEPS: Final = 20
UNITS: Final = {
    "gpu.variant": "of Mitsuba",
    "gpu.denoiser": "views of fast are denoised",
    "gpu.fast_views_per_hour": "views, light and development, one process",
    "gpu.fast_launches": "kernels of a view",
    "gpu.paper_views_per_hour": "views, light and development, one process",
    "gpu.paper_launches": "kernels of a view of 1/16 of the samples",
    "gpu.denoise_ms": "ms of a picture of 640x480",
    "gpu.opengl": "what draws the OpenGL modes",
    "gpu.opengl_ms": "ms of a picture of 640x480 by OpenGL-IL",
    "gpu.two_slots_views_per_hour": "views of fast that two processes render at once, as a worker's two slots do",
    "gpu.large_home_faces": "triangles of the built-in home, its faces split",
    "gpu.large_home_mb": "MB that its scene and a view take: of the card, of the process where there is none",
    "gpu.large_home_s": "s to load it",
    "gpu.train_step_ms": "ms of a step of the study's plan tiny for normals, 8 views",
    "gpu.train_device": "where that ran",
}


def main() -> None:
    """Measure every part and write out/bench/gpu.json; SystemExit with 1 where a part failed."""
    figures: dict[str, Any] = {}
    failed = []
    for name, part in PARTS.items():
        began = time.monotonic()
        try:
            figures |= part()
        except Exception as error:  # noqa: BLE001  a part's fault is told, the others still run
            print(f"gpu: {name} failed: {type(error).__name__}: {error}", file=sys.stderr)
            failed.append(name)
        print(f"gpu: {name}: {time.monotonic() - began:.0f} s", flush=True)
    missing = {name: -1 for name in UNITS if name not in figures}
    write_report("gpu", {**figures, **missing}, UNITS)
    if failed:
        raise SystemExit(f"gpu: failed: {', '.join(failed)}")


def light() -> dict[str, Any]:
    """Views an hour of the presets."""
    figures: dict[str, Any] = {"gpu.variant": choose_variant(), "gpu.denoiser": DENOISER}
    for preset, parts in PRESETS.items():
        seconds, launches = _view(preset, parts)
        figures[f"gpu.{preset}_views_per_hour"] = round(3600 / seconds, 1)
        figures[f"gpu.{preset}_launches"] = launches
    return figures


def denoise() -> dict[str, Any]:
    """Open Image Denoise, on the device that it takes for the best."""
    from pbrs_farm.transport.develop.denoiser import denoise_radiance

    dice = np.random.default_rng(1)
    noisy = dice.gamma(1.0, 0.5, (SIZE[1], SIZE[0], 3)).astype(np.float32)
    albedo = np.full_like(noisy, 0.5)
    normal = np.broadcast_to(np.array([0, 1, 0], np.float32), noisy.shape).copy()
    denoise_radiance(noisy, albedo, normal)  # its first call makes device and filter
    return {"gpu.denoise_ms": _ms(lambda: denoise_radiance(noisy, albedo, normal), 5)}


def opengl() -> dict[str, Any]:
    """OpenGL through EGL."""
    from pbrs_farm.raster import Rasterizer

    house, _recipe = _home("fast")
    camera = _camera(house)
    with Rasterizer(house, {}) as raster:
        raster.render_il(camera)
        name, milliseconds = raster.name, _ms(lambda: raster.render_il(camera), 10)
    return {"gpu.opengl": name, "gpu.opengl_ms": milliseconds}


def two_slots() -> dict[str, Any]:
    """Two processes on one card, each with its house, as the slots of a worker."""
    command = [sys.executable, "-m", "benchmarks.light.gpu", "slot"]
    slots = [subprocess.Popen(command, stdout=subprocess.PIPE, text=True) for _ in range(2)]
    rates = []
    for slot in slots:
        said, _ = slot.communicate()
        if slot.returncode:
            raise RuntimeError(f"a slot ended with {slot.returncode}")
        rates.append(float(said.split()[-1]))
    return {"gpu.two_slots_views_per_hour": round(sum(rates), 1)}


def slot() -> float:
    """Views an hour of one process, over views enough that both of two are at work."""
    house, recipe = _home("fast")
    scene = LightScene.load(house, {}, recipe, sky_for_house(recipe, house.id))
    camera = _camera(house)
    _render(scene, camera, recipe.light, recipe, 1)
    began = time.perf_counter()
    for seed in range(_SLOT_VIEWS):
        _render(scene, camera, recipe.light, recipe, seed)
    return 3600 * _SLOT_VIEWS / (time.perf_counter() - began)


def large_home(n_faces: int = LARGE_FACES) -> dict[str, Any]:
    """The memory of a home of about so many triangles (between half and twice as many)."""
    house, recipe = _home("fast")
    while 2 * count_faces(house) < n_faces:  # a split makes four of each
        house = split_triangles(house)
    before, began = _used_mb(), time.monotonic()
    scene = LightScene.load(house, {}, recipe, sky_for_house(recipe, house.id))
    fields = recipe.light.model_copy(update={"spp": 4, "denoise": False})
    _render(scene, _camera(house), fields, recipe, 1)
    return {
        "gpu.large_home_faces": count_faces(house),
        "gpu.large_home_s": round(time.monotonic() - began, 1),
        "gpu.large_home_mb": round(_used_mb() - before),
    }


def trainer() -> dict[str, Any]:
    """Steps of the study's smallest network on drawn pictures; -1 where torch is not installed."""
    if find_spec("torch") is None:
        return {"gpu.train_step_ms": -1, "gpu.train_device": "torch is not installed"}
    import torch

    from pbrs_farm.study.networks.network_choice import network_of
    from pbrs_farm.study.training.optimisers import optimiser_of
    from pbrs_farm.study.training.prediction import device_of, move_to_device, network_output
    from pbrs_farm.study.training_plan import plan_of

    plan = plan_of("normals", "tiny")
    network = move_to_device(network_of(plan.network, 3), plan)
    optimiser, device = optimiser_of(network, plan), device_of(plan)
    colour = torch.rand(plan.batch, 3, plan.height_px, plan.width_px, device=device)

    def step() -> None:
        optimiser.zero_grad()
        (1 - network_output(network, colour, plan)[:, 2]).square().mean().backward()
        optimiser.step()
        if device.type == "cuda":
            torch.cuda.synchronize()

    step()
    return {"gpu.train_step_ms": _ms(step, _STEPS), "gpu.train_device": str(device)}


PARTS: Final[dict[str, Callable[[], dict[str, Any]]]] = {
    "light": light, "denoise": denoise, "opengl": opengl, "two slots": two_slots,
    "large home": large_home, "trainer": trainer,
}  # fmt: skip
"""What is measured, in this order; each gives figures of UNITS."""


def _home(preset: str) -> tuple[House, Recipe]:
    """The built-in home, repaired, and the recipe."""
    from pbrs_farm.raycast.caster import Caster
    from pbrs_farm.read.builtin.builtin_home import builtin_home

    recipe = recipe_from_name(preset, {"sky.kind": "sunsky"})
    house, _report = repair(
        builtin_home(), recipe.repair, occluder_from=lambda h: Caster.of_house(h)
    )
    return house, recipe


def _camera(house: House) -> Camera:
    stored = house.cameras[0]
    return Camera.look(Intrinsics.from_hfov(*SIZE, stored.hfov_rad), stored.eye, stored.towards)


def _render(
    scene: LightScene, camera: Camera, fields: LightFields, recipe: Recipe, seed: int
) -> None:
    """Light and development of a view."""
    result = scene.render(camera, "-", fields, seed)
    aovs = LinearAovs(result.outdoor, result.indoor, result.albedo, result.normal)
    develop(aovs, recipe.tone, denoise=fields.denoise and DENOISER)


def _view(preset: str, parts: int) -> tuple[float, int]:
    """(seconds of a view, kernels it launched)."""
    import drjit as dr

    house, recipe = _home(preset)
    scene = LightScene.load(house, {}, recipe, sky_for_house(recipe, house.id))
    camera = _camera(house)
    counts = ("direct_spp", "mutations_per_pixel") if preset == "paper" else ("spp",)
    fields = recipe.light.model_copy(
        update={name: getattr(recipe.light, name) // parts for name in counts}
    )
    few = {"spp": 1, "direct_spp": 1, "mutations_per_pixel": 1}
    scene.render(camera, "-", fields.model_copy(update=few), 1)
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        dr.kernel_history_clear()
        began = time.perf_counter()
        _render(scene, camera, fields, recipe, 2)
        seconds = time.perf_counter() - began
        kernels = [k for k in dr.kernel_history() if k["type"] == dr.KernelType.JIT]
    return seconds * parts, len(kernels)


def _ms(work: Callable[[], object], n: int) -> float:
    """Milliseconds that work takes, the mean of n times."""
    began = time.perf_counter()
    for _ in range(n):
        work()
    return round(1e3 * (time.perf_counter() - began) / n, 1)


def count_faces(house: House) -> int:
    return sum(len(surface.faces) for item in house.items for surface in item.surfaces)


def split_triangles(house: House) -> House:
    """The same home, each triangle split at the middles of its edges into four."""
    items = [
        replace(item, surfaces=tuple(_split_surface(s) for s in item.surfaces))
        for item in house.items
    ]
    return house.with_items(items)


def _split_surface(surface: Surface) -> Surface:
    a, b, c = (surface.faces[:, k] for k in range(3))
    columns = [surface.positions, surface.uvs, surface.normals]
    # Triangles share no vertices: each has its corners and the middles of its edges.
    given: list[Any] = []
    for column in columns:
        if column is None:
            given.append(None)
            continue
        p, q, r = column[a], column[b], column[c]
        six = np.stack([p, q, r, (p + q) / 2, (q + r) / 2, (r + p) / 2], axis=1)
        given.append(six.reshape(-1, column.shape[1]).astype(column.dtype))
    first = 6 * np.arange(len(surface.faces))[:, None, None]
    four = np.array([[0, 3, 5], [3, 1, 4], [5, 4, 2], [3, 4, 5]])
    faces = (first + four).reshape(-1, 3).astype(np.int32)
    return replace(surface, positions=given[0], faces=faces, uvs=given[1], normals=given[2])


def _used_mb() -> float:
    """MB in use on the first card, or of this process without a card."""
    if choose_variant().startswith("cuda") and shutil.which("nvidia-smi"):
        query = [
            "nvidia-smi",
            "--query-gpu=memory.used",
            "--format=csv,noheader,nounits",
            "-i",
            "0",
        ]
        return float(subprocess.run(query, check=True, capture_output=True, text=True).stdout)
    return resident_mb(os.getpid())


if __name__ == "__main__":
    for _word in sys.argv[1:]:
        print(slot() if _word == "slot" else PARTS[_word]())
