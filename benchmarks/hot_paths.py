"""Instructions of ten hot paths, a CSV row a commit: `make bench NAME=hot_paths` -> out/bench/hot_paths.csv.

Instructions hardly depend on other work, so a slow-down of 5 % shows on a noisy machine. Each path runs once in a process of
one thread, which also imports and compiles; then callgrind counts a second run. Valgrind and not `perf stat`, because virtual
machines often have no counters, and rows of two programs do not compare. A path takes 15 to 40 s.
"""

from __future__ import annotations

import csv
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

from benchmarks.figures import FOLDER, commit, write_report

CSV: Final = FOLDER / "hot_paths.csv"
_SIZE: Final = (160, 120)


def _house() -> Any:
    from pbrs_farm.core.recipe import Recipe
    from pbrs_farm.read.builtin.builtin_home import builtin_home
    from pbrs_farm.repair import repair

    return repair(builtin_home(), Recipe().repair)[0]


def _camera(house: Any) -> Any:
    from pbrs_farm.core.camera import Camera, Intrinsics

    stored = house.cameras[0]
    return Camera.look(Intrinsics.from_hfov(*_SIZE, stored.hfov_rad), stored.eye, stored.towards)


def _caster(house: Any) -> Any:
    from pbrs_farm.raycast.caster import Caster

    return Caster.of_house(house)


def read_glb() -> Callable[[], object]:
    """Read a home from its stored files."""
    from pbrs_farm.formats.house_bundle import bundle_from_house, house_from_bundle

    glb, description = bundle_from_house(_house())
    return lambda: house_from_bundle(glb, description)


def repair_home() -> Callable[[], object]:
    """Repair the built-in home."""
    return _house


def make_items() -> Callable[[], object]:
    """Generate six pieces of furniture from their seeds."""
    import pbrs_farm as pf

    names = ("bed", "bookcase", "desk", "chair", "sofa", "wardrobe")
    return lambda: [pf.generate_model(name, seed=3) for name in names]


def read_plan() -> Callable[[], object]:
    """Read a floor plan into walls, rooms and openings."""
    import tempfile

    from pbrs_farm.core.recipe import ReadFields
    from pbrs_farm.prepare.read_source import read_house
    from pbrs_farm.prepare.source import resolve
    from tests.inputs.plan_files import write_own

    source = resolve(str(write_own(Path(tempfile.mkdtemp(prefix="hot-paths-")))))
    return lambda: read_house(source, ReadFields())


def count_items() -> Callable[[], object]:
    """Count the pixels of each item in small pictures, as the search for cameras does."""
    house = _house()
    caster, cameras = _caster(house), [_camera(house).with_size(40, 30)] * 4
    return lambda: caster.item_counts(cameras)


def cast_labels() -> Callable[[], object]:
    """One hit record and the labels of a view."""
    from pbrs_farm import truth

    house = _house()
    camera, caster = _camera(house), _caster(house)
    return lambda: truth.layers_from_hit(caster.hit_record(camera), house, camera)


def trace_light() -> Callable[[], object]:
    """Path tracing of a view, 4 samples a pixel."""
    from pbrs_farm.core.recipe import recipe_from_name
    from pbrs_farm.transport.light_scene import LightScene
    from pbrs_farm.transport.scene_tables.sky import sky_for_house

    house, recipe = _house(), recipe_from_name("preview")
    scene = LightScene.load(house, {}, recipe, sky_for_house(recipe, house.id))
    fields = recipe.light.model_copy(update={"spp": 4})
    return lambda: scene.render(_camera(house), "-", fields, 1)


def develop_picture() -> Callable[[], object]:
    """Tone-map a view of noise; without the denoiser, a library that valgrind runs for ten minutes."""
    import numpy as np

    from pbrs_farm.core.recipe import recipe_from_name
    from pbrs_farm.transport.develop.mode_pictures import LinearAovs, develop

    noisy = np.random.default_rng(1).gamma(1.0, 0.5, (4, *_SIZE[::-1], 3)).astype(np.float32)
    aovs = LinearAovs(noisy[0], noisy[1], 0.5 + 0 * noisy[2], 0 * noisy[3] + np.float32([0, 0, 1]))
    return lambda: develop(aovs, recipe_from_name("preview").tone, denoise=False)


def encode_layers() -> Callable[[], object]:
    """Encode the labels of a view as files."""
    from pbrs_farm import truth
    from pbrs_farm.formats.layer_file import layer_bytes

    house = _house()
    camera = _camera(house)
    layers = truth.layers_from_hit(_caster(house).hit_record(camera), house, camera)
    return lambda: [layer_bytes(name, array) for name, array in layers.items()]


def match_edges() -> Callable[[], object]:
    """Score a boundary picture."""
    import numpy as np

    from pbrs_farm.study.metrics.edge_scores import edge_counts

    rng = np.random.default_rng(0)
    strength, truth_edges = rng.random((96, 128)), rng.random((96, 128)) < 0.1
    return lambda: edge_counts(strength, truth_edges)


PATHS: Final = {
    path.__name__: path
    for path in (
        read_glb, read_plan, repair_home, make_items, count_items, cast_labels, trace_light,
        develop_picture, encode_layers, match_edges,
    )
}  # fmt: skip
_CALLGRIND: Final = ("valgrind", "--tool=callgrind", "--instr-atstart=no")
_ONE_THREAD: Final = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")  # fmt: skip


def main() -> None:
    """Count every path, add a row to the CSV and write out/bench/hot_paths.json."""
    if not shutil.which("valgrind"):
        raise RuntimeError("hot_paths: valgrind is not installed (apt install valgrind)")
    figures = {}
    for name in PATHS:
        figures[f"hot_paths.{name}"] = round(instructions(name) / 1e6, 1)
        print(name, figures[f"hot_paths.{name}"], flush=True)
    write_report("hot_paths", figures, dict.fromkeys(figures, "million instructions"))
    is_new = not CSV.exists()
    with CSV.open("a", newline="") as file:
        writer = csv.writer(file)
        if is_new:
            writer.writerow(["commit", *PATHS])
        writer.writerow([commit(), *figures.values()])


def instructions(name: str) -> int:
    """Instructions of one run of a path."""
    with tempfile.TemporaryDirectory() as folder:
        command = [
            *_CALLGRIND, f"--callgrind-out-file={folder}/counts", sys.executable, "-m", "benchmarks.hot_paths", name,
        ]  # fmt: skip
        environment = {**os.environ, **_ONE_THREAD, "PYTHONHASHSEED": "0"}
        done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    counts = re.findall(r"Collected : (\d+)", done.stderr)
    return int(counts[-1])


def run_counted(name: str) -> None:
    """Run a path twice in this process; callgrind counts the second run."""
    from pbrs_farm.raycast.variant import set_threads

    set_threads(1)
    work = PATHS[name]()
    work()
    control = ["callgrind_control", "-i"]
    subprocess.run([*control, "on", str(os.getpid())], check=True, stdout=subprocess.DEVNULL)
    work()
    subprocess.run([*control, "off", str(os.getpid())], check=True, stdout=subprocess.DEVNULL)


if __name__ == "__main__":
    if len(sys.argv) == 2:
        run_counted(sys.argv[1])
    else:
        main()
