"""What labels and roots say against what they are: falsehoods found, albedo, emitters, boxes, layers.

Effects: renders into a temporary folder; writes out/bench/truth.json. No figure is a time, so a busy
machine changes none.
"""

from __future__ import annotations

import json
import shutil
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import pbrs_farm as pf
from benchmarks.figures import write_report
from pbrs_farm.assets import homes_package
from pbrs_farm.check import verify
from pbrs_farm.core.frames import LM_PER_W, linear_from_srgb, srgb_from_linear
from pbrs_farm.core.house import House, corners_of_surfaces
from pbrs_farm.core.recipe import recipe_from_name
from pbrs_farm.images import array_from_png, layers_from_exr
from pbrs_farm.read.source import resolve, variants
from pbrs_farm.run.local import Run, run_local
from pbrs_farm.run.plan import wanted
from pbrs_farm.run.steps import repaired_house
from tests.check.test_falsehoods import FALSEHOODS, make_finished, planted
from tests.read.gltf.gltf_scenes import two_rooms

TILE_PX = 16
MADE = tuple(f"made:{seed}" for seed in range(1, 11))
UNITS = {
    "truth.planted": "kinds of falsehood found, all hashes mended",
    "truth.planted_of": "kinds planted",
    "truth.albedo_error": "of 255, median over tiles of 16 px: albedo.png against the light's own, dressed Studio",
    "truth.emitter_error": "of the radiance told, of the worse of a white and a red panel in a glTF scene",
    "truth.box_error_mm": "of the worst side of the worst box, nine homes dressed and ten made",
    "truth.box_items": "boxes looked at",
    "truth.layers_union": "1: CLEAN with all layers after runs with others and without",
}


def main() -> None:
    """Measure everything and write the report."""
    figures: dict[str, Any] = {}
    with tempfile.TemporaryDirectory(prefix="bench-truth-") as name:
        folder = Path(name)
        found = _found(folder / "planted")
        figures |= {"truth.planted": found, "truth.planted_of": len(FALSEHOODS)}
        figures["truth.albedo_error"] = round(_albedo_error(folder / "albedo"), 3)
        figures["truth.emitter_error"] = round(_emitter_error(folder / "emitters"), 5)
        figures["truth.layers_union"] = int(_is_union(folder / "union"))
    worst, n = _box_errors()
    figures |= {"truth.box_error_mm": round(worst, 4), "truth.box_items": n}
    write_report("truth", figures, UNITS)


def _found(folder: Path) -> int:
    make_finished(folder / "finished")
    n = 0
    for kind, (_plant, check) in FALSEHOODS.items():
        root = folder / "root"
        shutil.rmtree(root, ignore_errors=True)
        shutil.copytree(folder / "finished", root)
        is_found = check in planted(root, kind)
        n += is_found
        if not is_found:
            print(f"not found: {kind}")
    return n


def _albedo_error(root: Path) -> float:
    """Median difference of tile means between albedo.png and the albedo that light was traced with."""
    homes_package.fetch()
    recipe = recipe_from_name("preview", {"sky.time": "day"})
    run = Run(["Studio"], str(root), recipe, wanted(["mlt_il_ol"], ["albedo"], 3), dress_seeds=(1,))
    assert run_local(run).failures == []
    errors = []
    for view in root.glob("houses/*/views/*"):
        label = linear_from_srgb(array_from_png((view / "albedo.png").read_bytes()) / 255)
        planes = layers_from_exr((view / "radiance.exr").read_bytes())
        lit = np.stack([planes[f"albedo.{c}"] for c in "RGB"], axis=-1)
        a, b = (srgb_from_linear(_tiles(x)) * 255 for x in (label, lit))
        errors.append(np.abs(a - b).max(axis=-1).ravel())
    return float(np.median(np.concatenate(errors)))


