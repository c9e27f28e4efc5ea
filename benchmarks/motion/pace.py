"""How fast the frames of a walk are made on two cores, and what a frame's light saves by the one before."""

from __future__ import annotations

import tempfile
import time
from typing import Any, Final

from pbrs_farm.core.house import geometry_from_house
from pbrs_farm.core.recipe import recipe_from_name
from pbrs_farm.prepare.finished_house import repaired_house
from pbrs_farm.prepare.source import resolve
from pbrs_farm.raycast.caster import Caster
from pbrs_farm.run.house_cache import CachedHouse, decoded_textures
from pbrs_farm.run.local import run_local
from pbrs_farm.run.local_run import Run
from pbrs_farm.run.plan import wanted
from pbrs_farm.run.processes.render_task import Event
from pbrs_farm.run.steps import camera_seed
from pbrs_farm.run.view_setup import ViewSetup
from pbrs_farm.sample.walks.walk_sampler import sample_walk
from pbrs_farm.store import MemoryStore
from pbrs_farm.transport.light_scene import LightScene

HOME: Final = "Studio"
N_FRAMES: Final = 60
N_LIT: Final = 6
LAYERS: Final = ("flow_forward", "occlusion_forward")


def figures() -> dict[str, Any]:
    """Frames a second of labels, flow and OpenGL; CPU of later frames' light over the first one's."""
    return {"frames_per_s": round(_frames_per_s(), 2), "light_reuse": round(_light_reuse(), 3)}


def _frames_per_s() -> float:
    """Of a run with two processes, from the first finished frame of each to the last."""
    finished: list[float] = []

    def observe(event: Event) -> None:
        if event.kind == "done" and event.step == "view":
            finished.append(time.monotonic())

    fields = {"cameras.source": "walk", "cameras.walk_frames": str(N_FRAMES)}
    with tempfile.TemporaryDirectory() as folder:
        want = wanted(["opengl_il"], LAYERS)
        recipe = recipe_from_name("fast", fields)
        summary = run_local(Run([HOME], folder, recipe, want, n_jobs=2), observe)
    if summary.failures:
        raise RuntimeError(summary.failures[0])
    # Leave out the first ten, while both processes load the house.
    return (N_FRAMES - 10) / (finished[-1] - finished[9])


def _light_reuse() -> float:
    """CPU seconds of the light of frames 2..N, on average, over those of frame 1."""
    fields = {"cameras.source": "walk", "cameras.walk_frames": str(N_LIT)}
    recipe = recipe_from_name("preview", fields)
    house, _report = repaired_house(resolve(HOME), recipe)
    geometry = geometry_from_house(house)
    seed = camera_seed(house.id, recipe)
    views = sample_walk(house, recipe.cameras, seed, geometry, Caster(geometry).first_hit).views
    cached = CachedHouse(MemoryStore(), recipe, house.id, "")
    scene = LightScene.load(house, decoded_textures(house)[0], recipe, cached.sky)
    by_id = {view.id: view for view in views}
    cpu = []
    for view in views:
        setup = ViewSetup(cached, view, by_id)
        began = time.process_time()
        # Use the seed of the step `light`: frame 2 then takes over the pilot of frame 1.
        seed = setup.light_seed(view)
        scene.render(setup.camera, view.room_id, recipe.light, seed, pilot=setup.pilot)
        cpu.append(time.process_time() - began)
    print("CPU of the frames' light:", [round(c, 2) for c in cpu], flush=True)
    return sum(cpu[1:]) / (len(cpu) - 1) / cpu[0]
