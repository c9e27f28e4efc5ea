"""Views an hour on a GPU (or whatever Dr.Jit finds): `fast` and `paper` of the built-in home, 640x480.

Run by scripts/gpu_check.sh. Each preset renders one view to compile, then a second one that counts; `paper`
with a sixteenth of its samples and mutations, its time taken sixteen times. Launches are those of one view.
"""

from __future__ import annotations

import time
from importlib.util import find_spec
from typing import Any, Final

from benchmarks.figures import write_report
from pbrs_farm.core.camera import Camera, Intrinsics
from pbrs_farm.core.recipe import recipe_from_name
from pbrs_farm.raycast.variant import choose_variant
from pbrs_farm.repair import repair
from pbrs_farm.transport.develop.mode_pictures import LinearAovs, develop
from pbrs_farm.transport.light_scene import LightScene
from pbrs_farm.transport.scene_tables.sky import sky_for_house

SIZE: Final = (640, 480)
DENOISER: Final = find_spec("pyoidn") is not None
PARTS: Final = {"fast": 1, "paper": 16}  # preset -> by what its samples are divided


def main() -> None:
    """Measure and write out/bench/gpu.json."""
    figures: dict[str, Any] = {"gpu.variant": choose_variant(), "gpu.denoiser": DENOISER}
    units = {"gpu.variant": "of Mitsuba", "gpu.denoiser": "views of fast are denoised"}
    for preset, parts in PARTS.items():
        seconds, launches = _view(preset, parts)
        figures[f"gpu.{preset}_views_per_hour"] = round(3600 / seconds, 1)
        units[f"gpu.{preset}_views_per_hour"] = "views, light and development, one process"
        figures[f"gpu.{preset}_launches"] = launches
        units[f"gpu.{preset}_launches"] = f"kernels of a view of 1/{parts} of the samples"
    write_report("gpu", figures, units)


def _view(preset: str, parts: int) -> tuple[float, int]:
    """(seconds of a view, kernels it launched)."""
    import drjit as dr

    from pbrs_farm.raycast.caster import Caster
    from pbrs_farm.read.builtin.builtin_home import builtin_home

    recipe = recipe_from_name(preset, {"sky.kind": "sunsky"})
    house, _report = repair(
        builtin_home(), recipe.repair, occluder_from=lambda h: Caster.of_house(h)
    )
    scene = LightScene.load(house, {}, recipe, sky_for_house(recipe, house.id))
    stored = house.cameras[0]
    camera = Camera.look(Intrinsics.from_hfov(*SIZE, stored.hfov_rad), stored.eye, stored.towards)
    counts = ("direct_spp", "mutations_per_pixel") if preset == "paper" else ("spp",)
    fields = recipe.light.model_copy(
        update={name: getattr(recipe.light, name) // parts for name in counts}
    )
    few = {"spp": 1, "direct_spp": 1, "mutations_per_pixel": 1}
    scene.render(camera, "-", fields.model_copy(update=few), 1)
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        dr.kernel_history_clear()
        began = time.perf_counter()
        result = scene.render(camera, "-", fields, 2)
        aovs = LinearAovs(result.outdoor, result.indoor, result.albedo, result.normal)
        develop(aovs, recipe.tone, denoise=fields.denoise and DENOISER)
        seconds = time.perf_counter() - began
        kernels = [k for k in dr.kernel_history() if k["type"] == dr.KernelType.JIT]
    return seconds * parts, len(kernels)


if __name__ == "__main__":
    main()