def _tiles(picture: NDArray[Any]) -> NDArray[np.float64]:
    h, w = (n // TILE_PX for n in picture.shape[:2])
    cut = np.asarray(picture[: h * TILE_PX, : w * TILE_PX], np.float64)
    return np.asarray(cut.reshape(h, TILE_PX, w, TILE_PX, 3).mean(axis=(1, 3)))


def _emitter_error(folder: Path) -> float:
    """Radiance of panels as pixels have it against what their file tells."""
    told = {"Panel": ((1.0, 1.0, 1.0), 1000.0), "Red panel": ((1.0, 0.0, 0.0), 500.0)}
    scene = two_rooms()
    for k, (name, (rgb, strength)) in enumerate(told.items()):
        extension = {"KHR_materials_emissive_strength": {"emissiveStrength": strength}}
        scene.materials.append(
            {
                "name": name,
                "emissiveFactor": list(rgb),
                "extensions": extension,
                "doubleSided": True,
            }
        )
        x = 1.0 + k
        corners = [[x, 1, 1], [x + 0.5, 1, 1], [x + 0.5, 1.5, 1], [x, 1.5, 1]]
        scene.node(name, mesh=scene.mesh([corners], len(scene.materials) - 1))
    folder.mkdir(parents=True)
    file = folder / "panels.glb"
    file.write_bytes(scene.glb())
    home = pf.load(file, recipe="preview", **{"sky.time": "day"})
    look = pf.Camera.look_at((1.75, 1.3, 2.8), (1.75, 1.25, 1.0), size=(160, 120), hfov_deg=60)
    pf.render(home, look, modes=["mlt_il_ol"]).save(folder / "root")
    (view,) = (folder / "root").glob("houses/*/views/*")
    planes = layers_from_exr((view / "radiance.exr").read_bytes())
    seen = np.stack([planes[f"indoor.{c}"] for c in "RGB"], axis=-1) * LM_PER_W
    ids = array_from_png((view / "instance.png").read_bytes())
    rows = json.loads((view / "view.json").read_text())["instances"]
    worst = 0.0
    for name, (rgb, strength) in told.items():
        (number,) = (row["id"] for row in rows if row["name"] == name)
        # Amid the panel, where a pixel sees nothing else.
        own = ids == number
        inner = (
            own
            & np.roll(own, 3, 0)
            & np.roll(own, -3, 0)
            & np.roll(own, 3, 1)
            & np.roll(own, -3, 1)
        )
        level = np.median(seen[inner], axis=0)
        worst = max(worst, float(np.abs(level - np.array(rgb) * strength).max()) / strength)
    return worst


def _is_union(root: Path) -> bool:
    sizes = {"image.width_px": "64", "image.height_px": "48", "cameras.cell_m": "1.0"}
    recipe = recipe_from_name("preview", sizes)
    first = ("material", "class_source", "depth_z")
    for mode, layers in (
        ("opengl_dl", first), ("opengl_dl", ()), ("opengl_il", ("albedo",)), ("opengl_dl", first[::-1])
    ):  # fmt: skip
        run = Run(["builtin"], str(root), recipe, wanted([mode], layers, 1))
        if run_local(run).failures or run_local(run).n_done or not verify(root).is_clean:
            return False
    (view,) = root.glob("houses/*/views/*")
    kept = {"material.png", "class_source.png", "depth_z.exr", "albedo.png"}
    tables = json.loads((view / "view.json").read_text())
    return all((view / f).is_file() for f in kept) and {"materials", "source_classes"} <= set(
        tables
    )


def _box_errors() -> tuple[float, int]:
    recipe = recipe_from_name("fast")
    homes = [home.name for home in homes_package.example_homes()]
    worst, n = 0.0, 0
    for name in (*homes, *MADE):
        seeds = (1,) if name in homes else (0,)
        (source,) = variants(resolve(name), seeds)
        house, _report = repaired_house(source, recipe)
        errors = _errors_mm(house)
        print(
            f"{name:<36} {len(errors):>5} boxes, worst {max(errors, default=0):.4f} mm", flush=True
        )
        worst, n = max([worst, *errors]), n + len(errors)
    return worst, n


def _errors_mm(house: House) -> list[float]:
    """How far the worst side of each item's box is from its triangles."""
    found = []
    for item in house.items:
        points = corners_of_surfaces(item.surfaces).reshape(-1, 3)
        if len(points):
            local = (points - item.oriented_box.centre) @ item.oriented_box.axes
            sides = np.array([-local.min(0), local.max(0)]) - item.oriented_box.half
            found.append(1000 * float(np.abs(sides).max()))
    return found


if __name__ == "__main__":
    main()
